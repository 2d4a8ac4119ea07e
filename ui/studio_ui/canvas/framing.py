"""The frame of a picture to be made, within a canvas of another shape: all of it is seen, and some around it.

A camera's angle is vertical and belongs to its frame. A canvas narrower than the frame sees it with a wider
angle, so that nothing of the composition is cut off.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

ASPECTS: Mapping[str, tuple[str, float]] = {
    "16:9": ("16:9, screen", 16 / 9),
    "3:2": ("3:2, photograph", 3 / 2),
    "4:3": ("4:3", 4 / 3),
    "1:1": ("1:1, square", 1.0),
    "4:5": ("4:5, upright", 4 / 5),
    "2:3": ("2:3, upright photograph", 2 / 3),
    "9:16": ("9:16, telephone", 9 / 16),
    "2.39:1": ("2.39:1, cinema", 2.39),
}
"""Frames by name: what they are called, and width / height."""
USUAL = "16:9"
CAMERA_KEYS = 9
"""The first so many cameras have a key."""


def fitted(fov: float, aspect: float, width: int, height: int) -> float:
    """Degrees of the vertical angle with which a canvas shows all of a frame of that angle and aspect."""
    top = np.tan(np.radians(fov) / 2) * max(1.0, aspect * height / width)
    return float(np.degrees(2 * np.arctan(top)))


def unfitted(fov: float, aspect: float, width: int, height: int) -> float:
    """Degrees of the frame's vertical angle, from the angle with which a canvas shows all of it."""
    top = np.tan(np.radians(fov) / 2) / max(1.0, aspect * height / width)
    return float(np.degrees(2 * np.arctan(top)))


def frame_in(aspect: float, width: float, height: float) -> tuple[float, float, float, float]:
    """Left, top, width and height of the frame in the middle of a canvas, as large as it can be."""
    wide, high = min(width, aspect * height), min(height, width / aspect)
    return (width - wide) / 2, (height - high) / 2, wide, high
