"""From a guess to the last hundredth of a degree: patches of both rims are laid over each other.

Around the ring the back lens' strip is warped to the front lens'; in every patch a shift remains that makes
log light agree best (Gauss–Newton: Lucas and Kanade 1981), with the certainty that the patch's texture gives
in each direction. Rotation, field of view and the circles' centres then follow from all shifts by robust
least squares (Cauchy weights, no octant with more than its say), from coarse to fine.
"""

from __future__ import annotations

import math

import numpy as np

from studio_core.capturing.artifacts import F32, F64, Mask
from studio_plugins.capture.overlap import (
    NOTHING,
    Patches,
    Stand,
    Strip,
    across,
    flattened,
    padded,
    spread,
)
from studio_plugins.capture.solve import Fit, solved

BLURS = (2.0, 1.0, 0.5, 0.25)
"""Degrees, from a guess that may be off by a few; the first may be left out for better ones."""
_CALM = 4.0
_APART = 3.0  # degrees between patches
_NEAR = 0.7  # degrees by which near things may differ between the lenses
_TREND = 16  # pieces of the overlap from one lens' edge to the other's
_FEWEST = 6  # patches
_AGREE, _AGREE_BLURRED = 0.5, 0.3  # correlation from which a patch counts
_PATCH = 1.6  # degrees, standard deviation of its window
_MARGIN = math.radians(12)  # by which the overlap may lie elsewhere than expected
_FEW_PIXELS = 50


def refined(front: Strip, back: Strip, stand: Stand, fit_fov: bool, blurs: tuple[float, ...] = BLURS) -> Fit:
    """The stand that makes both strips agree best, near the given one, and that near things do not move."""
    made = Fit(stand, NOTHING, np.zeros(0), np.zeros(0), math.inf)
    for blur in blurs:
        if math.radians(blur) < 0.4 * front.step and made.patches.here.size:
            break
        for _ in range(4):
            seen = compared(front, back, stand, blur)
            if len(seen.here) < _FEWEST:
                break
            before, made = stand, solved(front, back, seen, stand, fit_fov)
            stand = made.stand
            if np.linalg.norm(stand.turn - before.turn) < 0.02 * math.radians(blur):
                break
    return _beside_near_things(front, back, made, fit_fov, blur) if len(made.left) else made


def _beside_near_things(front: Strip, back: Strip, made: Fit, fit_fov: bool, blur: float) -> Fit:
    """The fit that near things cannot turn, unless the overlap is too narrow for it."""
    for _ in range(2):
        seen = compared(front, back, made.stand, blur)
        if len(seen.here) < _FEWEST:
            break
        other = solved(front, back, seen, made.stand, fit_fov, _NEAR)
        if not other.doubt < 1.5 * made.doubt + 0.1:
            break
        made = other
    return made


def compared(front: Strip, back: Strip, stand: Stand, blur: float) -> Patches:
    """What a warp by `stand` leaves to shift, patch by patch; `blur` in degrees."""
    laid = _laid_over(front, back, stand, blur)
    if laid is None:
        return NOTHING
    one, other, calm, at = laid
    apart = max(1, round(math.radians(_APART) / front.step))
    columns = slice(apart // 2, None, apart)
    sigma = math.radians(max(_PATCH, 1.2 * blur)) / front.step
    picked = _middles(calm[:, columns] > 0, apart)
    slope_y, slope_x = np.gradient((one + other) / 2)
    missing = one - other
    products = (
        slope_x * slope_x, slope_x * slope_y, slope_y * slope_y, slope_x * missing, slope_y * missing,
        missing * missing, one, other, one * one, other * other, one * other, np.ones_like(one),
    )  # fmt: skip
    sums = spread(np.stack(products, axis=-1) * calm[..., None], sigma)[:, columns][picked].astype(np.float64)
    xx, xy, yy, bx, by, rest, mean_a, mean_b, aa, bb, ab, count = sums.T
    count = np.maximum(count, 1e-9)
    mean_a, mean_b = mean_a / count, mean_b / count
    va, vb = aa / count - mean_a**2, bb / count - mean_b**2
    likeness = (ab / count - mean_a * mean_b) / np.sqrt(np.maximum(va * vb, 1e-12))
    texture = np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)
    firm = (1e-3 * (xx + yy) + 1e-12)[:, None, None] * np.eye(2)
    shift = np.linalg.solve(texture + firm, np.stack([bx, by], -1)[..., None])[..., 0]
    unexplained = np.maximum(rest - shift[:, 0] * bx - shift[:, 1] * by, 1e-4 * aa) / count
    # a patch says as much as one pixel: it is often one edge, and more trust measured worse
    alike = 2 * math.pi * (math.radians(blur) / front.step) ** 2 + 1  # pixels, by the blur
    surety = texture / (unexplained * alike)[:, None, None] / front.step**2
    textured = (va > 1e-5) & (vb > 1e-5) & (count > 0.15 * count.max(initial=0.0))
    fits = np.hypot(*shift.T) * front.step < math.radians(max(1.5 * blur, 0.5))
    keep = (likeness > (_AGREE if blur < 1 else _AGREE_BLURRED)) & fits & textured
    contrast = np.where(textured, np.maximum(va * vb, 0) ** 0.25, 0)
    places = at[:, columns][picked][keep]
    there = across(front, back, places + shift[keep] * front.step, stand)
    return Patches(places, there, surety[keep], likeness[keep], contrast[keep], float(contrast.sum()))


