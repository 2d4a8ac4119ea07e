"""The columns of equation 3 at a stroke's own views: what each term sends there at each gloss level.

Sums over the 1024 cells of the nearest vertex, taken into a place's own frame, and over lamps and suns. Where
lobes are sharp, the cells about the mirror direction are divided, and where these see the sky, each part sees
its own part of it: a highlight is as sharp as the environment, not as the cells.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.kernels.directions import direction_at, leaf_of
from studio_core.parallel import Checkpoints, Workers
from studio_plugins.slf.incident import Arriving
from studio_plugins.slf.ladder import LEVELS, alpha_of_level
from studio_plugins.slf.places import Places

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
SHARP = 0.32
"""α below which cells are divided about the mirror direction."""
WITHIN = math.radians(22.0)
PARTS = 4  # a side of a cell that is divided


def sums_at(
    address: int,
    terms: int,
    shapes: F32,
    light: Arriving,
    places: Places,
    pattern: F32,
    workers: Workers,
    job: Checkpoints | None = None,
) -> F64:
    """(L, N, terms, 3) of a model's kernel, with shapes (L, D) of the levels; pattern (1024, 3) its cells.

    Σ_cells light · b_k · cosθ · ΔΩ + Σ_samples strength · b_k · cosθ.
    """
    count = len(places)
    out = np.zeros((len(shapes), count, terms, 3))
    given_shapes = np.ascontiguousarray(shapes, np.float32)
    sharp = np.array([alpha_of_level(level) < SHARP for level in range(len(shapes))])
    given = (
        np.ascontiguousarray(places.axes, np.float64), np.ascontiguousarray(places.wo, np.float32),
        light.row.astype(np.int64), light.axes.astype(np.float64), light.light, light.open, light.sky,
        light.towards, light.strength,
    )  # fmt: skip

    def body(start: int, stop: int) -> None:
        add_sums(
            address,
            terms,
            given_shapes,
            sharp,
            *given,
            pattern,
            WITHIN,
            PARTS,
            out,
            start,
            stop,
        )

    workers.run(count, 8, body, job)
    return out


@kernel
def add_sums(
    address: int,
    terms: int,
    shapes: F32,
    sharp: Bools,
    axes: F64,
    wo: F32,
    row_of: I64,
    row_axes: F64,
    light: F32,
    open_: Bools,
    sky: F32,
    towards: F32,
    strength: F32,
    pattern: F32,
    within: float,
    parts: int,
    out: F64,
    start: int,
    stop: int,
) -> None:
    """See `sums_at`. Directions are laid out as near cells, other cells, samples of lamps, parts of cells:
    dull levels sum over the first three, sharp ones over the last three, each in one call of the kernel."""
    cells, lamps = len(pattern), towards.shape[1]
    side = int(np.sqrt(float(cells)) + 0.5)
    solid = 2.0 * np.pi / cells
    k = 0
    while (1 << k) < len(sky):
        k += 1
    most = cells + lamps + cells * parts * parts
    x, y, z = np.empty(most, np.float32), np.empty(most, np.float32), np.empty(most, np.float32)
    weight = np.empty((3, most), np.float32)
    wi, values = np.empty(3 * most, np.float32), np.empty(terms * most, np.float32)
    near = np.empty(cells, np.bool_)
    turn = np.empty((3, 3))
    limit = np.cos(within)
    for n in range(start, stop):
        row = row_of[n]
        for i in range(3):
            for j in range(3):
                total = 0.0
                for c in range(3):
                    total += axes[n, i, c] * row_axes[row, j, c]
                turn[i, j] = total
        mx, my, mz = -wo[n, 0], -wo[n, 1], wo[n, 2]
        close = 0
        for cell in range(cells):
            px, py, pz = float(pattern[cell, 0]), float(pattern[cell, 1]), float(pattern[cell, 2])
            ax = turn[0, 0] * px + turn[0, 1] * py + turn[0, 2] * pz
            ay = turn[1, 0] * px + turn[1, 1] * py + turn[1, 2] * pz
            az = turn[2, 0] * px + turn[2, 1] * py + turn[2, 2] * pz
            near[cell] = ax * mx + ay * my + az * mz > limit
            close += near[cell]
        first, other = 0, close
        for cell in range(cells):
            px, py, pz = float(pattern[cell, 0]), float(pattern[cell, 1]), float(pattern[cell, 2])
            at = first if near[cell] else other
            x[at] = turn[0, 0] * px + turn[0, 1] * py + turn[0, 2] * pz
            y[at] = turn[1, 0] * px + turn[1, 1] * py + turn[1, 2] * pz
            z[at] = turn[2, 0] * px + turn[2, 1] * py + turn[2, 2] * pz
            scale = np.float32(solid) * max(z[at], np.float32(0))
            for c in range(3):
                weight[c, at] = light[row, cell, c] * scale
            if near[cell]:
                first += 1
            else:
                other += 1
        at = cells
        for c in range(lamps):
            lx, ly, lz = towards[n, c, 0], towards[n, c, 1], towards[n, c, 2]
            x[at] = axes[n, 0, 0] * lx + axes[n, 0, 1] * ly + axes[n, 0, 2] * lz
            y[at] = axes[n, 1, 0] * lx + axes[n, 1, 1] * ly + axes[n, 1, 2] * lz
            z[at] = axes[n, 2, 0] * lx + axes[n, 2, 1] * ly + axes[n, 2, 2] * lz
            for channel in range(3):
                weight[channel, at] = strength[n, c, channel] * max(z[at], np.float32(0))
            at += 1
        fine = np.float32(solid / (parts * parts))
        for cell in range(cells):
            if not near[cell]:
                continue
            # the cell's place in the pattern: ray i of the grid is leaf i, in Morton order
            column, line = 0, 0
            for bit in range(6):
                column |= ((cell >> (2 * bit + 1)) & 1) << bit
                line |= ((cell >> (2 * bit)) & 1) << bit
            for part in range(parts * parts):
                s = (column + (part // parts + 0.5) / parts) / side
                t = (line + (part % parts + 0.5) / parts) / side
                dx, dy, dz = direction_at(0, np.float32(s), np.float32(t))
                px, py, pz = float(dz), float(dx), float(dy)  # as `grid_pattern` turns them
                x[at] = turn[0, 0] * px + turn[0, 1] * py + turn[0, 2] * pz
                y[at] = turn[1, 0] * px + turn[1, 1] * py + turn[1, 2] * pz
                z[at] = turn[2, 0] * px + turn[2, 1] * py + turn[2, 2] * pz
                scale = fine * max(z[at], np.float32(0))
                if open_[row, cell] and len(sky):
                    wx = row_axes[row, 0, 0] * px + row_axes[row, 1, 0] * py + row_axes[row, 2, 0] * pz
                    wy = row_axes[row, 0, 1] * px + row_axes[row, 1, 1] * py + row_axes[row, 2, 1] * pz
                    wz = row_axes[row, 0, 2] * px + row_axes[row, 1, 2] * py + row_axes[row, 2, 2] * pz
                    leaf = leaf_of(np.float32(wx), np.float32(wy), np.float32(wz), k)
                    for c in range(3):
                        weight[c, at] = sky[leaf, c] * scale
                else:
                    for c in range(3):
                        weight[c, at] = light[row, cell, c] * scale
                at += 1
        for level in range(len(shapes)):
            begin = close if sharp[level] else 0
            end = at if sharp[level] else cells + lamps
            count = end - begin
            wi[:count], wi[count : 2 * count], wi[2 * count : 3 * count] = (
                x[begin:end],
                y[begin:end],
                z[begin:end],
            )
            call_address(address, shapes[level], wo[n], count, wi, values)
            reds, greens, blues = weight[0, begin:end], weight[1, begin:end], weight[2, begin:end]
            for term in range(terms):
                value = values[term * count : (term + 1) * count]
                red, green, blue = np.float32(0), np.float32(0), np.float32(0)
                for i in range(count):
                    red += value[i] * reds[i]
                    green += value[i] * greens[i]
                    blue += value[i] * blues[i]
                out[level, n, term, 0], out[level, n, term, 1], out[level, n, term, 2] = red, green, blue


__all__ = ["LEVELS", "sums_at"]
