"""Path tracing: light at a surface, and where the path goes on from there.

At each surface one lamp is looked at, chosen by what it would give unhindered, and one place of the
environment, chosen by its radiance; area lamps and environment are combined with the rays that go on by the
balance heuristic (Veach & Guibas 1995). A path goes on by the cosine or by one term of the surface's BRDF,
chosen by its albedo times the size of its coefficient; terms may be negative.
"""

from __future__ import annotations

import numpy as np

from studio_core.jit import call_address, kernel
from studio_core.kernels.compose import AFFINE, CONSTANT, repeated, texel
from studio_core.kernels.directions import cell_of_leaf, direction_at
from studio_core.kernels.packets import DIRECTION, MASK, OPAQUE, ORIGIN, TFAR, new_packet
from studio_core.kernels.path_state import (
    AREA,
    DIRECTIONAL,
    ENDED,
    F32,
    F64,
    I64,
    SOME,
    SPOT,
    SUNS,
    Lights,
    Looks,
    Models,
    Paths,
    Tracer,
    area_weight,
    next_random,
)
from studio_core.kernels.radiance import LOWEST_VIEW, surface_frame
from studio_core.kernels.sampling import cosine_direction

BINS = 8
"""Cosines of the view for which `Models.albedo` is known."""
COSINE_SHARE = 0.05
"""Of paths, go on by the cosine where terms draw directions of their own."""
LEAST_DENSITY = 1e-12
"""Of a ray that is followed: what is rarer would be too bright for numbers."""
INV_PI = 1 / np.pi
NEXT, LAMP, SKY = 0, 1, 2  # the directions looked at from a surface


