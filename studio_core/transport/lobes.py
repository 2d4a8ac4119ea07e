"""Rays by the receivers' own lobes, for what cosine-distributed ones would find too seldom."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.calls import is_sampled
from studio_core.contract import Registry
from studio_core.jit import call_address, kernel
from studio_core.kernels.radiance import local_view, surface_frame
from studio_core.scene.nodes import MaterialId, Scene
from studio_core.shading.artifacts import Shapes
from studio_core.shading.materials import resolve
from studio_core.transport.cells import CELLS, cell_directions, cell_projected_angles

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

BROAD = 0.6  # share of cosine-distributed rays that a term makes good use of, above which it needs no others
_VIEWS = np.array([[np.sin(a), 0, np.cos(a)] for a in np.radians([5.0, 45.0, 70.0])], np.float32)


@dataclass(frozen=True, eq=False)
class Lobes:
    """Of each row of shapes: addresses of `sample` and `density` (0: none); which terms are peaked (R, T)."""

    sampler: I64
    density: I64
    peaked: Bools

    @property
    def rows(self) -> Bools:
        """(R,) which have any peaked term."""
        return np.asarray(self.peaked.any(axis=1))


class LobeTable:
    """Lobes of shapes, kept by kernel and shape."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._kept: dict[tuple[int, int, bytes], Bools] = {}

    def __call__(self, scene: Scene, materials: Sequence[MaterialId], shapes: Shapes) -> Lobes:
        """For all rows; `materials` are those of the surfaces."""
        known: dict[int, tuple[int, int]] = {}
        for material in materials:
            brdf = resolve(scene.material(material), self._registry).brdf
            if is_sampled(brdf):
                known[brdf.address] = (brdf.sampler, brdf.density)  # type: ignore[attr-defined]
        count = len(shapes.address)
        pairs = [known.get(int(address), (0, 0)) for address in shapes.address]
        peaked = np.zeros((count, shapes.width), np.bool_)
        bounds = np.append(shapes.offset, len(shapes.data))
        for row in range(count):
            if pairs[row][0]:
                terms = int(shapes.terms[row])
                shape = np.ascontiguousarray(shapes.data[bounds[row] : bounds[row + 1]])
                key = int(shapes.address[row]), terms, shape.tobytes()
                if key not in self._kept:
                    if len(self._kept) > 4096:
                        self._kept.clear()
                    self._kept[key] = used_share(key[0], terms, shape) < BROAD
                peaked[row, :terms] = self._kept[key]
        sampler, density = np.array(pairs, np.int64).reshape(-1, 2).T
        return Lobes(np.ascontiguousarray(sampler), np.ascontiguousarray(density), peaked)


def used_share(address: int, terms: int, shape: F32) -> F64:
    """(terms,) the least (∫ b cosθ)² / (π ∫ b² cosθ) of three views: 1 for a constant, little for a peak."""
    shape = shape if len(shape) else np.zeros(1, np.float32)
    wi, weight = np.ascontiguousarray(cell_directions().T).ravel(), cell_projected_angles()
    least = np.ones(terms)
    for view in _VIEWS:
        out = np.zeros(terms * CELLS, np.float32)
        _evaluate(address, shape, view, CELLS, wi, out)
        b = out.reshape(terms, -1).astype(np.float64)
        squares = np.pi * (b * b * weight).sum(axis=1)
        share = np.divide((b * weight).sum(axis=1) ** 2, squares, out=np.ones(terms), where=squares > 0)
        least = np.minimum(least, share)
    return least


@kernel
def _evaluate(address: int, shape: F32, wo: F32, count: int, wi: F32, out: F32) -> None:
    call_address(address, shape, wo, count, wi, out)


@kernel
def draw_lobes(
    start: int,
    stop: int,
    rows: I64,
    variant: I32,
    positions: F32,
    normals: F32,
    tangents: F32,
    row: I32,
    eye: F32,
    offset: I64,
    data: F32,
    sampler: I64,
    peaked: Bools,
    numbers: F32,
    directions: F32,
) -> None:
    """Directions (G, N, 3), in the world, of receivers rows[start:stop]: their peaked terms in turn.

    numbers (P, T, N, 2) in [0, 1): for each variant and term evenly spread; variant (R,) of each receiver.
    (0, 0, 0) where none is found.
    """
    many = directions.shape[1]
    axes = np.empty((3, 3))
    wo = np.empty(3, np.float32)
    u = np.empty(2 * many, np.float32)
    wi = np.empty(3 * many, np.float32)
    for i in range(start, stop):
        v = rows[i]
        r = row[v]
        surface_frame(normals[v], tangents[v], axes)
        local_view(positions[v], eye, axes, wo)
        terms = 0
        for t in range(peaked.shape[1]):
            terms += 1 if peaked[r, t] else 0
        turn = 0
        for t in range(peaked.shape[1]):
            if not peaked[r, t]:
                continue
            count = (many - turn + terms - 1) // terms
            for j in range(count):
                u[j] = numbers[variant[i], t, j, 0]
                u[count + j] = numbers[variant[i], t, j, 1]
            call_address(sampler[r], data[offset[r] :], wo, t, count, u, wi)
            for j in range(count):
                x, y, z = wi[j], wi[count + j], wi[2 * count + j]
                target = turn + j * terms
                for c in range(3):
                    along = axes[0, c] * x + axes[1, c] * y + axes[2, c] * z
                    directions[i, target, c] = along if z > 0.0 else 0.0
            turn += 1


def spread_numbers(variants: int, terms: int, count: int, seed: int) -> F32:
    """(variants, terms, count, 2): points of the R2 sequence (Roberts 2018), each set shifted at random.

    The first `n` of a set are evenly spread for every n.
    """
    steps = np.array([0.7548776662466927, 0.5698402909980532])
    shift = np.random.default_rng(seed).random((variants, terms, 1, 2))
    made = (shift + (np.arange(count) + 0.5)[:, None] * steps) % 1.0
    return np.asarray(np.minimum(made, 1 - 2.0**-24), np.float32)
