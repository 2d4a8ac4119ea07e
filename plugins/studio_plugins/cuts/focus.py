"""Nodes split further where a sharp BRDF, seen from where the eye is, needs it.

Nodes are chosen without regard to BRDF and view. A lobe that is narrower than a node is lost in it; so for
every node its error is estimated: what it contributes (the kernels themselves are asked) times how far its
light spreads within the lobe, squared, both about half vectors, as for microfacets. Nodes whose estimate is
above a share of the whole are split into up to eight, and those again, at most down to leaves.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.kernels.radiance import local_view, surface_frame
from studio_plugins.cuts.choose import BLOCK, MOST_NODES, NODE, SUMS, write_node
from studio_plugins.cuts.intervals import Pool

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

ROUNDS = 6
LEVELS = 3  # a split node becomes at most 2^LEVELS
_LEAST_COSINE = np.float32(0.05)
_BOOST = np.float32(1e4)


@kernel
def _luminous(values: F32, count: int, terms: int, weights: F32, material: int, out: F32) -> None:
    """out[node] becomes the luminous reflectance of the first `count` nodes."""
    for node in range(count):
        out[node] = 0
    for k in range(terms):
        weight = weights[material, k]
        for node in range(count):
            out[node] += weight * values[k * count + node]


@kernel
def lobe_error(
    x: np.float32,
    y: np.float32,
    z: np.float32,
    ox: np.float32,
    oy: np.float32,
    oz: np.float32,
    spread: np.float32,
    contribution: np.float32,
    alpha: np.float32,
) -> np.float32:
    """Estimated error of a node in direction (x, y, z) with mean square angle `spread`, in radiance.

    (ox, oy, oz) leads to the eye; contribution is irradiance times BRDF; alpha the lobe's width as the
    slope of half vectors. A lobe that stands inside the node shows by the rise of
    (1 + tan² / α²)^-2 from the node's direction to where the node comes nearest to the lobe.
    """
    hx, hy, hz = x + ox, y + oy, z + oz
    length = np.float32(np.sqrt(hx * hx + hy * hy + hz * hz))
    along = max(np.float32(0.5) * length, _LEAST_COSINE)  # cosine between light and half vector
    up = max(hz / length, np.float32(1e-3))
    slope2 = (np.float32(1) - up * up) / (up * up)
    width2 = spread / (np.float32(4) * along * along)
    slope = np.float32(np.sqrt(slope2))
    nearest = max(slope - np.float32(2) * np.float32(np.sqrt(width2)), np.float32(0))
    a2 = alpha * alpha
    fall, rise = a2 + slope2, a2 + nearest * nearest
    boost = min(fall / rise * (fall / rise), _BOOST)
    share = min(width2 / (a2 + nearest * nearest), np.float32(1))
    made: np.float32 = contribution * boost * share
    return made


@kernel
def _errors(
    wi: F32,
    count: int,
    ox: np.float32,
    oy: np.float32,
    oz: np.float32,
    spread: F32,
    arrives: F32,
    alpha: np.float32,
    bright: F32,
    out: F32,
) -> None:
    """bright (reflectance) becomes each node's contribution, out its `lobe_error`; vectorised."""
    for node in range(count):
        contribution = bright[node] * arrives[node]
        bright[node] = contribution
        out[node] = lobe_error(
            wi[node],
            wi[count + node],
            wi[2 * count + node],
            ox,
            oy,
            oz,
            spread[node],
            contribution,
            alpha,
        )


@kernel
def _split(
    place: int,
    size: int,
    parts: int,
    runs: Pool,
    first: int,
    last: int,
    block: F64,
    leaf: F32,
    nx: np.float32,
    ny: np.float32,
    nz: np.float32,
    axes: F64,
    least: np.float32,
    out: F32,
    found: int,
    most: int,
) -> int:
    """Writes the visible light of `parts` equal parts of leaves place … place + size − 1 as rows of out.

    From row `found` on and not beyond `most`; returns where they end.
    """
    leaves = len(leaf) - 1
    low, high = first, last
    while low < high:
        between = (low + high) >> 1
        if int(runs[2 * between + 1]) < place:
            low = between + 1
        else:
            high = between
    run = low
    step = size // parts
    sums = np.empty(SUMS, np.float32)
    for part in range(parts):
        begin = place + part * step
        end = begin + step
        for i in range(SUMS):
            sums[i] = np.float32(0)
        while run < last and int(runs[2 * run]) < end:
            a, b = max(int(runs[2 * run]), begin), min(int(runs[2 * run + 1]) + 1, end)
            for i in range(SUMS):
                sums[i] += leaf[b, i] - leaf[a, i]
            one, other = a // BLOCK, b // BLOCK
            if one != other:
                for i in range(SUMS):
                    sums[i] += np.float32(block[other, i] - block[one, i])
            if int(runs[2 * run + 1]) >= end:
                break
            run += 1
        power = sums[0]
        arrives = nx * sums[1] + ny * sums[2] + nz * sums[3]
        if power > least and arrives > 0 and found < most:
            moment = np.float32(np.sqrt(sums[1] * sums[1] + sums[2] * sums[2] + sums[3] * sums[3]))
            cell = (leaves + begin) // step
            write_node(sums, power, moment, nx, ny, nz, axes, np.float32(1), cell, out, found)
            found += 1
    return found


