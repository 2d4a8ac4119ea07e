"""Reflections of the lens' frame over many simulated captures, from phones that nothing was tuned on.

Both lenses' light is exact but for its pixels and some noise; they are registered as in a capture. An arc is
found where rectangles cover half of its azimuths at least; a rectangle is right where half of it at least
(without its margins) is on an arc.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report
from studio.bench.phone import Arc, Phone, lens_light
from studio.bench.phone_random import random_phone
from studio_core.capturing.artifacts import View
from studio_core.capturing.settings import SIDES, Patch
from studio_core.shading.job import Job

F32 = npt.NDArray[np.float32]
STRONG = 0.7
"""Stops, from which an arc must be found."""
NOISE = 0.01
MARGIN = 2.0
FIRST = 9000
"""Seed of the first phone."""


@dataclass
class Count:
    """Of all captures so far."""

    strong: int = 0
    found: int = 0
    rectangles: int = 0
    right: int = 0
    clean: int = 0
    touched: int = 0
    untrusted: int = 0

    def add(self, arcs: Sequence[Arc], patches: Sequence[Patch]) -> None:
        """One more capture."""
        strong = [arc for arc in arcs if arc.stops > STRONG]
        self.strong += len(strong)
        self.found += sum(share(azimuths(arc), on(patches, arc.side)) >= 0.5 for arc in strong)
        self.rectangles += len(patches)
        self.right += sum(share(inner(patch), on(arcs, patch.side)) >= 0.5 for patch in patches)
        if not arcs:
            self.clean += 1
            self.touched += bool(patches)


def measure(report: Report, job: Job, rooms: Mapping[str, F32], captures: int, radius: float = 200.0) -> None:
    """Rows `reflections`: a third of the captures have no arcs."""
    count, details = Count(), []
    for index in range(captures):
        job.checkpoint(index, captures)
        name = list(rooms)[index % len(rooms)]
        phone = random_phone(FIRST + index, tuned=False, radius=radius, reflections=index % 3 > 0)
        patches, trusted = detected(rooms[name], phone, index)
        count.add(phone.arcs, patches)
        count.untrusted += not trusted
        details.append(
            {
                "map": name,
                "fov": phone.lens.fov,
                "parallax": phone.parallax,
                "trusted": trusted,
                "arcs": [[a.side, a.azimuth, a.width, a.stops] for a in phone.arcs],
                "rectangles": [[p.side, p.azimuth + p.width / 2, p.width, p.excess] for p in patches],
            }
        )
    report.add("reflections", "reflection_recall", count.found / max(count.strong, 1), "1")
    report.add("reflections", "reflection_precision", count.right / max(count.rectangles, 1), "1")
    report.add("reflections", "clean_touched", count.touched / max(count.clean, 1), "1")
    report.add("reflections", "arcs", count.strong, "1")
    report.add("reflections", "captures", captures, "1")
    report.add("reflections", "unregistered", count.untrusted / captures, "1")
    report.details["reflections"] = details


def detected(room: F32, phone: Phone, seed: int) -> tuple[tuple[Patch, ...], bool]:
    """The rectangles of a capture, and whether its lenses could be registered."""
    from studio_core.capturing.settings import LensSettings, ReflectionSettings, RegistrationSettings
    from studio_plugins.capture.reflections import find_reflections
    from studio_plugins.capture.register import register

    truth = lens_light(room, phone, seed)
    rng = np.random.default_rng([seed, 4])
    fov = float(round(phone.lens.fov / 5) * 5)
    settings = LensSettings(model=phone.lens.model, fov=fov, coefficients=phone.lens.coefficients)
    front, back = (_noisy(truth.view(side), phone.lens.with_fov(fov), rng) for side in SIDES)
    job = Job("reflections")
    registration = register(front, back, RegistrationSettings(), settings, job)
    front = replace(front, lens=registration.lens, circle=registration.front or front.circle)
    back = replace(back, lens=registration.lens, circle=registration.back or back.circle)
    patches = find_reflections(front, back, registration, ReflectionSettings(), job)
    return patches, registration.trusted


def _noisy(view: View, lens: object, rng: np.random.Generator) -> View:
    light = view.light * (1 + NOISE * rng.standard_normal(view.light.shape, np.float32))
    return replace(view, light=np.maximum(light, 0).astype(np.float32), lens=lens)  # type: ignore[arg-type]


def azimuths(arc: Arc) -> npt.NDArray[np.bool_]:
    """(360,) degrees that an arc covers."""
    return _span(arc.azimuth - arc.width / 2, arc.width)


def inner(patch: Patch) -> npt.NDArray[np.bool_]:
    """(360,) degrees that a rectangle covers, without its margins."""
    margin = min(MARGIN, patch.width / 4)
    return _span(patch.azimuth + margin, patch.width - 2 * margin)


def on(parts: Iterable[Arc | Patch], side: str) -> npt.NDArray[np.bool_]:
    """(360,) degrees of a side that arcs or rectangles cover together."""
    made = np.zeros(360, bool)
    for part in parts:
        if part.side == side:
            made |= azimuths(part) if isinstance(part, Arc) else inner(part)
    return made


def share(part: npt.NDArray[np.bool_], covered: npt.NDArray[np.bool_]) -> float:
    """Of a part's degrees: how many are covered."""
    return float((part & covered).sum() / max(part.sum(), 1))


def _span(start: float, width: float) -> npt.NDArray[np.bool_]:
    return np.asarray((np.arange(360) + 0.5 - start) % 360 < width, bool)
