"""The brush: which pixels of a picture a path of the hand covers, and how surely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.params import param

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

LEAST_RADIUS = 0.75
"""Pixels: every dab reaches at least one centre."""
Rectangle = tuple[int, int, int, int]
"""Rows and columns from … to below: top, bottom, left, right."""


@dataclass(frozen=True, kw_only=True)
class Brush:
    """A round brush: diameter in parts of the picture's height, how much of it is hard, how far it goes.

    Hardness shapes the mask: how much a pixel counts. Opacity does not: it is how far from what is shown to
    what the tool makes of it the light is wanted (`tools.wanted`).
    """

    size: float = param(0.06, "Size", "Diameter, in parts of the picture's height", low=1e-3, high=4.0)
    hardness: float = param(0.7, "Hardness", "How much of the brush counts in full", low=0.0, high=1.0)
    opacity: float = param(1.0, "Opacity", "How far to what the tool makes of it", low=0.0, high=1.0)

    def mask(self, path: npt.ArrayLike, width: int, height: int) -> F32:
        """(height, width) 0 … 1: how much each pixel is meant by a path, as `path_of` takes it."""
        made = np.zeros((height, width), np.float32)
        self.add(made, path)
        return made

    def add(self, mask: F32, path: npt.ArrayLike) -> Rectangle:
        """Lay a path over a mask (H, W), where that raises it; the rectangle outside which nothing changed.

        A path in parts that share their ends gives the same mask as the whole.
        """
        height, width = mask.shape
        points = path_of(path)
        placed = points * (width, height, self.size / 2 * height)
        placed[:, 2] = np.maximum(placed[:, 2], LEAST_RADIUS)
        lay(placed, self.hardness, mask)
        reach = placed[:, 2].max() + 1
        limits = np.array([width, height])
        low = np.clip(placed[:, :2].min(axis=0) - reach, 0, limits)
        high = np.clip(placed[:, :2].max(axis=0) + reach, 0, limits)
        (left, top), (right, bottom) = np.floor(low).astype(int), np.ceil(high).astype(int)
        return int(top), int(bottom), int(left), int(right)


def path_of(points: npt.ArrayLike) -> F64:
    """(N, 3) from N places (x, y), or (x, y, pressure), of a picture.

    x and y run from 0 to 1 over its width and height, from the top left; pressure 0 … 1 scales the size.
    ValueError where there is no place, or one that is not finite.
    """
    path = np.asarray(points, np.float64)
    if path.ndim != 2 or path.shape[1] not in (2, 3) or not len(path) or not np.isfinite(path).all():
        raise ValueError("a path is a list of finite places (x, y) or (x, y, pressure)")
    if path.shape[1] == 2:
        path = np.concatenate([path, np.ones((len(path), 1))], axis=1)
    path[:, 2] = path[:, 2].clip(0, 1)
    return path


@kernel
def lay(points: F64, hardness: float, mask: F32) -> None:
    """Raises a mask (H, W) to the brush's profile along points (N, 3): x, y and radius in pixels.

    Along a segment the distance to its axis counts, and the radius there; where that changes, dabs at both
    ends count too. The profile falls from 1 within `hardness` of the radius to 0 at the radius, over a pixel
    at least, as 3t² − 2t³.
    """
    height, width = mask.shape
    count = len(points)
    for i in range(max(count - 1, 1)):
        j = min(i + 1, count - 1)
        ax, ay, a = points[i, 0], points[i, 1], points[i, 2]
        along_x, along_y, growth = points[j, 0] - ax, points[j, 1] - ay, points[j, 2] - a
        square = along_x * along_x + along_y * along_y
        reach = max(a, a + growth) + 1
        left = int(max(min(ax, ax + along_x) - reach, 0.0))
        right = int(min(max(ax, ax + along_x) + reach + 1, float(width)))
        top = int(max(min(ay, ay + along_y) - reach, 0.0))
        bottom = int(min(max(ay, ay + along_y) + reach + 1, float(height)))
        for y in range(top, bottom):
            for x in range(left, right):
                px, py = x + 0.5 - ax, y + 0.5 - ay
                near = 0.0
                if square > 0:
                    near = min(max((px * along_x + py * along_y) / square, 0.0), 1.0)
                value = np.float32(0)
                for end in range(3 if growth != 0 else 1):
                    t = near if end == 0 else end - 1.0
                    radius = a + t * growth
                    dx, dy = px - t * along_x, py - t * along_y
                    distance = np.sqrt(dx * dx + dy * dy)
                    middle, half = radius * (1 + hardness) / 2, max(radius * (1 - hardness) / 2, 0.5)
                    fall = min(max((middle + half - distance) / (2 * half), 0.0), 1.0)
                    value = max(value, np.float32(fall * fall * (3 - 2 * fall)))
                if value > mask[y, x]:
                    mask[y, x] = value


__all__ = ["LEAST_RADIUS", "Brush", "Rectangle", "path_of"]
