"""Resampling equirectangular pictures without seams, and without holes or aliasing at their poles."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]


def with_border(pixels: npt.NDArray[Any], border: int) -> npt.NDArray[Any]:
    """(H + 2 border, W + 2 border, ...): goes on over both poles and past the left and right edge.

    `border` ≤ H; W is even.
    """
    height, width = pixels.shape[:2]
    made = np.empty((height + 2 * border, width + 2 * border, *pixels.shape[2:]), pixels.dtype)
    inside = made[:, border : border + width]
    inside[border : border + height] = pixels
    inside[:border] = np.roll(pixels[:border][::-1], width // 2, axis=1)
    inside[border + height :] = np.roll(pixels[height - border :][::-1], width // 2, axis=1)
    made[:, :border] = made[:, width : width + border]
    made[:, border + width :] = made[:, border : 2 * border]
    return made


def even_rows(pixels: F32, step: float) -> F32:
    """(H, W, C) in which a pixel near the poles is the mean over an arc of `step` radians along its row.

    The rows of an equirectangular picture are denser the nearer they are to a pole; after this, samples
    `step` apart on the sphere miss nothing of them. Rows whose pixels are as wide as that stay as they are.
    """
    height, width, channels = pixels.shape
    ring = np.sin(np.pi * (np.arange(height) + 0.5) / height)
    reach = np.minimum(step / ring * width / (2 * np.pi), width)  # pixels
    made = pixels
    at = np.arange(width) + 0.5 + width
    for row in np.flatnonzero(reach > 1.0 + 1e-6):
        if made is pixels:
            made = pixels.copy()
        if reach[row] >= width:
            made[row] = pixels[row].mean(axis=0, dtype=np.float64)
            continue
        sums = np.zeros((3 * width + 1, channels))
        np.cumsum(np.tile(pixels[row], (3, 1)), axis=0, dtype=np.float64, out=sums[1:])
        made[row] = (_between(sums, at + reach[row] / 2) - _between(sums, at - reach[row] / 2)) / reach[row]
    return np.maximum(made, 0, out=made) if made is not pixels and pixels.min() >= 0 else made


def _between(sums: npt.NDArray[np.float64], x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    low = x.astype(np.intp)
    part = (x - low)[:, None]
    made: npt.NDArray[np.float64] = sums[low] * (1 - part) + sums[low + 1] * part
    return made


def lookup(bordered: F32, border: int, u: npt.NDArray[Any], v: npt.NDArray[Any]) -> F32:
    """Bilinear values (h, w, C) at u and v (h, w) of a picture that `with_border` gave a `border` ≥ 1."""
    import cv2

    height, width = bordered.shape[0] - 2 * border, bordered.shape[1] - 2 * border
    x = (u * width + (border - 0.5)).astype(np.float32)
    y = (v * height + (border - 0.5)).astype(np.float32)
    made = cv2.remap(bordered, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(made, np.float32).reshape(*u.shape, bordered.shape[2])
