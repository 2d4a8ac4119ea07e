"""Finding the lens' circle, or two, in photographs: where the picture ends and darkness begins.

Many circles are proposed from the outlines of what is brighter than this or that; each is scored by how far
light drops across it and by how much detail the rings inside have that those outside lack: a shiny rim is
bright but shows nothing, a round table drops but has a room around it. The best is fitted to its edge. The
confidence says how likely the radius and the centre are right within a hundredth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import FoundCircle
from studio_core.imaging.projection import Circle
from studio_core.shading.job import Job
from studio_plugins.capture.circle_edge import (
    AGAIN,
    CLOSE,
    WIDE,
    changes,
    fitted,
    in_stops,
    rings,
    rough_light,
    steps_inside,
)

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

_FINE, _COARSE = 1400, 360  # pixels across the pictures that are worked on
_LEVELS = 9
_TRIALS = 150
_BEST = 6  # candidates that are fitted
_WEIGHTS = (-0.5, 1.8, 1.0, 2.3, 2.5, 0.1, -3.2, -0.6, -3.2, -1.1)  # of `_evidence`, from 460 circles
_LOOKED_INTO = 4  # of these, for an edge inside


@dataclass(frozen=True)
class _Scored:
    """A circle; `drop`: stops from its inside to its outside; `detail` −1 … 1: how much of the detail is
    inside; `dark` 0 … 1: how dark it is around it; `seen`: share of directions where both sides are in the
    picture; `edge`: of these, where an edge fits, `spread` its median distance in radii."""

    circle: Circle
    drop: float = 0.0
    detail: float = 0.0
    dark: float = 0.0
    seen: float = 0.0
    edge: float = 0.0
    spread: float = 1.0

    @property
    def score(self) -> float:
        """0 … about 4."""
        looks = 0.8 * min(max(self.drop, 0.0), 3.0) / 3 + max(self.detail, -0.5) + 0.8 * self.dark
        whole = math.sqrt(min(1.0, self.seen / 0.5)) * min(max(self.dark / 0.5, 0.3), 1.0)
        return (looks + 1.2 * self.edge) * whole


def find_circles(
    pictures: Sequence[npt.NDArray[Any]], count: int | None, job: Job | None = None
) -> tuple[FoundCircle, ...]:
    """The circles of one or two lenses in exposures (H, W, 3) of one size, from left to right or down.

    `count` None: two where two alike are found side by side. Always gives `count` circles: what is not
    found is guessed, with a confidence near 0 (one circle: about the middle, through the corners).
    """
    light, factor = rough_light(pictures, _FINE)
    if job is not None:
        job.checkpoint(1, 8)
    stops = in_stops(light)
    small, shrink = _smaller(stops)
    proposals = _proposals(small)
    if job is not None:
        job.checkpoint(2, 8)
    scored = _distinct([_scored(small, one, 180) for one in proposals])[:_BEST]
    refined = []
    for place, one in enumerate(scored):
        refined.append(_refined(light, stops, one.circle.scaled(shrink), WIDE))
        if job is not None:
            job.checkpoint(_BEST + place, 4 * _BEST)
    refined = _distinct(refined)
    for place, one in enumerate(refined[:_LOOKED_INTO]):
        refined += _inside(light, stops, one.circle)
        if job is not None:
            job.checkpoint(2 * _BEST + place, 4 * _BEST)
    refined = _distinct(refined)
    height, width = light.shape
    chosen = _chosen(refined, count, width, height, stops)
    found = [FoundCircle(one.circle.scaled(factor), _confidence(one, refined)) for one in chosen]
    if len(found) == 1 and found[0].confidence < 0.15 and chosen[0].dark < 0.35:
        height, width = pictures[0].shape[:2]  # no darkness around anything: the lens fills the picture
        found = [FoundCircle(Circle(width / 2, height / 2, math.hypot(width, height) / 2), 0.0)]
    return tuple(found)


def _smaller(picture: F32) -> tuple[F32, float]:
    import cv2

    height, width = picture.shape
    factor = max(1.0, max(height, width) / _COARSE)
    size = (max(round(width / factor), 1), max(round(height / factor), 1))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32), width / size[0]


def _proposals(stops: F32) -> list[Circle]:
    """Circles through the outlines of what is brighter than several levels, and the obvious guesses."""
    import cv2

    height, width = stops.shape
    rng = np.random.default_rng(1)
    half_w, half_h = width / 2, height / 2
    found = [
        Circle(half_w, half_h, min(half_w, half_h) * 0.97),
        Circle(half_w, half_h, max(half_w, half_h)),
        Circle(half_w, half_h, math.hypot(half_w, half_h)),
    ]
    if width > 1.5 * height or height > 1.5 * width:
        reach = min(max(half_w, half_h) / 2, min(half_w, half_h))
        for side in (-0.5, 0.5):
            x, y = (half_w * (1 + side), half_h) if width > height else (half_w, half_h * (1 + side))
            found.append(Circle(x, y, reach))
    top = float(np.quantile(stops, 0.7))
    for level in np.linspace(0.06, 0.9, _LEVELS) * top:
        mask = cv2.morphologyEx((stops > level).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        for outline in outlines:
            if len(outline) < 0.4 * min(width, height):
                continue
            points = outline[:, 0, :].astype(np.float64) + 0.5
            x, y = points.T
            points = points[(x > 2) & (x < width - 2) & (y > 2) & (y < height - 2)]
            found += _through(points, (width, height), rng)
    return found


def _through(points: F64, size: tuple[int, int], rng: np.random.Generator) -> list[Circle]:
    """Up to three circles that many points of an outline lie on (random samples of three)."""
    found = []
    for _ in range(3):
        if len(points) < 0.25 * min(size):
            break
        a, b, c = (points[rng.integers(0, len(points), _TRIALS)] for _ in range(3))
        circles = _of_three(a, b, c)
        x, y, radius = circles.T
        fits = (radius > 0.12 * min(size)) & (radius < 0.8 * math.hypot(*size))
        fits &= (np.abs(x / size[0] - 0.5) < 0.75) & (np.abs(y / size[1] - 0.5) < 0.75)
        circles = circles[fits]
        if not len(circles):
            break
        some = points[:: max(1, len(points) // 400)]
        off = np.hypot(*(some[None] - circles[:, None, :2]).transpose(2, 0, 1)) - circles[:, 2:]
        best = circles[np.argmax((np.abs(off) < 1.2).sum(axis=1))]
        found.append(Circle(*(float(value) for value in best)))
        points = points[np.abs(np.hypot(*(points - best[:2]).T) - best[2]) > 3]
    return found


def _of_three(a: F64, b: F64, c: F64) -> F64:
    """(n, 3) centres and radii of the circles through three points each (n, 2)."""
    u, v = b - a, c - a
    cross = 2 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    cross = np.where(np.abs(cross) < 1e-9, np.nan, cross)
    uu, vv = (u * u).sum(axis=1), (v * v).sum(axis=1)
    x = (v[:, 1] * uu - u[:, 1] * vv) / cross
    y = (u[:, 0] * vv - v[:, 0] * uu) / cross
    made = np.stack([a[:, 0] + x, a[:, 1] + y, np.hypot(x, y)], axis=1)
    return np.asarray(made[np.isfinite(made).all(axis=1)], np.float64)


def _inside(light: F32, stops: F32, circle: Circle) -> list[_Scored]:
    """Other edges a little inside of one: of a rim, or where flare pulled it out to one side."""
    tried = [_refined(light, stops, _shrunk(circle, by), AGAIN) for by in (0.975, 0.95)]
    return tried + [_refined(light, stops, _shrunk(circle, by), CLOSE) for by in steps_inside(stops, circle)]


def _shrunk(circle: Circle, by: float) -> Circle:
    return Circle(circle.x, circle.y, circle.radius * by)


def _refined(light: F32, stops: F32, circle: Circle, windows: Sequence[float]) -> _Scored:
    fit = fitted(light, circle, windows)
    made = _scored(stops, fit.circle, 360)
    return replace(made, edge=min(fit.seen / max(made.seen, 0.02), 1.0), spread=fit.spread)


def _scored(stops: F32, circle: Circle, around: int) -> _Scored:
    """How much a circle looks like a lens' edge in a picture of stops above darkness."""
    inside = rings(stops, circle, np.linspace(0.89, 0.985, 9), around)
    outside = rings(stops, circle, np.linspace(1.015, 1.09, 7), around)
    beyond = rings(stops, circle, np.linspace(1.03, 1.4, 8), around)
    valid = ~(np.isnan(inside).any(axis=1) | np.isnan(outside[:, :2]).any(axis=1))
    if np.count_nonzero(valid) < 0.03 * around:
        return _Scored(circle)
    inside, outside, beyond = inside[valid], outside[valid], beyond[valid]
    within = np.median(inside, axis=1)
    drop = within - np.nanmedian(outside, axis=1)
    lit = within >= 0.25 * np.median(within)
    rest = np.nanmean(np.where(np.isnan(beyond), outside[:, 1:2], beyond), axis=1)
    dark = 1 - float(np.mean(np.clip(rest[lit] / np.maximum(within[lit], 0.1), 0, 1)))
    details = [float(changes(ring).mean()) for ring in (inside[:, 5:], outside[:, :4])]
    detail = (details[0] - details[1]) / (details[0] + details[1] + 0.1)
    return _Scored(circle, float(np.clip(drop, -1, 4).mean()), detail, dark, float(valid.mean()))


