"""Nodes for the light of some intervals of leaves: which are enough, and what each stands for.

Top-down: a node of the tree is split while the *visible light* in it, its irradiance times its spread
1 − |Σ L ω| / Σ L, is more than what is allowed; it then stands for its light at the light's centroid. So
the first-order error of a smooth BRDF vanishes in every node, and irradiance is exact for any cut.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.colour import LUMINANCE
from studio_core.jit import kernel
from studio_core.kernels.light_tree import LightTree
from studio_plugins.cuts.intervals import Pool

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

SUMS = 16
"""Columns: power and vector (p, x, y, z) of luminance, red, green and blue: one line of the cache."""
DEEPEST = 20
MOST_NODES = 2048
NODE = 8
BLOCK = 64
_WEIGHTS = np.array(LUMINANCE)


@dataclass(frozen=True, eq=False)
class Prefix:
    """Sums over the leaves before each, in two parts that add up.

    block (S/64 + 1, 16) float64 up to each block of 64 leaves, leaf (S + 1, 16) float32 from there on: half
    the memory of one table, and as exact, since that part is small. A vertex' sums may then be float32.
    """

    block: F64
    leaf: F32

    @staticmethod
    def of(tree: LightTree) -> Prefix:
        """The sums of a light tree."""
        leaves = len(tree.prefix_power)
        block = np.empty(((leaves - 1) // BLOCK + 1, SUMS))
        leaf = np.empty((leaves, SUMS), np.float32)
        _tables(tree.prefix_power, tree.prefix_vector, block, leaf)
        return Prefix(block, leaf)

    @property
    def power(self) -> float:
        """Luminance of ∫ L dω over the whole sphere."""
        return float(self.block[-1, 0] + self.leaf[-1, 0])


@kernel
def _tables(power: F64, vector: F64, block: F64, leaf: F32) -> None:
    row = np.empty(SUMS)
    for i in range(len(power)):
        row[:4] = 0.0
        for c in range(3):
            weight = _WEIGHTS[c]
            row[4 + 4 * c] = power[i, c]
            row[0] += weight * power[i, c]
            for x in range(3):
                row[5 + 4 * c + x] = vector[i, c, x]
                row[1 + x] += weight * vector[i, c, x]
        if i % BLOCK == 0:
            block[i // BLOCK] = row
        for j in range(SUMS):
            leaf[i, j] = row[j] - block[i // BLOCK, j]


@kernel
def add_up(runs: Pool, count: int, block: F64, leaf: F32, total: F32) -> None:
    """total (16,) becomes the sums over all runs."""
    for i in range(SUMS):
        total[i] = np.float32(0)
    for run in range(count):
        start, stop = int(runs[2 * run]), int(runs[2 * run + 1]) + 1
        for i in range(SUMS):
            total[i] += leaf[stop, i] - leaf[start, i]
        first, last = start // BLOCK, stop // BLOCK
        if first != last:
            for i in range(SUMS):
                total[i] += np.float32(block[last, i] - block[first, i])


@kernel
def accumulate(runs: Pool, count: int, block: F64, leaf: F32, before: F32) -> None:
    """before[j] (16,) becomes the sums over the runs before j, for j = 0 … count."""
    for i in range(SUMS):
        before[0, i] = np.float32(0)
    for run in range(count):
        start, stop = int(runs[2 * run]), int(runs[2 * run + 1]) + 1
        for i in range(SUMS):
            before[run + 1, i] = before[run, i] + (leaf[stop, i] - leaf[start, i])
        first, last = start // BLOCK, stop // BLOCK
        if first != last:
            for i in range(SUMS):
                before[run + 1, i] += np.float32(block[last, i] - block[first, i])


@kernel
def index_runs(runs: Pool, count: int, index: I64) -> None:
    """index[b] (S/64 + 1,) becomes the first run that ends at or after the start of block b, or count."""
    run = 0
    for b in range(len(index)):
        while run < count and int(runs[2 * run + 1]) < BLOCK * b:
            run += 1
        index[b] = run


@kernel
def sums_until(
    place: int, runs: Pool, index: I64, last: int, before: F32, block: F64, leaf: F32, out: F32, row: int
) -> int:
    """out[row] (16,) becomes the sums over the runs' leaves before `place`.

    Returns the first of the runs before `last` that ends at or after it, or `last`.
    """
    low = min(int(index[place // BLOCK]), last)
    while low < last and int(runs[2 * low + 1]) < place:
        low += 1
    for i in range(SUMS):
        out[row, i] = before[low, i]
    if low < last:
        start = int(runs[2 * low])
        if start < place:
            for i in range(SUMS):
                out[row, i] += leaf[place, i] - leaf[start, i]
            one, other = start // BLOCK, place // BLOCK
            if one != other:
                for i in range(SUMS):
                    out[row, i] += np.float32(block[other, i] - block[one, i])
    return low


@kernel
def write_node(
    sums: F32,
    power: np.float32,
    moment: np.float32,
    nx: np.float32,
    ny: np.float32,
    nz: np.float32,
    axes: F64,
    sign: np.float32,
    cell: int,
    out: F32,
    row: int,
) -> None:
    """out[row] (NODE,) becomes a node's direction (3, in the shading frame), irradiance (3), spread, cell.

    sums (16,) of its light, of which `power` and `moment` are luminance and the length of its vector.
    """
    scale = np.float32(1) / moment
    x, y, z = sums[1] * scale, sums[2] * scale, sums[3] * scale
    out[row, 0] = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z
    out[row, 1] = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z
    out[row, 2] = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z
    out[row, 3] = sign * max(nx * sums[5] + ny * sums[6] + nz * sums[7], np.float32(0))
    out[row, 4] = sign * max(nx * sums[9] + ny * sums[10] + nz * sums[11], np.float32(0))
    out[row, 5] = sign * max(nx * sums[13] + ny * sums[14] + nz * sums[15], np.float32(0))
    out[row, 6] = max(np.float32(2) * (power - moment) / power, np.float32(0))
    out[row, 7] = cell


@kernel
def choose_nodes(
    runs: Pool,
    count: int,
    index: I64,
    block: F64,
    leaf: F32,
    before: F32,
    nx: np.float32,
    ny: np.float32,
    nz: np.float32,
    axes: F64,
    allowed: np.float32,
    sign: np.float32,
    made: F32,
    found: int,
) -> int:
    """Writes nodes as rows of made (MOST_NODES, NODE) from `found` on; where they end.

    n is the vertex' normal, axes its shading frame; colours are multiplied by `sign`.
    """
    stack_size, stack_run = np.empty(DEEPEST, np.int64), np.empty(DEEPEST, np.int64)
    stack = np.empty((DEEPEST, SUMS), np.float32)  # sums up to the end of each waiting node
    low = np.zeros(SUMS, np.float32)  # and up to the beginning of the current one
    here = np.empty(SUMS, np.float32)
    least = np.float32(1e-6) * before[count, 0]
    place = 0
    depth = 0
    stack_size[0], stack_run[0] = len(leaf) - 1, count
    for i in range(SUMS):
        stack[0, i] = before[count, i]
    # Depth first from the left.
    while depth >= 0:
        size, high_run = stack_size[depth], stack_run[depth]
        power = stack[depth, 0] - low[0]
        mx, my, mz = stack[depth, 1] - low[1], stack[depth, 2] - low[2], stack[depth, 3] - low[3]
        arrives = nx * mx + ny * my + nz * mz
        if power > least and arrives > 0:
            moment = np.float32(np.sqrt(mx * mx + my * my + mz * mz))
            if arrives * (power - moment) > allowed * power and size > 1 and found + depth + 2 < MOST_NODES:
                half = size >> 1
                stack_size[depth] = half
                depth += 1
                run = sums_until(place + half, runs, index, high_run, before, block, leaf, stack, depth)
                stack_size[depth], stack_run[depth] = half, min(run + 1, high_run)
                continue
            for i in range(SUMS):
                here[i] = stack[depth, i] - low[i]
            cell = (len(leaf) - 1 + place) // size
            write_node(here, power, moment, nx, ny, nz, axes, sign, cell, made, found)
            found += 1
        place += size
        for i in range(SUMS):
            low[i] = stack[depth, i]
        depth -= 1
    return found