@kernel
def light_paths(
    start: int,
    stop: int,
    active: I64,
    last: bool,
    roulette: bool,
    tracer: Tracer,
    looks: Looks,
    models: Models,
    offset: I64,
    data: F32,
    lights: Lights,
    paths: Paths,
) -> None:
    """Adds the light that reaches the surfaces of paths active[start:stop], and gives each its next ray.

    Shapes start at offset (R,) of `data`, by the paths' rows. `last`: the next ray counts only where it
    leaves the scene or passes an area lamp, so without these there is none. `roulette`: dim paths end by
    chance.
    """
    packet, valid = new_packet()
    packet.view(np.uint32)[MASK, :] = OPAQUE
    width = looks.plain.shape[1] // 3
    axes = np.empty((3, 3))
    colour, found = np.empty(3 * width, np.float32), np.empty(3, np.float32)
    rows = np.empty(looks.tables.shape[1], np.float32)
    wo, wi = np.empty(3, np.float32), np.empty(9, np.float32)
    numbers, drawn = np.empty(2, np.float32), np.empty(3, np.float32)
    values, drawing = np.empty(3 * width, np.float32), np.empty(3 * width, np.float32)
    share = np.empty(width)
    reflected = np.empty((3, 3))
    given = np.zeros((3, 8, 3))  # light of each lane by way of its lamp and its sky
    ray, far = np.zeros((3, 8, 3)), np.zeros((3, 8))
    lamps, aim, world, mixed = len(lights.kind), np.empty(3), np.empty((3, 3)), np.empty(3)
    for first in range(start, stop, 8):
        count = min(8, stop - first)
        for lane in range(count):
            n = active[first + lane]
            m = np.int64(paths.material[n])
            shape = data[offset[paths.row[n]] :]
            terms = min(models.terms[m], width)
            for k in range(3 * width):
                colour[k] = looks.plain[m, k]
            if looks.kind[m] != CONSTANT:
                tu = repeated(paths.uv[n, 0], paths.uv[n, 1], *_row(looks.uv_map, m, 0))
                tv = repeated(paths.uv[n, 0], paths.uv[n, 1], *_row(looks.uv_map, m, 3))
                if looks.kind[m] == AFFINE:
                    texel(looks.texels, looks.first[m], looks.size[m, 0], looks.size[m, 1], tu, tv, found)
                    for k in range(3 * width):
                        colour[k] += looks.slope[m, k] * found[k % 3]
                else:
                    texel(looks.tables, looks.first[m], looks.size[m, 0], looks.size[m, 1], tu, tv, rows)
                    for k in range(3 * width):
                        colour[k] = rows[k]
            if len(looks.painted):
                for k in range(3 * width):
                    colour[k] += looks.painted[paths.vertex[n], k]
            surface_frame(paths.normal[n], paths.tangent[n], axes)
            x, y, z = _local(axes, -paths.direction[n, 0], -paths.direction[n, 1], -paths.direction[n, 2])
            if z < LOWEST_VIEW:
                z = LOWEST_VIEW
                scale = 1.0 / np.sqrt(x * x + y * y + z * z)
                x, y, z = x * scale, y * scale, z * scale
            wo[0], wo[1], wo[2] = x, y, z

            # Where the path goes on.
            level, total, matte = min(int(z * BINS), BINS - 1), 0.0, 0.0
            for k in range(terms):
                size = max(abs(colour[3 * k]), abs(colour[3 * k + 1]), abs(colour[3 * k + 2]))
                part = np.float64(size) * models.albedo[m, level, k]
                total += part
                share[k] = part
                if models.matte[m, k] or models.sampler[m] == 0:
                    share[k] = 0.0
                    matte += part
            if not total > 0.0:
                paths.material[n] = ENDED
                valid[lane] = 0
                for way in range(LAMP, SKY + 1):
                    far[way, lane] = -1.0
                continue
            matte = max(matte, COSINE_SHARE * total)
            whole = matte
            for k in range(terms):
                whole += share[k]
            numbers[0], numbers[1] = next_random(paths.random, n), next_random(paths.random, n)
            at, chosen = next_random(paths.random, n) * whole - matte, -1
            for k in range(terms):
                if at >= 0.0 and share[k] > 0.0:
                    chosen = k
                    at -= share[k]
            if chosen < 0:
                drawn[0], drawn[1], drawn[2] = cosine_direction(numbers[0], numbers[1])
            else:
                call_address(models.sampler[m], shape, wo, chosen, 1, numbers, drawn)
            for axis in range(3):
                wi[3 * axis + NEXT] = drawn[axis]
                world[NEXT, axis] = (
                    axes[0, axis] * drawn[0] + axes[1, axis] * drawn[1] + axes[2, axis] * drawn[2]
                )

            # A lamp, by what each would give.
            px, py, pz = (
                np.float64(paths.origin[n, 0]),
                np.float64(paths.origin[n, 1]),
                np.float64(paths.origin[n, 2]),
            )
            nx, ny, nz = axes[2, 0], axes[2, 1], axes[2, 2]
            lamp, upto, own = -1, 0.0, 0.0
            for i in range(lamps):
                kind = lights.kind[i]
                if kind >= DIRECTIONAL:
                    cosine = -(lights.axis[i, 0] * nx + lights.axis[i, 1] * ny + lights.axis[i, 2] * nz)
                    weight = lights.power[i] * (max(cosine, 0.0) + (SOME if lights.spread[i] > 0 else 0.0))
                else:
                    ex, ey, ez = (
                        lights.position[i, 0] - px,
                        lights.position[i, 1] - py,
                        lights.position[i, 2] - pz,
                    )
                    square = max(ex * ex + ey * ey + ez * ez, 1e-12)
                    away = np.sqrt(square)
                    cosine = max((ex * nx + ey * ny + ez * nz) / away, 0.0)
                    back = -(ex * lights.axis[i, 0] + ey * lights.axis[i, 1] + ez * lights.axis[i, 2]) / away
                    if kind == AREA:
                        weight = area_weight(lights.power[i], lights.spread[i], cosine, back, square) * square
                    elif kind == SPOT:
                        weight = (
                            lights.power[i] * cosine * _falloff(back, lights.cones[i, 1], lights.cones[i, 0])
                        )
                    else:
                        weight = lights.power[i] * cosine
                    weight /= square
                if weight > 0.0:
                    upto += weight
                    if next_random(paths.random, n) * upto < weight:
                        lamp, own = i, weight
            paths.lamps[n] = upto
            far[LAMP, lane], wi[6 + LAMP], shone = -1.0, np.float32(-1), 0.0
            wi[LAMP] = wi[3 + LAMP] = np.float32(0)
            for c in range(3):
                given[LAMP, lane, c] = 0.0
            if lamp >= 0:
                kind, pick = lights.kind[lamp], upto / own
                u0, u1 = next_random(paths.random, n), next_random(paths.random, n)
                if kind == SUNS:
                    q = _chosen(lights.sun_upto, u0)
                    chance = lights.sun_upto[q] - (lights.sun_upto[q - 1] if q > 0 else 0.0)
                    pick *= lights.sun_upto[-1] / max(chance, 1e-300)
                    for axis in range(3):
                        aim[axis] = lights.towards[q, axis]
                        given[LAMP, lane, axis] = pick * lights.sun[q, axis]
                    far[LAMP, lane] = np.inf
                elif kind == DIRECTIONAL:
                    radius, turn = lights.spread[lamp] * np.sqrt(u0), 2 * np.pi * u1
                    a, b = radius * np.cos(turn), radius * np.sin(turn)
                    for axis in range(3):
                        aim[axis] = (
                            -lights.axis[lamp, axis]
                            + a * lights.across[lamp, axis]
                            + b * lights.up[lamp, axis]
                        )
                        given[LAMP, lane, axis] = pick * lights.gain[lamp, axis]
                    scale = 1.0 / np.sqrt(aim[0] * aim[0] + aim[1] * aim[1] + aim[2] * aim[2])
                    for axis in range(3):
                        aim[axis] *= scale
                    far[LAMP, lane] = np.inf
                else:
                    a, b = (u0 - 0.5, u1 - 0.5) if kind == AREA else (0.0, 0.0)
                    ex = lights.position[lamp, 0] + a * lights.across[lamp, 0] + b * lights.up[lamp, 0] - px
                    ey = lights.position[lamp, 1] + a * lights.across[lamp, 1] + b * lights.up[lamp, 1] - py
                    ez = lights.position[lamp, 2] + a * lights.across[lamp, 2] + b * lights.up[lamp, 2] - pz
                    away = max(np.sqrt(ex * ex + ey * ey + ez * ez), 1e-6)
                    aim[0], aim[1], aim[2] = ex / away, ey / away, ez / away
                    back = -(
                        aim[0] * lights.axis[lamp, 0]
                        + aim[1] * lights.axis[lamp, 1]
                        + aim[2] * lights.axis[lamp, 2]
                    )
                    if kind == AREA and back > 0.0:
                        shone = away * away / (pick * back * lights.area[lamp])
                        pick *= back
                    elif kind == AREA:
                        pick = 0.0
                    elif kind == SPOT:
                        pick *= _falloff(back, lights.cones[lamp, 1], lights.cones[lamp, 0])
                    for c in range(3):
                        given[LAMP, lane, c] = pick * lights.gain[lamp, c] / (away * away)
                    far[LAMP, lane] = max(away - 4 * tracer.epsilon, 0.0)
                for axis in range(3):
                    world[LAMP, axis] = aim[axis]
                wi[LAMP], wi[3 + LAMP], wi[6 + LAMP] = _local(axes, aim[0], aim[1], aim[2])

            # A place of the environment.
            far[SKY, lane], wi[6 + SKY], sky = -1.0, np.float32(-1), np.float32(0)
            wi[SKY] = wi[3 + SKY] = np.float32(0)
            for c in range(3):
                given[SKY, lane, c] = 0.0
            if lights.k > 0:
                leaf = _chosen(lights.upto, next_random(paths.random, n))
                sky = lights.chance[leaf]
                hemisphere, column, line = cell_of_leaf(leaf, lights.k)
                s = (column + next_random(paths.random, n)) / np.float32(1 << (lights.k // 2))
                t = (line + next_random(paths.random, n)) / np.float32(1 << ((lights.k - 1) // 2))
                aim[0], aim[1], aim[2] = direction_at(hemisphere, np.float32(s), np.float32(t))
                wi[SKY], wi[3 + SKY], wi[6 + SKY] = _local(axes, aim[0], aim[1], aim[2])
                far[SKY, lane] = np.inf
                for axis in range(3):
                    world[SKY, axis] = aim[axis]
                    given[SKY, lane, axis] = lights.radiance[leaf, axis]

            # What the surface sends back of all three.
            call_address(models.address[m], shape, wo, 3, wi, values)
            if whole > matte:
                call_address(models.density[m], shape, wo, 3, wi, drawing)
            for way in range(3):
                up = np.float64(wi[6 + way])
                above = 0.0
                if up > 0.0:
                    above = (
                        world[way, 0] * paths.geometric[n, 0]
                        + world[way, 1] * paths.geometric[n, 1]
                        + world[way, 2] * paths.geometric[n, 2]
                    )
                for c in range(3):
                    reflected[way, c] = 0.0
                if not above > 0.0:
                    far[way, lane] = -1.0
                    continue
                for k in range(terms):
                    for c in range(3):
                        reflected[way, c] += np.float64(colour[3 * k + c]) * values[3 * k + way]
                for c in range(3):
                    reflected[way, c] *= up
            for way in range(3):
                mixed[way] = 0.0
                if wi[6 + way] > 0:
                    mixed[way] = matte * INV_PI * wi[6 + way]
                    for k in range(terms):
                        if share[k] > 0.0:
                            mixed[way] += share[k] * drawing[3 * k + way]
                    mixed[way] /= whole
            for c in range(3):
                given[LAMP, lane, c] *= reflected[LAMP, c] * paths.throughput[n, c]
                if shone > 0.0:  # area lamps are found by rays that go on, too
                    given[LAMP, lane, c] *= shone / (shone + mixed[LAMP])
                given[SKY, lane, c] *= (
                    reflected[SKY, c] * paths.throughput[n, c] / max(sky + mixed[SKY], 1e-30)
                )
                ray[LAMP, lane, c], ray[SKY, lane, c] = world[LAMP, c], world[SKY, c]
            alive = mixed[NEXT] > LEAST_DENSITY and not (last and lights.k == 0 and lights.areas == 0)
            most = 0.0
            for c in range(3):
                paths.throughput[n, c] *= reflected[NEXT, c] / max(mixed[NEXT], 1e-30)
                most = max(most, abs(np.float64(paths.throughput[n, c])))
                paths.direction[n, c] = world[NEXT, c]
            paths.density[n] = mixed[NEXT]
            alive = alive and most > 0.0
            if alive and roulette:
                survives = min(max(most, 0.05), 1.0)
                alive = next_random(paths.random, n) < survives
                for c in range(3):
                    paths.throughput[n, c] /= survives
            if not alive:
                paths.material[n] = ENDED

        # Whether anything is in the way.
        for way in range(LAMP, SKY + 1):
            used = 0
            for lane in range(8):
                valid[lane] = 0
                if lane >= count or far[way, lane] < 0.0:
                    continue
                if given[way, lane, 0] == 0.0 and given[way, lane, 1] == 0.0 and given[way, lane, 2] == 0.0:
                    continue
                n = active[first + lane]
                for axis in range(3):
                    packet[ORIGIN + axis, lane] = paths.origin[n, axis]
                    packet[DIRECTION + axis, lane] = ray[way, lane, axis]
                packet[TFAR, lane] = far[way, lane]
                valid[lane] = -1
                used += 1
            if used == 0:
                continue
            call_address(tracer.occluded8, valid, tracer.scene, packet, 0)
            for lane in range(count):
                if valid[lane] != 0 and packet[TFAR, lane] >= 0:
                    n = active[first + lane]
                    for c in range(3):
                        paths.radiance[n, c] += given[way, lane, c]


@kernel
def _row(table: F32, m: np.int64, first: int) -> tuple[np.float32, np.float32, np.float32]:
    return table[m, first], table[m, first + 1], table[m, first + 2]


@kernel
def _local(axes: F64, x: float, y: float, z: float) -> tuple[float, float, float]:
    return (
        axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z,
        axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z,
        axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z,
    )


@kernel
def _chosen(upto: F64, share: np.float32) -> int:
    """The first item whose running sum is over a share of all."""
    level = share * upto[-1]
    low, high = 0, len(upto) - 1
    while low < high:
        middle = (low + high) >> 1
        if upto[middle] > level:
            high = middle
        else:
            low = middle + 1
    return low


@kernel
def _falloff(cosine: float, inner: float, cone: float) -> float:
    """As `shading.lamps.spot_falloff`."""
    if inner - cone < 1e-9:
        return 1.0 if cosine >= cone else 0.0
    t = min(max((cosine - cone) / (inner - cone), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@kernel
def weigh_terms(
    address: int,
    sampler: int,
    density: int,
    terms: int,
    shape: F32,
    numbers: F32,
    albedo: F32,
    flat: F32,
) -> None:
    """albedo (BINS, T) of the terms of a shape, about, from N draws `numbers` (2 N,) for each.

    flat (T,): the largest value of a term less its smallest over some directions, relative to the largest.
    """
    count = len(numbers) // 2
    wo, wi = np.empty(3, np.float32), np.empty(3 * count, np.float32)
    values, drawing = np.empty(terms * count, np.float32), np.empty(terms * count, np.float32)
    least, most = np.full(terms, np.inf), np.full(terms, -np.inf)
    for level in range(BINS):
        z = (level + 0.5) / BINS
        wo[0], wo[1], wo[2] = 0.8 * np.sqrt(1 - z * z), 0.6 * np.sqrt(1 - z * z), z
        for i in range(count):
            x, y, up = cosine_direction(numbers[i], numbers[count + i])
            wi[i], wi[count + i], wi[2 * count + i] = x, y, up
        call_address(address, shape, wo, count, wi, values)
        for k in range(terms):
            total = 0.0
            for i in range(count):
                b = np.float64(values[k * count + i])
                total += abs(b)
                if wi[2 * count + i] > 1e-3:
                    least[k], most[k] = min(least[k], b), max(most[k], b)
            albedo[level, k] = np.pi * total / count
        for k in range(terms if sampler != 0 else 0):
            call_address(sampler, shape, wo, k, count, numbers, wi)
            call_address(address, shape, wo, count, wi, values)
            call_address(density, shape, wo, count, wi, drawing)
            total = 0.0
            for i in range(count):
                if wi[2 * count + i] > 0 and drawing[k * count + i] > 0:
                    total += (
                        abs(np.float64(values[k * count + i])) * wi[2 * count + i] / drawing[k * count + i]
                    )
            albedo[level, k] = total / count
    for k in range(terms):
        flat[k] = (most[k] - least[k]) / max(abs(most[k]), abs(least[k]), 1e-30)


__all__ = ["BINS", "light_paths", "weigh_terms"]
