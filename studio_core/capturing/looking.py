"""Looking through a lens: what a view shows in given directions, and plain perspective pictures of it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import F32, F64, Mask, View
from studio_core.imaging.projection import project
from studio_core.imaging.resample import known_means

_COARSER = 1.5


def look(view: View, directions: npt.NDArray[np.floating]) -> tuple[F32, Mask]:
    """Light (..., 3) of directions (H, W, 3) of the lens' own frame, and where there is usable light.

    Bilinear; 0 where the lens does not look.
    """
    import cv2

    points, seen = project(view.lens, view.circle, directions)
    x, y = np.ascontiguousarray(np.moveaxis(points - 0.5, -1, 0), np.float32)
    light = cv2.remap(view.light, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    usable = cv2.remap(view.usable.view(np.uint8), x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT)
    seen &= usable.astype(np.bool_)
    made = np.asarray(light, np.float32)
    made[~seen] = 0
    return made, seen


def camera_rays(fov: float, width: int, height: int) -> F64:
    """(height, width, 3) directions, not of unit length, of a pinhole camera's pixels; it looks along −z.

    `fov`: degrees across the width.
    """
    if not 0 < fov < 180:
        raise ValueError(f"no flat picture shows {fov:g}°")
    step = 2 * math.tan(math.radians(fov) / 2) / width
    x = (np.arange(width) + 0.5 - width / 2) * step
    y = (height / 2 - 0.5 - np.arange(height)) * step
    rays = np.empty((height, width, 3))
    rays[..., 0], rays[..., 1], rays[..., 2] = x, y[:, None], -1
    return rays


def perspective(
    view: View, rotation: npt.NDArray[np.floating], fov: float, size: tuple[int, int]
) -> tuple[F32, Mask]:
    """What a pinhole camera at the lens' place shows: light (height, width, 3), and where there is any.

    `rotation` (3, 3) takes the camera's frame to the lens' frame; both look along −z. `fov`: degrees across
    the width; `size`: width and height. Straight lines of the room are straight. Where the cut is coarser
    than the photograph, light is averaged. ValueError for fields of view that no flat picture shows.
    """
    width, height = size
    rays = camera_rays(fov, width, height) @ np.asarray(rotation, np.float64).T
    finest = view.circle.radius / view.lens.half  # pixels of the photograph for a radian
    coarse = 2 * math.tan(math.radians(fov) / 2) / width * finest
    if coarse > _COARSER:
        old_height, old_width = view.light.shape[:2]
        new = max(1, round(old_height / coarse)), max(1, round(old_width / coarse))
        light, share = known_means(view.light, view.usable, *new)
        factor = new[1] / old_width
        view = View(light, share > 0.5, view.circle.scaled(factor), view.lens)
    return look(view, rays)
