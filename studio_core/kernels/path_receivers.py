"""Path tracing: rays that leave the points where light is asked for, and what their light comes to there.

Half of a point's rays follow the cosine, the others each glossy term of its BRDF; every ray counts for all
terms and for irradiance, weighted by the density of all ways to draw it (balance heuristic over all samples).
"""

from __future__ import annotations

import numpy as np

from studio_core.jit import call_address, kernel
from studio_core.kernels.path_state import (
    ENDED,
    F32,
    I32,
    I64,
    Models,
    Paths,
    next_random,
    seeded,
)
from studio_core.kernels.radiance import local_view, surface_frame
from studio_core.kernels.sampling import cosine_direction

_ACROSS, _DOWN = 0.7548776662466927, 0.5698402909980532  # of x³ = x + 1 (Roberts 2018)
INV_PI = 1 / np.pi


@kernel
def begin_paths(
    start: int,
    stop: int,
    samples: int,
    seed: int,
    number: I64,
    positions: F32,
    normals: F32,
    tangents: F32,
    horizon: F32,
    geometric: F32,
    origins: F32,
    material: I32,
    row: I32,
    eye: F32,
    models: Models,
    offset: I64,
    data: F32,
    paths: Paths,
    towards: F32,
    weight: F32,
) -> None:
    """Draws `samples` rays for each of the points start … stop−1, for paths point · samples + i.

    They are drawn about normals, tangents, and leave above `horizon` and `geometric` (P, 3) alone; origins
    (P, 3) are relative to the ray caster's middle, positions and eye to the same place. towards (N, 3) and
    weight (N,), 0 where there is no ray, are kept for `gather_paths`; `number` (P,) makes points different.
    """
    width = models.matte.shape[1]
    axes, wo = np.empty((3, 3)), np.empty(3, np.float32)
    wi, numbers = np.empty(3 * samples, np.float32), np.empty(2 * samples, np.float32)
    drawn, drawing = np.empty(3 * samples, np.float32), np.empty(width * samples, np.float32)
    counts = np.zeros(width, np.int64)
    random = np.zeros(1, np.uint64)
    for p in range(start, stop):
        m = np.int64(material[p])
        surface_frame(normals[p], tangents[p], axes)
        local_view(positions[p], eye, axes, wo)
        glossy, terms = 0, 0
        if m >= 0 and models.sampler[m] != 0:
            terms = models.terms[m]
            for k in range(terms):
                glossy += 0 if models.matte[m, k] else 1
        each = (samples // 2) // glossy if glossy else 0
        shape = data[offset[row[p]] if m >= 0 else 0 :]
        made = 0
        for k in range(-1, terms):
            if k >= 0 and models.matte[m, k]:
                counts[k] = 0
                continue
            own = samples - each * glossy if k < 0 else each
            if k >= 0:
                counts[k] = own
            if own == 0:
                continue
            random[0] = seeded(seed, number[p], -2 - k)
            first, second = np.float64(next_random(random, 0)), np.float64(next_random(random, 0))
            for i in range(own):
                numbers[i] = min((first + i * _ACROSS) % 1.0, 1 - 2.0**-24)
                numbers[own + i] = min((second + i * _DOWN) % 1.0, 1 - 2.0**-24)
            if k < 0:
                for i in range(own):
                    drawn[i], drawn[own + i], drawn[2 * own + i] = cosine_direction(
                        numbers[i], numbers[own + i]
                    )
            else:
                call_address(models.sampler[m], shape, wo, k, own, numbers, drawn)
            for i in range(own):
                for axis in range(3):
                    wi[axis * samples + made + i] = drawn[axis * own + i]
            made += own
        if each:
            call_address(models.density[m], shape, wo, samples, wi, drawing)
        for i in range(samples):
            n = p * samples + i
            x, y, z = wi[i], wi[samples + i], wi[2 * samples + i]
            weight[n] = 0.0
            paths.material[n] = ENDED
            for axis in range(3):
                paths.radiance[n, axis] = 0.0
            if not z > 0:
                continue
            total = (samples - each * glossy) * INV_PI * z
            for k in range(terms if each else 0):
                total += counts[k] * np.float64(drawing[k * samples + i])
            over, clear = 0.0, 0.0
            for axis in range(3):
                d = axes[0, axis] * x + axes[1, axis] * y + axes[2, axis] * z
                towards[n, axis] = d
                over += d * horizon[p, axis]
                clear += d * geometric[p, axis]
            if not (over > 0.0 and clear > 0.0 and total > 0.0):
                continue
            weight[n] = 1.0 / total
            for axis in range(3):
                paths.origin[n, axis] = origins[p, axis]
                paths.direction[n, axis] = towards[n, axis]
                paths.throughput[n, axis] = 1.0
            paths.density[n] = 0.0
            paths.random[n] = seeded(seed, number[p], i)
            paths.material[n] = 0


@kernel
def gather_paths(
    start: int,
    stop: int,
    samples: int,
    positions: F32,
    normals: F32,
    tangents: F32,
    row: I32,
    eye: F32,
    address: I64,
    terms: I64,
    offset: I64,
    data: F32,
    towards: F32,
    weight: F32,
    radiance: F32,
    out_terms: F32,
    out_irradiance: F32,
) -> None:
    """Sums the light of rays over points start … stop−1: terms (P, T, 3), irradiance (P, 3) are set.

    Shapes by `row` (P,), −1: none; frames may lean away from those that rays were drawn in.
    """
    axes, wo = np.empty((3, 3)), np.empty(3, np.float32)
    wi, values = np.empty(3 * samples, np.float32), np.empty(out_terms.shape[1] * samples, np.float32)
    sums = np.empty((out_terms.shape[1] + 1, 3))
    for p in range(start, stop):
        surface_frame(normals[p], tangents[p], axes)
        local_view(positions[p], eye, axes, wo)
        first, r = p * samples, np.int64(row[p])
        for i in range(samples):
            x, y, z = towards[first + i, 0], towards[first + i, 1], towards[first + i, 2]
            for axis in range(3):
                wi[axis * samples + i] = axes[axis, 0] * x + axes[axis, 1] * y + axes[axis, 2] * z
            if not weight[first + i] > 0:
                wi[2 * samples + i] = -1.0
        count = terms[r] if r >= 0 else 0
        if count:
            call_address(address[r], data[offset[r] :], wo, samples, wi, values)
        sums[:] = 0.0
        for i in range(samples):
            z = np.float64(wi[2 * samples + i])
            if not z > 0.0:
                continue
            z *= weight[first + i]
            for c in range(3):
                light = z * radiance[first + i, c]
                sums[count, c] += light
                for k in range(count):
                    sums[k, c] += light * values[k * samples + i]
        for c in range(3):
            for k in range(out_terms.shape[1]):
                out_terms[p, k, c] = sums[k, c] if k < count else 0.0
            out_irradiance[p, c] = sums[count, c]


__all__ = ["begin_paths", "gather_paths"]
