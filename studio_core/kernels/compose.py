"""Pixels from vertices: interpolation of the light sums, per-pixel coefficients, background."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.camera import sample_direction

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U32 = npt.NDArray[np.uint32]
ROOT_TWO = 2**0.5
NO_FACE = np.uint32(0xFFFFFFFF)


@kernel
def texel(table: F32, first: int, height: int, width: int, tu: float, tv: float, out: F32) -> None:
    """Bilinear (TERMS·3) coefficients of a map that starts at row `first`; u, v repeat, rows from v = 0."""
    x = tu * width - 0.5
    y = tv * height - 0.5
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = np.float32(x - x0), np.float32(y - y0)
    ix, iy = int(x0) % width, int(y0) % height
    jx, jy = (ix + 1) % width, (iy + 1) % height
    a, b = first + iy * width + ix, first + iy * width + jx
    c, d = first + jy * width + ix, first + jy * width + jx
    for k in range(table.shape[1]):
        low = table[a, k] + fx * (table[b, k] - table[a, k])
        high = table[c, k] + fx * (table[d, k] - table[c, k])
        out[k] = low + fy * (high - low)


@kernel
def cosine(positions: F32, i: int, j: int, k: int, along: F32) -> float:
    """Between a direction and a face's normal; > 0: it is met from behind, 0: it has no area."""
    ax, ay, az = float(positions[i, 0]), float(positions[i, 1]), float(positions[i, 2])
    bx, by, bz = positions[j, 0] - ax, positions[j, 1] - ay, positions[j, 2] - az
    cx, cy, cz = positions[k, 0] - ax, positions[k, 1] - ay, positions[k, 2] - az
    nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if not length > 0.0:
        return 0.0
    made: float = (nx * along[0] + ny * along[1] + nz * along[2]) / length
    return made


@kernel
def shade_samples(
    start: int,
    stop: int,
    face: I32,
    u: F32,
    v: F32,
    distance: F32,
    samples: I64,
    pinhole: F64,
    faces: U32,
    back_faces: U32,
    positions: F32,
    material: I32,
    uvs: F32,
    texels_per_metre: F32,
    terms: F32,
    table: F32,
    first: I64,
    size: I64,
    uv_scale: F32,
    pixel_angle: float,
    out: F32,
) -> None:
    """Radiance (N, 3) of hits start … stop−1; those that meet nothing are left alone.

    samples (N,) names their samples of the picture; empty: hit i is sample i.
    terms (V, T·3) are light sums with gains; table (rows, T·3) holds coefficients of all materials and
    mip levels: material m has levels `first[m, l]` of size `size[m, l] = (height, width)`, of which those
    with height 0 do not exist; uv_scale (M, 4) scale and offset; texels_per_metre (F,) at level 0.
    """
    width = terms.shape[1]
    found = np.empty(width, np.float32)
    along = np.empty(3, np.float32)
    for n in range(start, stop):
        f = face[n]
        if f < 0:
            continue
        sample_direction(pinhole, samples[n] if len(samples) else n, along)
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        w1, w2 = u[n], v[n]
        w0 = np.float32(1) - w1 - w2
        m = material[i]
        first_level = first[m, 0]
        away = cosine(positions, i, j, k, along)
        if size[m, 0, 0] == 1 and size[m, 0, 1] == 1:
            for c in range(width):
                found[c] = table[first_level, c]
        else:
            tu = (w0 * uvs[i, 0] + w1 * uvs[j, 0] + w2 * uvs[k, 0]) * uv_scale[m, 0] + uv_scale[m, 2]
            tv = (w0 * uvs[i, 1] + w1 * uvs[j, 1] + w2 * uvs[k, 1]) * uv_scale[m, 1] + uv_scale[m, 3]
            tu, tv = tu - np.floor(tu), tv - np.floor(tv)
            if not (tu >= 0 and tv >= 0):  # too large for any texel
                tu, tv = 0.0, 0.0
            footprint = distance[n] * pixel_angle * texels_per_metre[f] / np.sqrt(max(abs(away), 0.05))
            level, wider = 0, ROOT_TWO
            while footprint >= wider and level + 1 < first.shape[1] and size[m, level + 1, 0] > 0:
                level += 1
                wider *= 2
            texel(table, first[m, level], size[m, level, 0], size[m, level, 1], tu, tv, found)
        if away > 0 and back_faces[f, 0] != NO_FACE:
            i, j, k = back_faces[f, 0], back_faces[f, 1], back_faces[f, 2]
        red, green, blue = np.float32(0), np.float32(0), np.float32(0)
        for t in range(0, width, 3):
            red += found[t] * (w0 * terms[i, t] + w1 * terms[j, t] + w2 * terms[k, t])
            green += found[t + 1] * (w0 * terms[i, t + 1] + w1 * terms[j, t + 1] + w2 * terms[k, t + 1])
            blue += found[t + 2] * (w0 * terms[i, t + 2] + w1 * terms[j, t + 2] + w2 * terms[k, t + 2])
        out[n, 0], out[n, 1], out[n, 2] = red, green, blue


@kernel
def background_samples(
    start: int,
    stop: int,
    face: I32,
    samples: I64,
    pinhole: F64,
    rotation: F32,
    pixels: F32,
    gain: F32,
    out: F32,
) -> None:
    """Bilinear radiance of an equirectangular picture where hits start … stop−1 meet nothing.

    rotation (3, 3) is picture from world; `samples` as in `shade_samples`.
    """
    height, width = pixels.shape[0], pixels.shape[1]
    d = np.empty(3, np.float32)
    for n in range(start, stop):
        if face[n] >= 0:
            continue
        sample_direction(pinhole, samples[n] if len(samples) else n, d)
        x = rotation[0, 0] * d[0] + rotation[0, 1] * d[1] + rotation[0, 2] * d[2]
        y = rotation[1, 0] * d[0] + rotation[1, 1] * d[1] + rotation[1, 2] * d[2]
        z = rotation[2, 0] * d[0] + rotation[2, 1] * d[1] + rotation[2, 2] * d[2]
        s = (0.5 - np.arctan2(x, z) / (2 * np.pi)) * width - 0.5
        t = np.arccos(min(max(y, -1.0), 1.0)) / np.pi * height - 0.5
        s0, t0 = np.floor(s), np.floor(t)
        fx, fy = np.float32(s - s0), np.float32(t - t0)
        i0, i1 = int(s0) % width, (int(s0) + 1) % width
        j0, j1 = min(max(int(t0), 0), height - 1), min(max(int(t0) + 1, 0), height - 1)
        for c in range(3):
            low = pixels[j0, i0, c] + fx * (pixels[j0, i1, c] - pixels[j0, i0, c])
            high = pixels[j1, i0, c] + fx * (pixels[j1, i1, c] - pixels[j1, i0, c])
            out[n, c] = (low + fy * (high - low)) * gain[c]
