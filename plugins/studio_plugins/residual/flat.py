"""Photographs of a flat sample (RTI sets, swatches) as samples: every texel looks the same way.

A thing that isn't quite flat is taken as flat, too: how each place tilts is then part of what it has of its
own.
"""

from __future__ import annotations

import numpy as np

from studio_core.errors import InputError
from studio_plugins.residual.pictures import Pictures
from studio_plugins.residual.samples import F32, Flags, Samples

_LEAST = 8  # texels a side


def flat_samples(
    pictures: Pictures, size: int = 256, mask: Flags | None = None, distance: float = float("inf")
) -> Samples:
    """Samples (n, h, w) of the whole picture, or of what the mask (H, W) encloses; the longer side has up to
    `size` texels.

    Normals are (0, 0, 1). `distance` of the camera from the picture's middle, in widths of the picture;
    infinity for a view without perspective. InputError when hardly anything is left.
    """
    height, width = pictures.light.shape[1:3]
    inside = np.ones((height, width), np.bool_) if mask is None else mask
    rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
    if len(rows) < _LEAST or len(columns) < _LEAST:
        raise InputError(f"a flat sample is at least {_LEAST} × {_LEAST} pixels large")
    top, left = int(rows[0]), int(columns[0])
    across, down = int(columns[-1]) + 1 - left, int(rows[-1]) + 1 - top
    scale = min(size / max(across, down), 1.0)
    shape = max(round(down * scale), 1), max(round(across * scale), 1)
    crop = (slice(top, top + down), slice(left, left + across))
    values = np.stack([_averaged(one[crop], shape) for one in pictures.light])
    bad = np.stack([_averaged((c[crop] | ~inside[crop]).astype(np.float32), shape) for c in pictures.clipped])
    values /= np.maximum(pictures.lights.strengths, 1e-9).astype(np.float32)[:, None, None]
    normals = np.zeros((*shape, 3), np.float32)
    normals[..., 2] = 1
    x = (left + (np.arange(shape[1]) + 0.5) / shape[1] * across) / width - 0.5
    y = (0.5 * height - top - (np.arange(shape[0]) + 0.5) / shape[0] * down) / width
    views = normals
    if np.isfinite(distance):
        at_x, at_y = np.meshgrid(x, y)
        away = np.stack([-at_x, -at_y, np.full_like(at_x, distance)], axis=-1)
        views = (away / np.linalg.norm(away, axis=-1, keepdims=True)).astype(np.float32)
    usable = (bad <= 1e-6) & np.isfinite(values).all(axis=-1)
    return Samples(np.nan_to_num(values), usable, normals, views, pictures.lights)


def _averaged(picture: F32, shape: tuple[int, int]) -> F32:
    import cv2

    if picture.shape[:2] == shape:
        return np.asarray(picture, np.float32)
    return np.asarray(cv2.resize(picture, shape[::-1], interpolation=cv2.INTER_AREA), np.float32)
