"""Which part of the photographs is which lens': circles found, and two of them in one picture taken apart."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

from studio_core.capturing.artifacts import Bracket, Brackets, FoundCircle
from studio_core.capturing.settings import BACK, DUAL, EQUIRECTANGULAR, FRONT
from studio_core.errors import InputError
from studio_core.imaging.projection import Circle
from studio_core.shading.job import Job
from studio_plugins.capture.circle import find_circles
from studio_plugins.capture.progress import StageJob

_AROUND = 0.06
"""Kept around a circle that is cut out, of its radius."""
_NONE = 0.1
"""Confidence below which there is no circle: the lens fills the picture, and is at home in its corners."""
_UNLIKE = 0.04
"""Of the radius: one lens on one phone has its circle in nearly the same place in both shots."""
_SURER = 0.15
_LENT = 0.45
"""Confidence in a circle that was taken from the other side, at most: it should be looked at."""


def cut_out(brackets: Brackets, job: Job) -> tuple[dict[str, Bracket], dict[str, FoundCircle]]:
    """A bracket for each lens, and its circle in the bracket's pictures (none in equirectangular ones).

    Of two circles in one picture the left one, or the upper one, is the front.
    """
    if brackets.layout == EQUIRECTANGULAR:
        return dict(brackets.sides), {}
    if brackets.layout == DUAL:
        return _two(brackets.sides[FRONT], job)
    found = {}
    for place, (side, bracket) in enumerate(brackets.sides.items()):
        part = StageJob(job, place / len(brackets.sides), 1 / len(brackets.sides))
        one = find_circles([shot.pixels for shot in bracket.shots], 1, part)[0]
        found[side] = one if one.confidence >= _NONE else _whole(bracket)
    return dict(brackets.sides), _alike(found, brackets.sides)


def _alike(found: dict[str, FoundCircle], sides: Mapping[str, Bracket]) -> dict[str, FoundCircle]:
    """A circle that is unlike the other side's and less sure takes the other's place: it is the same lens."""
    if set(found) != {FRONT, BACK} or sides[FRONT].shots[0].size != sides[BACK].shots[0].size:
        return found
    less, more = sorted((FRONT, BACK), key=lambda side: found[side].confidence)
    one, other = found[less], found[more]
    off = max(abs(getattr(one.circle, a) - getattr(other.circle, a)) for a in ("x", "y", "radius"))
    if off < _UNLIKE * other.circle.radius or other.confidence < one.confidence + _SURER:
        return found
    return {**found, less: FoundCircle(other.circle, min(other.confidence, _LENT))}


def _whole(bracket: Bracket) -> FoundCircle:
    width, height = bracket.shots[0].size
    return FoundCircle(Circle(width / 2, height / 2, math.hypot(width, height) / 2), 0.0)


def _two(bracket: Bracket, job: Job) -> tuple[dict[str, Bracket], dict[str, FoundCircle]]:
    circles = find_circles([shot.pixels for shot in bracket.shots], 2, job)
    if len(circles) != 2:
        name = bracket.shots[0].facts.name
        raise InputError(f"{name} was to show two circles, but only {len(circles)} can be found in it.")
    apart_x, apart_y = (abs(getattr(circles[0].circle, a) - getattr(circles[1].circle, a)) for a in "xy")
    first_to_last = sorted(circles, key=lambda one: one.circle.x if apart_x >= apart_y else one.circle.y)
    sides, found = {}, {}
    for side, one in zip((FRONT, BACK), first_to_last, strict=True):
        sides[side], found[side] = _cut(bracket, one)
    return sides, found


def _cut(bracket: Bracket, found: FoundCircle) -> tuple[Bracket, FoundCircle]:
    width, height = bracket.shots[0].size
    circle, reach = found.circle, found.circle.radius * (1 + _AROUND)
    left, top = max(math.floor(circle.x - reach), 0), max(math.floor(circle.y - reach), 0)
    right, bottom = min(math.ceil(circle.x + reach), width), min(math.ceil(circle.y + reach), height)
    shots = tuple(
        dataclasses.replace(shot, pixels=shot.pixels[top:bottom, left:right]) for shot in bracket.shots
    )
    inside = Circle(circle.x - left, circle.y - top, circle.radius)
    return dataclasses.replace(bracket, shots=shots), dataclasses.replace(found, circle=inside)
