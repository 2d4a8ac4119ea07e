"""Least squares of every texel over thousands of pictures that pass by once: a QR that grows.

Of each texel only the triangle R of its weighted design and Qᵀb are kept, k × (k + 3) numbers however many
pictures there are; a block of pictures is folded in by Householder reflections of [R; rows] (TSQR, Demmel et
al. 2012, section 4). Never through HᵀH: singular values of R are those of the whole design, so that they can
be truncated at the end as `solve` does, and stages can be solved one after the other.
"""

from __future__ import annotations

import numpy as np

from studio_core.jit import kernel
from studio_core.parallel import Workers
from studio_plugins.residual.samples import F32, F64

_CHUNK = 2048  # texels


class GrowingSolve:
    """The state of `texels` least squares of `size` unknowns in three colours."""

    def __init__(self, texels: int, size: int, workers: Workers | None = None) -> None:
        self.triangle: F64 = np.zeros((texels, size, size))
        self.rotated: F64 = np.zeros((texels, size, 3))
        self._workers = workers

    def add(self, rows: F32, values: F32, weights: F32 | None = None) -> None:
        """More samples: rows (b, k) of the design, which all texels share, values (b, t, 3), and weights
        (b, t) ≥ 0."""
        count, size = values.shape[1], self.triangle.shape[1]
        if not size:
            return
        rows = np.ascontiguousarray(rows, np.float32)
        values = np.ascontiguousarray(values, np.float32)
        weighted = weights is not None
        root = np.sqrt(weights).astype(np.float32) if weights is not None else np.ones((1, 1), np.float32)

        def some(first: int, last: int) -> None:
            _fold(self.triangle, self.rotated, rows, values, root, weighted, first, last)

        if self._workers is None:
            some(0, count)
        else:
            self._workers.run(count, _CHUNK, some)

    def solved(self, stages: tuple[int, ...], truncation: float) -> tuple[F32, np.ndarray]:
        """Coefficients (t, k, 3), each stage fitted to what those before leave, and ranks (t,).

        Singular values under `truncation` times a stage's largest are left out; finite always.
        """
        count, size = self.triangle.shape[:2]
        made = np.zeros((count, size, 3))
        rank = np.zeros(count, np.uint8)
        left = self.rotated.copy()
        first = 0
        for width in stages:
            part = slice(first, first + width)
            u, s, vt = np.linalg.svd(self.triangle[:, :, part], full_matrices=False)
            keep = (s > truncation * s[:, :1]) & (s > 1e-9)
            inverse = np.where(keep, 1 / np.where(keep, s, 1), 0)
            along = inverse[:, :, None] * (np.swapaxes(u, 1, 2) @ left)
            made[:, part] = np.swapaxes(vt, 1, 2) @ along
            left -= self.triangle[:, :, part] @ made[:, part]
            rank += keep.sum(axis=1).astype(np.uint8)
            first += width
        return made.astype(np.float32), rank


@kernel
def _fold(
    triangle: F64,
    rotated: F64,
    rows: F32,
    values: F32,
    root: F32,
    weighted: bool,
    first: int,
    last: int,
) -> None:
    """Householder's reflections of [R | Qᵀb] over weighted rows, texel by texel."""
    count, size = rows.shape
    width = size + 3
    part = np.empty((width, count), np.float32)
    for t in range(first, last):
        for j in range(count):
            w = root[j, t] if weighted else np.float32(1)
            for c in range(size):
                part[c, j] = w * rows[j, c]
            for c in range(3):
                part[size + c, j] = w * values[j, t, c]
        for i in range(size):
            square = np.float32(0)
            for j in range(count):
                square += part[i, j] * part[i, j]
            if square == 0:
                continue
            head = triangle[t, i, i]
            length = np.sqrt(head * head + square)
            beta = -length if head > 0 else length
            v = head - beta  # the reflection is along (v, part[i])
            tau = 2.0 / (v * v + square)
            triangle[t, i, i] = beta
            for c in range(i + 1, width):
                top = triangle[t, i, c] if c < size else rotated[t, i, c - size]
                dot = np.float32(0)
                for j in range(count):
                    dot += part[i, j] * part[c, j]
                share = tau * (v * top + dot)
                if c < size:
                    triangle[t, i, c] = top - share * v
                else:
                    rotated[t, i, c - size] = top - share * v
                step = np.float32(share)
                for j in range(count):
                    part[c, j] -= step * part[i, j]
