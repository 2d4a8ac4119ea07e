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
_AGREE = 0.5  # correlation from which a patch counts


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
    import cv2

    at = front.grid()
    rows = np.flatnonzero(front.usable.any(axis=1))
    reach = back.first + back.shape[0] * back.step, back.first
    t = at[:, 0, 1]
    margin = math.radians(12)
    rows = rows[(t[rows] < reach[0] + margin) & (t[rows] > reach[1] - margin)]
    if not len(rows):
        return NOTHING
    part = slice(rows[0], rows[-1] + 1)
    at = at[part]
    opposite = across(front, back, at, stand)
    x, y = back.pixels(opposite)
    weight = np.asarray(
        cv2.remap(
            padded(back.usable.astype(np.float32)), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT
        )
    )
    other = np.asarray(cv2.remap(padded(back.tone), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT))
    both: Mask = front.usable[part] & (weight > 0.99)
    if both.sum() < 50:
        return NOTHING
    sigma = math.radians(blur) / front.step
    calm_sigma = math.radians(max(_CALM, 2 * blur)) / front.step
    one = front.tone[part] - _trend(front.tone[part] - other, at[..., 1] + opposite[..., 1], both)
    one, other = flattened(one, both, calm_sigma), flattened(np.asarray(other, np.float32), both, calm_sigma)
    one, other, both = _blurred(one, other, both, sigma)
    patch = max(1.6, 1.2 * blur)  # degrees, standard deviation of a patch
    slope_x = np.gradient((one + other) / 2, axis=1)
    slope_y = np.gradient((one + other) / 2, axis=0)
    calm = both.astype(np.float32)
    calm = np.asarray(
        cv2.erode(calm, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=0), np.float32
    )
    missing = one - other
    sums = np.stack(
        [
            slope_x * slope_x, slope_x * slope_y, slope_y * slope_y, slope_x * missing, slope_y * missing,
            missing * missing, one, other, one * one, other * other, one * other, np.ones_like(one),
        ],
        axis=-1,
    )  # fmt: skip
    sums *= calm[..., None]
    sums = spread(sums, math.radians(patch) / front.step)
    apart = max(1, round(math.radians(_APART) / front.step))
    middle = slice(apart // 2, None, apart)
    some = sums[:, middle]
    share = some[..., 11].sum(axis=0) > 0
    # rows of patches: as many as fit the overlap at this azimuth
    picked = np.zeros(some.shape[:2], np.bool_)
    high = np.maximum(1, apart)
    for column in np.flatnonzero(share):
        inside = np.flatnonzero(calm[:, middle][:, column] > 0)
        if not len(inside):
            continue
        first, last = inside[0], inside[-1]
        number = max(1, round((last - first + 1) / high))
        centre = first + (np.arange(number) + 0.5) * (last - first + 1) / number
        picked[np.clip(centre.astype(np.intp), first, last), column] = True
    here = at[:, middle][picked]
    xx, xy, yy, bx, by, rest, mean_a, mean_b, aa, bb, ab, count = (some[picked][:, i] for i in range(12))
    count = np.maximum(count, 1e-9)
    mean_a, mean_b = mean_a / count, mean_b / count
    va, vb = aa / count - mean_a**2, bb / count - mean_b**2
    likeness = (ab / count - mean_a * mean_b) / np.sqrt(np.maximum(va * vb, 1e-12))
    texture = np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)
    trace = (xx + yy)[:, None, None] * np.eye(2)
    shift = np.linalg.solve(texture + 1e-3 * trace + 1e-12 * np.eye(2), np.stack([bx, by], -1)[..., None])[
        ..., 0
    ]
    unexplained = np.maximum(rest - shift[:, 0] * bx - shift[:, 1] * by, 1e-4 * aa) / count
    pixels = 2 * math.pi * sigma**2 + 1  # correlated by the blur
    surety = texture / (unexplained * pixels)[:, None, None] / front.step**2
    limit = max(1.5 * blur, 0.5)  # degrees
    fits = np.hypot(*shift.T) * front.step < math.radians(limit)
    textured = (va > 1e-5) & (vb > 1e-5) & (count > 0.15 * count.max(initial=0.0))
    keep = (likeness > (_AGREE if blur < 1 else 0.3)) & fits & textured
    contrast = np.where(textured, np.maximum(va * vb, 0) ** 0.25, 0)
    here, there = here[keep], across(front, back, here[keep] + shift[keep] * front.step, stand)
    return Patches(here, there, surety[keep], likeness[keep], contrast[keep], float(contrast.sum()))


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


def _blurred(one: F32, other: F32, both: Mask, sigma: float) -> tuple[F32, F32, Mask]:
    if sigma < 0.3:
        return one.astype(np.float32), other.astype(np.float32), both
    stack = np.dstack([one, other, both]).astype(np.float32)
    made = spread(stack, sigma)
    share = np.maximum(made[..., 2], 1e-3)
    return np.where(both, made[..., 0] / share, 0), np.where(both, made[..., 1] / share, 0), both
