"""The edge of a lens' image in a picture: light roughly undone from numbers, rings around a circle, the fit.

All lengths are pixels of the picture that is given; angles go clockwise as seen, from the right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.imaging.projection import Circle

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

_GAMMA = 2.2
_FOOT = 0.22  # of the light inside, at which the edge is looked for
_AROUND = 720  # directions of a fit
_TRIALS = 200
_PIXEL = 0.6  # width of a sharp edge between a fifth and four fifths of the light, as pixels show it
_TO_FOOT = 0.67  # of the way between a fifth and four fifths of the light, from the fifth to where it ends


def rough_light(pictures: Sequence[npt.NDArray[Any]], longest: int) -> tuple[F32, float]:
    """(h, w) light of exposures of one view, any unit, and how many times smaller it is.

    Bytes and 16 bit are taken for a power of light, exposures from what two frames both show: good for
    telling dark from bright, not for measuring.
    """
    import cv2

    height, width = pictures[0].shape[:2]
    factor = max(1.0, max(height, width) / longest)
    size = (max(round(width / factor), 1), max(round(height / factor), 1))
    lights, weights = [], []
    for picture in pictures:
        small = cv2.resize(np.ascontiguousarray(picture[..., :3]), size, interpolation=cv2.INTER_AREA)
        small = small.astype(np.float32)
        if picture.dtype.kind == "f":
            light = np.nan_to_num(small, nan=0.0, posinf=0.0, neginf=0.0).mean(axis=2)
            lights.append(np.maximum(light, 0))
            weights.append(np.ones_like(light))
            continue
        number = small.mean(axis=2) / np.float32(np.iinfo(picture.dtype).max)
        lights.append(number**_GAMMA)
        weights.append(
            np.where(small.max(axis=2) < 0.97 * np.iinfo(picture.dtype).max, number * (1 - number), 0)
        )
    order = sorted(range(len(lights)), key=lambda i: float(lights[i].mean()))
    total, weight, gain = np.zeros_like(lights[0]), np.zeros_like(lights[0]), 1.0
    for place, index in enumerate(order):
        if place:
            gain *= _brighter(order[place - 1], index, lights, weights)
        # what is clipped or black everywhere is still told by the darkest and the brightest frame
        least = 1e-4 if place in (0, len(order) - 1) else 1e-6
        part = weights[index] + np.float32(least)
        total += part * (lights[index] / np.float32(gain))
        weight += part
    return np.asarray(total / weight, np.float32), width / size[0]


def _brighter(first: int, second: int, lights: list[F32], weights: list[F32]) -> float:
    both = (weights[first] > 0.03) & (weights[second] > 0.03)
    if np.count_nonzero(both) < 50:
        return 4.0 if lights[second].mean() > 1.05 * lights[first].mean() else 1.0
    return max(float(np.median(lights[second][both] / lights[first][both])), 1.0)


def in_stops(light: F32) -> F32:
    """log2 of light above its darkness: 0 where nothing but noise is, however dark the room."""
    import cv2

    light = np.asarray(cv2.GaussianBlur(light, (0, 0), 0.8), np.float32)
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6
    rough = np.abs(cv2.filter2D(light, -1, kernel))
    dark = light <= np.quantile(light, 0.2)
    noise = float(np.median(rough[dark])) / 0.6745
    black = float(np.quantile(light, 0.01))
    bright = float(np.quantile(light, 0.75)) - black
    floor = max(12 * noise, 0.004 * bright, 1e-12)  # the blur leaves noise that the mask hardly sees
    return np.asarray(np.log2(np.maximum(light - np.float32(black), 0) / np.float32(floor) + 1), np.float32)


def rings(picture: F32, circle: Circle, reach: npt.NDArray[Any], around: int) -> F32:
    """(around, len(reach)): the picture at these distances, in radii, all around; NaN outside of it."""
    import cv2

    angle = 2 * np.pi * np.arange(around) / around
    distance = circle.radius * np.asarray(reach)
    x = circle.x + np.cos(angle)[:, None] * distance - 0.5
    y = circle.y + np.sin(angle)[:, None] * distance - 0.5
    height, width = picture.shape
    made = cv2.remap(
        picture, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    outside = (x < -0.5) | (x > width - 0.5) | (y < -0.5) | (y > height - 0.5)
    made[outside] = np.nan
    return np.asarray(made, np.float32)


@dataclass(frozen=True)
class Fit:
    """A circle, the share of all directions in which its edge is seen, and how far these are from it
    (median, in radii)."""

    circle: Circle
    seen: float
    spread: float


WIDE, AGAIN, CLOSE = (0.05, 0.03, 0.02, 0.012, 0.012), (0.03, 0.02, 0.012, 0.009), (0.012, 0.009, 0.009)


def fitted(light: F32, circle: Circle, windows: Sequence[float] = WIDE) -> Fit:
    """The circle whose edge is where light ends, near `circle`: robust, below a pixel.

    `windows`: how far from the circle the edge is looked for, in radii, step by step.
    """
    found, wide = Fit(circle, 0.0, 1.0), _PIXEL
    for window in windows:
        angle, edge, width, contrast = _edges(light, found.circle, window)
        if len(angle) < 0.04 * _AROUND:
            continue  # the picture's border may leave room for a narrower window
        radius = found.circle.radius
        close = max(0.004 * radius, 1.2)
        sharp = max(float(np.quantile(width, 0.2)), _PIXEL)
        weight = contrast / (1 + (width / (2.5 * sharp)) ** 2)  # flare fades, an edge ends
        change = _circle_step(angle, edge, weight, window * radius, close)
        moved = Circle(found.circle.x + change[0], found.circle.y + change[1], radius + change[2])
        off = np.abs(edge - (change[2] + np.cos(angle) * change[0] + np.sin(angle) * change[1]))
        near = (off < close) & (width < 4 * sharp)
        spread = float(np.median(off[near])) / radius if near.any() else 1.0
        found = Fit(moved, float(np.count_nonzero(near)) / _AROUND, spread)
        wide = max(float(np.median(width[near])), _PIXEL) if near.any() else _PIXEL
    if not found.seen:
        return Fit(circle, 0.0, 1.0)
    soft = math.sqrt(wide**2 - _PIXEL**2)
    c = found.circle
    radius = (
        c.radius + _TO_FOOT * soft - 0.28 * _PIXEL / wide
    )  # a pixel shows what lies half of it further in
    return Fit(Circle(float(c.x), float(c.y), float(radius)), found.seen, found.spread)


def _edges(light: F32, circle: Circle, window: float) -> tuple[F64, F64, F64, F64]:
    """Directions in which light ends near the circle: angle, distance outside it, width of the edge,
    and contrast (0 … 1). Lengths in pixels."""
    steps = int(np.clip(2 * window * circle.radius * 2 * 2.2, 40, 400))
    reach = np.linspace(1 - 2.2 * window, 1 + 2.2 * window, steps)
    profile = rings(light, circle, reach, _AROUND)
    inner, outer = reach < 1 - window, reach > 1 + window
    with np.errstate(invalid="ignore"):
        known = ~np.isnan(profile).any(axis=1)
    profile, angle = profile[known], 2 * np.pi * np.flatnonzero(known) / _AROUND
    if not len(profile):
        empty = np.zeros(0)
        return empty, empty, empty, empty
    inside, outside = np.median(profile[:, inner], axis=1), np.median(profile[:, outer], axis=1)
    step = inside - outside
    contrast = step / np.maximum(inside + outside, 1e-12)
    levels = []
    for share in (_FOOT, 0.8):
        level = outside + share * step
        below = profile < level[:, None]
        levels.append(_last_fall(profile, below, level, reach, inner, outer))
    foot, top = levels
    good = (contrast > 0.25) & np.isfinite(foot) & np.isfinite(top)
    width = (foot - top) * circle.radius
    return angle[good], ((foot - 1) * circle.radius)[good], width[good], contrast[good]


def _last_fall(
    profile: F32, below: npt.NDArray[np.bool_], level: F32, reach: F64, inner: Any, outer: Any
) -> F64:
    """The distance, in radii, after which the profile stays below its level; NaN when there is none."""
    above = ~below
    above[:, outer] = False
    last = above.shape[1] - 1 - np.argmax(above[:, ::-1], axis=1)
    rows = np.arange(len(profile))
    none = ~above.any(axis=1) | (last >= len(reach) - 1)
    last = np.minimum(last, len(reach) - 2)
    a, b = profile[rows, last], profile[rows, last + 1]
    part = np.clip((a - level) / np.where(a > b, a - b, 1), 0, 1)
    made = reach[last] + part * (reach[1] - reach[0])
    made[none | inner[last]] = np.nan
    return np.asarray(made, np.float64)


def _circle_step(angle: F64, edge: F64, contrast: F64, window: float, close: float) -> F64:
    """(x, y, radius) by which the circle is to change so that most directions' edges are on it.

    Begun with the best of random threes, for flare can hide more than half of the edge; then by weights.
    """
    lines = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], axis=1)
    rng = np.random.default_rng(len(angle))
    threes = rng.integers(0, len(angle), (_TRIALS, 3))
    threes = threes[np.abs(np.linalg.det(lines[threes])) > 0.05]
    change = np.zeros(3)
    if len(threes):
        tried = np.linalg.solve(lines[threes], edge[threes][..., None])[..., 0]
        tried = np.concatenate([np.zeros((1, 3)), tried[np.abs(tried).max(axis=1) < 1.5 * window]])
        some = slice(None, None, max(1, len(angle) // 240))
        off = np.abs(edge[some] - tried @ lines[some].T)
        change = tried[
            np.argmax((np.minimum(1, close / np.maximum(off, 1e-9)) ** 2 * contrast[some]).sum(axis=1))
        ]
    hold = np.diag([1e-3, 1e-3, 1e-3])  # what a short arc leaves open stays
    for scale in (2.0, 1.5, 1.0, 0.7, 0.5, 0.4, 0.4, 0.4):
        off = edge - lines @ change
        weight = contrast / (1 + (off / (scale * close)) ** 2) ** 2
        step = np.linalg.solve((lines * weight[:, None]).T @ lines + hold, lines.T @ (weight * off))
        change = change + step
    return np.asarray(np.clip(change, -1.5 * window, 1.5 * window), np.float64)


def steps_inside(stops: F32, circle: Circle) -> list[float]:
    """Where light or detail ends too, on circles about the same centre: radii, in radii.

    A shiny rim ends the light further out than the picture does, but nothing can be seen in it.
    """
    reach = np.arange(0.82, 1.0, 0.003)
    profile = rings(stops, circle, reach, 360)
    known = ~np.isnan(profile).any(axis=1)
    if np.count_nonzero(known) < 40:
        return []
    fall = profile[known, :-4] - profile[known, 4:]  # over 1.2 % of the radius
    darker = np.quantile(np.clip(fall, -2, 3), (0.3, 0.5), axis=0).mean(axis=0)
    detail = np.convolve(changes(profile), np.full(4, 0.25), mode="same")
    before, after = detail[:-8], detail[8:]
    emptier = np.where(after < 0.6 * before, before - after, 0.0)[2:-2]
    made = [*_peaks(darker, 0.3, reach[:-4] + 0.006), *_peaks(emptier, 0.03, reach[2:-10] + 0.012)]
    return [r for r in made if r < 0.988]


def changes(profile: F32) -> F64:
    """(n,) how much there is to be seen in rings (around, n): mean change over 4°, in stops, at most 2."""
    change = np.minimum(np.abs(np.roll(profile, -max(1, len(profile) // 90), axis=0) - profile), 2)
    seen = ~np.isnan(change)
    total = np.where(seen, change, 0).sum(axis=0, dtype=np.float64)
    return np.asarray(total / np.maximum(seen.sum(axis=0), 1), np.float64)


def _peaks(values: F64, least: float, at: F64) -> list[float]:
    found = [
        i
        for i in range(1, len(values) - 1)
        if values[i] >= values[i - 1] and values[i] > values[i + 1] and values[i] > least
    ]
    return [float(at[i]) for i in sorted(found, key=lambda i: -values[i])[:3]]