@kernel
def focus_nodes(
    begin: int,
    stop: int,
    block_number: int,
    points: I64,
    first: I64,
    data: F32,
    spread: F32,
    cells: I32,
    runs: Pool,
    run_start: I64,
    run_length: I32,
    owner: I32,
    wanted: Bools,
    positions: F32,
    normals: F32,
    tangents: F32,
    material: I32,
    eye: F32,
    address: I64,
    terms: I64,
    offset: I64,
    shapes: F32,
    weights: F32,
    alpha: F32,
    block: F64,
    leaf: F32,
    tolerance: np.float32,
    out: F32,
    nodes: I64,
) -> int:
    """Nodes of those of points[begin:stop] that are wanted and owned by this block, split where needed.

    weights (M, T) luminous coefficients of each material's terms, alpha (M,) widths of lobes (0: leave the
    material alone); tolerance is a node's share of the point's radiance. `out` is as in
    `gather_light`; nodes (P,) are counted, -1: the point keeps what it has. Returns how many points fitted.
    """
    leaves = len(leaf) - 1
    axes = np.empty((3, 3))
    wo = np.empty(3, np.float32)
    made = np.empty((MOST_NODES, NODE), np.float32)  # finished nodes
    waiting = np.empty((2 * MOST_NODES, NODE), np.float32)  # this turn's and the next one's
    wi = np.empty(3 * MOST_NODES, np.float32)
    values = np.empty(weights.shape[1] * MOST_NODES, np.float32)
    bright, errors = np.empty(MOST_NODES, np.float32), np.empty(MOST_NODES, np.float32)
    arrives, width = np.empty(MOST_NODES, np.float32), np.empty(MOST_NODES, np.float32)
    place = 0
    for number in range(begin, stop):
        if len(out) - 6 * place < 6 * MOST_NODES:
            return number - begin
        p = points[number]
        nodes[number] = -1
        if p < 0 or owner[p] != block_number or not wanted[p]:
            continue
        m = material[p]
        count = first[number + 1] - first[number]
        if alpha[m] <= 0 or count == 0:
            continue
        nx, ny, nz = normals[p, 0], normals[p, 1], normals[p, 2]
        surface_frame(normals[p], tangents[p], axes)
        local_view(positions[p], eye, axes, wo)
        shape = shapes[offset[m] :]
        base = 6 * first[number]
        current = 0
        for node in range(count):
            for line in range(6):
                waiting[node, line] = data[base + line * count + node]
            waiting[node, 6] = spread[first[number] + node]
            waiting[node, 7] = cells[first[number] + node]
        found = 0
        differs = False
        total = np.float32(0)
        for turn in range(ROUNDS):
            now, later = current * MOST_NODES, (1 - current) * MOST_NODES
            for node in range(count):
                row = now + node
                wi[node] = waiting[row, 0]
                wi[count + node] = waiting[row, 1]
                wi[2 * count + node] = waiting[row, 2]
                arrives[node] = waiting[row, 3] + waiting[row, 4] + waiting[row, 5]
                width[node] = waiting[row, 6]
            call_address(address[m], shape, wo, count, wi, values)
            _luminous(values, count, terms[m], weights, m, bright)
            _errors(wi, count, wo[0], wo[1], wo[2], width, arrives, alpha[m], bright, errors)
            if turn == 0:
                for node in range(count):
                    total += bright[node]
            allowed = tolerance * total
            next_count = later
            for node in range(count):
                row = now + node
                error = errors[node]
                if error > allowed and turn + 1 < ROUNDS:
                    cell = int(waiting[row, 7])
                    level = 0
                    while (2 << level) <= cell:
                        level += 1
                    size = leaves >> level
                    room = MOST_NODES - (next_count - later) - found - (count - node)
                    if size > 1 and room > (1 << LEVELS):
                        levels = 1
                        while levels < LEVELS and (size >> levels) > 1 and error > allowed * (1 << levels):
                            levels += 1
                        next_count = _split(
                            cell * size - leaves,
                            size,
                            1 << levels,
                            runs,
                            run_start[p] // 2,
                            (run_start[p] + run_length[p]) // 2,
                            block,
                            leaf,
                            nx,
                            ny,
                            nz,
                            axes,
                            np.float32(0),
                            waiting,
                            next_count,
                            later + MOST_NODES,
                        )
                        differs = True
                        continue
                for line in range(NODE):
                    made[found, line] = waiting[row, line]
                found += 1
            if next_count == later:
                break
            count = next_count - later
            current = 1 - current
        if not differs:
            continue
        nodes[number] = found
        for line in range(6):
            for node in range(found):
                out[6 * place + line * found + node] = made[node, line]
        place += found
    return stop - begin
