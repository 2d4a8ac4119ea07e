"""The environment as elements see it: averaged over as much of it as a cell of directions is wide.

One ray a cell would see a small bright window or miss it. Cells of different rings are of different size, so
there are a few averages of every direction, over discs; a ring looks into the one next to its cells' size.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.directions import direction_set, leaf_of
from studio_core.kernels.light_tree import LightTree
from studio_core.parallel import Checkpoints, Workers
from studio_core.transport.cells import PARTS, cell_solid_angles

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

FINENESS = 15
DIRECTIONS = 1 << FINENESS
SIZES = 4
SKY = SIZES * DIRECTIONS
"""Rows of all averages, one size after the other, each in the order of `direction_set(FINENESS)`."""
POINTS = 24  # of a disc


@functools.cache
def _angles() -> F64:
    """(SIZES,) steradians of the discs: of the first ring's cells, then in equal ratios up to the last's."""
    rings = cell_solid_angles().astype(np.float64)[::PARTS]
    return np.geomspace(rings[0], rings[-1], SIZES)


@functools.cache
def size_of_ring() -> I64:
    """(RINGS,) which of the sizes is nearest to the cells of a ring."""
    rings = np.log(cell_solid_angles().astype(np.float64)[::PARTS])
    return np.asarray(np.abs(rings[:, None] - np.log(_angles())).argmin(axis=1), np.int64)


def averages(tree: LightTree, workers: Workers, job: Checkpoints | None = None) -> F32:
    """(SKY, 3) of an environment's light at unit gain."""
    k = min(tree.k, FINENESS)
    leaves = tree.node_sum[1 << k : 2 << k] * np.float32(1 / (1 << (tree.k - k)))
    turn = math.pi * (3 - math.sqrt(5)) * np.arange(POINTS)  # Vogel's spiral
    spiral = np.sqrt((np.arange(POINTS) + 0.5) / POINTS)[:, None] * np.stack([np.cos(turn), np.sin(turn)], 1)
    directions = direction_set(FINENESS).directions
    out = np.empty((SIZES, DIRECTIONS, 3), np.float32)
    for size, angle in enumerate(_angles().tolist()):
        disc = np.tan(np.arccos(1 - angle / (2 * math.pi))) * spiral

        def body(start: int, stop: int, disc: F64 = disc, size: int = size) -> None:
            average(start, stop, directions, disc, leaves, k, out[size])

        workers.run(DIRECTIONS, 2048, body, job)
    return out.reshape(SKY, 3)


@kernel
def average(start: int, stop: int, directions: F32, disc: F64, leaves: F32, k: int, out: F32) -> None:
    """out[start:stop]: the mean of 2^k leaves over points (P, 2) of the plane that touches at a direction."""
    points = len(disc)
    for at in range(start, stop):
        x, y, z = float(directions[at, 0]), float(directions[at, 1]), float(directions[at, 2])
        # a frame without branches but one (Duff et al. 2017)
        sign = 1.0 if z >= 0 else -1.0
        a = -1.0 / (sign + z)
        b = x * y * a
        red, green, blue = 0.0, 0.0, 0.0
        for p in range(points):
            u, v = disc[p, 0], disc[p, 1]
            px = x + u * (1.0 + sign * x * x * a) + v * b
            py = y + u * sign * b + v * (sign + y * y * a)
            pz = z - u * sign * x - v * y
            scale = 1.0 / np.sqrt(px * px + py * py + pz * pz)
            leaf = leaf_of(np.float32(px * scale), np.float32(py * scale), np.float32(pz * scale), k)
            red += leaves[leaf, 0]
            green += leaves[leaf, 1]
            blue += leaves[leaf, 2]
        out[at, 0], out[at, 1], out[at, 2] = red / points, green / points, blue / points


__all__ = ["DIRECTIONS", "FINENESS", "SKY", "averages", "size_of_ring"]
