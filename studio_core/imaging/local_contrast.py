"""What differently exposed photographs have in common: local contrast of the logarithm of their numbers.

Any response curve is nearly a power over a small window, so an exposure step becomes an offset of the
logarithm and the curve's slope a factor: both go when each window is brought to mean 0 and variance 1.
Windows that hold nothing but noise are not blown up: the noise is part of the variance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]

WINDOW = 17  # pixels of a level, in which contrast is measured
_LEAST = 0.01  # of contrast, natural logarithm: below, a surface has no features
_NOISE = 3.0  # standard deviations of noise that count as no contrast
_SMALLEST = 48
_STEP = 0.29 / 255  # standard deviation of what rounding to bytes does


@dataclass(frozen=True, eq=False)
class Level:
    """One size of a frame: `log` (h, w) natural logarithm of numbers, and the standard deviation of their
    `noise`, in the unit whose logarithm is taken. `valid` (h, w): 1 where pixels are neither clipped nor
    black; `kept`: 1 where the picture is."""

    log: F32
    valid: F32
    kept: F32
    noise: float

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.log.shape[1], self.log.shape[0]


@dataclass(frozen=True, eq=False)
class Sizes:
    """A frame at several sizes, the finest first; level i shows the frame's box from (x, y), divided by
    `factor` · 2^i."""

    x: int
    y: int
    factor: int
    levels: tuple[Level, ...]


def sizes_of(frame: npt.NDArray[Any], box: tuple[int, int, int, int], finest: int) -> Sizes:
    """`frame` (H, W, 3) of bytes, 16 bit or float32 inside `box` (left, top, right, bottom), which may stick
    out; the finest size has about `finest` pixels across, or what there is."""
    import cv2

    left, top, right, bottom = box
    across = max(right - left, bottom - top)
    factor = max(1, round(across / finest))
    count = 1
    while across / (factor * 2**count) >= _SMALLEST:
        count += 1
    step = factor * 2 ** (count - 1)
    width, height = -(-(right - left) // step) * step, -(-(bottom - top) // step) * step
    cut = frame[max(top, 0) : top + height, max(left, 0) : left + width]
    middle, most = _middle_and_most(cut)
    unclipped = (most < _clipped_from(middle)).astype(np.float32)
    numbers = middle.astype(np.float32)
    if frame.dtype.kind == "f":
        numbers = np.nan_to_num(numbers, nan=0.0, posinf=0.0, neginf=0.0)
        numbers /= max(float(np.percentile(numbers[::7, ::7], 99.0)), 1e-30)
    else:
        numbers /= np.float32(np.iinfo(frame.dtype).max)
    room = (max(-top, 0), height, max(-left, 0), width)
    kept = _padded(np.ones_like(numbers), room)
    numbers, unclipped = _padded(numbers, room), _padded(unclipped, room)

    def smaller(a: F32, by: int) -> F32:
        size = (a.shape[1] // by, a.shape[0] // by)
        return np.asarray(cv2.resize(a, size, interpolation=cv2.INTER_AREA), np.float32)

    levels = []
    for index in range(count):
        by = factor if index == 0 else 2
        numbers, unclipped, kept = (smaller(a, by) for a in (numbers, unclipped, kept))
        noise = max(_noise(numbers, unclipped), _STEP / math.sqrt(factor * 2**index))
        offset = np.float32(max(2 * noise, 0.3 / 255))
        valid = ((unclipped > 0.999) & (numbers > 0.5 * offset)).astype(np.float32)
        levels.append(
            Level(np.log(np.maximum(numbers, 0) + offset), valid, (kept > 0.999).astype(np.float32), noise)
        )
    return Sizes(left, top, factor, tuple(levels))


def normalised(level_log: F32, valid: F32, noise: float) -> tuple[F32, F32]:
    """Local contrast (h, w), about −1 … 1, of a level's logarithm where `valid`, and how sure it is: 0 … 1.

    Means are taken over what is valid alone, so that what is left out throws no shadow around itself.
    """
    import cv2

    def mean(a: F32) -> F32:
        return np.asarray(cv2.boxFilter(a, -1, (WINDOW, WINDOW), borderType=cv2.BORDER_CONSTANT), np.float32)

    share = mean(valid)
    safe = np.maximum(share, np.float32(1e-6))
    centred = level_log - np.float32(level_log[valid > 0].mean() if valid.any() else 0.0)
    first = mean(centred * valid) / safe
    second = np.maximum(mean(centred * centred * valid) / safe - first * first, 0)
    of_noise = np.float32(_NOISE * noise) * np.exp(-level_log)
    floor = of_noise * of_noise + np.float32(_LEAST**2)
    made = (centred - first) / np.sqrt(second + floor)
    sure = np.where(share > 0.35, valid, np.float32(0))
    return made, sure


def _middle_and_most(cut: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """The median of three channels, which is usable as long as one is on either side, and the largest."""
    import cv2

    a, b, c = (np.ascontiguousarray(cut[..., i]) for i in range(3))
    low, high = cv2.min(a, b), cv2.max(a, b)
    return np.asarray(cv2.max(low, cv2.min(high, c))), np.asarray(cv2.max(high, c))


def _clipped_from(middle: npt.NDArray[Any]) -> float:
    """The number from which on pixels count as clipped: a plateau at the top, or nearly the type's top."""
    some = middle[::3, ::3]
    if some.dtype.kind == "f":
        top = float(np.nanmax(np.where(np.isfinite(some), some, 0)))
        return top if np.count_nonzero(some >= top) > 0.0005 * some.size else float("inf")
    full = float(np.iinfo(some.dtype).max)
    top = float(some.max())
    if top > 0.5 * full and np.count_nonzero(some >= 0.99 * top) > 0.002 * some.size:
        return 0.98 * top
    return 0.98 * full


def _padded(a: F32, room: tuple[int, int, int, int]) -> F32:
    """With what sticks out as 0."""
    above, height, left, width = room
    if a.shape == (height, width):
        return a
    made = np.zeros((height, width), np.float32)
    made[above : above + a.shape[0], left : left + a.shape[1]] = a
    return made


def _noise(numbers: F32, unclipped: F32) -> float:
    """Standard deviation of the noise: the median of what a mask blind to edges leaves (Immerkær 1996)."""
    import cv2

    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6
    left = np.abs(cv2.filter2D(numbers, -1, kernel))[1:-1, 1:-1]
    some = left[(unclipped[1:-1, 1:-1] > 0.999) & (numbers[1:-1, 1:-1] > 0)]
    return float(np.median(some)) / 0.6745 if some.size else 1.0
