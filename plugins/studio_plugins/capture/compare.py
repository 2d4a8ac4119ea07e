"""Two lenses compared where both look: how much brighter one of them is near its own frame.

Both lenses stand at different places, so that near things are shifted against each other by degrees. The
shift is searched for piece by piece around the ring; a brightness counts only if no plausible shift
explains it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import F32, F64, Mask, Registration, View
from studio_core.capturing.looking import look
from studio_core.capturing.settings import FRONT
from studio_core.colour import LUMINANCE
from studio_core.shading.job import Job
from studio_plugins.capture.overlap_balance import Overlap, balance, veil_of
from studio_plugins.capture.ring import Ring, angles, calmed, coarser

A = TypeVar("A", bound=npt.NDArray[Any])
STEP = 0.5
"""Degrees a pixel."""
_REACH = 3.0  # degrees: of the shifts that are tried
_WINDOW = 12.0  # degrees of azimuth that are shifted together
_DETAIL = 3.0  # degrees: what is wider is left out when the shift is searched for
_AT_MOST = 0.5  # stops: a larger difference counts as this
_TIE = 0.02  # stops for the largest shift, so that it is 0 where nothing tells
_PLAUSIBLE = (1.25, 0.01)  # of the least difference, and stops
_DEPTHS = (2.5, 4.0, 6.0, 8.0)  # degrees from the frame: a reflection fills one of these
EDGE = 1.0
"""Degrees at the very edge that are left out: the rim's shadow falls there."""
_BASE = 0.7  # of what is too bright far from the frame is no reflection of the frame
_FLOOR = 1e-3  # of the median light: darker is as dark


@dataclass(frozen=True, eq=False)
class Comparison:
    """One lens against the other on the ring near its frame, rows of `STEP` outwards to the edge.

    `score` (C,): stops by which the lens is too bright at its frame, whatever plausible shift is assumed;
    `likely` (C,): for the likeliest shift; `excess` (R, C): that place by place, 0 where one does not see;
    `known` (R, C). `shift` (C, 2): that shift, radians outwards and of azimuth: what the lens shows at
    (θ, a) the other shows at (θ, a) + shift of this lens' frame.
    """

    ring: Ring
    score: F32
    likely: F32
    excess: F32
    known: Mask
    shift: F64


def towards(registration: Registration, side: str) -> tuple[F64, F64]:
    """(3, 3) the other lens' frame from this lens', and the other's light in this lens' unit (3,)."""
    rotation = np.asarray(registration.rotation, np.float64)
    gain = np.asarray(registration.gain, np.float64)
    return (rotation.T, gain) if side == FRONT else (rotation, 1 / gain)


def falloff_at(registration: Registration, theta: F64, half: float) -> F64:
    """Light at angles from the axis, relative to the axis'; never below 0.02."""
    return registration.light_at(theta / half)


def compare(own: View, other: View, registration: Registration, side: str, job: Job) -> Comparison | None:
    """`own` is the lens of `side`. None where the lenses see nothing in common."""
    strips = _unrolled(own, other, registration, side)
    if strips is None:
        return None
    shifts, cost = _shifts(strips, job)
    return _scored(strips, shifts, cost)


@dataclass(frozen=True, eq=False)
class _Strips:
    """log2 of both lenses' channels (R', C, 3), of their comparable luminance (R', C), and where they see.

    The first `rows` rows are inside of the own lens' edge; the others are for shifts.
    """

    ring: Ring
    rows: int
    own: F32
    other: F32
    own_tone: F32
    other_tone: F32
    own_seen: Mask
    other_seen: Mask


def _unrolled(own: View, other: View, registration: Registration, side: str) -> _Strips | None:
    step, half = math.radians(STEP), own.lens.half
    inner = math.pi - other.lens.half - math.radians(_REACH)
    rows = math.ceil((half - inner) / step)
    if half - (math.pi - other.lens.half) < math.radians(1):
        return None
    fine = 0.75 * half / step
    own, other = coarser(own, fine), coarser(other, fine)
    columns, beyond = round(2 * math.pi / step), _pixels(_REACH) + 2
    theta = np.asarray(half - (np.arange(rows, -beyond, -1) - 0.5) * step, np.float64)
    ring = Ring(theta, (np.arange(columns) + 0.5) * 2 * math.pi / columns)
    rotation, gain = towards(registration, side)
    way = ring.directions @ rotation.T
    _, away = angles(way)
    raw, own_seen = look(own, ring.directions)
    raw_other, other_seen = look(other, way)
    own_seen[rows - _pixels(EDGE) :] = False
    other_seen &= away <= other.lens.half - math.radians(EDGE)
    if not (own_seen & other_seen).any():
        return None
    light = raw / falloff_at(registration, theta, half)[:, None, None]
    shown = raw_other * gain / falloff_at(registration, away, other.lens.half)[:, :, None]
    luminance = np.array(LUMINANCE)
    floor = max(_FLOOR * float(np.median(light[own_seen] @ luminance)), 1e-30)
    one, two = np.maximum(light @ luminance, floor), np.maximum(shown @ luminance, floor)
    both, calm = own_seen & other_seen, _pixels(1.5)
    within = ring.directions.copy()
    within[rows:] = within[rows - 1]
    found = balance(
        Overlap(
            own=calmed(one, both, calm, calm),
            other=calmed(two, both, calm, calm),
            known=both,
            from_own=np.broadcast_to(np.degrees(half - theta)[:, None], both.shape).clip(0),
            from_other=np.degrees(other.lens.half - away).clip(0),
            tilt=theta[:, None] - away,
            azimuth=ring.azimuth,
            veils=np.stack([veil_of(own, within), veil_of(other, way) * float(gain @ luminance)]),
        )
    )
    plain = two * found.gain
    two = np.maximum(plain + found.veil, 0.25 * plain)
    return _Strips(
        ring,
        rows,
        np.log2(np.maximum(light, floor)).astype(np.float32),
        np.log2(np.maximum(shown, floor)).astype(np.float32),
        np.log2(one + found.doubt).astype(np.float32),
        np.log2(two + found.doubt).astype(np.float32),
        own_seen,
        other_seen,
    )


