"""Reflections of the lens' frame: found, and what is left of them, when it is known how the lenses stand.

As `capture_reflections`, but the stages get the true stand about as well as registration shall find it, so
that figures are those of finding and removing alone. Counted are arcs as they are seen: runs of azimuth where
the outermost 3° are brighter by 0.15 stops, at least 5° wide, as strong as the median of where they have half
of their strength. An arc is found when rectangles cover half of its azimuths; a rectangle is right when half
of its azimuths have 0.1 stops. Every capture is also searched without its reflections: there, any rectangle
is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report
from studio.bench.phone import Phone, SideTruth, Truth, lens_light
from studio.bench.phone_random import random_phone
from studio_core.capturing.artifacts import Registration, View
from studio_core.capturing.settings import (
    BACK,
    FRONT,
    SIDES,
    Patch,
    ReflectionSettings,
)
from studio_core.capturing.standing import euler
from studio_core.imaging.projection import Lens, pixel_points, unproject
from studio_core.shading.job import Job

F32 = npt.NDArray[np.float32]
STRONG, SEEN, RIGHT = 0.7, 0.15, 0.1  # stops
NARROWEST = 5.0  # degrees
CASE = "reflections-known-stand"
_STEP = 0.5  # degrees of azimuth


@dataclass
class Tally:
    """Counts over captures; `left` and `before` (mean |log2| error inside right rectangles)."""

    strong: int = 0
    strong_found: int = 0
    weak: int = 0
    weak_found: int = 0
    rectangles: int = 0
    right: int = 0
    searched: int = 0
    touched: int = 0
    before: list[float] = field(default_factory=list)
    left: list[float] = field(default_factory=list)
    missed: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)

    def rows(self) -> dict[str, float]:
        """Metrics by name; nan where nothing was counted."""

        def share(part: int, whole: int) -> float:
            return part / whole if whole else math.nan

        return {
            "reflection_recall": share(self.strong_found, self.strong),
            "reflection_weak_recall": share(self.weak_found, self.weak),
            "reflection_precision": share(self.right, self.rectangles),
            "clean_touched": share(self.touched, self.searched),
            "arcs": float(self.strong),
            "captures": float(self.searched),
            "stops_before": float(np.mean(self.before)) if self.before else math.nan,
            "stops_left": float(np.mean(self.left)) if self.left else math.nan,
        }


def measure(
    report: Report,
    job: Job,
    rooms: Mapping[str, F32],
    captures: int,
    radius: float = 200.0,
    tuned: bool = False,
) -> Tally:
    """Rows `reflections-known-stand` over captures of the maps in turn, turned and mirrored at random.

    tuned: of the phones that the method was tuned on, not the others.
    """
    tally = Tally()
    names = list(rooms)
    for seed in range(captures):
        job.checkpoint(seed, captures)
        name = names[seed % len(names)]
        phone = random_phone(seed, tuned, radius=radius)
        add(tally, lens_light(turned(rooms[name], seed), phone, seed), seed, f"{name} {seed}")
    for metric, figure in tally.rows().items():
        report.add(CASE, metric, figure, "stop" if metric.startswith("stops") else "1")
    report.details[CASE] = {"missed": tally.missed, "wrong": tally.wrong}
    return tally


def turned(room: F32, seed: int) -> F32:
    """The room seen from elsewhere: turned about the vertical by any angle, half of them mirrored."""
    rng = np.random.default_rng([seed, 5])
    made = np.roll(room, int(rng.integers(room.shape[1])), axis=1)
    return np.ascontiguousarray(made[:, ::-1] if rng.random() < 0.5 else made)


def add(tally: Tally, truth: Truth, seed: int, name: str) -> None:
    """One capture, with its reflections (if it has some) and without."""
    from studio_plugins.capture.reflections import find_reflections
    from studio_plugins.capture.removal import remove

    settings, job = ReflectionSettings(), Job("reflections")
    tally.searched += 1
    views, registration = known(truth, True, seed)
    wrong = find_reflections(views[FRONT], views[BACK], registration, settings, job)
    tally.touched += bool(wrong)
    tally.wrong += [f"{name} clean: {told(patch)}" for patch in wrong]
    if not truth.phone.arcs:
        return
    views, registration = known(truth, False, seed)
    patches = find_reflections(views[FRONT], views[BACK], registration, settings, job)
    lights = remove(views, registration, patches, job).lights
    for side in SIDES:
        mine = [patch for patch in patches if patch.side == side]
        _count(tally, truth.side(side), truth.phone, mine, name)
        for patch in mine:
            inside = _inside(views[side], patch)
            if truth.side(side).stops[inside].mean() > RIGHT:
                clean = truth.side(side).clean
                tally.before.append(_off(views[side].light, clean, inside))
                tally.left.append(_off(lights[side], clean, inside))


def known(truth: Truth, clean: bool, seed: int) -> tuple[dict[str, View], Registration]:
    """The truth, but for 0.2° of rotation, 0.2 % of the field of view, 5 % of gain and of falloff."""
    rng = np.random.default_rng([seed, 9])
    phone = truth.phone
    rotation = euler(*rng.normal(0, 0.12, 3)) @ truth.rotation
    gain = np.exp(rng.normal(0, 0.05, 3))
    lens = phone.lens.with_fov(phone.lens.fov * (1 + rng.normal(0, 0.002)))
    lost = float(np.clip(phone.falloff + rng.normal(0, 0.05), 0, 0.9))
    s = np.linspace(0, 1, 64)
    light = replace(phone, falloff=lost).falloff_at(s) - 1
    a, b, c = np.linalg.lstsq(np.stack([s**2, s**4, s**6], axis=1), light, rcond=None)[0]
    registration = Registration(rotation, lens, gain, (float(a), float(b), float(c)), 0.2, 99, True)
    return _views(truth, clean, lens), registration


def _views(truth: Truth, clean: bool, lens: Lens) -> dict[str, View]:
    """Whole circles, their shaded rims too."""
    views = {}
    for side in SIDES:
        one = truth.side(side)
        light = one.clean if clean else one.light
        away = np.moveaxis(pixel_points(*light.shape[:2]) - (one.circle.x, one.circle.y), -1, 0)
        views[side] = View(light, np.hypot(*away) < one.circle.radius, one.circle, lens)
    return views


def arcs_of(side: SideTruth, phone: Phone) -> tuple[list[tuple[npt.NDArray[np.intp], float]], F32]:
    """Azimuths (in steps of 0.5°) and strength of the arcs that are seen; stops near the edge (720,)."""
    from studio_plugins.capture.ring import runs

    half = math.degrees(phone.lens.half)
    strip = _strip(side, phone, np.arange(half - 10, half - 1, 0.5))
    rim = np.median(strip[-5:], axis=0)
    found = []
    for start, length in runs(rim > SEEN):
        if length * _STEP >= NARROWEST:
            places = (start + np.arange(length)) % len(rim)
            stops = strip[:, places]
            core = stops[stops > 0.5 * np.percentile(stops, 95)]
            found.append((places, float(np.median(core))))
    return found, rim


def _strip(side: SideTruth, phone: Phone, theta: npt.NDArray[np.float64]) -> F32:
    from studio_core.capturing.looking import look
    from studio_plugins.capture.ring import Ring

    azimuth = (np.arange(round(360 / _STEP)) + 0.5) * math.radians(_STEP)
    stops = np.repeat(side.stops[:, :, None], 3, axis=2)
    view = View(stops, np.ones(side.stops.shape, np.bool_), side.circle, phone.lens)
    return look(view, Ring(np.radians(theta), azimuth).directions)[0][..., 0]


def _count(tally: Tally, side: SideTruth, phone: Phone, patches: Sequence[Patch], name: str) -> None:
    arcs, rim = arcs_of(side, phone)
    covered = np.zeros(len(rim), np.bool_)
    for patch in patches:
        places = (round(patch.azimuth / _STEP) + np.arange(round(patch.width / _STEP))) % len(rim)
        covered[places] = True
        right = bool((rim[places] > RIGHT).mean() >= 0.5)
        tally.rectangles += 1
        tally.right += right
        if not right:
            tally.wrong.append(f"{name}: {told(patch)}")
    for places, stops in arcs:
        found = bool(covered[places].mean() >= 0.5)
        if stops > STRONG:
            tally.strong += 1
            tally.strong_found += found
            if not found:
                tally.missed.append(f"{name} {places[0] * _STEP:.0f}° {len(places) * _STEP:.0f}° {stops:.2f}")
        else:
            tally.weak += 1
            tally.weak_found += found


def told(patch: Patch) -> str:
    """A rectangle in a few words."""
    return f"{patch.side} {patch.azimuth:.0f}° {patch.width:.0f}° {patch.excess:.2f} stops"


def _inside(view: View, patch: Patch) -> npt.NDArray[np.bool_]:
    from studio_plugins.capture.ring import angles, covers

    way, _ = unproject(view.lens, view.circle, pixel_points(*view.usable.shape))
    azimuth, theta = angles(way)
    return view.usable & covers(patch, azimuth, theta) & (theta < view.lens.half - math.radians(1))


def _off(light: F32, clean: F32, inside: npt.NDArray[np.bool_]) -> float:
    one, two = (np.maximum(picture[inside].mean(axis=1), 1e-9) for picture in (light, clean))
    return float(np.abs(np.log2(one / two)).mean())
