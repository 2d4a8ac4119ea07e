"""Small looks at photographs: how bright they are, whether two show the same view, where their light lies.

What decides here is structure, not brightness, so that two exposures of one view are alike and two views
with the same exposure are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.imaging.photograph import Photograph

F32 = npt.NDArray[np.float32]
SMALL = 128
"""Pixels along the long side of a look."""
_DARK, _FULL = 0.03, 0.97
_LEAST = 300  # pixels that two looks must share
_CLUMP = 25  # pixels that have one structure in common: as if there were so many fewer
_NOISE = 0.004  # of numbers in 0 … 1: structure below is none
_DARKER = 0.4  # of light: what is outside a lens' image
_LIT = 0.08  # of the upper quartile's light


@dataclass(frozen=True, eq=False)
class Look:
    """A photograph made small: `numbers` (h, w) encoded 0 … 1, their `structure`, and where that is `known`.

    `brightness`: log2 of its mean light, as far as its numbers tell without a response curve.
    """

    numbers: F32
    structure: F32
    known: npt.NDArray[np.bool_]
    brightness: float


def look_at(photograph: Photograph) -> Look:
    """The small look at a photograph."""
    import cv2

    width, height = photograph.size
    factor = SMALL / max(width, height)
    size = (max(round(width * factor), 1), max(round(height * factor), 1))
    # 64 numbers a place: averaging all of twelve million takes longer than everything else
    stride = max(int(1 / factor) // 8, 1)
    fewer = np.ascontiguousarray(photograph.pixels[::stride, ::stride])
    small = cv2.resize(fewer, size, interpolation=cv2.INTER_AREA)
    numbers = _encoded(small).mean(axis=2, dtype=np.float32)
    blurred = cv2.GaussianBlur(numbers, (0, 0), 0.8)
    rough = blurred - cv2.GaussianBlur(blurred, (0, 0), 4)
    grain = numbers - blurred
    spread, noise = (np.sqrt(cv2.GaussianBlur(part * part, (0, 0), 4)) for part in (rough, grain))
    # of white noise, `rough` has 0.4 of what `grain` has
    clear = ((numbers > _DARK) & (numbers < _FULL) & (spread > 0.7 * noise)).astype(np.uint8)
    spread += np.float32(_NOISE)
    known = cv2.erode(clear, np.ones((5, 5), np.uint8), borderValue=0).astype(bool)
    light = float(_linear(small).mean(dtype=np.float64))
    return Look(numbers, np.asarray(rough / spread, np.float32), known, float(np.log2(max(light, 1e-12))))


def alike(a: Look, b: Look) -> tuple[float, float]:
    """Bounds (two standard deviations) of the correlation of their structure, best over shifts of a pixel.

    NaN where they share too little that is neither dark nor clipped.
    """
    if a.numbers.shape != b.numbers.shape:
        return float("nan"), float("nan")
    found = [_correlation(a, b, x, y) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    return max(found, key=lambda bounds: -2.0 if np.isnan(bounds[0]) else bounds[0])


def well_exposed(looks: Sequence[Look]) -> Look:
    """The one whose light is neither clipped nor lost, so that what is dark in it is no glare's."""
    return min(looks, key=lambda look: abs(float(np.quantile(look.numbers, 0.8)) - 0.6))


def two_discs(look: Look) -> bool:
    """Whether the light lies in two discs side by side: dark in the corners of both halves, not beside."""
    light = look.numbers**2.2
    height, width = light.shape
    y, x = np.mgrid[0:height, 0:width] + 0.5
    reach = np.hypot((x % (width / 2) - width / 4) / (width / 4), (y - height / 2) / (height / 2))
    outside, content = reach > 1.2, float(np.quantile(light[reach < 0.8], 0.3))
    places = (x < width / 4), (np.abs(x - width / 2) < width / 4), (x > width * 3 / 4)
    corners = [
        float(np.median(light[outside & place & half]))
        for place in places
        for half in (y < height / 2, y > height / 2)
    ]
    sides = (width * 8 // 100, width * 20 // 100), (width * 80 // 100, width * 92 // 100)
    middle = light[height * 35 // 100 : height * 65 // 100]
    beside = min(float(np.median(middle[:, first:last])) for first, last in sides)
    # a lamp at the edge may light one corner up
    dark = float(np.quantile(light[outside], 0.7)) < _DARKER * content
    dark &= sorted(corners)[-2] < 0.6 * content
    return dark and float(np.median(corners[:2] + corners[4:])) < 0.7 * beside


def dark_ends(look: Look) -> bool:
    """Whether the picture is dark at its left and right ends: one circle in a wide frame."""
    lit, width = _lit(look), look.numbers.shape[1]
    return float(lit[:, : width // 20].mean()) < 0.2 and float(lit[:, -(width // 20) :].mean()) < 0.2


def goes_round(look: Look) -> bool:
    """Whether the left end goes on at the right end, as in a picture of all directions."""
    ends = float(np.abs(look.numbers[:, 0] - look.numbers[:, -1]).mean())
    steps = np.abs(look.numbers - np.roll(look.numbers, look.numbers.shape[1] // 6, axis=1)).mean()
    return ends < 0.5 * float(steps) + 0.02


def _lit(look: Look) -> npt.NDArray[np.bool_]:
    light = look.numbers**2.2
    made: npt.NDArray[np.bool_] = light > _LIT * float(np.quantile(light, 0.75))
    return made


def _encoded(small: npt.NDArray[Any]) -> F32:
    if small.dtype == np.float32:
        top = max(float(np.quantile(small, 0.995)), 1e-12)
        if top > 1:  # no sensor's scale
            small = small / top
        return np.asarray(np.clip(small, 0, 1) ** np.float32(1 / 2.2), np.float32)
    return small.astype(np.float32) / np.float32(255 if small.dtype == np.uint8 else 65535)


def _linear(small: npt.NDArray[Any]) -> F32:
    return small if small.dtype == np.float32 else _encoded(small) ** np.float32(2.2)


def _correlation(a: Look, b: Look, x: int, y: int) -> tuple[float, float]:
    height, width = a.numbers.shape
    here = (slice(max(y, 0), height + min(y, 0)), slice(max(x, 0), width + min(x, 0)))
    there = (slice(max(-y, 0), height + min(-y, 0)), slice(max(-x, 0), width + min(-x, 0)))
    shared = a.known[here] & b.known[there]
    if shared.sum() < _LEAST:
        return float("nan"), float("nan")
    one, other = a.structure[here][shared], b.structure[there][shared]
    one, other = one - one.mean(), other - other.mean()
    size = float(np.sqrt((one * one).sum() * (other * other).sum()))
    if size <= 0:
        return float("nan"), float("nan")
    found = np.arctanh(min(max(float((one * other).sum()) / size, -0.999), 0.999))
    spread = 1 / np.sqrt(float(shared.sum()) / _CLUMP - 3)  # Fisher's
    return float(np.tanh(found - 2 * spread)), float(np.tanh(found + 2 * spread))
