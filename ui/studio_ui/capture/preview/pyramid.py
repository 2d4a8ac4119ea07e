"""A picture in halves of halves, so that what is seen small is a mean and costs no more than the screen."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_ui.capture.preview.sight import Part

_SMALLEST = 256  # pixels across, from which on nothing is halved


class Pyramid:
    """(H, W) or (H, W, C) pixels, at first in full size alone; `build` makes the rest, on any thread.

    Masks are halved by "any of them": a lamp of three pixels is still marked in the smallest picture.
    """

    def __init__(self, pixels: npt.NDArray[Any]) -> None:
        self.pixels = pixels
        self._levels = [pixels]
        self.complete = max(pixels.shape[:2]) <= _SMALLEST

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.pixels.shape[1], self.pixels.shape[0]

    def build(self) -> None:
        """Halve until it is small."""
        levels = [self.pixels]
        while max(levels[-1].shape[:2]) > _SMALLEST and min(levels[-1].shape[:2]) > 1:
            levels.append(halved(levels[-1]))
        self._levels = levels
        self.complete = True

    def part(self, part: Part) -> npt.NDArray[Any]:
        """The pixels of a part; every n-th one while the halves are not made yet."""
        if part.level < len(self._levels):
            return self._levels[part.level][part.top : part.bottom, part.left : part.right]
        known = len(self._levels) - 1
        step = 1 << (part.level - known)
        rows, columns = (
            slice(part.top * step, part.bottom * step, step),
            slice(part.left * step, part.right * step, step),
        )
        return self._levels[known][rows, columns]


def halved(pixels: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Means of 2 × 2 pixels (for masks: whether any is set); an odd last row or column is left out."""
    rows, columns = pixels.shape[0] // 2 * 2, pixels.shape[1] // 2 * 2
    even = pixels[:rows, :columns]
    corners = (even[::2, ::2], even[1::2, ::2], even[::2, 1::2], even[1::2, 1::2])
    if pixels.dtype == np.bool_:
        return corners[0] | corners[1] | corners[2] | corners[3]
    wide = np.float32 if pixels.dtype == np.float32 else np.uint32
    total = corners[0].astype(wide)
    for corner in corners[1:]:
        total += corner
    if wide is np.float32:
        return np.asarray(total * np.float32(0.25), np.float32)
    return ((total + 2) >> 2).astype(pixels.dtype)
