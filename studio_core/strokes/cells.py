"""Pixels of a mask in cells of about equal size, each on one part of one surface."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

ALIKE = 0.8
"""Cosine between normals that one cell may have."""
PASSES = 4
GROWTH = 1.12


@dataclass(frozen=True, eq=False)
class Pixels:
    """P pixels of a picture: column x and row y, which surface `group` they show (0 … G − 1), `share` of them
    that counts, place (P, 3) from the eye, unit normal (P, 3), and metres across, `wide`, of one pixel there.
    """

    x: I64
    y: I64
    group: I64
    share: F64
    place: F32
    normal: F32
    wide: F32

    def __len__(self) -> int:
        return len(self.x)


def cells_of(pixels: Pixels, limit: int) -> tuple[I64, I64]:
    """Which cell each pixel belongs to (P,), and the pixel in the middle of each, (M,), M ≤ limit.

    Rows of cells are shifted by half a cell. Where even the coarsest cells are more than `limit`, pixels of
    the smallest have none: −1.
    """
    label, chosen = np.empty(len(pixels), np.int64), np.empty(len(pixels), np.int64)
    size = max(1.0, math.sqrt(len(pixels) / limit))
    largest = 2.0 + max(int(pixels.x.max(initial=0)), int(pixels.y.max(initial=0)))
    while True:
        columns, rows = int(pixels.x.max() / size + 0.5) + 1, int(pixels.y.max() / size) + 1
        most = limit if size < largest else len(pixels)
        held = (pixels.x, pixels.y, pixels.group, pixels.share, pixels.place, pixels.normal, pixels.wide)
        count = cut(size, columns, rows, int(pixels.group.max()) + 1, most, *held, label, chosen)
        if 0 <= count <= limit:
            return label, chosen[:count].copy()
        if count > limit:
            kept = np.argsort(-np.bincount(label, pixels.share), kind="stable")[:limit]
            number = np.full(count, -1)
            number[kept] = np.arange(limit)
            return number[label], chosen[kept]
        size *= GROWTH


@kernel
def cut(
    size: float,
    columns: int,
    rows: int,
    groups: int,
    most: int,
    x: I64,
    y: I64,
    group: I64,
    share: F64,
    place: F32,
    normal: F32,
    wide: F32,
    label: I64,
    chosen: I64,
) -> int:
    """Labels pixels by cells of `size` pixels and gives their number, or −1 where they are more than `most`.

    A cell's middle is the pixel nearest to the mean of its own. Pixels that turn away from it, or lie off its
    plane by more than the cell is wide, make cells of their own in the next pass; in the last, all stay.
    chosen (P,) gets the middles.
    """
    count = groups * rows * columns
    cell = np.empty(len(x), np.int64)
    for i in range(len(x)):
        row = int(y[i] / size)
        column = int(x[i] / size + 0.5 * (row % 2))
        cell[i] = (group[i] * rows + row) * columns + column
        label[i] = -1
    sums, best = np.empty((count, 3)), np.empty(count)
    middle, number = np.empty(count, np.int64), np.empty(count, np.int64)
    made = 0
    for turn in range(PASSES):
        sums[:] = 0
        best[:] = np.inf
        middle[:] = -1
        for i in range(len(x)):
            if label[i] < 0:
                c = cell[i]
                sums[c, 0] += share[i]
                sums[c, 1] += share[i] * x[i]
                sums[c, 2] += share[i] * y[i]
        for i in range(len(x)):
            if label[i] < 0:
                c = cell[i]
                across, down = x[i] - sums[c, 1] / sums[c, 0], y[i] - sums[c, 2] / sums[c, 0]
                far = across * across + down * down
                if far < best[c] - 1e-9:
                    best[c], middle[c] = far, i
        begun = made
        for c in range(count):
            if middle[c] >= 0:
                if made == most:
                    return -1
                chosen[made], number[c] = middle[c], made
                made += 1
        if made == begun:
            break
        for i in range(len(x)):
            if label[i] < 0:
                c = cell[i]
                m = middle[c]
                alike = (
                    normal[i, 0] * normal[m, 0] + normal[i, 1] * normal[m, 1] + normal[i, 2] * normal[m, 2]
                )
                height = (
                    (place[i, 0] - place[m, 0]) * normal[m, 0]
                    + (place[i, 1] - place[m, 1]) * normal[m, 1]
                    + (place[i, 2] - place[m, 2]) * normal[m, 2]
                )
                close = alike > ALIKE and abs(height) <= size * wide[m]
                if close or m == i or turn == PASSES - 1:
                    label[i] = number[c]
    return made


__all__ = ["ALIKE", "PASSES", "Pixels", "cells_of", "cut"]
