"""A kernel over cells of directions as a sum of few products that returns the energy of all of them.

M = W^½ b W^½ with W the cells' cosine-weighted measures is what an error in radiance is measured with, so its
singular values say what a product is worth. Three things are added to their plain truncation:

- Energy first. With e = W^½ 1, the rank-one part M e eᵀM / eᵀMe (Wedderburn 1934) reflects uniform light as
  M does, in both directions, and what is left, R, reflects none of it: R e = 0 and eᵀR = 0. So the
  hemispherical reflectance of every cell is right whatever is then kept of R. Kernels whose eᵀMe vanishes
  (those that are odd) take the rank-two part that does the same.
- Values are cut off softly: s becomes s (1 − (τ/s)^q), τ the largest value that is left out. With q = 1 that
  is the matrix of least nuclear norm nearby; it is a blurred lobe, where a hard end (q = ∞) rings below 0.
- q is as large as what lies below 0, and will be clamped, allows.

A kernel that turns with the normal is block-circulant over the cells: a Fourier series in the azimuth
leaves one RINGS × RINGS matrix a harmonic, and products come in pairs, cosine and sine.
"""

from __future__ import annotations

import functools
import math
from typing import Protocol

import numpy as np
import numpy.typing as npt

from studio_core.transport.cell_means import ring_measures
from studio_core.transport.cells import CELLS, PARTS, RINGS, cell_projected_angles
from studio_core.transport.symmetries import Symmetry

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

HARMONICS = PARTS // 2 + 1
EVEN = 0.2
"""eᵀMe over |Me| |e|: below it a kernel counts as odd."""
ODD = 1e-3
"""|Me| / |e| over |M|: below it uniform light is not reflected at all."""
FAINT = 1e-4
"""Harmonics below this share of a kernel are left out."""
SCALINGS = 6
LOOKED_AT = 96
"""Cells of outgoing light at which kernels without symmetry are compared."""
MORE = 12
"""Values beyond those wanted that the randomised decomposition looks for (Halko et al. 2011)."""


class Spectrum(Protocol):
    """What is known of one term: values (N,) falling in no order, and how many products each stands for."""

    values: F64
    copies: I64
    base: int
    norm: float

    def measure(self, values: F64) -> tuple[float, float]:
        """Relative error, once clamped at 0, and the largest share of light that clamping adds.

        `values` (N,) are put in the place of one's own; the share is of a cell's reflectance, or of the mean
        where that is more.
        """
        ...

    def products(self, values: F64) -> tuple[F64, F64]:
        """incoming, outgoing (CELLS, K): b ≈ Σ_k incoming[:, k] outgoing[:, k]."""
        ...


@functools.cache
def _harmonics() -> tuple[F64, F64]:
    """cos (HARMONICS, PARTS) of m times the turn of j parts, and 1 or 2: how often each harmonic counts."""
    m, j = np.arange(HARMONICS), np.arange(PARTS)
    often = np.where((m == 0) | (m == HARMONICS - 1), 1.0, 2.0)
    return np.cos(np.outer(m, j) * (2 * math.pi / PARTS)), often


