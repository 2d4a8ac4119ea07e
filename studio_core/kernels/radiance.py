"""The brute-force light sum: equation (2) of Iwasaki et al., per BRDF term.

T_k(x) = Σ_j L(ω_j) V(x, ω_j) b_k(ω_j, ω_o) cosθ_j Δ, over all directions whose visibility bit is set;
E(x) = Σ_j L(ω_j) V(x, ω_j) cosθ_j Δ. Directions are gathered in batches for the BRDF's C function and
summed in float64.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

BATCH = 256
LOWEST_VIEW = 1e-3  # smallest n·ω_o: interpolated normals may turn away at silhouettes


@kernel
def frame(nx: float, ny: float, nz: float, out: F64) -> None:
    """Tangents of a unit normal without a branch at the pole (Duff et al. 2017): rows t, b, n."""
    sign = 1.0 if nz >= 0 else -1.0
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    out[0, 0], out[0, 1], out[0, 2] = 1.0 + sign * nx * nx * a, sign * b, -sign * nx
    out[1, 0], out[1, 1], out[1, 2] = b, sign + ny * ny * a, -ny
    out[2, 0], out[2, 1], out[2, 2] = nx, ny, nz


@kernel
def surface_frame(normal: F32, tangent: F32, out: F64) -> None:
    """Rows t, b, n about a unit normal; t is a tangent (x, y, z, s) of `scene.tangents`, b = s · n × t."""
    nx, ny, nz = float(normal[0]), float(normal[1]), float(normal[2])
    tx, ty, tz, sense = float(tangent[0]), float(tangent[1]), float(tangent[2]), float(tangent[3])
    out[0, 0], out[0, 1], out[0, 2] = tx, ty, tz
    out[1, 0] = sense * (ny * tz - nz * ty)
    out[1, 1] = sense * (nz * tx - nx * tz)
    out[1, 2] = sense * (nx * ty - ny * tx)
    out[2, 0], out[2, 1], out[2, 2] = nx, ny, nz


@kernel
def local_view(position: F32, eye: F32, axes: F64, wo: F32) -> None:
    """Direction towards the eye in the shading frame, at least `LOWEST_VIEW` above the surface."""
    dx = float(eye[0]) - float(position[0])
    dy = float(eye[1]) - float(position[1])
    dz = float(eye[2]) - float(position[2])
    scale = 1.0 / max(np.sqrt(dx * dx + dy * dy + dz * dz), 1e-12)
    x = (axes[0, 0] * dx + axes[0, 1] * dy + axes[0, 2] * dz) * scale
    y = (axes[1, 0] * dx + axes[1, 1] * dy + axes[1, 2] * dz) * scale
    z = (axes[2, 0] * dx + axes[2, 1] * dy + axes[2, 2] * dz) * scale
    if z < LOWEST_VIEW:
        z = LOWEST_VIEW
        length = 1.0 / np.sqrt(x * x + y * y + z * z)
        x, y, z = x * length, y * length, z * length
    wo[0], wo[1], wo[2] = x, y, z


@kernel
def _flush(
    count: int, address: int, terms: int, shape: F32, wo: F32, wi: F32, light: F32, values: F32, sums: F64
) -> None:
    # values: b_k of the batch; light (3, BATCH) is L V cosθ already
    call_address(address, shape, wo, count, wi, values)
    for k in range(terms):
        red, green, blue = 0.0, 0.0, 0.0
        for j in range(count):
            b = values[k * count + j]
            red += light[0, j] * b
            green += light[1, j] * b
            blue += light[2, j] * b
        sums[k, 0] += red
        sums[k, 1] += green
        sums[k, 2] += blue


@kernel
def environment_terms(
    start: int,
    stop: int,
    points: I64,
    positions: F32,
    normals: F32,
    tangents: F32,
    material: I32,
    eye: F32,
    bits: npt.NDArray[np.uint64],
    directions: F32,
    leaf_radiance: F32,
    solid_angle: float,
    address: I64,
    terms: I64,
    offset: I64,
    shapes: F32,
    out_terms: F32,
    out_irradiance: F32,
) -> None:
    """Adds terms (V, TERMS, 3) and irradiance (V, 3) of points[start:stop].

    `bits` (len(points), S/64) are their visibility words; directions (S, 3) are world.
    """
    axes = np.empty((3, 3))
    wo = np.empty(3, np.float32)
    wi = np.empty(3 * BATCH, np.float32)
    packed = np.empty(3 * BATCH, np.float32)
    light = np.empty((3, BATCH), np.float32)
    values = np.empty(out_terms.shape[1] * BATCH, np.float32)
    sums = np.empty((out_terms.shape[1], 3))
    for row in range(start, stop):
        p = points[row]
        surface_frame(normals[p], tangents[p], axes)
        local_view(positions[p], eye, axes, wo)
        m = material[p]
        shape = shapes[offset[m] :]
        sums[:] = 0.0
        red, green, blue = 0.0, 0.0, 0.0
        count = 0
        for word in range(bits.shape[1]):
            left = bits[row, word]
            base = word * 64
            while left:
                lowest = left & (~left + np.uint64(1))
                leaf = base + _bit_index(lowest)
                left ^= lowest
                dx, dy, dz = directions[leaf, 0], directions[leaf, 1], directions[leaf, 2]
                z = axes[2, 0] * dx + axes[2, 1] * dy + axes[2, 2] * dz
                if z <= 0.0:
                    continue
                wi[count] = axes[0, 0] * dx + axes[0, 1] * dy + axes[0, 2] * dz
                wi[BATCH + count] = axes[1, 0] * dx + axes[1, 1] * dy + axes[1, 2] * dz
                wi[2 * BATCH + count] = z
                r, g, b = leaf_radiance[leaf, 0] * z, leaf_radiance[leaf, 1] * z, leaf_radiance[leaf, 2] * z
                light[0, count], light[1, count], light[2, count] = r, g, b
                red += r
                green += g
                blue += b
                count += 1
                if count == BATCH:
                    _flush(count, address[m], terms[m], shape, wo, wi, light, values, sums)
                    count = 0
        if count:
            for j in range(count):
                packed[j] = wi[j]
                packed[count + j] = wi[BATCH + j]
                packed[2 * count + j] = wi[2 * BATCH + j]
            _flush(count, address[m], terms[m], shape, wo, packed, light, values, sums)
        for k in range(terms[m]):
            for c in range(3):
                out_terms[p, k, c] += sums[k, c] * solid_angle
        out_irradiance[p, 0] += red * solid_angle
        out_irradiance[p, 1] += green * solid_angle
        out_irradiance[p, 2] += blue * solid_angle


@kernel
def _bit_index(lowest: np.uint64) -> int:
    # position of the one set bit, by halves
    index = 0
    if lowest & np.uint64(0xFFFFFFFF00000000):
        index += 32
    if lowest & np.uint64(0xFFFF0000FFFF0000):
        index += 16
    if lowest & np.uint64(0xFF00FF00FF00FF00):
        index += 8
    if lowest & np.uint64(0xF0F0F0F0F0F0F0F0):
        index += 4
    if lowest & np.uint64(0xCCCCCCCCCCCCCCCC):
        index += 2
    if lowest & np.uint64(0xAAAAAAAAAAAAAAAA):
        index += 1
    return index


@kernel
def lamp_terms(
    start: int,
    stop: int,
    points: I64,
    positions: F32,
    normals: F32,
    tangents: F32,
    material: I32,
    eye: F32,
    to_lamp: F32,
    weight: F32,
    colour: F32,
    seen: npt.NDArray[np.bool_],
    address: I64,
    terms: I64,
    offset: I64,
    shapes: F32,
    out_terms: F32,
    out_irradiance: F32,
) -> None:
    """Adds one lamp's terms (V, TERMS, 3) and irradiance (V, 3) for points[start:stop]: Q samples each.

    to_lamp (P, Q, 3) unit directions; weight (P, Q) times colour (Q, 3) is what each sample gives to a
    surface that faces it; seen (P, Q). Where all points share them, to_lamp and weight may have one row for
    all; where all samples share it, colour may: np.ones((1, 3)) for a white lamp, a sun's irradiance (Q, 3)
    with a weight of ones((1, Q)). Q ≤ BATCH.
    """
    axes = np.empty((3, 3))
    wo = np.empty(3, np.float32)
    wi = np.empty(3 * BATCH, np.float32)
    keep = np.empty(BATCH, np.int64)
    light = np.empty((3, BATCH), np.float32)
    values = np.empty(out_terms.shape[1] * BATCH, np.float32)
    sums = np.empty((out_terms.shape[1], 3))
    samples = weight.shape[1]
    own_way, own_weight, own_colour = len(to_lamp) > 1, len(weight) > 1, len(colour) > 1
    for row in range(start, stop):
        p = points[row]
        towards, given = to_lamp[row if own_way else 0], weight[row if own_weight else 0]
        surface_frame(normals[p], tangents[p], axes)
        local_view(positions[p], eye, axes, wo)
        m = material[p]
        count = 0
        for q in range(samples):
            d = towards[q]
            z = axes[2, 0] * d[0] + axes[2, 1] * d[1] + axes[2, 2] * d[2]
            if z > 0.0 and given[q] > 0.0 and seen[row, q]:
                keep[count] = q
                count += 1
        if count == 0:
            continue
        red, green, blue = 0.0, 0.0, 0.0
        for j in range(count):
            q = keep[j]
            d = towards[q]
            z = axes[2, 0] * d[0] + axes[2, 1] * d[1] + axes[2, 2] * d[2]
            wi[j] = axes[0, 0] * d[0] + axes[0, 1] * d[1] + axes[0, 2] * d[2]
            wi[count + j] = axes[1, 0] * d[0] + axes[1, 1] * d[1] + axes[1, 2] * d[2]
            wi[2 * count + j] = z
            own, facing = colour[q if own_colour else 0], given[q] * z
            light[0, j], light[1, j], light[2, j] = own[0] * facing, own[1] * facing, own[2] * facing
            red += own[0] * facing
            green += own[1] * facing
            blue += own[2] * facing
        sums[:] = 0.0
        _flush(count, address[m], terms[m], shapes[offset[m] :], wo, wi, light, values, sums)
        for k in range(terms[m]):
            for c in range(3):
                out_terms[p, k, c] += sums[k, c]
        out_irradiance[p, 0] += red
        out_irradiance[p, 1] += green
        out_irradiance[p, 2] += blue


__all__ = ["BATCH", "environment_terms", "frame", "lamp_terms", "local_view", "surface_frame"]