def _shifts(strips: _Strips, job: Job) -> tuple[list[tuple[int, int]], F32]:
    """Shifts (rows, columns), and (shifts, C) the mean difference of detail around each column, stops."""
    from scipy import ndimage

    wide = _pixels(_DETAIL)
    detail = []
    for picture, seen in ((strips.own, strips.own_seen), (strips.other, strips.other_seen)):
        detail.append(calmed(picture - calmed(picture, seen, wide, wide), seen, 0.7, 0.7))
    own, other = detail
    n, window = _pixels(_REACH), _pixels(_WINDOW)
    tried = [(y, x) for y in range(-n, n + 1) for x in range(-n, n + 1) if y * y + x * x <= n * n]
    cost = np.empty((len(tried), own.shape[1]), np.float32)
    for index, (y, x) in enumerate(tried):
        job.checkpoint(index, 2 * len(tried))
        both = strips.own_seen & _moved(strips.other_seen, y, x)
        off = np.minimum(np.abs(own - _moved(other, y, x)).mean(axis=2), _AT_MOST) * both
        total = ndimage.uniform_filter1d(off.sum(axis=0), window, mode="wrap")
        count = ndimage.uniform_filter1d(both.sum(axis=0, dtype=np.float32), window, mode="wrap")
        cost[index] = total / np.maximum(count, 1e-3) + _TIE * math.hypot(y, x) / n
        cost[index, count < _pixels(3)] = 9
    return tried, cost


def _scored(strips: _Strips, shifts: list[tuple[int, int]], cost: F32) -> Comparison:
    from scipy import ndimage

    rows, columns = strips.rows, cost.shape[1]
    own = calmed(strips.own_tone, strips.own_seen, 1, 1)[:rows]
    other = calmed(strips.other_tone, strips.other_seen, 1, 1)
    factor, more = _PLAUSIBLE
    limit = factor * cost.min(axis=0) + more
    score = np.full(columns, np.inf, np.float32)
    excess, known = np.zeros((rows, columns), np.float32), np.zeros((rows, columns), np.bool_)
    best = cost.argmin(axis=0)
    for index, (y, x) in enumerate(shifts):
        plausible = cost[index] <= limit
        if not plausible.any():
            continue
        both = (strips.own_seen & _moved(strips.other_seen, y, x))[:rows]
        off = np.where(both, own - _moved(other, y, x)[:rows], 0)
        np.minimum(score, _at_frame(off, both), out=score, where=plausible)
        here = best == index
        likeliest = own[:, here] - _moved(other, y, x)[:rows, here]
        excess[:, here], known[:, here] = np.where(both[:, here], likeliest, 0), both[:, here]
    chosen = np.array(shifts, np.float64)[best] * math.radians(STEP)
    calm = np.stack([ndimage.median_filter(c, _pixels(_WINDOW) | 1, mode="wrap") for c in chosen.T], axis=1)
    ring = Ring(strips.ring.theta[:rows], strips.ring.azimuth)
    return Comparison(ring, score, _at_frame(excess, known), excess, known, calm)


def _at_frame(excess: F32, known: Mask) -> F32:
    """(C,) the most that a band along the frame is too bright, less what is so far from it as well."""
    rows, columns = excess.shape
    last = rows - _pixels(EDGE)
    total = np.concatenate([np.zeros((1, columns)), np.cumsum(excess, axis=0, dtype=np.float64)])
    count = np.concatenate([np.zeros((1, columns), np.intp), np.cumsum(known, axis=0)])
    most = np.full(columns, -np.inf)
    for depth in _DEPTHS:
        first = max(last - _pixels(depth), 0)
        seen = count[last] - count[first]
        mean = (total[last] - total[first]) / np.maximum(seen, 1)
        most = np.maximum(most, np.where(seen >= 0.5 * _pixels(depth), mean, 0))
    inside = known.argmax(axis=0)
    end, here = np.minimum(inside + _pixels(2), rows), np.arange(columns)
    far = (total[end, here] - total[inside, here]) / np.maximum(count[end, here] - count[inside, here], 1)
    return np.asarray(most - _BASE * np.maximum(far, 0), np.float32)


def _moved(picture: A, rows: int, columns: int) -> A:
    """What lies `rows` further out and `columns` further round; 0 beyond the picture, the azimuth closed."""
    turned = np.roll(picture, -columns, axis=1)
    made: A = np.zeros_like(turned)
    if rows >= 0:
        made[: len(made) - rows] = turned[rows:]
    else:
        made[-rows:] = turned[:rows]
    return made


def _pixels(degrees: float) -> int:
    return round(degrees / STEP)
