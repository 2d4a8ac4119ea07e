"""A small capture for tests: photographs made up, and a capturer that needs no time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from studio_core.arrays import content_hash, frozen_map
from studio_core.capturing.artifacts import (
    Bracket,
    Brackets,
    Calibration,
    Captured,
    CaptureState,
    Exposures,
    FoundCircle,
    LensLight,
    Motion,
    Reflections,
    Registration,
    Response,
    Stitched,
)
from studio_core.capturing.settings import CaptureSettings, Patch
from studio_core.contract import API, Plugin, Services
from studio_core.errors import InputError
from studio_core.imaging.photograph import Photograph, ShotFacts
from studio_core.imaging.projection import Circle, Lens
from studio_core.scene.capture import KeptPhotograph
from studio_core.scene.geometry import Image
from studio_core.shading.job import Job

SIZE = (120, 90)
CIRCLE = Circle(61.0, 44.0, 40.0)
FOUND = Patch("front", 20.0, 30.0, 84.0, 95.0, found=True, excess=1.2)


def photograph(name: str, ev: float, seed: int = 0) -> Photograph:
    """A round picture that is brighter with its exposure."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    inside = np.hypot(x - CIRCLE.x, y - CIRCLE.y) < CIRCLE.radius
    light = np.random.default_rng(seed).random((*inside.shape, 3)) * inside[..., None]
    pixels = np.clip(255 * (light * 2.0**ev * 0.2) ** (1 / 2.2), 0, 255).astype(np.uint8)
    return Photograph(pixels, ShotFacts(name, 2.0**ev / 60, 100.0, 2.0), content_hash(pixels))


def kept(photograph: Photograph) -> KeptPhotograph:
    """As a project has it."""
    small = Image(np.ascontiguousarray(photograph.pixels[::2, ::2]), "srgb")
    return KeptPhotograph(photograph.digest, photograph.facts, photograph.size, small)


def bracket() -> list[Photograph]:
    """Three exposures to the front, three to the back."""
    return [
        photograph(f"{side}{i}.jpg", ev, seed)
        for seed, side in enumerate(("front", "back"))
        for i, ev in enumerate((-2.0, 0.0, 2.0))
    ]


class FakeRun:
    """Makes every part of a state out of nothing, and remembers what it was asked for."""

    def __init__(self) -> None:
        self.asked: list[tuple[tuple[str, ...], CaptureSettings]] = []
        self.gate: threading.Event | None = None
        self.started = threading.Event()
        self.fail = ""
        self.wait_at = "lens"

    def run(
        self, photographs: Sequence[Photograph], settings: CaptureSettings, job: Job, until: str = ""
    ) -> CaptureState:
        self.asked.append((tuple(p.digest for p in photographs), settings))
        state = CaptureState()
        for number, (name, make) in enumerate(_STAGES.items()):
            job.checkpoint(number, len(_STAGES))
            if name == self.wait_at and self.gate is not None:
                self.started.set()
                while not self.gate.wait(0.002):
                    job.checkpoint(number, len(_STAGES))
            if self.fail == name:
                raise InputError(f"the {name} did not work")
            state = make(state, photographs, settings)
            job.publish(state)
        return state


class FakeCapturer:
    """Every run is the same one, so that tests can look at it."""

    label = "Fake"
    current = FakeRun()

    def open(self, services: Services) -> FakeRun:
        return FakeCapturer.current


def capturer() -> FakeCapturer:
    """As plugins offer it."""
    return FakeCapturer()


fisheye = FakeCapturer()

plugin = Plugin(
    id="fake-capture",
    label="Fake capture",
    api=API,
    provides={"capturer": {"fisheye": "capture_support:fisheye"}},
)


def _with(state: CaptureState, **parts: Any) -> CaptureState:
    from dataclasses import replace

    return replace(state, **parts)


def _brackets(
    state: CaptureState, photographs: Sequence[Photograph], settings: CaptureSettings
) -> CaptureState:
    dropped = {shot.photograph for shot in settings.bracket.shots if not shot.used}
    sides: dict[str, Bracket] = {}
    for side in ("front", "back"):
        shots = tuple(p for p in photographs if p.facts.name.startswith(side) and p.digest not in dropped)
        if shots:
            evs = tuple(float(p.facts.ev or 0) for p in shots)
            sides[side] = Bracket(shots, evs, (True,) * len(shots))
    return _with(state, brackets=Brackets("two lenses, a picture each", frozen_map(sides)))


