"""The stages of a capture in their order: photographs → light of each lens → one picture → calibrated light.

Every stage is a pure function of what came before and of one part of the settings, so a change recomputes
what follows it and nothing else. Two circles in one photograph become two brackets by cutting them out.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.capturing.artifacts import (
    Bracket,
    Brackets,
    CaptureState,
    Exposures,
    FoundCircle,
    LensLight,
    Motion,
    Reflections,
    Registration,
    Response,
    Stitched,
    View,
)
from studio_core.capturing.settings import BACK, EQUIRECTANGULAR, FRONT, CaptureSettings, LensSettings
from studio_core.contract import Services
from studio_core.errors import InputError
from studio_core.imaging.photograph import Photograph
from studio_core.imaging.projection import Circle, Lens
from studio_core.shading.job import Job
from studio_plugins.capture.level import Level
from studio_plugins.capture.progress import Kept, StageJob

T = TypeVar("T")
_SHARES = {
    "bracket": 0.02,
    "circles": 0.06,
    "motions": 0.22,
    "response": 0.10,
    "light": 0.24,
    "views": 0.01,
    "registration": 0.12,
    "reflections": 0.05,
    "level": 0.04,
    "stitch": 0.12,
    "calibration": 0.02,
}
STAGES = tuple(_SHARES)
"""In the order in which they run."""
_UNSURE = 0.5
_COARSE_FOV, _NUDGE = 10.0, 0.02


class FisheyeCapturer:
    """The capturer for phones with a clip-on fisheye, two-lens cameras and ready pictures."""

    label = "Fisheye photographs"

    def open(self, services: Services) -> FisheyeRun:
        """A run that remembers what its stages made."""
        return FisheyeRun(services)


class FisheyeRun:
    """One capture; see `studio_core.contract.CaptureRun`. `made`: stages that ran, in order, for counting."""

    def __init__(self, services: Services) -> None:
        self._services = services
        self._kept = Kept()

    @property
    def made(self) -> list[str]:
        """Names of the stages that ran since the run was opened."""
        return self._kept.made

    def run(
        self, photographs: Sequence[Photograph], settings: CaptureSettings, job: Job, until: str = ""
    ) -> CaptureState:
        """See `CaptureRun`."""
        return _Pass(self._kept, self._services, settings, job, until).run(tuple(photographs))


class _Reached(Exception):  # noqa: N818 - no error: the step that was asked for is done
    pass


class _Pass:
    """One walk through the stages."""

    def __init__(
        self, kept: Kept, services: Services, settings: CaptureSettings, job: Job, until: str
    ) -> None:
        self._kept, self._services, self._settings, self._until = kept, services, settings, until
        self._job, self._start = job, 0.0
        self._state = CaptureState()

    def run(self, photographs: tuple[Photograph, ...]) -> CaptureState:
        try:
            self._light(photographs)
            self._picture()
        except _Reached:
            pass
        return self._state

    # -- photographs → light of each lens

    def _light(self, photographs: tuple[Photograph, ...]) -> None:
        from studio_plugins.capture.bracket import arrange

        wanted = self._settings
        brackets = self._stage(
            "bracket", (photographs, wanted.bracket), lambda job: arrange(photographs, wanted.bracket, job)
        )
        self._tell(brackets=brackets, notes=brackets.notes)
        self._reached("bracket")

        cut, circles = self._stage("circles", (brackets,), lambda job: _cut(brackets, job))
        chosen = _by_hand(circles, wanted.lens)
        self._tell(circles=frozen_map(chosen), notes=_of_circles(chosen))
        lenses = _rough(circles, chosen, wanted.lens)

        def align(job: Job) -> dict[str, tuple[Motion, ...]]:
            return _motions(cut, lenses, wanted.radiance.align, job)

        motions = self._stage("motions", (cut, lenses, wanted.radiance.align), align)
        self._tell(notes=_of_motions(cut, motions))

        def solve(job: Job) -> tuple[Response, dict[str, Exposures]]:
            from studio_core.imaging.response import solve_response

            kind, source = wanted.radiance.response, wanted.radiance.exposures
            return solve_response(cut, motions, lenses, response=kind, exposures=source, job=job)

        how = (wanted.radiance.response, wanted.radiance.exposures)
        response, exposures = self._stage("response", (cut, motions, lenses, how), solve)
        told = tuple(note for one in exposures.values() for note in one.notes)
        self._tell(response=response, notes=(*response.notes, *told))

        workers = self._services.workers

        def merge(job: Job) -> dict[str, LensLight]:
            return _merged(cut, motions, response, exposures, lenses, wanted.radiance.ghosts, workers, job)

        inputs = (cut, motions, response, exposures, lenses, wanted.radiance.ghosts)
        lights = self._stage("light", inputs, merge)
        self._tell(lights=frozen_map(lights), notes=tuple(n for one in lights.values() for n in one.notes))
        self._reached("radiance")
        self._reached("lens")

    # -- light of each lens → one calibrated picture

    def _picture(self) -> None:
        from studio_plugins.capture.result import captured
        from studio_plugins.capture.stitch import level_of, stitch, stitch_equirectangular

        wanted, lights, circles = self._settings, self._state.lights, self._state.circles
        lens, layout = _lens(wanted.lens), self._state.brackets.layout if self._state.brackets else ""
        views = self._stage(
            "views",
            (tuple(lights.items()), tuple(circles.items()), lens),
            lambda job: {side: _view(light, circles.get(side), lens) for side, light in lights.items()},
        )
        registration: Registration | None = None
        if layout != EQUIRECTANGULAR:
            registration = self._stage(
                "registration",
                (views, wanted.registration, wanted.lens),
                lambda job: _registered(views, wanted, job),
            )
            self._tell(registration=registration, notes=registration.notes)
        self._reached("registration")

        def clean(job: Job) -> tuple[Reflections, Registration | None]:
            return _without_reflections(views, registration, wanted, job)

        inputs = (views, registration, wanted.reflections, wanted.lens)
        reflections, registration = self._stage("reflections", inputs, clean)
        self._tell(reflections=reflections, registration=registration, notes=reflections.notes)
        self._reached("reflections")

        workers, clean_views = self._services.workers, _clean(views, reflections)
        wants_level = wanted.stitch.level and layout != EQUIRECTANGULAR

        def upright(job: Job) -> Level | None:
            return level_of(clean_views, registration, job, workers) if wants_level else None

        # found once, however the picture is turned afterwards
        level = self._stage("level", (views, registration, reflections, wants_level), upright)

        def join(job: Job) -> Stitched:
            if layout == EQUIRECTANGULAR:
                return stitch_equirectangular(clean_views[FRONT], wanted.stitch, job, workers)
            return stitch(clean_views, registration, wanted.stitch, job, workers, level)

        joined = dataclasses.replace(wanted.stitch, face=0)  # the cube map is cut from the finished picture
        stitched = self._stage("stitch", (views, registration, reflections, level, joined), join)
        self._tell(stitched=stitched, notes=stitched.notes)
        self._reached("stitch")

        state = self._state
        result = self._stage(
            "calibration",
            (stitched, wanted.calibration, wanted.stitch.face),
            lambda job: captured(state, wanted, job),
        )
        self._tell(captured=result, notes=result.calibration.notes)

    # -- common

    def _stage(self, name: str, inputs: tuple[Any, ...], make: Callable[[Job], T]) -> T:
        share = _SHARES[name]
        job = StageJob(self._job, self._start, share)
        job.checkpoint(0, 1)
        made = self._kept.get(name, inputs, lambda: make(job))
        job.checkpoint(1, 1)
        self._start += share
        return made

    def _tell(self, notes: tuple[str, ...] = (), **made: Any) -> None:
        known = tuple(dict.fromkeys((*self._state.notes, *notes)))
        self._state = dataclasses.replace(self._state, notes=known, **made)
        self._job.publish(self._state)

    def _reached(self, step: str) -> None:
        if step == self._until:
            raise _Reached


def _lens(settings: LensSettings) -> Lens:
    try:
        return Lens(settings.model, settings.fov, settings.coefficients, settings.affine)
    except ValueError as error:
        raise InputError(f"The lens cannot be so: {error}.") from None


def _cut(brackets: Brackets, job: Job) -> tuple[dict[str, Bracket], dict[str, FoundCircle]]:
    from studio_plugins.capture.sides import cut_out

    return cut_out(brackets, job)


def _by_hand(found: Mapping[str, FoundCircle], settings: LensSettings) -> dict[str, FoundCircle]:
    """What a designer drew counts instead of what was found."""
    given: dict[str, Circle | None] = {"front": settings.front, "back": settings.back}
    return {
        side: one if given.get(side) is None else FoundCircle(given[side], 1.0, True)  # type: ignore[arg-type]
        for side, one in found.items()
    }


def _rough(
    found: Mapping[str, FoundCircle], chosen: Mapping[str, FoundCircle], settings: LensSettings
) -> dict[str, tuple[Circle, Lens]]:
    """Circles and lens to undo the hand's motion with.

    Its turns are small, so they are nearly the same for lenses and circles that are nearly the same: what is
    nudged by hand does not have everything aligned and merged again.
    """
    fov = min(max(round(settings.fov / _COARSE_FOV) * _COARSE_FOV, 100), 280)
    lens = _lens(dataclasses.replace(settings, fov=float(fov)))
    made = {}
    for side, one in chosen.items():
        before, now = found[side].circle, one.circle
        off = max(abs(before.x - now.x), abs(before.y - now.y), abs(before.radius - now.radius))
        made[side] = (before if off <= _NUDGE * before.radius else now, lens)
    return made


def _of_circles(circles: Mapping[str, FoundCircle]) -> tuple[str, ...]:
    return tuple(
        f"No circle is seen in the {side} pictures: the lens was taken to fill them from corner to corner."
        if one.confidence == 0
        else f"The {side} lens' circle was not found for certain: look at it."
        for side, one in circles.items()
        if one.confidence < _UNSURE
    )


def _motions(
    brackets: Mapping[str, Bracket], lenses: Mapping[str, tuple[Circle, Lens]], align: bool, job: Job
) -> dict[str, tuple[Motion, ...]]:
    from studio_core.imaging.alignment import align_frames

    made = {}
    for place, (side, bracket) in enumerate(brackets.items()):
        part = StageJob(job, place / len(brackets), 1 / len(brackets))
        circle, lens = lenses.get(side, (None, None))
        frames = [shot.pixels for shot in bracket.shots]
        made[side] = align_frames(frames, None, circle, lens, part) if align else (Motion(),) * len(frames)
    return made


def _of_motions(brackets: Mapping[str, Bracket], motions: Mapping[str, Sequence[Motion]]) -> tuple[str, ...]:
    lost = [
        shot.facts.name
        for side, bracket in brackets.items()
        for shot, motion in zip(bracket.shots, motions[side], strict=True)
        if not motion.trusted
    ]
    if not lost:
        return ()
    them = ", ".join(lost)
    return (
        f"{them}: too little is in common with the other exposures to align it;"
        " it counts only where no other shows anything.",
    )


def _merged(
    brackets: Mapping[str, Bracket],
    motions: Mapping[str, tuple[Motion, ...]],
    response: Response,
    exposures: Mapping[str, Exposures],
    lenses: Mapping[str, tuple[Circle, Lens]],
    ghosts: bool,
    workers: Any,
    job: Job,
) -> dict[str, LensLight]:
    from studio_core.imaging.merging import merge

    made = {}
    for place, (side, bracket) in enumerate(brackets.items()):
        part = StageJob(job, place / len(brackets), 1 / len(brackets))
        circle, lens = lenses.get(side, (None, None))
        made[side] = merge(
            bracket,
            motions[side],
            response,
            exposures[side],
            part,
            ghosts=ghosts,
            circle=circle,
            lens=lens,
            workers=workers,
        )
    return made


def _view(light: LensLight, found: FoundCircle | None, lens: Lens) -> View:
    height, width = light.light.shape[:2]
    if found is None:  # a picture of all around: what is dark is marked so, and stays as dark as it is
        return View(
            light.light,
            np.ones((height, width), np.bool_),
            Circle(width / 2, height / 2, height / 2),
            lens,
            light.clipped,
            light.dark,
        )
    circle = found.circle
    x, y = np.arange(width) + 0.5 - circle.x, np.arange(height) + 0.5 - circle.y
    inside = x * x + (y * y)[:, None] < circle.radius**2
    return View(light.light, inside, circle, lens, light.clipped, light.dark)


def _registered(views: Mapping[str, View], settings: CaptureSettings, job: Job) -> Registration:
    from studio_plugins.capture.register import alone, register

    if len(views) == 2:
        return register(views[FRONT], views[BACK], settings.registration, settings.lens, job)
    (view,) = views.values()
    return alone(view, settings.lens)


def _without_reflections(
    views: Mapping[str, View], registration: Registration | None, settings: CaptureSettings, job: Job
) -> tuple[Reflections, Registration | None]:
    """Light without them, and the registration whose brightness they do not disturb."""
    from studio_plugins.capture.reflections import find_reflections
    from studio_plugins.capture.register import rebalanced
    from studio_plugins.capture.removal import remove

    if registration is None:
        return Reflections((), frozen_map({side: view.light for side, view in views.items()})), None
    chosen = settings.reflections
    moved: dict[str, Circle | None] = {FRONT: registration.front, BACK: registration.back}
    through = {
        side: dataclasses.replace(view, lens=registration.lens, circle=moved[side] or view.circle)
        for side, view in views.items()
    }
    patches = chosen.patches
    if patches is None:
        half = StageJob(job, 0.0, 0.5)
        patches = find_reflections(through[FRONT], through.get(BACK), registration, chosen, half)
    registration = rebalanced(registration, through, patches, settings.lens)
    return remove(through, registration, patches, StageJob(job, 0.5, 0.5)), registration


def _clean(views: Mapping[str, View], reflections: Reflections) -> dict[str, View]:
    return {side: dataclasses.replace(view, light=reflections.lights[side]) for side, view in views.items()}


CAPTURER = FisheyeCapturer()