def _distinct(circles: list[_Scored]) -> list[_Scored]:
    """The best first, without those that are nearly a better one."""
    kept: list[_Scored] = []
    for one in sorted(circles, key=lambda c: -c.score):
        if all(_apart(one.circle, other.circle) > 0.015 for other in kept):
            kept.append(one)
    return kept


def _innermost(best: _Scored, found: list[_Scored], stops: F32) -> _Scored:
    """`best`, or the edge a little inside of it where nothing is to be seen between: `best` is a rim's."""
    for one in sorted(found, key=lambda o: o.circle.radius):
        inner, outer = one.circle, best.circle
        within = math.hypot(inner.x - outer.x, inner.y - outer.y) < 0.04 * outer.radius
        if not within or not 0.8 * outer.radius < inner.radius < 0.99 * outer.radius:
            continue
        if one.edge > 0.6 * max(best.edge, 0.6) or (one.edge > 0.08 and _empty_between(stops, inner, outer)):
            return one
    return best


def _empty_between(stops: F32, inner: Circle, outer: Circle) -> bool:
    """Whether a dark gap lies between two circles, or little is to be seen there against the inside."""
    first, last = 1.012, outer.radius / inner.radius - 0.012
    if last <= first:
        return False
    profile = rings(stops, inner, np.linspace(0.96, outer.radius / inner.radius * 0.995, 24), 360)
    profile = profile[~np.isnan(profile).any(axis=1)]
    inside = np.median(profile[:, :6], axis=1)[:, None]
    behind = np.maximum.accumulate(profile[:, ::-1], axis=1)[:, ::-1]
    gap = (np.minimum(inside, behind) - profile)[:, 6:].max(axis=1)
    if len(gap) and np.mean(gap > 0.5) > 0.5:
        return True
    seen = changes(rings(stops, inner, np.linspace(0.94, 0.985, 5), 360)).mean()
    between = changes(rings(stops, inner, np.linspace(first, last, 5), 360)).mean()
    return bool(seen > 0.05 and between < 0.55 * seen)


