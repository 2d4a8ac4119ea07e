"""Pixels from vertices: light sums become colours at vertices, and these are interpolated at every hit.

A material's coefficients are constant, affine in the texel of one map (c = plain + slope · texel), or have a
map of their own. With the first two a vertex needs two colours, whatever the number of terms and lights:
Σ plain · term and Σ slope · term; a hit is the first plus texel times the second. Only the third kind sums
terms at every hit; it may have coefficients below 0 (captured materials), so its sums are cut off at 0.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U32 = npt.NDArray[np.uint32]
Bools = npt.NDArray[np.bool_]
Colour = tuple[np.float32, np.float32, np.float32]

CONSTANT, AFFINE, GENERAL = 0, 1, 2
CAUGHT = 3
"""What catches shadows, for canvases; kernels draw it by `add_caught`."""
RECORD = 8
"""Floats of a vertex: two colours, u, v."""
ROOT_TWO = 2**0.5
LEAST_COSINE = 0.05
_ONE = np.float32(1)


@kernel
def face_texels(
    start: int,
    stop: int,
    positions: F32,
    uvs: F32,
    faces: U32,
    face_material: I32,
    kind: I64,
    size: I64,
    uv_map: F32,
    out: F32,
) -> None:
    """(F,) texels of the finest level along a metre of faces start … stop−1; 1 where nothing is textured."""
    for f in range(start, stop):
        m = face_material[f]
        out[f] = 1.0
        if kind[m] == CONSTANT:
            continue
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = np.float64(positions[i, 0]), np.float64(positions[i, 1]), np.float64(positions[i, 2])
        bx, by, bz = positions[j, 0] - ax, positions[j, 1] - ay, positions[j, 2] - az
        cx, cy, cz = positions[k, 0] - ax, positions[k, 1] - ay, positions[k, 2] - az
        nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        area = np.sqrt(nx * nx + ny * ny + nz * nz)
        au, av = np.float64(uvs[i, 0]), np.float64(uvs[i, 1])
        in_map = abs((uvs[j, 0] - au) * (uvs[k, 1] - av) - (uvs[j, 1] - av) * (uvs[k, 0] - au))
        a, b, c, d = uv_map[m, 0], uv_map[m, 1], uv_map[m, 3], uv_map[m, 4]
        in_map *= abs(np.float64(a) * d - np.float64(b) * c) * (size[m, 0, 0] * size[m, 0, 1])
        out[f] = min(np.sqrt(in_map / max(area, 1e-20)), 1e30)


@kernel
def add_light(
    start: int,
    stop: int,
    terms: F32,
    gain: F32,
    valid: Bools,
    material: I32,
    kind: I64,
    plain: F32,
    slope: F32,
    painted: F32,
    record: F32,
    sums: F32,
) -> None:
    """Adds one light layer's terms (V, T·3) at `gain` (3,) to the vertices start … stop−1 that are valid.

    record (V, RECORD) gets Σ (plain + painted) · term in 0:3 and Σ slope · term in 3:6, with plain and slope
    (M, T·3), painted (V, T·3) or empty; sums (V, T·3) gets the weighted terms themselves where the material's
    map is its own, and 0:3 of the record only what is painted.
    """
    width = terms.shape[1]
    for v in range(start, stop):
        if not valid[v]:
            continue
        m = material[v]
        if len(painted):
            for c in range(3):
                base = np.float32(0)
                for k in range(c, width, 3):
                    base += painted[v, k] * terms[v, k]
                record[v, c] += gain[c] * base
        if kind[m] == GENERAL:
            for k in range(width):
                sums[v, k] += terms[v, k] * gain[k % 3]
            continue
        for c in range(3):
            base = np.float32(0)
            for k in range(c, width, 3):
                base += plain[m, k] * terms[v, k]
            record[v, c] += gain[c] * base
        if kind[m] == AFFINE:
            for c in range(3):
                rise = np.float32(0)
                for k in range(c, width, 3):
                    rise += slope[m, k] * terms[v, k]
                record[v, 3 + c] += gain[c] * rise


@kernel
def map_level(levels: int, footprint: float) -> int:
    """The level whose texels are about as large as a pixel; `footprint` in texels of the finest."""
    level, wider = 0, ROOT_TWO
    while footprint >= wider and level + 1 < levels:
        level += 1
        wider *= 2
    return level


@kernel
def repeated(u: np.float32, v: np.float32, a: np.float32, b: np.float32, offset: np.float32) -> np.float32:
    """A texture coordinate in 0 … 1, of a u + b v + offset; 0 where it is too large for any texel."""
    made = u * a + v * b + offset
    made -= np.floor(made)
    return made if made >= 0 else np.float32(0)


@kernel
def texels_covered(
    distance: np.float32, height: np.float32, density: np.float32, pixel_angle: float
) -> float:
    """How many texels of the finest level a pixel covers: the mean of along and across."""
    away = max(np.float64(distance), 1e-30)
    cosine = max(abs(np.float64(height)) / away, LEAST_COSINE)
    made: float = away * pixel_angle * density / np.sqrt(cosine)
    return made


@kernel
def mix(a: np.float32, b: np.float32, c: np.float32, w1: np.float32, w2: np.float32) -> np.float32:
    """Between the corners of a face."""
    return (_ONE - w1 - w2) * a + w1 * b + w2 * c


@kernel
def neighbours(t: np.float32, count: int) -> tuple[int, int, np.float32]:
    """The texels on either side of t in 0 … 1, and how near the second is."""
    x = t * np.float32(count) - np.float32(0.5)
    below = np.floor(x)
    first = int(below)
    second = first + 1
    return first if first >= 0 else count - 1, second if second < count else 0, x - below


@kernel
def texel(table: F32, first: int, height: int, width: int, tu: np.float32, tv: np.float32, out: F32) -> None:
    """Bilinear row (C,) of a map that starts at row `first`; u, v in 0 … 1, rows from v = 0; edges repeat."""
    left, right, fx = neighbours(tu, width)
    top, bottom, fy = neighbours(tv, height)
    a, b = first + top * width + left, first + top * width + right
    c, d = first + bottom * width + left, first + bottom * width + right
    for k in range(table.shape[1]):
        low = table[a, k] + fx * (table[b, k] - table[a, k])
        high = table[c, k] + fx * (table[d, k] - table[c, k])
        out[k] = low + fy * (high - low)


@kernel
def shade_hits(
    start: int,
    stop: int,
    face: I32,
    u: F32,
    v: F32,
    distance: F32,
    shown: U32,
    height: F32,
    density: F32,
    face_material: I32,
    kind: I64,
    record: F32,
    sums: F32,
    texels: F32,
    tables: F32,
    first: I64,
    size: I64,
    levels: I64,
    uv_map: F32,
    pixel_angle: float,
    beside: F32,
    added: F32,
    out: F32,
) -> None:
    """Radiance out (stop − start, 3) of hits start … stop−1.

    face (N,), u, v, distance are hits, −1 nothing: this gets beside[n] (N, 3), or 0 where that is empty.
    added (N, 3) is light that vertices do not have, or empty.
    shown (F, 3) and height (F,) come from `facing.shown_sides`, density (F,) from `face_texels`, record
    (V, RECORD) and sums (V, T·3) from `add_light`. Material m is of kind[m]; level l < levels[m] of its map
    starts at row first[m, l] of `texels` (R, 3) or `tables` (R, T·3) and has size[m, l] = (height, width);
    uv_map (M, 6) is `Texture.affine`. pixel_angle: radians between samples.

    In one piece: a kernel that hands arrays to another counts their references at every call.
    """
    found = np.zeros(tables.shape[1], np.float32)
    zero = np.float32(0)
    for n in range(start, stop):
        f = face[n]
        if f < 0:
            for c in range(3):
                out[n - start, c] = beside[n, c] if len(beside) else zero
            continue
        i, j, k = np.int64(shown[f, 0]), np.int64(shown[f, 1]), np.int64(shown[f, 2])
        w1, w2 = u[n], v[n]
        red = mix(record[i, 0], record[j, 0], record[k, 0], w1, w2)
        green = mix(record[i, 1], record[j, 1], record[k, 1], w1, w2)
        blue = mix(record[i, 2], record[j, 2], record[k, 2], w1, w2)
        m = face_material[f]
        if kind[m] != CONSTANT:
            su = mix(record[i, 6], record[j, 6], record[k, 6], w1, w2)
            sv = mix(record[i, 7], record[j, 7], record[k, 7], w1, w2)
            tu = repeated(su, sv, uv_map[m, 0], uv_map[m, 1], uv_map[m, 2])
            tv = repeated(su, sv, uv_map[m, 3], uv_map[m, 4], uv_map[m, 5])
            level = map_level(levels[m], texels_covered(distance[n], height[f], density[f], pixel_angle))
            begin, wide = first[m, level], size[m, level, 1]
            top, bottom, fy = neighbours(tv, size[m, level, 0])
            left, right, fx = neighbours(tu, wide)
            a, b = begin + top * wide + left, begin + top * wide + right
            c, d = begin + bottom * wide + left, begin + bottom * wide + right
            wa, wb = (_ONE - fx) * (_ONE - fy), fx * (_ONE - fy)
            wc, wd = (_ONE - fx) * fy, fx * fy
            if kind[m] == AFFINE:
                r = wa * texels[a, 0] + wb * texels[b, 0] + wc * texels[c, 0] + wd * texels[d, 0]
                g = wa * texels[a, 1] + wb * texels[b, 1] + wc * texels[c, 1] + wd * texels[d, 1]
                s = wa * texels[a, 2] + wb * texels[b, 2] + wc * texels[c, 2] + wd * texels[d, 2]
                red += r * mix(record[i, 3], record[j, 3], record[k, 3], w1, w2)
                green += g * mix(record[i, 4], record[j, 4], record[k, 4], w1, w2)
                blue += s * mix(record[i, 5], record[j, 5], record[k, 5], w1, w2)
            else:
                for t in range(len(found)):
                    found[t] = wa * tables[a, t] + wb * tables[b, t] + wc * tables[c, t] + wd * tables[d, t]
                    found[t] *= mix(sums[i, t], sums[j, t], sums[k, t], w1, w2)
                for t in range(0, len(found), 3):
                    red, green, blue = red + found[t], green + found[t + 1], blue + found[t + 2]
        if len(added):
            red, green, blue = red + added[n, 0], green + added[n, 1], blue + added[n, 2]
        if kind[m] == GENERAL:
            red, green, blue = max(red, zero), max(green, zero), max(blue, zero)
        out[n - start, 0], out[n - start, 1], out[n - start, 2] = red, green, blue


@kernel
def average(samples: int, values: F32, weight: F32, background: F32, out: F32) -> None:
    """out (P, 3): the mean of `samples` values (P·samples, 3) each, and `background` added.

    weight (P·samples,) is what a value counts, background is (P, 3); empty: 1 and 0.
    """
    share = _ONE / np.float32(samples)
    for pixel in range(len(out)):
        red, green, blue = np.float32(0), np.float32(0), np.float32(0)
        for n in range(pixel * samples, (pixel + 1) * samples):
            part = weight[n] if len(weight) else _ONE
            red, green, blue = (
                red + part * values[n, 0],
                green + part * values[n, 1],
                blue + part * values[n, 2],
            )
        red, green, blue = share * red, share * green, share * blue
        if len(background):
            red += background[pixel, 0]
            green += background[pixel, 1]
            blue += background[pixel, 2]
        out[pixel, 0], out[pixel, 1], out[pixel, 2] = red, green, blue


@kernel
def hit_coefficients(
    face: I32,
    u: F32,
    v: F32,
    distance: F32,
    shown: U32,
    height: F32,
    density: F32,
    face_material: I32,
    uvs: F32,
    kind: I64,
    plain: F32,
    slope: F32,
    texels: F32,
    tables: F32,
    first: I64,
    size: I64,
    levels: I64,
    uv_map: F32,
    pixel_angle: float,
    out: F32,
) -> None:
    """BRDF coefficients (N, T·3) of hits on faces ≥ 0; with plain, slope (M, T·3); else as `shade_hits`."""
    found = np.zeros(3, np.float32)
    for n in range(len(face)):
        f = face[n]
        m = face_material[f]
        out[n] = plain[m]
        if kind[m] == CONSTANT:
            continue
        i, j, k = shown[f, 0], shown[f, 1], shown[f, 2]
        su = mix(uvs[i, 0], uvs[j, 0], uvs[k, 0], u[n], v[n])
        sv = mix(uvs[i, 1], uvs[j, 1], uvs[k, 1], u[n], v[n])
        tu = repeated(su, sv, uv_map[m, 0], uv_map[m, 1], uv_map[m, 2])
        tv = repeated(su, sv, uv_map[m, 3], uv_map[m, 4], uv_map[m, 5])
        level = map_level(levels[m], texels_covered(distance[n], height[f], density[f], pixel_angle))
        start, high, wide = first[m, level], size[m, level, 0], size[m, level, 1]
        if kind[m] == AFFINE:
            texel(texels, start, high, wide, tu, tv, found)
            for t in range(out.shape[1]):
                out[n, t] += slope[m, t] * found[t % 3]
        else:
            texel(tables, start, high, wide, tu, tv, out[n])


@kernel
def add_samples(samples: I64, count: int, weight: F32, values: F32, out: F32) -> None:
    """Adds values (N, 3) to the pixels out (P, 3) whose samples (of `count` a pixel) they are, weighted."""
    share = _ONE / np.float32(count)
    for n in range(len(samples)):
        pixel, part = samples[n] // count, weight[n] * share
        for c in range(3):
            out[pixel, c] += part * values[n, c]


@kernel
def add_caught(
    start: int,
    stop: int,
    rows: I64,
    samples: I64,
    count: int,
    weight: F32,
    face: I32,
    u: F32,
    v: F32,
    shown: U32,
    record: F32,
    photograph: F32,
    out: F32,
) -> None:
    """Adds what hits rows[start:stop] show to the pixels out (P, 3), `count` samples each.

    That is photograph (N, 3) times record[:, 3:6] between the corners, times weight (N,); samples (N,), which
    must rise, are where they belong. A pixel belongs to the part start … stop−1 that its first sample is in,
    so that threads share none.
    """
    share = _ONE / np.float32(count)
    n = start
    while 0 < n < stop and samples[n] // count == samples[n - 1] // count:
        n += 1
    last = -1
    while n < len(rows):
        pixel = samples[n] // count
        if n >= stop and pixel != last:
            break
        last = pixel
        hit, part = rows[n], weight[n] * share
        f = face[hit]
        i, j, k = shown[f, 0], shown[f, 1], shown[f, 2]
        for c in range(3):
            light = mix(record[i, 3 + c], record[j, 3 + c], record[k, 3 + c], u[hit], v[hit])
            out[pixel, c] += part * (light * photograph[n, c])
        n += 1


@kernel
def outline_pixels(
    start: int,
    stop: int,
    samples: int,
    face: I32,
    distance: F32,
    faces: U32,
    objects: I32,
    coverage: F32,
    node: I32,
    away: F32,
) -> None:
    """Pixels start … stop−1: the share of hits; object (−1: none) and distance of the first sample."""
    share = _ONE / np.float32(samples)
    for pixel in range(start, stop):
        begin = pixel * samples
        hits = 0
        for n in range(begin, begin + samples):
            hits += 1 if face[n] >= 0 else 0
        coverage[pixel] = hits * share
        f = face[begin]
        node[pixel] = objects[faces[f, 0]] if f >= 0 else -1
        away[pixel] = distance[begin] if f >= 0 else np.float32(np.inf)
