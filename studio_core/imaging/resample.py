"""Changing the size of pictures."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.imaging.transfer import linear_to_srgb, srgb_to_linear


def resize_area(pixels: npt.NDArray[Any], height: int, width: int) -> npt.NDArray[Any]:
    """(height, width, C) of the same dtype: each new pixel is the mean over its area.

    Bytes are averaged as the light they stand for (sRGB; alpha as it is). Enlarging repeats and blends.
    """
    import cv2

    if height < 1 or width < 1:
        raise ValueError("a picture has at least one pixel")
    encoded = pixels.dtype == np.uint8
    light = pixels.astype(np.float32)
    if encoded:
        colour = 3 if pixels.shape[2] >= 3 else 1
        light[:, :, :colour] = srgb_to_linear(pixels[:, :, :colour])
    made = cv2.resize(light, (width, height), interpolation=cv2.INTER_AREA)
    made = np.asarray(made, dtype=np.float32).reshape(height, width, pixels.shape[2])
    if not encoded:
        return made
    bytes_ = np.rint(np.clip(made, 0, 255)).astype(np.uint8)
    bytes_[:, :, :colour] = linear_to_srgb(made[:, :, :colour])
    return bytes_


def known_means(
    pixels: npt.NDArray[np.float32], known: npt.NDArray[np.bool_], height: int, width: int
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Means (height, width, C) over what is `known` (H, W) of each new pixel's area, and its share.

    The share is (height, width); where it is 0, so is the mean.
    """
    share = resize_area(known[..., None].astype(np.float32), height, width)
    total = resize_area(np.where(known[..., None], pixels, np.float32(0)), height, width)
    return np.asarray(total / np.maximum(share, 1e-6), np.float32), share[..., 0]


def thumbnail_size(height: int, width: int, longest: int) -> tuple[int, int]:
    """Height and width that fit into a square of `longest` pixels, never enlarged."""
    factor = min(1.0, longest / max(height, width))
    return max(1, round(height * factor)), max(1, round(width * factor))
