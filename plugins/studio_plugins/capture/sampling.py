"""Resampling what a lens or a picture shows: no aliasing where the new picture is coarser, no blur where not.

Where a new pixel covers more than one of the source it is the mean over its footprint; else Catmull–Rom's
cubic (1974), but at the borders of lamps, where any cubic rings, the mean over the footprint again. So light
is kept: the mean of bilinear lookups is what a box sees, neither darker nor brighter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import F32, F64, Mask, View
from studio_core.imaging.projection import project
from studio_core.imaging.resample import known_means, resize_area

COARSE = 1.2
"""Pixels of the source a new pixel covers, from which on it is their mean."""
_MOST = 2.5  # more than that: the source is shrunk first
_LINE = 256
_CALM, _HARSH = 0.6, 1.0  # contrast (max − min) / mean of neighbours: cubic below, many lookups above


@dataclass(frozen=True, eq=False)
class Source:
    """Pixels (H, W, 3), which of them are good (uint8, 255), and where directions lie in them.

    `at` gives points (h, w, 2) (pixels, centres at i + 0.5) and which directions lie in the picture at all.
    `harsh` (H, W): 0 calm … 255 next to a lamp. `coarse`: new pixels are means everywhere. `round`: width
    after which x begins again, 0 for lenses.
    """

    pixels: F32
    good: npt.NDArray[np.uint8]
    clipped: npt.NDArray[np.uint8] | None
    dark: npt.NDArray[np.uint8] | None
    harsh: npt.NDArray[np.uint8]
    coarse: bool
    at: Callable[[npt.NDArray[Any]], tuple[F64, Mask]]
    round: int = 0


def lens_source(view: View, pitch: float) -> Source:
    """A lens' picture, to be seen in pixels of `pitch` radians. What is not finite is not used."""
    density = view.circle.radius * float(view.lens.radius_of([0.1])[0]) / 0.1  # pixels a radian, inside
    coarse = pitch * density
    light, usable, circle = view.light, view.usable, view.circle
    clipped, dark = view.clipped, view.dark
    finite = np.isfinite(light.sum(axis=2))
    if not finite.all():
        usable = usable & finite
        light = np.where(finite[..., None], light, np.float32(0))
    if coarse > _MOST:
        factor = _MOST / 1.5 / coarse
        height, width = light.shape[:2]
        size = max(2, round(height * factor)), max(2, round(width * factor))
        light, share = known_means(light, usable, *size)
        light, usable = _carried_out(light, share > 0), share > 0.5
        clipped, dark = _shrunk(clipped, size, 0.2), _shrunk(dark, size, 0.5)
        circle = circle.scaled(size[1] / width)
        coarse *= size[1] / width
    else:  # what lies next to unusable pixels mixes with them
        import cv2

        usable = cv2.erode(usable.view(np.uint8), np.ones((3, 3), np.uint8), borderValue=0) > 0
    lens = view.lens
    return Source(
        np.ascontiguousarray(light),
        usable.astype(np.uint8) * 255,
        _bytes(clipped),
        _bytes(dark),
        harshness(light),
        coarse > COARSE,
        lambda directions: project(lens, circle, directions),
    )


def _carried_out(light: F32, known: Mask) -> F32:
    """Known light carried on over the pixels next to it."""
    import cv2

    near = cv2.blur(np.where(known[..., None], light, np.float32(0)), (5, 5))
    count = cv2.blur(known.astype(np.float32), (5, 5))
    return np.asarray(
        np.where(known[..., None], light, near / np.maximum(count, 1e-3)[..., None]), np.float32
    )


def _shrunk(mask: Mask | None, size: tuple[int, int], share: float) -> Mask | None:
    if mask is None:
        return None
    made: Mask = resize_area(mask[..., None].astype(np.float32), *size)[..., 0] > share
    return made


def _bytes(mask: Mask | None) -> npt.NDArray[np.uint8] | None:
    return None if mask is None or not mask.any() else mask.astype(np.uint8) * 255


def harshness(light: F32) -> npt.NDArray[np.uint8]:
    """How much brighter the brightest of the 5 × 5 around a pixel is than the darkest."""
    import cv2

    grey = light.max(axis=2)
    box = np.ones((5, 5), np.uint8)
    high, low = cv2.dilate(grey, box), cv2.erode(grey, box)
    contrast = (high - low) / np.maximum((high + low) / 2, 1e-12)
    return np.asarray(np.clip((contrast - _CALM) / (_HARSH - _CALM), 0, 1) * 255, np.uint8)


@dataclass(frozen=True, eq=False)
class Seen:
    """What a source shows in (h, w) directions: light (0 where nothing is seen) and what is known of it."""

    light: F32
    seen: Mask
    clipped: Mask
    dark: Mask