def _light(state: CaptureState, photographs: Sequence[Photograph], settings: CaptureSettings) -> CaptureState:
    assert state.brackets is not None
    lights = {}
    for side, found in state.brackets.sides.items():
        light = (found.shots[-1].pixels / np.float32(255)) ** np.float32(2.2)
        nothing = np.zeros(light.shape[:2], bool)
        clipped = nothing.copy()
        clipped[40:44, 60:66] = True
        solved = (found.listed[0] - 0.9, *found.listed[1:])
        lights[side] = LensLight(
            light,
            clipped,
            nothing,
            nothing,
            np.full(light.shape[:2], 0.01, np.float32),
            tuple(Motion(1.0, 0.5, 0.1) for _ in found.shots),
            Exposures(found.listed, solved, (0,)),
        )
    curve = np.tile(np.linspace(-8, 2, 64), (3, 1))
    response = Response(curve, 255.0, (2.0, 2.0, 2.0), (250.0, 250.0, 250.0), (1e-5, 1e-4), rms=0.01)
    return _with(state, lights=frozen_map(lights), response=response)


def _lens(state: CaptureState, photographs: Sequence[Photograph], settings: CaptureSettings) -> CaptureState:
    circles = {}
    for side in state.lights:
        by_hand = getattr(settings.lens, side)
        circles[side] = FoundCircle(by_hand or CIRCLE, 0.4 if side == "back" else 0.9, by_hand is not None)
    return _with(state, circles=frozen_map(circles))


def _registration(
    state: CaptureState, photographs: Sequence[Photograph], settings: CaptureSettings
) -> CaptureState:
    lens = Lens(settings.lens.model, settings.lens.fov)
    turn = np.diag([-1.0, 1.0, -1.0])
    found = Registration(turn, lens, np.ones(3), (-0.1, 0.0, 0.0), 0.2, 321, True)
    return _with(state, registration=found)


def _reflections(
    state: CaptureState, photographs: Sequence[Photograph], settings: CaptureSettings
) -> CaptureState:
    patches = settings.reflections.patches
    found = (FOUND,) if patches is None else patches
    lights = {side: light.light * np.float32(0.9) for side, light in state.lights.items()}
    return _with(state, reflections=Reflections(found, frozen_map(lights)))


def _stitch(
    state: CaptureState, photographs: Sequence[Photograph], settings: CaptureSettings
) -> CaptureState:
    light = np.random.default_rng(3).random((64, 128, 3)).astype(np.float32)
    light = np.roll(light, round(settings.stitch.north / 360 * 128), axis=1)
    nothing = np.zeros((64, 128), bool)
    front = np.tile(np.linspace(0, 1, 128, dtype=np.float32), (64, 1))
    return _with(state, stitched=Stitched(light, nothing, nothing, front, np.eye(3)))


def _calibrate(
    state: CaptureState, photographs: Sequence[Photograph], settings: CaptureSettings
) -> CaptureState:
    assert state.stitched is not None
    scale = 80.0 if settings.calibration.scale != "not calibrated" else None
    unresolved = np.zeros((64, 128), np.uint8)
    unresolved[10:12, 5:9] = 1
    made = Captured(
        Image(state.stitched.light),
        np.ones((6, 16, 16, 3), np.float32) * np.arange(6, dtype=np.float32)[:, None, None, None],
        unresolved,
        Calibration(luminance_scale=scale, scale_uncertainty=0.05),
        frozen_map({"photographs": len(photographs), "lens": {"fov": settings.lens.fov}}),
    )
    return _with(state, captured=made)


Stage = Callable[[CaptureState, Sequence[Photograph], CaptureSettings], CaptureState]
_STAGES: dict[str, Stage] = {
    "photographs": _brackets,
    "light": _light,
    "lens": _lens,
    "registration": _registration,
    "reflections": _reflections,
    "join": _stitch,
    "calibration": _calibrate,
}
