"""The rows that strokes weigh in the paper's least squares: W = I + σ_m diag(m) of equation 2.

Moments of all of an element's directions ask that it sends what it sends (`moments`). Where a stroke lies on
a cell of directions, as seen from where it was painted, the wanted light takes the place of that, and counts
1 + σ_m times: a cell's columns, one number of each gloss level, are added to the moments.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.transport.cells import CELLS, PARTS, cells_of
from studio_plugins.slf.ladder import LEVELS
from studio_plugins.slf.lobes import cell_weights
from studio_plugins.slf.paper import Systems
from studio_plugins.slf.series import half_kernels, matte_of, shares, waves

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Rows:
    """N painted cells: element (N,), cell (N,), change (N, 3) that is wanted of the light, weight (N,)."""

    element: I64
    cell: I64
    change: F64
    weight: F64

    def __len__(self) -> int:
        return len(self.element)

    @classmethod
    def of(cls, element: I64, towards: F32, change: F64, weight: F64) -> Rows:
        """Of places (P,), each seen along a unit vector (P, 3) of its element's frame.

        Those in one cell of one element are one row: the mean of their changes, and the largest weight.
        """
        cells = np.empty(len(element), np.uint16)
        cells_of(np.ascontiguousarray(towards, np.float32), cells)
        good = np.isfinite(change).all(axis=1) & np.isfinite(weight) & (weight > 0)
        key, at = np.unique(element[good] * CELLS + cells[good], return_inverse=True)
        own, total, most = weight[good], np.zeros(len(key)), np.zeros(len(key))
        sums = np.zeros((len(key), 3))
        np.add.at(sums, at, change[good] * own[:, None])
        np.add.at(total, at, own)
        np.maximum.at(most, at, own)
        return cls(key // CELLS, key % CELLS, sums / total[:, None], most)


@dataclass(frozen=True, eq=False)
class Columns:
    """At N rows: matte (N, 3) and shiny (N, 3, LEVELS) light of reflectances of 1."""

    matte: F64
    shiny: F64

    @staticmethod
    def of(series: F32, rows: Rows) -> Columns:
        """Of the incident light (E, 3, RINGS, WIDTH) of elements."""
        shiny = np.zeros((len(rows), 3, LEVELS), np.float32)
        ring, part = np.divmod(rows.cell, PARTS)
        cosines, sines = waves()
        share = shares().astype(np.float32)
        at_cells(series, half_kernels(), rows.element, ring, part, cosines, sines, share, shiny)
        return Columns(matte_of(series)[rows.element], shiny.astype(np.float64))

    def sent(self, reflectance: F64, level: I64) -> F64:
        """(N, 3) by reflectances (N, 3, 2) at levels (N,)."""
        own = self.shiny[np.arange(len(level)), :, level]
        return np.asarray(self.matte * reflectance[..., 0] + own * reflectance[..., 1])


@kernel
def at_cells(
    series: F32,
    kernels: F32,
    element: I64,
    ring: I64,
    part: I64,
    cosines: F32,
    sines: F32,
    share: F32,
    out: F32,
) -> None:
    """out (N, 3, LEVELS): S_g of elements (N,) in cells (N,); the kernels' even rows are the levels."""
    rings, half = series.shape[2], series.shape[3] // 2
    last = cosines.shape[1] - 1
    values = np.empty((rings, half), np.float32)
    for n in range(len(element)):
        e, i = element[n], ring[n]
        at = min(part[n], 2 * last - part[n])  # cosines are even about half a turn, sines odd
        sign = np.float32(1 if part[n] <= last else -1)
        for c in range(series.shape[1]):
            for j in range(rings):
                for m in range(half):
                    real = series[e, c, j, m] * cosines[at, m]
                    values[j, m] = share[m] * (real - series[e, c, j, half + m] * sign * sines[at, m])
            for level in range(out.shape[2]):
                total = np.float32(0)
                for j in range(rings):
                    for m in range(half):
                        total += kernels[2 * level, i, j, m] * values[j, m]
                out[n, c, level] = total


def with_rows(systems: Systems, columns: Columns, rows: Rows, sent: F64, strength: float) -> Systems:
    """Moments of E elements in three colours, with rows that count 1 + `strength` times.

    sent (N, 3) is what the moments have as the target of these cells.
    """
    within = cell_weights()[rows.cell // PARTS][:, None]
    more = strength * rows.weight[:, None] * within
    wanted = sent + rows.change
    once = within * rows.change + more * wanted
    squares = within * (wanted**2 - sent**2) + more * wanted**2
    at = (rows.element[:, None] * 3 + np.arange(3)).ravel()
    matte, shiny = columns.matte, columns.shiny

    def added(name: str, part: F64) -> F64:
        made = getattr(systems, name).copy()
        np.add.at(made, at, part.reshape(len(at), *made.shape[1:]))
        return np.asarray(made)

    return dataclasses.replace(
        systems,
        c11=added("c11", more * matte**2),
        c12=added("c12", (more * matte)[..., None] * shiny),
        c22=added("c22", more[..., None] * shiny**2),
        d1=added("d1", once * matte),
        d2=added("d2", once[..., None] * shiny),
        bb=added("bb", squares),
    )


__all__ = ["Columns", "Rows", "at_cells", "with_rows"]
