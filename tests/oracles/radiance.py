"""Equation (2) term by term, and pixels from vertices, in float64 and plain loops."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]


def shading_frame(normal: npt.ArrayLike) -> F64:
    """3×3 with rows t, b, n; isotropic kernels do not care which tangents."""
    n = np.asarray(normal, np.float64)
    n = n / np.linalg.norm(n)
    other = np.array([1.0, 0, 0]) if abs(n[0]) < 0.9 else np.array([0, 1.0, 0])
    t = np.cross(other, n)
    t /= np.linalg.norm(t)
    return np.stack([t, np.cross(n, t), n])


def view_direction(position: npt.ArrayLike, eye: npt.ArrayLike, frame: F64, lowest: float) -> F64:
    """Unit direction to the eye in the frame, lifted to at least `lowest`."""
    d = frame @ (np.asarray(eye, np.float64) - np.asarray(position, np.float64))
    d /= np.linalg.norm(d)
    if d[2] < lowest:
        d[2] = lowest
        d /= np.linalg.norm(d)
    return d


def light_sum(brdf, shape, position, normal, eye, visible, directions, radiance, solid_angle, lowest=1e-3):  # type: ignore[no-untyped-def]
    """Terms (K, 3) and irradiance (3,) by the interpreted BRDF kernel, one direction at a time."""
    frame = shading_frame(normal)
    wo = view_direction(position, eye, frame, lowest)
    terms, irradiance = np.zeros((brdf.terms, 3)), np.zeros(3)
    for j in range(len(directions)):
        if not visible[j]:
            continue
        wi = frame @ np.asarray(directions[j], np.float64)
        if wi[2] <= 0:
            continue
        light = np.asarray(radiance[j], np.float64) * wi[2] * solid_angle
        irradiance += light
        terms += evaluate(brdf, shape, wo, wi)[:, None] * light
    return terms, irradiance


def evaluate(brdf, shape, wo: F64, wi: F64) -> F64:  # type: ignore[no-untyped-def]
    """(K,) b_k of one pair of directions through the C function."""
    import ctypes

    call = ctypes.CFUNCTYPE(
        None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p
    )(brdf.address)
    shape, o, i = (np.ascontiguousarray(a, np.float32) for a in (shape, wo, wi))
    out = np.zeros(brdf.terms, np.float32)
    call(shape.ctypes.data, o.ctypes.data, 1, i.ctypes.data, out.ctypes.data)
    return out.astype(np.float64)


def bilinear_repeat(texels: F64, u: float, v: float) -> F64:
    """Row 0 at v = 0; texel centres at half integers."""
    height, width = texels.shape[:2]
    x, y = u * width - 0.5, v * height - 0.5
    made = np.zeros(texels.shape[2:])
    for dy in (0, 1):
        for dx in (0, 1):
            i, j = int(np.floor(x)) + dx, int(np.floor(y)) + dy
            weight = (1 - abs(x - i)) * (1 - abs(y - j))
            made = made + weight * texels[j % height, i % width]
    return made


def lat_long(pixels: F64, direction: npt.ArrayLike) -> F64:
    """Bilinear radiance of an equirectangular picture in its own frame; image centre is +z."""
    x, y, z = np.asarray(direction, np.float64)
    height, width = pixels.shape[:2]
    s = (0.5 - np.arctan2(x, z) / (2 * np.pi)) * width - 0.5
    t = np.arccos(np.clip(y, -1, 1)) / np.pi * height - 0.5
    made = np.zeros(3)
    for dj in (0, 1):
        for di in (0, 1):
            i, j = int(np.floor(s)) + di, int(np.floor(t)) + dj
            weight = (1 - abs(s - i)) * (1 - abs(t - j))
            made += weight * pixels[min(max(j, 0), height - 1), i % width, :3]
    return made
