"""What moved between exposures: places where one shows light that the others rule out.

Exposures are compared at reduced size, from the best exposed one outwards, each with what those before it
say. Differences that noise, the response or half a cell of misalignment explain do not count, nor do specks.
A place that is clipped rules out less light than that, one that is black rules out more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Mask, Motion
from studio_core.imaging.numbers import Numbers
from studio_core.imaging.projection import Circle, Lens
from studio_core.imaging.warping import warp

F32 = npt.NDArray[np.float32]
_CELLS = 700  # along the longer side, about
_STRONG = 0.3  # log2 beyond the tolerance, of the heart of something that moved
_TOLERANCE = 0.08  # log2, of response and exposures
_SIGMAS = 3.0  # of a cell's mean
_COMPRESSED = 1.5 / 255  # what compression may do to dark numbers that are calm in themselves
_NOTHING = np.float32(-60.0)


@dataclass(frozen=True, eq=False)
class Look:
    """One exposure, reduced: log2 light between (h, w, 3) `low` and `high` is what it allows.

    `known` (h, w): not outside; `exact`: nor clipped; `best`: how much of the picture it exposes well.
    """

    low: F32
    high: F32
    exact: Mask
    known: Mask
    best: float


def reduction(width: int, height: int) -> int:
    """Pixels of a cell, a side."""
    return max(2, round(max(width, height) / _CELLS))


def reduced(
    pixels: npt.NDArray[Any],
    clip: npt.NDArray[np.uint8],
    motion: Motion,
    gain: F32,
    numbers: Numbers,
    circle: Circle | None = None,
    lens: Lens | None = None,
) -> Look:
    """A look at a frame (H, W, 3), where it belongs in the reference."""
    import cv2

    height, width = pixels.shape[:2]
    size = (max(1, width // reduction(width, height)), max(1, height // reduction(width, height)))
    scale = size[0] / width
    small = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    clipped = cv2.resize(clip, size, interpolation=cv2.INTER_AREA)
    move = Motion(motion.dx * scale, motion.dy * scale, motion.degrees, rotation=motion.rotation)
    ring = None if circle is None else circle.scaled(scale)
    small, known = warp(small, move, ring, lens)
    clipped, _ = warp(clipped, move, ring, lens)
    if ring is not None:  # outside there is the rim, which does not turn with the world
        y, x = np.mgrid[0 : size[1], 0 : size[0]] + 0.5
        known &= np.hypot(x - ring.x, y - ring.y) < 0.98 * ring.radius
    exposure, stubborn = numbers.light(small), numbers.stubborn(small, _COMPRESSED)
    spread = np.sqrt(numbers.variance(small) * scale**2 + stubborn)  # of the mean of a cell
    high = np.log2(np.maximum(exposure + _SIGMAS * spread, 1e-9) * gain)
    low = np.log2(np.maximum(exposure - _SIGMAS * spread, 1e-9) * gain)
    beyond = clipped > 25
    high[beyond] = 60.0
    low[exposure <= 0] = _NOTHING
    good = ~beyond & known & (spread < 0.1 * exposure).all(axis=2)
    return Look(low, high, ~beyond & known, known, float(good.mean()))


def left_out(looks: Sequence[Look]) -> tuple[list[F32 | None], list[float]]:
    """Share 0 … 1 (h, w) of each exposure that is not used, None for nothing; and how much of it that is.

    `looks` from dark to bright.
    """
    import cv2

    reference = int(np.argmax([look.best for look in looks]))
    order = sorted(range(len(looks)), key=lambda i: (abs(i - reference), i))
    low, high = looks[reference].low.copy(), looks[reference].high.copy()
    told = looks[reference].known.copy()
    made: list[F32 | None] = [None] * len(looks)
    shares = [0.0] * len(looks)
    for i in order[1:]:
        look = looks[i]
        gap = _gap(look, low, high) * (told & look.known)
        both = told & look.known
        off = _offset(look, low, high, both & look.exact)
        if abs(off) > _TOLERANCE:  # exposures of another origin: only what stands out of that has moved
            shifted = Look(look.low - off, look.high - off, look.exact, look.known, look.best)
            gap = _gap(shifted, low, high) * both
        moved = _regions(gap)
        shares[i] = float(moved.sum() / max(both.sum(), 1))
        if moved.any():
            made[i] = np.asarray(cv2.GaussianBlur(moved.astype(np.float32), (0, 0), 0.8), np.float32)
        good = look.known & ~moved
        # what both allow; where nothing was told, what this one says
        narrower = good[..., None] & (look.high - look.low < high - low)
        low = np.where(narrower, look.low, low)
        high = np.where(narrower, look.high, high)
        told |= good
    return made, shares


def _gap(look: Look, low: F32, high: F32) -> F32:
    """(h, w) log2 between what a look allows and what the others do, in the worst channel; 0 if they meet."""
    import cv2

    cell = np.ones((3, 3), np.uint8)
    over = look.low - cv2.dilate(high, cell)
    under = cv2.erode(low, cell) - look.high
    made: F32 = (np.maximum(over, under).max(axis=2) - np.float32(_TOLERANCE)).clip(0)
    return made


def _offset(look: Look, low: F32, high: F32, where: Mask) -> float:
    """log2 by which all of it is brighter than the others say."""
    sure = where[..., None] & (high - low < 0.5) & (look.high - look.low < 0.5)
    if np.count_nonzero(sure) < 50:
        return 0.0
    return float(np.median((look.high + look.low - high - low)[sure])) / 2


def _regions(gap: F32) -> Mask:
    """Places that moved: more than specks of strong difference, with the weaker difference around them."""
    import cv2

    strong = cv2.morphologyEx((gap > _STRONG).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    if not strong.any():
        return np.zeros(gap.shape, np.bool_)
    count, parts = cv2.connectedComponents((gap > 0.02).astype(np.uint8), connectivity=8)
    marked = np.zeros(count, np.bool_)
    marked[np.unique(parts[strong > 0])] = True
    marked[0] = False
    grown = cv2.dilate(marked[parts].astype(np.uint8), np.ones((5, 5), np.uint8))
    return np.asarray(grown > 0, np.bool_)