def _laid_over(front: Strip, back: Strip, stand: Stand, blur: float) -> tuple[F32, F32, F32, F64] | None:
    """Both strips' tones at places (rows, columns, 2), levelled and blurred, and 1 where both are known."""
    import cv2

    at = front.grid()
    t = at[:, 0, 1]
    rows = np.flatnonzero(front.usable.any(axis=1) & (t > back.first - _MARGIN))
    if not len(rows):
        return None
    part = slice(rows[0], rows[-1] + 1)
    at = at[part]
    opposite = across(front, back, at, stand)
    x, y = back.pixels(opposite)

    def warped(picture: F32) -> F32:
        made = cv2.remap(padded(picture), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        return np.asarray(made, np.float32)

    other = warped(back.tone)
    both: Mask = front.usable[part] & (warped(back.usable.astype(np.float32)) > 0.99)
    if both.sum() < _FEW_PIXELS:
        return None
    one = front.tone[part] - _trend(front.tone[part] - other, at[..., 1] + opposite[..., 1], both)
    sigma = math.radians(max(_CALM, 2 * blur)) / front.step
    one, other = flattened(one, both, sigma), flattened(other, both, sigma)
    one, other = _blurred(one, other, both, math.radians(blur) / front.step)
    inner = cv2.erode(both.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=0)
    return one, other, np.asarray(inner, np.float32), at


def _middles(known: Mask, apart: int) -> Mask:
    """Where patches' middles are: as many in every column as fit into what is known there."""
    made = np.zeros(known.shape, np.bool_)
    for column in np.flatnonzero(known.any(axis=0)):
        inside = np.flatnonzero(known[:, column])
        first, high = inside[0], inside[-1] - inside[0] + 1
        number = max(1, round(high / apart))
        middle = first + (np.arange(number) + 0.5) * high / number
        made[np.clip(middle.astype(np.intp), first, inside[-1]), column] = True
    return made


def _trend(apart: F32, height: F64, both: Mask) -> F32:
    """What falloff makes of the difference of both lenses' tones: its median by how near to which edge."""
    values, where = apart[both], height[both]
    low, high = where.min(), where.max()
    bins = max(1, min(_TREND, int((high - low) / math.radians(1.0))))
    index = np.minimum(((where - low) / max(high - low, 1e-9) * bins).astype(np.intp), bins - 1)
    order = np.argsort(index, kind="stable")
    parts = np.split(values[order], np.searchsorted(index[order], np.arange(1, bins)))
    known = [i for i, part in enumerate(parts) if len(part)]
    middle = low + (np.array(known) + 0.5) * (high - low) / bins
    return np.interp(height, middle, [np.median(parts[i]) for i in known]).astype(np.float32)


def _blurred(one: F32, other: F32, both: Mask, sigma: float) -> tuple[F32, F32]:
    if sigma < 0.3:
        return one, other
    stack = np.dstack([one, other, both]).astype(np.float32)
    made = spread(stack, sigma)
    share = np.maximum(made[..., 2], 1e-3)
    return np.where(both, made[..., 0] / share, 0), np.where(both, made[..., 1] / share, 0)