class Turning:
    """Of a kernel that turns with the normal: means (RINGS of wo, RINGS of wi, PARTS), see `cell_means`."""

    def __init__(self, means: F64, reciprocal: bool, signed: bool, energy: bool = True) -> None:
        cosine, self._often = _harmonics()
        root = np.sqrt(ring_measures())
        self._root, self._signed = root, signed
        blocks = np.moveaxis(means @ cosine.T / PARTS, 2, 0) * (root[:, None] * root)
        if reciprocal:
            own = blocks[0] @ root
            blocks = (blocks + blocks.transpose(0, 2, 1)) / 2
            if not signed:
                scale = _scales(blocks[0], root, own)
                blocks = blocks * (scale[:, None] * scale)
        self._blocks = blocks
        self.norm = float(np.sqrt((self._often[:, None, None] * self._blocks**2).sum()))
        self._left, self._right = _energy(self._blocks[0], root) if energy else (np.zeros((RINGS, 0)),) * 2
        self.base = self._left.shape[1]
        rest = self._blocks.copy()
        rest[0] -= self._left @ self._right.T
        there = np.flatnonzero((rest**2).sum(axis=(1, 2)) > (FAINT * self.norm) ** 2)
        self._u, self._v = np.zeros((2, HARMONICS, RINGS, RINGS))
        found = np.zeros((HARMONICS, RINGS))
        self._u[there], found[there], vt = np.linalg.svd(rest[there])
        self._v[there] = vt.transpose(0, 2, 1)
        self.values = found.ravel()
        self.copies = np.repeat(self._often.astype(np.int64), RINGS)
        self._half = cosine[:, : PARTS // 2 + 1] * self._often[:, None]
        self._true = self._dense(self._blocks)
        self._back = _reflectances(self._blocks[0], root)
        self._sides = np.where(np.isin(np.arange(PARTS // 2 + 1), (0, PARTS // 2)), 1.0, 2.0) / PARTS

    def _dense(self, blocks: F64) -> F64:
        """(RINGS · RINGS, half of PARTS and one) weighted kernel, times PARTS."""
        made: F64 = blocks.reshape(HARMONICS, -1).T @ self._half
        return made

    def _made(self, values: F64) -> F64:
        scaled = self._u * values.reshape(HARMONICS, 1, RINGS)
        blocks = scaled @ self._v.transpose(0, 2, 1)
        blocks[0] += self._left @ self._right.T
        return blocks

    def measure(self, values: F64) -> tuple[float, float]:
        """See `Spectrum`."""
        dense = self._dense(self._made(values))
        spill = 0.0
        if not self._signed:
            under = (np.minimum(dense, 0.0) @ self._sides).reshape(RINGS, RINGS)
            spill = float((-(self._root @ under) / self._root / self._back).max())
            dense = np.maximum(dense, 0.0)
        off = float(((dense - self._true) ** 2 @ self._sides).sum())
        return math.sqrt(off) / max(self.norm, 1e-300), spill

    def products(self, values: F64) -> tuple[F64, F64]:
        """See `Spectrum`."""
        outgoing = [np.repeat(self._left / self._root[:, None], PARTS, axis=0)]
        incoming = [np.repeat(self._right / self._root[:, None], PARTS, axis=0)]
        turn = (np.arange(PARTS) + 0.5) * (2 * math.pi / PARTS)
        for number in np.flatnonzero(values):
            m, k = divmod(int(number), RINGS)
            size = math.sqrt(values[number] * self._often[m])
            waves = [np.cos(m * turn)] if m == 0 else [np.sin(m * turn)]
            if 0 < m < HARMONICS - 1:
                waves.append(np.cos(m * turn))
            for wave in waves:
                outgoing.append(np.outer(size * self._u[m, :, k] / self._root, wave).reshape(CELLS, 1))
                incoming.append(np.outer(size * self._v[m, :, k] / self._root, wave).reshape(CELLS, 1))
        return np.concatenate(incoming, axis=1), np.concatenate(outgoing, axis=1)


class Directed:
    """Of a kernel with a direction of its own: means (N representatives of wo, CELLS of wi), `cell_means`.

    Everything is done with N rows: the kernel is known between representatives and their images, and each
    combination of these by signs is a block of its own.
    """

    def __init__(
        self, means: F32, alike: Symmetry, reciprocal: bool, signed: bool, most: int, energy: bool = True
    ) -> None:
        images, signs = alike.images, alike.signs.astype(np.float32)
        self._alike, self._signed, self._group = alike, signed, len(images)
        root = np.sqrt(cell_projected_angles()[images[0]]).astype(np.float32)
        self._root = root
        parts = np.moveaxis(means[:, images], 1, 0) * (root[:, None] * root)
        if reciprocal:
            own = parts.sum(axis=0) @ root
            parts = np.float32(0.5) * (parts + parts.transpose(0, 2, 1))
            if not signed:
                scale = _scales(parts.sum(axis=0), root, own).astype(np.float32)
                parts *= scale[:, None] * scale
        self.norm = float(np.linalg.norm(parts)) * math.sqrt(self._group)
        blocks = np.tensordot(signs, parts, axes=(1, 0))
        empty = np.zeros((len(root), 0))
        left, right = _energy(blocks[0], root) if energy else (empty, empty)
        self._left, self._right = left.astype(np.float32), right.astype(np.float32)
        self.base = left.shape[1]
        count = min(most + MORE, len(root))
        none = empty.astype(np.float32)
        found = [
            _randomised(block, *((self._left, self._right) if kind == 0 else (none, none)), count)
            for kind, block in enumerate(blocks)
        ]
        self._u, self._v = np.stack([u for u, _, _ in found]), np.stack([v for _, _, v in found])
        self.values = np.concatenate([values for _, values, _ in found]).astype(np.float64)
        self.copies = np.ones(len(self.values), np.int64)
        # what is compared: some cells of light, each standing for its neighbours
        self._some = np.unique(np.linspace(0, len(root) - 1, LOOKED_AT).astype(np.int64))
        self._true = parts[:, :, self._some]
        self._back = _reflectances(blocks[0], root)[self._some]
        self._own = float(np.linalg.norm(self._true))

    def measure(self, values: F64) -> tuple[float, float]:
        """See `Spectrum`."""
        size = values.astype(np.float32).reshape(len(self._u), 1, -1)
        blocks = (self._u * size) @ self._v[:, self._some].transpose(0, 2, 1)
        blocks[0] += self._left @ self._right[self._some].T
        dense = np.tensordot(self._alike.signs.T.astype(np.float32) / self._group, blocks, axes=(1, 0))
        spill = 0.0
        if not self._signed:
            under = (self._root @ np.minimum(dense, 0.0).sum(axis=0)) / self._root[self._some]
            spill = float((-under / self._back).max())
            dense = np.maximum(dense, 0.0)
        return float(np.linalg.norm(dense - self._true)) / max(self._own, 1e-30), spill

    def products(self, values: F64) -> tuple[F64, F64]:
        """See `Spectrum`."""
        incoming, outgoing = [self._spread(self._right, 0)], [self._spread(self._left, 0)]
        for kind, own in enumerate(values.reshape(len(self._u), -1)):
            kept = np.flatnonzero(own)
            size = np.sqrt(own[kept])
            incoming.append(self._spread(self._v[kind][:, kept] * size, kind))
            outgoing.append(self._spread(self._u[kind][:, kept] * size, kind))
        return np.concatenate(incoming, axis=1), np.concatenate(outgoing, axis=1)

    def _spread(self, functions: npt.NDArray[np.floating], kind: int) -> F64:
        """(CELLS, K) over all cells, and without weights, of functions (N, K) of some kind."""
        made = np.empty((CELLS, functions.shape[1]))
        plain = functions / (self._root[:, None] * math.sqrt(self._group))
        for cells, sign in zip(self._alike.images, self._alike.signs[kind], strict=True):
            made[cells] = plain * sign
        return made


def _energy(matrix: F32 | F64, root: F32 | F64) -> tuple[F64, F64]:
    """left, right (N, 1 or 2): left rightᵀ reflects uniform light, `root`, as the matrix (N, N) does."""
    whole, e = matrix.astype(np.float64), root.astype(np.float64)
    sent, caught = whole @ e, e @ whole
    both, length = float(e @ sent), float(np.linalg.norm(e))
    farthest = max(float(np.linalg.norm(sent)), float(np.linalg.norm(caught)))
    if both > max(EVEN * length * farthest, 1e-300):
        return sent[:, None] / math.sqrt(both), caught[:, None] / math.sqrt(both)
    e = e / length
    sent, caught = sent / length, caught / length - both / length**2 * e
    if farthest / length <= ODD * float(np.linalg.norm(whole)):
        return np.zeros((len(e), 0)), np.zeros((len(e), 0))
    return np.stack([sent, e], axis=1), np.stack([e, caught], axis=1)


def _scales(matrix: F32 | F64, root: F32 | F64, sent: F32 | F64) -> F64:
    """(N,) by which rows and columns of a symmetric matrix have to be multiplied to reflect `sent`.

    What is sent towards a view is an accurate integral; its mean with what light of a cell makes is not.
    """
    made = np.ones(len(root))
    for _ in range(SCALINGS):
        there = made * (matrix @ (made * root).astype(matrix.dtype))
        made *= np.sqrt(np.divide(sent, there, out=np.ones(len(root)), where=there > 1e-12))
    return np.clip(made, 0.5, 2.0)


def _reflectances(matrix: F32 | F64, root: F32 | F64) -> F64:
    """Of light from each cell, or the mean of all where that is more."""
    whole: F64 = (root @ matrix).astype(np.float64)
    mean = float(whole @ root) / float(root @ root)
    return np.maximum(whole / root, max(mean, 1e-300))


def _randomised(whole: F32, left: F32, right: F32, count: int) -> tuple[F32, F32, F32]:
    """u (N, count), values, v (N, count) of whole − left rightᵀ, by its range found with random vectors."""
    probe = np.random.default_rng(3).normal(size=(len(whole), count)).astype(np.float32)
    found = whole @ probe - left @ (right.T @ probe)
    base, _ = np.linalg.qr(found)
    base, _ = np.linalg.qr(whole.T @ base - right @ (left.T @ base))
    found = whole @ base - left @ (right.T @ base)
    base, _ = np.linalg.qr(found)
    small = base.T @ whole - (base.T @ left) @ right.T
    u, values, vt = np.linalg.svd(small, full_matrices=False)
    return base @ u, values, np.ascontiguousarray(vt.T)


__all__ = ["Directed", "Spectrum", "Turning"]