def _apart(first: Circle, second: Circle) -> float:
    """The largest distance between two circles' edges, in radii of the second."""
    centres = math.hypot(first.x - second.x, first.y - second.y)
    return (centres + abs(first.radius - second.radius)) / second.radius


def _chosen(found: list[_Scored], count: int | None, width: int, height: int, stops: F32) -> list[_Scored]:
    best = _innermost(found[0], found, stops)
    if count == 1 or (count is None and max(width, height) < 1.4 * min(width, height)):
        return [best]
    pairs = [
        (one, other)
        for i, one in enumerate(found)
        for other in found[i + 1 :]
        if abs(one.circle.radius / other.circle.radius - 1) < 0.15
        and math.hypot(one.circle.x - other.circle.x, one.circle.y - other.circle.y)
        > 0.85 * (one.circle.radius + other.circle.radius)
    ]
    if pairs:
        pair = max(pairs, key=lambda p: p[0].score + p[1].score)
        pair = (_innermost(pair[0], found, stops), _innermost(pair[1], found, stops))
        if count == 2 or min(p.score for p in pair) > 0.6 * best.score:
            across = abs(pair[0].circle.x - pair[1].circle.x) >= abs(pair[0].circle.y - pair[1].circle.y)
            return sorted(pair, key=lambda p: p.circle.x if across else p.circle.y)
    if count is None:
        return [best]
    mirrored = Circle(width - best.circle.x, height - best.circle.y, best.circle.radius)
    pair = (best, _Scored(mirrored))
    return sorted(pair, key=lambda p: p.circle.x if width >= height else p.circle.y)


def _confidence(one: _Scored, others: list[_Scored]) -> float:
    """0 … 1 that centre and radius are right within a hundredth, by a logistic model (`_WEIGHTS`)."""
    if one.edge <= 0:
        return 0.02
    return 1 / (1 + math.exp(-sum(w * e for w, e in zip(_WEIGHTS, _evidence(one, others), strict=True))))


def _evidence(one: _Scored, others: list[_Scored]) -> tuple[float, ...]:
    """What speaks for a circle: 1, then numbers of about 0 … 1."""
    rivals = [o for o in others if o is not one and _overlap(o.circle, one.circle)]
    outer = [o for o in rivals if o.circle.radius > 1.01 * one.circle.radius]
    inner = [o for o in rivals if o.circle.radius < 0.99 * one.circle.radius]

    def against(some: list[_Scored]) -> float:
        return min(max((o.score for o in some), default=0.0) / max(one.score, 1e-3), 1.5)

    return (
        1.0,
        one.edge,
        min(one.drop, 3.0) / 3,
        one.detail,
        one.dark,
        min(one.seen / 0.5, 1.0),
        min(one.spread / 0.004, 1.5),
        against(outer),
        against(inner),
        against([o for o in rivals if o not in outer and o not in inner]),
    )


def _overlap(first: Circle, second: Circle) -> bool:
    """Whether they cannot both be a lens' circle."""
    return math.hypot(first.x - second.x, first.y - second.y) < 0.85 * (first.radius + second.radius)
