"""Photographs of a ball as reflectance maps R(p, q): one texel a slope of the surface (equation 1).

p and q are n_x / n_z and n_y / n_z, z towards the camera; rows go from large q to small.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_plugins.residual.samples import F32, Ball, Flags, Lights, Samples


def slopes(size: int, reach: float = 1.0) -> F32:
    """(size, size, 3) unit normals of the texels' middles, of slopes −reach … reach both ways."""
    at = ((np.arange(size) + 0.5) / size * 2 - 1) * reach
    p, q = np.meshgrid(at, -at)
    n = np.stack([p, q, np.ones_like(p)], axis=-1)
    return np.asarray(n / np.linalg.norm(n, axis=-1, keepdims=True), np.float32)


def reflectance_maps(
    pictures: npt.NDArray[np.float32],
    clipped: Flags,
    ball: Ball,
    lights: Lights,
    size: int = 256,
    reach: float = 1.0,
    noise: float = 0.0,
) -> Samples:
    """Samples (n, size, size) of pictures (n, H, W, 3) and of what was clipped in them (n, H, W).

    Pictures that are much finer than the map are averaged first. Every value is per strength of its light.
    """
    import cv2

    normals = slopes(size, reach)
    factor = max(int(ball.radius * reach / size), 1)
    x, y = ball.positions(normals)
    height, width = pictures.shape[1:3]
    inside = (
        (x > 0.5 * factor) & (y > 0.5 * factor) & (x < width - 0.5 * factor) & (y < height - 0.5 * factor)
    )
    at_x, at_y = (x / factor - 0.5).astype(np.float32), (y / factor - 0.5).astype(np.float32)
    values = np.empty((len(lights), size, size, 3), np.float32)
    usable = np.empty((len(lights), size, size), np.bool_)
    for i in range(len(lights)):
        picture, bad = pictures[i], clipped[i].astype(np.float32)
        if factor > 1:
            fit = (width // factor * factor, height // factor * factor)
            small = (fit[0] // factor, fit[1] // factor)
            picture = cv2.resize(picture[: fit[1], : fit[0]], small, interpolation=cv2.INTER_AREA)
            bad = cv2.resize(bad[: fit[1], : fit[0]], small, interpolation=cv2.INTER_AREA)
        made = cv2.remap(picture, at_x, at_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        gone = cv2.remap(bad, at_x, at_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        values[i] = made / np.maximum(lights.strengths[i], 1e-9).astype(np.float32)
        usable[i] = inside & (gone <= 0) & np.isfinite(made).all(axis=-1)
    values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
    return Samples(values, usable, normals, ball.views(normals).astype(np.float32), lights, noise)
