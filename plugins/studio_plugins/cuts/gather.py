"""Light that reaches vertices: irradiance, exactly, and nodes for glossy surfaces.

Sums over an interval of leaves are differences of the light tree's prefix sums, so a vertex' irradiance
n · Σ L ω Δω over its visible intervals is that of brute force. Nodes are chosen top-down: a node of the
tree is split while the *visible light* in it, its irradiance times its spread 1 − |Σ L ω| / Σ L, is more
than a tolerance of the vertex' irradiance; it then stands for its light at the light's centroid. So the
first-order error of a smooth BRDF vanishes in every node, and a Lambert surface is exact for any cut.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.colour import LUMINANCE
from studio_core.jit import kernel
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.radiance import frame
from studio_plugins.cuts.intervals import Pool, visible_runs

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

SUMS = 12  # power of three channels, then the vector irradiance of each
DEEPEST = 20
MOST_NODES = 2048
_RED, _GREEN, _BLUE = LUMINANCE


def prefix_table(tree: LightTree) -> F64:
    """(S + 1, 12): power and vector irradiance of the leaves before each, side by side."""
    vectors = tree.prefix_vector.reshape(len(tree.prefix_vector), 9)
    return np.ascontiguousarray(np.concatenate([tree.prefix_power, vectors], axis=1))


@kernel
def _until(leaf: int, runs: Pool, first: int, last: int, before: F64, prefix: F64, out: F64) -> int:
    """Sums over the visible leaves before `leaf` into out (12,); the first run that ends at or after it.

    It is among the runs first … last.
    """
    low, high = first, last
    while low < high:
        middle = (low + high) // 2
        if int(runs[2 * middle + 1]) < leaf:
            low = middle + 1
        else:
            high = middle
    start = int(runs[2 * low]) if low < last else leaf
    for i in range(SUMS):
        out[i] = before[low, i]
    if start < leaf:
        for i in range(SUMS):
            out[i] += prefix[leaf, i] - prefix[start, i]
    return low


@kernel
def gather_light(
    begin: int,
    stop: int,
    points: I64,
    normals: F32,
    glossy: Bools,
    alive: Bools,
    pool: Pool,
    start: I64,
    length: I32,
    prefix: F64,
    tolerance: float,
    floor: float,
    irradiance: F32,
    out: F32,
    nodes: I64,
) -> int:
    """Irradiance (V, 3) of points[begin:stop], and in `out` their nodes, one point after the other.

    A surface that is not glossy gets one node, whose direction nobody looks at. `nodes` (P,) counts them.
    The tolerance is a share of the point's luminous irradiance, and at least of `floor`. Returns how many
    points fitted into `out`.
    """
    leaves = len(prefix) - 1
    words = np.empty(leaves >> 6, np.uint64)
    runs = np.empty(leaves + 2, pool.dtype)
    before = np.empty((leaves // 2 + 2, SUMS))
    stack_size = np.empty(DEEPEST, np.int64)
    stack_run = np.empty(DEEPEST, np.int64)
    stack_sum = np.empty((DEEPEST, SUMS))
    low_sum = np.empty(SUMS)
    mid_sum = np.empty(SUMS)
    axes = np.empty((3, 3))
    made = np.empty((6, MOST_NODES), np.float32)
    place = 0
    for number in range(begin, stop):
        if len(out) - place < 6 * MOST_NODES:
            return number - begin
        p = points[number]
        nx, ny, nz = float(normals[p, 0]), float(normals[p, 1]), float(normals[p, 2])
        count = visible_runs(pool, start[p], length[p], alive, words, runs) // 2
        before[0, :] = 0.0
        for run in range(count):
            a, b = int(runs[2 * run]), int(runs[2 * run + 1]) + 1
            for i in range(SUMS):
                before[run + 1, i] = before[run, i] + (prefix[b, i] - prefix[a, i])
        total = before[count]
        red = max(nx * total[3] + ny * total[4] + nz * total[5], 0.0)
        green = max(nx * total[6] + ny * total[7] + nz * total[8], 0.0)
        blue = max(nx * total[9] + ny * total[10] + nz * total[11], 0.0)
        irradiance[p, 0], irradiance[p, 1], irradiance[p, 2] = red, green, blue
        light = _RED * red + _GREEN * green + _BLUE * blue
        found = 0
        if not light > 0.0:
            nodes[number] = 0
            continue
        if not glossy[p]:
            made[0, 0], made[1, 0], made[2, 0] = 0.0, 0.0, 1.0
            made[3, 0], made[4, 0], made[5, 0] = red, green, blue
            found = 1
        else:
            frame(nx, ny, nz, axes)
            allowed = tolerance * max(light, floor)
            # Depth first from the left: what lies left of the current node is already summed.
            low_sum[:] = 0.0
            low_run = 0
            leaf = 0
            depth = 0
            stack_size[0], stack_run[0] = leaves, count
            stack_sum[0, :] = total
            while depth >= 0:
                size = stack_size[depth]
                high_run = stack_run[depth]
                high_sum = stack_sum[depth]
                power = (
                    _RED * (high_sum[0] - low_sum[0])
                    + _GREEN * (high_sum[1] - low_sum[1])
                    + _BLUE * (high_sum[2] - low_sum[2])
                )
                mx = (
                    _RED * (high_sum[3] - low_sum[3])
                    + _GREEN * (high_sum[6] - low_sum[6])
                    + _BLUE * (high_sum[9] - low_sum[9])
                )
                my = (
                    _RED * (high_sum[4] - low_sum[4])
                    + _GREEN * (high_sum[7] - low_sum[7])
                    + _BLUE * (high_sum[10] - low_sum[10])
                )
                mz = (
                    _RED * (high_sum[5] - low_sum[5])
                    + _GREEN * (high_sum[8] - low_sum[8])
                    + _BLUE * (high_sum[11] - low_sum[11])
                )
                arrives = nx * mx + ny * my + nz * mz
                moment = np.sqrt(mx * mx + my * my + mz * mz)
                if power > 1e-12 * light and arrives > 0.0 and moment > 0.0:
                    spread = max(1.0 - moment / power, 0.0)
                    room = found + depth + 2 < MOST_NODES
                    if size > 1 and arrives * spread > allowed and room:
                        half = size >> 1
                        run = _until(leaf + half, runs, low_run, high_run, before, prefix, mid_sum)
                        stack_size[depth] = half
                        depth += 1
                        stack_size[depth], stack_run[depth] = half, min(run + 1, high_run)
                        stack_sum[depth, :] = mid_sum
                        continue
                    dx, dy, dz = mx / moment, my / moment, mz / moment
                    made[0, found] = axes[0, 0] * dx + axes[0, 1] * dy + axes[0, 2] * dz
                    made[1, found] = axes[1, 0] * dx + axes[1, 1] * dy + axes[1, 2] * dz
                    made[2, found] = axes[2, 0] * dx + axes[2, 1] * dy + axes[2, 2] * dz
                    for c in range(3):
                        i = 3 + 3 * c
                        part = (
                            nx * (high_sum[i] - low_sum[i])
                            + ny * (high_sum[i + 1] - low_sum[i + 1])
                            + nz * (high_sum[i + 2] - low_sum[i + 2])
                        )
                        made[3 + c, found] = max(part, 0.0)
                    found += 1
                leaf += size
                low_sum[:] = high_sum
                while low_run < high_run and int(runs[2 * low_run + 1]) < leaf:
                    low_run += 1
                depth -= 1
        nodes[number] = found
        for row in range(6):
            out[place : place + found] = made[row, :found]
            place += found
    return stop - begin
