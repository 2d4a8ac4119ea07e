"""The columns of equation 3 at a stroke's own views: what each term sends there at each gloss level.

Sums over the 1024 cells of the nearest vertex, taken into a place's own frame, and over lamps and suns. They
are as fine as lobes need: the farther from the mirror direction, the coarser (FINE, MIDDLE and FAR). Where
lobes are sharp, the cells about it are divided, and where these see the sky, each part sees its own part of
it: a highlight is as sharp as the environment, not as the cells. Far from it four cells are taken as one, in
the direction that most of their light comes from.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.kernels.directions import leaf_of
from studio_core.parallel import Checkpoints, Workers
from studio_core.transport.patterns import grid_pattern
from studio_plugins.slf.incident import OF_QUARTERS, SIDE, Arriving, averaged
from studio_plugins.slf.ladder import LEVELS, alpha_of_level
from studio_plugins.slf.places import Places

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
SHARP = 0.32
"""α below which cells are divided about the mirror direction."""
FINE, MIDDLE, FAR = math.radians(12.0), math.radians(22.0), math.radians(40.0)
"""Within the first, cells have 16 parts, within the second 4; from the last on, four cells are one."""


def sums_at(
    address: int,
    terms: int,
    shapes: F32,
    light: Arriving,
    places: Places,
    workers: Workers,
    job: Checkpoints | None = None,
) -> F64:
    """(L, N, terms, 3) of a model's kernel, with shapes (L, D) of the levels.

    Σ_cells light · b_k · cosθ · ΔΩ + Σ_samples strength · b_k · cosθ.
    """
    count = len(places)
    out = np.zeros((len(shapes), count, terms, 3))
    given_shapes = np.ascontiguousarray(shapes, np.float32)
    sharp = np.array([alpha_of_level(level) < SHARP for level in range(len(shapes))])
    given = (
        np.ascontiguousarray(places.axes, np.float64), np.ascontiguousarray(places.wo, np.float32),
        light.row.astype(np.int64), light.axes, light.light, light.open, light.sky,
        averaged(light.sky, OF_QUARTERS), light.towards, light.strength, *_parts(),
    )  # fmt: skip
    angles = np.cos([FINE, MIDDLE, FAR])

    def body(start: int, stop: int) -> None:
        add_sums(address, terms, given_shapes, sharp, *given, angles, out, start, stop)

    workers.run(count, 8, body, job)
    return out


@functools.cache
def _parts() -> tuple[F32, F32, F32]:
    """Directions (1024, P, 3) of cells, of their 4 and of their 16 parts."""
    whole, quarters, sixteenths = (
        np.ascontiguousarray(grid_pattern(SIDE * side).directions[0].reshape(SIDE * SIDE, side * side, 3))
        for side in (1, 2, 4)
    )
    return whole, quarters, sixteenths


@kernel
def add_sums(
    address: int,
    terms: int,
    shapes: F32,
    sharp: Bools,
    axes: F64,
    wo: F32,
    row_of: I64,
    row_axes: F32,
    light: F32,
    open_: Bools,
    sky: F32,
    coarse: F32,
    towards: F32,
    strength: F32,
    whole: F32,
    quarters: F32,
    sixteenths: F32,
    angles: F64,
    out: F64,
    start: int,
    stop: int,
) -> None:
    """See `sums_at`; directions (1024, P, 3) of cells and of their parts, in Morton order.

    They are laid out as near cells, other cells, samples of lamps, parts of near cells: dull levels sum over
    the first three, sharp ones over the last three, each in one call of the kernel. What has no light is
    left out.
    """
    cells, lamps = len(whole), towards.shape[1]
    solid = np.float32(2.0 * np.pi / cells)
    fine_k, coarse_k = 0, 0
    while (1 << fine_k) < len(sky):
        fine_k += 1
    while (1 << coarse_k) < len(coarse):
        coarse_k += 1
    most = cells + lamps + cells * sixteenths.shape[1]
    x, y, z = np.empty(most, np.float32), np.empty(most, np.float32), np.empty(most, np.float32)
    weight = np.empty((3, most), np.float32)
    wi, values = np.empty(3 * most, np.float32), np.empty(terms * most, np.float32)
    own, cosine = np.empty((3, cells), np.float32), np.empty(cells, np.float32)
    turn = np.empty((3, 3), np.float32)
    fine, middle, far = np.float32(angles[0]), np.float32(angles[1]), np.float32(angles[2])
    for n in range(start, stop):
        row = row_of[n]
        for i in range(3):
            for j in range(3):
                total = 0.0
                for c in range(3):
                    total += axes[n, i, c] * row_axes[row, j, c]
                turn[i, j] = total
        mx, my, mz = -wo[n, 0], -wo[n, 1], wo[n, 2]
        at = 0
        for cell in range(cells):
            px, py, pz = whole[cell, 0, 0], whole[cell, 0, 1], whole[cell, 0, 2]
            ax = turn[0, 0] * px + turn[0, 1] * py + turn[0, 2] * pz
            ay = turn[1, 0] * px + turn[1, 1] * py + turn[1, 2] * pz
            az = turn[2, 0] * px + turn[2, 1] * py + turn[2, 2] * pz
            own[0, cell], own[1, cell], own[2, cell] = ax, ay, az
            cosine[cell] = ax * mx + ay * my + az * mz
            if cosine[cell] > middle and az > 0:
                x[at], y[at], z[at] = ax, ay, az
                for c in range(3):
                    weight[c, at] = light[row, cell, c] * (solid * az)
                at += 1
        close = at
        for parent in range(0, cells, 4):
            nearest = max(
                max(cosine[parent], cosine[parent + 1]), max(cosine[parent + 2], cosine[parent + 3])
            )
            if nearest < far:
                ax, ay, az, bright = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
                for c in range(3):
                    weight[c, at] = 0
                for cell in range(parent, parent + 4):
                    scale, grey = solid * max(own[2, cell], np.float32(0)), np.float32(0)
                    for c in range(3):
                        part = light[row, cell, c] * scale
                        weight[c, at] += part
                        grey += part
                    ax, ay, az = ax + grey * own[0, cell], ay + grey * own[1, cell], az + grey * own[2, cell]
                    bright += grey
                if bright > 0:
                    length = np.float32(1) / np.sqrt(ax * ax + ay * ay + az * az)
                    x[at], y[at], z[at] = ax * length, ay * length, az * length
                    at += 1
                continue
            for cell in range(parent, parent + 4):
                if cosine[cell] <= middle and own[2, cell] > 0:
                    x[at], y[at], z[at] = own[0, cell], own[1, cell], own[2, cell]
                    for c in range(3):
                        weight[c, at] = light[row, cell, c] * (solid * own[2, cell])
                    at += 1
        for sample in range(lamps):
            lx, ly, lz = towards[n, sample, 0], towards[n, sample, 1], towards[n, sample, 2]
            above = axes[n, 2, 0] * lx + axes[n, 2, 1] * ly + axes[n, 2, 2] * lz
            if above <= 0 or max(strength[n, sample, 0], strength[n, sample, 1], strength[n, sample, 2]) <= 0:
                continue
            x[at] = axes[n, 0, 0] * lx + axes[n, 0, 1] * ly + axes[n, 0, 2] * lz
            y[at] = axes[n, 1, 0] * lx + axes[n, 1, 1] * ly + axes[n, 1, 2] * lz
            z[at] = above
            for channel in range(3):
                weight[channel, at] = strength[n, sample, channel] * z[at]
            at += 1
        dull = at
        for cell in range(cells):
            if cosine[cell] <= middle:
                continue
            finest, seen = cosine[cell] > fine, open_[row, cell] and len(sky) > 0
            parts = sixteenths.shape[1] if finest else quarters.shape[1]
            share = solid / np.float32(parts)
            for part in range(parts):
                if finest:
                    px, py, pz = (
                        sixteenths[cell, part, 0],
                        sixteenths[cell, part, 1],
                        sixteenths[cell, part, 2],
                    )
                else:
                    px, py, pz = quarters[cell, part, 0], quarters[cell, part, 1], quarters[cell, part, 2]
                az = turn[2, 0] * px + turn[2, 1] * py + turn[2, 2] * pz
                if az <= 0:
                    continue
                x[at] = turn[0, 0] * px + turn[0, 1] * py + turn[0, 2] * pz
                y[at] = turn[1, 0] * px + turn[1, 1] * py + turn[1, 2] * pz
                z[at] = az
                wx = row_axes[row, 0, 0] * px + row_axes[row, 1, 0] * py + row_axes[row, 2, 0] * pz
                wy = row_axes[row, 0, 1] * px + row_axes[row, 1, 1] * py + row_axes[row, 2, 1] * pz
                wz = row_axes[row, 0, 2] * px + row_axes[row, 1, 2] * py + row_axes[row, 2, 2] * pz
                leaf = 0
                if seen:
                    leaf = leaf_of(wx, wy, wz, fine_k if finest else coarse_k)
                for c in range(3):
                    sent = light[row, cell, c]
                    if seen:
                        sent = sky[leaf, c] if finest else coarse[leaf, c]
                    weight[c, at] = sent * (share * az)
                at += 1
        for level in range(len(shapes)):
            begin, end = (close, at) if sharp[level] else (0, dull)
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
