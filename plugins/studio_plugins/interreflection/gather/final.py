"""What receivers get of all others' light: every term of their BRDF over every ray.

Rays are of two kinds, by the cosine (N_c of them) and by the receiver's peaked terms (N_l); each counts by
the balance heuristic (Veach & Guibas 1995) 1 / (N_c p_c + N_l p_l), with p_c = cosθ / π and p_l the mean of
the peaked terms' densities. So all rays serve all terms.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.kernels.radiance import local_view, surface_frame
from studio_core.transport.hits import BLACK

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]
Bools = npt.NDArray[np.bool_]

INV_PI = 1.0 / np.pi
ZERO = np.float32(0.0)


@kernel
def gather_final(
    start: int,
    stop: int,
    by_cosine: float,
    by_lobes: int,
    which: I64,
    rows: I64,
    variant: I32,
    hit_vertex: U32,
    hit_cell: U16,
    pattern: F32,
    world: F32,
    positions: F32,
    normals: F32,
    tangents: F32,
    leaning_normals: F32,
    leaning_tangents: F32,
    row: I32,
    eye: F32,
    address: I64,
    terms: I64,
    offset: I64,
    data: F32,
    density: I64,
    peaked: Bools,
    flat: F32,
    matte: F32,
    slot: I64,
    base: I64,
    count: I64,
    outgoing: F32,
    functions: F32,
    out_terms: F32,
    out_irradiance: F32,
    along: F32,
) -> None:
    """Adds terms (V, T, 3) that are not flat, and irradiance (V, 3), of receivers rows[which[start:stop]].

    hit_vertex, hit_cell (R, N) are what rays met: of the pattern's variants (P, N, 3), variant (R,) of each
    row, or, where that is empty, along `world` (R, N, 3). by_cosine = N_c and by_lobes = N_l are how many
    there are of each kind in all; rows without a peaked term have no rays by lobes. Light is weighed as
    surfaces with the leaning normals and tangents do; flat (R, T) are kernels' values that are constant (0:
    they are not). along (stop − start, N), unless it is empty, gets the sum
    over colours of the light along each ray.
    """
    many = hit_vertex.shape[1]
    drawn, telling = len(world) > 0, len(along) > 0
    axes, level = np.empty((3, 3)), np.empty((3, 3))
    wo, level_wo = np.empty(3, np.float32), np.empty(3, np.float32)
    wi, wi_level = np.empty(3 * many, np.float32), np.empty(3 * many, np.float32)
    packed = np.empty(3 * many, np.float32)
    light, weight = np.empty((3, many), np.float32), np.empty(many, np.float32)
    values = np.empty(out_terms.shape[1] * many, np.float32)
    for n in range(start, stop):
        i = which[n]
        v = rows[i]
        r = row[v]
        if r < 0:
            if telling:
                along[n - start] = ZERO
            continue
        surface_frame(normals[v], tangents[v], level)
        surface_frame(leaning_normals[v], leaning_tangents[v], axes)
        some = 0
        for j in range(many):
            vertex = np.int64(hit_vertex[i, j])
            if telling:
                along[n - start, j] = ZERO
            if vertex >= BLACK:
                continue
            red, green, blue = matte[vertex, 0], matte[vertex, 1], matte[vertex, 2]
            source = slot[vertex]
            if source >= 0:  # as in `transport.gather`
                its = count[row[vertex]]
                at = base[row[vertex]] + np.int64(hit_cell[i, j]) * its
                source *= 3
                for k in range(its):
                    share = outgoing[at + k]
                    red += share * functions[source + k]
                    green += share * functions[source + its + k]
                    blue += share * functions[source + 2 * its + k]
                red, green, blue = max(red, ZERO), max(green, ZERO), max(blue, ZERO)
            if drawn:
                x, y, z = world[i, j, 0], world[i, j, 1], world[i, j, 2]
            else:
                a, b, c = pattern[variant[i], j, 0], pattern[variant[i], j, 1], pattern[variant[i], j, 2]
                x = level[0, 0] * a + level[1, 0] * b + level[2, 0] * c
                y = level[0, 1] * a + level[1, 1] * b + level[2, 1] * c
                z = level[0, 2] * a + level[1, 2] * b + level[2, 2] * c
            for k in range(3):
                wi_level[3 * some + k] = level[k, 0] * x + level[k, 1] * y + level[k, 2] * z
                wi[3 * some + k] = axes[k, 0] * x + axes[k, 1] * y + axes[k, 2] * z
            if wi_level[3 * some + 2] <= 0.0 or wi[3 * some + 2] <= 0.0:
                continue
            light[0, some], light[1, some], light[2, some] = red, green, blue
            some += 1
            if telling:
                along[n - start, j] = red + green + blue
        if some == 0:
            continue
        own = 0
        for t in range(terms[r]):
            own += 1 if peaked[r, t] else 0
        shape = data[offset[r] :]
        for j in range(some):
            weight[j] = by_cosine * wi_level[3 * j + 2] * INV_PI
        if own > 0 and by_lobes > 0:
            local_view(positions[v], eye, level, level_wo)
            for j in range(some):
                for k in range(3):
                    packed[k * some + j] = wi_level[3 * j + k]
            call_address(density[r], shape, level_wo, some, packed, values)
            turn = 0
            for t in range(terms[r]):
                if peaked[r, t]:
                    drawn_of_term = (by_lobes - turn + own - 1) // own  # as `lobes.draw_lobes` parts them
                    turn += 1
                    for j in range(some):
                        weight[j] += drawn_of_term * values[t * some + j]
        red_sum, green_sum, blue_sum = 0.0, 0.0, 0.0
        for j in range(some):
            scale = wi[3 * j + 2] / weight[j] if weight[j] > 0.0 else 0.0
            light[0, j] *= scale
            light[1, j] *= scale
            light[2, j] *= scale
            red_sum += light[0, j]
            green_sum += light[1, j]
            blue_sum += light[2, j]
        out_irradiance[v, 0] += red_sum
        out_irradiance[v, 1] += green_sum
        out_irradiance[v, 2] += blue_sum
        bent = False
        for t in range(terms[r]):
            if flat[r, t] == 0.0:
                bent = True
        if bent:
            local_view(positions[v], eye, axes, wo)
            for j in range(some):
                for k in range(3):
                    packed[k * some + j] = wi[3 * j + k]
            call_address(address[r], shape, wo, some, packed, values)
        for t in range(terms[r]):
            if flat[r, t] != 0.0:
                continue
            red, green, blue = 0.0, 0.0, 0.0
            for j in range(some):
                value = values[t * some + j]
                red += value * light[0, j]
                green += value * light[1, j]
                blue += value * light[2, j]
            out_terms[v, t, 0] += red
            out_terms[v, t, 1] += green
            out_terms[v, t, 2] += blue


@kernel
def add_flat_terms(
    start: int, stop: int, vertices: I64, row: I32, flat: F32, irradiance: F32, out_terms: F32
) -> None:
    """Adds flat_t · E to terms (V, T, 3) of vertices[start:stop]."""
    for i in range(start, stop):
        v = vertices[i]
        r = row[v]
        if r < 0:
            continue
        for t in range(flat.shape[1]):
            for c in range(3):
                out_terms[v, t, c] += flat[r, t] * irradiance[v, c]