def look_through(source: Source, directions: npt.NDArray[Any]) -> Seen:
    """What is seen in directions (h, w, 3), neighbours in a picture; h, w ≥ 2."""
    import cv2

    points, seen = source.at(directions)
    shape = seen.shape
    none = np.zeros(shape, np.bool_)
    if not seen.any():
        return Seen(np.zeros((*shape, 3), np.float32), none, none, none)
    x, y = np.ascontiguousarray(np.moveaxis(points - 0.5, -1, 0), np.float32)
    edge = cv2.BORDER_REPLICATE
    seen = seen & (cv2.remap(source.good, x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT) > 0)
    steps = _steps(x, y, source.round)
    count = _count(steps, seen)
    light = _mean(source.pixels, x, y, steps, count) if source.coarse else _cubic(source.pixels, x, y)
    harsh = np.asarray(cv2.remap(source.harsh, x, y, cv2.INTER_LINEAR, borderMode=edge), np.uint8)
    near_lamps = np.flatnonzero((harsh > 0) & seen)
    if len(near_lamps):
        _refine(light, near_lamps, harsh, source.pixels, x, y, steps, max(2 * count, 4))
    np.maximum(light, 0, out=light)
    light[~seen] = 0
    clipped, dark = (
        none if mask is None else seen & (cv2.remap(mask, x, y, cv2.INTER_LINEAR, borderMode=edge) > limit)
        for mask, limit in ((source.clipped, 63), (source.dark, 127))
    )
    return Seen(light, seen, clipped, dark)


Steps = Sequence[F32]


def _steps(x: F32, y: F32, around: int) -> Steps:
    """How x and y of the source change over a new pixel's width and height."""
    across_x, across_y = np.gradient(x, axis=1), np.gradient(y, axis=1)
    down_x, down_y = np.gradient(x, axis=0), np.gradient(y, axis=0)
    if around:  # one-sided where it begins again
        across_x, down_x = (np.where(np.abs(d) > around / 8, 0, d) for d in (across_x, down_x))
    return across_x, across_y, down_x, down_y


def _count(steps: Steps, seen: Mask) -> int:
    """Lookups a side for footprints of this size."""
    if not seen.any():
        return 1
    across = np.hypot(steps[0], steps[1])[seen].max()
    down = np.hypot(steps[2], steps[3])[seen].max()
    return int(min(max(math.ceil(max(across, down) - 0.05), 2), 4))


def _mean(pixels: F32, x: F32, y: F32, steps: Steps, count: int) -> F32:
    """Mean of count² bilinear lookups spread over each new pixel's footprint."""
    import cv2

    total = np.zeros((*x.shape, 3), np.float32)
    across_x, across_y, down_x, down_y = steps
    for i in range(count):
        part = np.float32((i + 0.5) / count - 0.5)
        row_x, row_y = x + down_x * part, y + down_y * part
        for j in range(count):
            part = np.float32((j + 0.5) / count - 0.5)
            at_x, at_y = row_x + across_x * part, row_y + across_y * part
            total += cv2.remap(pixels, at_x, at_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    total *= np.float32(1 / count**2)
    return total


def _refine(
    light: F32, where: npt.NDArray[np.intp], harsh: npt.NDArray[np.uint8], pixels: F32, *rest: Any
) -> None:
    """Means of more lookups for a few of the new pixels, as much as they are next to lamps."""
    x, y, steps, count = rest
    wide = np.resize(where, (-(-len(where) // _LINE), _LINE))  # a picture's form, for the lookups
    mean = _mean(pixels, x.ravel()[wide], y.ravel()[wide], [step.ravel()[wide] for step in steps], count)
    flat = light.reshape(-1, 3)
    part = harsh.ravel()[where, None] / np.float32(255)
    flat[where] += (mean.reshape(-1, 3)[: len(where)] - flat[where]) * part


def _cubic(pixels: F32, x: F32, y: F32) -> F32:
    """Catmull–Rom's cubic by nine bilinear lookups: the two middle weights of a row join into one."""
    import cv2

    total = np.zeros((*x.shape, 3), np.float32)
    columns, lines = _taps(x), _taps(y)
    for at_y, weight_y in lines:
        for at_x, weight_x in columns:
            seen = cv2.remap(pixels, at_x, at_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            total += seen * (weight_x * weight_y)[..., None]
    return total


def _taps(x: F32) -> tuple[tuple[F32, F32], ...]:
    low = np.floor(x)
    t = x - low
    first = t * (np.float32(-0.5) + t * (1 - np.float32(0.5) * t))
    last = t * t * (np.float32(0.5) * t - np.float32(0.5))
    third = t * (np.float32(0.5) + t * (2 - np.float32(1.5) * t))
    middle = 1 - first - last
    taps = (low - 1, first), (low + third / middle, middle), (low + 2, last)
    return tuple((np.asarray(at, np.float32), np.asarray(weight, np.float32)) for at, weight in taps)
