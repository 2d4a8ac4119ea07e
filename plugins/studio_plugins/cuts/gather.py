"""Light that reaches vertices: irradiance, exactly, and nodes for glossy surfaces.

Sums over an interval of leaves are differences of the light tree's prefix sums, so a vertex' irradiance
n · Σ L ω Δω over its visible intervals is that of brute force. While a hand moves something, only the
difference is summed: leaves that became visible add nodes, leaves that were hidden take nodes away.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.colour import LUMINANCE
from studio_core.jit import kernel
from studio_core.kernels.radiance import surface_frame
from studio_plugins.cuts.choose import (
    BLOCK,
    MOST_NODES,
    NODE,
    SUMS,
    accumulate,
    add_up,
    choose_nodes,
    index_runs,
)
from studio_plugins.cuts.glimpse import BEFORE, NOW
from studio_plugins.cuts.intervals import ONES, U64, Pool, hide, runs_of, set_bits

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

_RED, _GREEN, _BLUE = LUMINANCE
_ONE = np.float32(1)


@kernel
def gather_light(
    begin: int,
    stop: int,
    points: I64,
    normals: F32,
    tangents: F32,
    object_of: I32,
    glossy: Bools,
    pool: Pool,
    start: I64,
    length: I32,
    coarse_pool: Pool,
    coarse_start: I64,
    coarse_length: I32,
    row: I32,
    skip: Bools,
    block: F64,
    leaf: F32,
    tolerance: float,
    floor: float,
    irradiance: F32,
    out: F32,
    nodes: I64,
    detail: F32,
    known: Pool,
    known_start: I64,
    known_length: I32,
    out_runs: Pool,
    run_count: I64,
) -> int:
    """Irradiance (V, 3) of points[begin:stop], and in `out` their nodes, one point after the other.

    A surface that is not glossy gets one node, whose direction nobody looks at. `nodes` (P,) counts them.
    The tolerance is a share of the point's luminous irradiance, and at least of `floor`. Records as in
    `Sources`. `detail` gets spread and cell of every node, `out_runs` the first and last leaves of all that
    each point sees, of which `run_count` (P,) says how many pairs; where known_length (V,) is not negative
    they are `known` already, and not written. Returns how many points fitted.
    """
    leaves = len(leaf) - 1
    words = np.empty(leaves >> 6, np.uint64)
    room = np.empty(leaves + 2, pool.dtype)
    before = np.empty((leaves // 2 + 2, SUMS), np.float32)
    index = np.empty(leaves // BLOCK + 1, np.int64)
    total = np.empty(SUMS, np.float32)
    axes = np.empty((3, 3))
    made = np.empty((MOST_NODES, NODE), np.float32)
    past = np.zeros(2, np.bool_)
    past[BEFORE] = True
    place = kept = 0
    for number in range(begin, stop):
        if len(out) - 6 * place < 6 * MOST_NODES or len(out_runs) - kept < leaves + 2:
            return number - begin
        p = points[number]
        nx, ny, nz = normals[p, 0], normals[p, 1], normals[p, 2]
        runs = room
        if known_length[p] >= 0:
            count = known_length[p] // 2
            runs = known[known_start[p] : known_start[p] + known_length[p]]
        else:
            words[:] = ONES if length[p] + coarse_length[p] > 0 else np.uint64(0)
            hide(pool, start[p], length[p], skip[row[p], object_of[p]], words)
            hide(coarse_pool, coarse_start[p], coarse_length[p], past, words)
            count = runs_of(words, len(words), runs, 0) // 2
            run_count[number] = count
            for i in range(2 * count):
                out_runs[kept + i] = runs[i]
            kept += 2 * count
        if glossy[p]:
            accumulate(runs, count, block, leaf, before)
            for i in range(SUMS):
                total[i] = before[count, i]
        else:
            add_up(runs, count, block, leaf, total)
        red = max(nx * total[5] + ny * total[6] + nz * total[7], np.float32(0))
        green = max(nx * total[9] + ny * total[10] + nz * total[11], np.float32(0))
        blue = max(nx * total[13] + ny * total[14] + nz * total[15], np.float32(0))
        irradiance[p, 0], irradiance[p, 1], irradiance[p, 2] = red, green, blue
        light = _RED * red + _GREEN * green + _BLUE * blue
        found = 0
        if light > 0.0 and glossy[p]:
            surface_frame(normals[p], tangents[p], axes)
            index_runs(runs, count, index)
            allowed = np.float32(tolerance * max(light, floor))
            found = choose_nodes(
                runs,
                count,
                index,
                block,
                leaf,
                before,
                nx,
                ny,
                nz,
                axes,
                allowed,
                _ONE,
                made,
                0,
            )
        elif light > 0.0:
            made[0, 0], made[0, 1], made[0, 2] = 0.0, 0.0, 1.0
            made[0, 3], made[0, 4], made[0, 5] = red, green, blue
            made[0, 6], made[0, 7] = 0.0, 1.0
            found = 1
        nodes[number] = found
        for line in range(6):
            for node in range(found):
                out[6 * place + line * found + node] = made[node, line]
        for node in range(found):
            detail[2 * (place + node)] = made[node, 6]
            detail[2 * (place + node) + 1] = made[node, 7]
        place += found
    return stop - begin


@kernel
def _mark(pool: Pool, start: int, length: int, chosen: int, words: U64, reach: I64) -> None:
    """Sets what one slot of a record blocks; reach is widened to the first and last word touched."""
    place, end = start, start + length
    while place < end:
        slot, count = int(pool[place]), int(pool[place + 1])
        place += 2
        if count > 0 and slot == chosen:
            reach[0] = min(reach[0], int(pool[place]) >> 6)
            reach[1] = max(reach[1], int(pool[place + 2 * count - 1]) >> 6)
            for pair in range(place, place + 2 * count, 2):
                set_bits(words, int(pool[pair]), int(pool[pair + 1]))
        place += 2 * count


@kernel
def gather_difference(
    begin: int,
    stop: int,
    points: I64,
    normals: F32,
    tangents: F32,
    glossy: Bools,
    coarse_pool: Pool,
    coarse_start: I64,
    coarse_length: I32,
    block: F64,
    leaf: F32,
    tolerance: float,
    floor: float,
    known: F32,
    irradiance: F32,
    out: F32,
    nodes: I64,
) -> int:
    """What the coarse records change: irradiance (V, 3) and nodes to add to those of the exact ones.

    `known` (V, 3) is the irradiance of the exact records; otherwise as `gather_light`.
    """
    leaves = len(leaf) - 1
    old, new = np.zeros(leaves >> 6, np.uint64), np.zeros(leaves >> 6, np.uint64)
    runs = np.empty(leaves + 2, coarse_pool.dtype)
    before = np.empty((leaves // 2 + 2, SUMS), np.float32)
    index = np.empty(leaves // BLOCK + 1, np.int64)
    axes = np.empty((3, 3))
    made = np.empty((MOST_NODES, NODE), np.float32)
    reach = np.empty(2, np.int64)
    place = 0
    for number in range(begin, stop):
        if len(out) - place < 6 * MOST_NODES:
            return number - begin
        p = points[number]
        nx, ny, nz = normals[p, 0], normals[p, 1], normals[p, 2]
        reach[0], reach[1] = len(old), -1
        _mark(coarse_pool, coarse_start[p], coarse_length[p], BEFORE, old, reach)
        _mark(coarse_pool, coarse_start[p], coarse_length[p], NOW, new, reach)
        found = 0
        irradiance[p, 0], irradiance[p, 1], irradiance[p, 2] = 0.0, 0.0, 0.0
        if reach[1] >= reach[0]:
            for w in range(reach[0], reach[1] + 1):
                both = old[w] & new[w]
                old[w] &= ~both
                new[w] &= ~both
            light = _RED * known[p, 0] + _GREEN * known[p, 1] + _BLUE * known[p, 2]
            allowed = np.float32(tolerance * max(light, floor))
            surface_frame(normals[p], tangents[p], axes)
            for sign in (_ONE, -_ONE):
                words = old if sign > 0 else new
                count = _runs_within(words, reach[0], reach[1], runs)
                if count == 0:
                    continue
                accumulate(runs, count, block, leaf, before)
                total = before[count]
                for c in range(3):
                    i = 5 + 4 * c
                    irradiance[p, c] += sign * (nx * total[i] + ny * total[i + 1] + nz * total[i + 2])
                if glossy[p]:
                    index_runs(runs, count, index)
                    found = choose_nodes(
                        runs,
                        count,
                        index,
                        block,
                        leaf,
                        before,
                        nx,
                        ny,
                        nz,
                        axes,
                        allowed,
                        sign,
                        made,
                        found,
                    )
            if not glossy[p]:
                made[0, 0], made[0, 1], made[0, 2] = 0.0, 0.0, 1.0
                for c in range(3):
                    made[0, 3 + c] = irradiance[p, c]
                found = 1
            old[reach[0] : reach[1] + 1] = np.uint64(0)
            new[reach[0] : reach[1] + 1] = np.uint64(0)
        nodes[number] = found
        for line in range(6):
            for node in range(found):
                out[place + node] = made[node, line]
            place += found
    return stop - begin


@kernel
def _runs_within(words: U64, first: int, last: int, runs: Pool) -> int:
    """How many runs of set bits there are in words first … last; they are written as pairs of leaves."""
    length = runs_of(words[first : last + 1], last + 1 - first, runs, 0)
    for i in range(length):
        runs[i] += 64 * first
    return length // 2
