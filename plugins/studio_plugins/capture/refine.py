"""From a guess to the last hundredth of a degree: patches of both rims are laid over each other.

Around the ring the back lens' strip is warped to the front lens'; in every patch a shift remains that makes
log light agree best (Gauss–Newton: Lucas and Kanade 1981), but for a constant and a slope from the axis
outwards: these are falloff's and large reflections', and in smooth sky they would agree wherever it is laid.
Each shift is as certain as the patch's texture makes it in each direction. Rotation, field of view and the
circles' centres then follow from all shifts by robust least squares (Cauchy weights, no octant with more than
its say), from coarse to fine.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

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

Index = npt.NDArray[np.intp]
BLURS = (2.0, 1.0, 0.5, 0.25)
"""Degrees, from a guess that may be off by a few; the first may be left out for better ones."""
_CALM = 4.0  # degrees
_APART = 3.0  # degrees between patches
_NEAR = 0.7  # degrees by which near things may differ between the lenses
_FEWEST = 6  # patches
_AGREE, _AGREE_BLURRED = 0.5, 0.3  # correlation from which a patch counts
_PATCH = 1.6  # degrees, standard deviation of its window
_MARGIN = math.radians(12)  # by which the overlap may lie elsewhere than expected
_FEW_PIXELS = 50
_PAIRS = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2), (3, 3), (4, 4), (3, 4))


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
    sigma = math.radians(max(_PATCH, 1.2 * blur)) / front.step
    where = _middles(calm > 0, apart)
    slope_y, slope_x = (np.asarray(slope, np.float32) for slope in np.gradient((one + other) / 2))
    pictures = (slope_x, slope_y, one - other, one, other)
    moments, count = _partial_moments(pictures, _PAIRS, calm, at[:, 0, 1], sigma, where)
    xx, xy, yy, bx, by, rest, va, vb, ab = moments
    likeness = ab / np.sqrt(np.maximum(va * vb, 1e-12))
    texture = np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)
    firm = (1e-3 * (xx + yy) + 1e-12)[:, None, None] * np.eye(2)
    shift = np.linalg.solve(texture + firm, np.stack([bx, by], -1)[..., None])[..., 0]
    unexplained = np.maximum(rest - shift[:, 0] * bx - shift[:, 1] * by, 1e-4 * va)
    # a patch says as much as one pixel: it is often one edge, and more trust measured worse
    alike = 2 * math.pi * (math.radians(blur) / front.step) ** 2 + 1  # pixels, by the blur
    surety = texture / (unexplained * alike)[:, None, None] / front.step**2
    textured = (va > 1e-5) & (vb > 1e-5) & (count > 0.15 * count.max(initial=0.0))
    fits = np.hypot(*shift.T) * front.step < math.radians(max(1.5 * blur, 0.5))
    keep = (likeness > (_AGREE if blur < 1 else _AGREE_BLURRED)) & fits & textured
    contrast = np.where(textured, np.maximum(va * vb, 0) ** 0.25, 0)
    places = at[where][keep]
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
    x, y = back.pixels(across(front, back, at, stand))

    def warped(picture: F32) -> F32:
        made = cv2.remap(padded(picture), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        return np.asarray(made, np.float32)

    other = warped(back.tone)
    both: Mask = front.usable[part] & (warped(back.usable.astype(np.float32)) > 0.99)
    if both.sum() < _FEW_PIXELS:
        return None
    sigma = math.radians(max(_CALM, 2 * blur)) / front.step
    one, other = flattened(front.tone[part], both, sigma), flattened(other, both, sigma)
    one, other = _blurred(one, other, both, math.radians(blur) / front.step)
    inner = cv2.erode(both.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=0)
    return one, other, np.asarray(inner, np.float32), at


def _partial_moments(
    pictures: tuple[F32, ...],
    pairs: tuple[tuple[int, int], ...],
    known: F32,
    t: F64,
    sigma: float,
    where: tuple[Index, Index],
) -> tuple[list[F64], F64]:
    """Covariances (N,) of pairs of pictures around N pixels, and how much is known there.

    What is linear in t (rows,) is taken out of both.
    """
    height = np.broadcast_to((t - t.mean()).astype(np.float32)[:, None], known.shape)
    parts = (*pictures, height)
    last = len(pictures)
    wanted = (*pairs, *((i, last) for i in range(last + 1)))
    products = np.stack([np.ones_like(known), *parts, *(parts[i] * parts[j] for i, j in wanted)], axis=-1)
    sums = spread(products * known[..., None], sigma)[where].astype(np.float64).T
    count = np.maximum(sums[0], 1e-9)
    mean = sums[1 : last + 2] / count
    raw = zip(wanted, sums[last + 2 :], strict=True)
    cov = {(i, j): some / count - mean[i] * mean[j] for (i, j), some in raw}
    steep = np.maximum(cov[last, last], 1e-12)
    return [cov[i, j] - cov[i, last] * cov[j, last] / steep for i, j in pairs], count


def _middles(known: Mask, apart: int) -> tuple[Index, Index]:
    """Rows and columns of patches' middles: every `apart` columns as many as fit into what is known there."""
    rows, columns = [], []
    for column in range(apart // 2, known.shape[1], apart):
        inside = np.flatnonzero(known[:, column])
        if not len(inside):
            continue
        first, high = inside[0], inside[-1] - inside[0] + 1
        number = max(1, round(high / apart))
        middle = first + (np.arange(number) + 0.5) * high / number
        rows.append(np.clip(middle.astype(np.intp), first, inside[-1]))
        columns.append(np.full(number, column, np.intp))
    empty = [np.zeros(0, np.intp)]
    return np.concatenate(rows or empty), np.concatenate(columns or empty)


def _blurred(one: F32, other: F32, both: Mask, sigma: float) -> tuple[F32, F32]:
    if sigma < 0.3:
        return one, other
    stack = np.dstack([one, other, both]).astype(np.float32)
    made = spread(stack, sigma)
    share = np.maximum(made[..., 2], 1e-3)
    return np.where(both, made[..., 0] / share, 0), np.where(both, made[..., 1] / share, 0)
