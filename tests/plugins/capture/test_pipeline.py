"""The whole capture: light near the truth, only what a change touches runs again, hard input is answered."""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import replace

import numpy as np
import pytest
from capture_shots import LITTLE, room, shots

from studio_core.capturing.artifacts import CaptureState
from studio_core.capturing.settings import (
    EQUIRECTANGULAR,
    CalibrationSettings,
    CaptureSettings,
    LensSettings,
    Patch,
    RadianceSettings,
    ReflectionSettings,
    StitchSettings,
)
from studio_core.contract import Services
from studio_core.errors import Cancelled, InputError
from studio_core.imaging.latlong import pixel_directions, pixel_solid_angles
from studio_core.imaging.photograph import Photograph, ShotFacts
from studio_core.imaging.projection import Circle
from studio_core.parallel import Workers
from studio_core.registry import PluginHost
from studio_core.shading.job import Job
from studio_plugins.capture.pipeline import CAPTURER, STAGES, FisheyeRun

SMALL = CaptureSettings(stitch=StitchSettings(width=256, level=False))


@pytest.fixture
def run(host: PluginHost, workers: Workers) -> FisheyeRun:
    return CAPTURER.open(Services(workers, host))


@pytest.fixture(scope="module")
def whole(host: PluginHost, workers: Workers) -> FisheyeRun:
    """A run that went through everything once; `after` gives runs that know what it made."""
    run = CAPTURER.open(Services(workers, host))
    run.run(_photographs(), SMALL, Job("capture"))
    assert run.made == list(STAGES)
    return run


@pytest.fixture
def after(whole: FisheyeRun, host: PluginHost, workers: Workers) -> FisheyeRun:
    run = CAPTURER.open(Services(workers, host))
    run._kept._kept.update(whole._kept._kept)
    return run


@functools.cache
def _photographs() -> tuple[Photograph, ...]:
    made = shots()
    return (*made.front, *made.back)


def _irradiance_error(light: np.ndarray, truth: np.ndarray) -> float:
    """Relative RMSE over six directions after the best scale."""
    from studio_core.imaging.resample import resize_area

    truth = resize_area(truth, *light.shape[:2])
    height, width = light.shape[:2]
    d = pixel_directions(height, width)
    area = pixel_solid_angles(height, width)[:, None]
    weights = [np.maximum(sign * d[..., axis], 0) * area for axis in range(3) for sign in (1, -1)]
    ours, theirs = ([float((w[..., None] * x).sum()) for w in weights] for x in (light, truth))
    a, b = np.array(ours), np.array(theirs)
    a *= (a @ b) / (a @ a)
    return float(np.sqrt(np.mean((a - b) ** 2)) / b.mean())


def test_two_brackets_become_the_room(after: FisheyeRun) -> None:
    state = after.run(_photographs(), SMALL, Job("capture"))
    assert state.captured is not None
    light = state.captured.environment.pixels
    assert light.shape == (128, 256, 3)
    assert np.isfinite(light).all()
    assert (light >= 0).all()
    assert _irradiance_error(light, room()) < 0.03
    assert state.registration is not None
    assert state.registration.trusted
    report = state.captured.report
    assert {shot["side"] for shot in report["photographs"]} == {"front", "back"}
    assert state.captured.faces.shape == (6, 64, 64, 3)


@pytest.mark.parametrize(
    ("change", "again"),
    [
        ({"calibration": CalibrationSettings(white="temperature", kelvin=3000.0)}, "calibration"),
        ({"stitch": StitchSettings(width=200, level=False)}, "stitch"),
        ({"stitch": StitchSettings(width=256, level=False, north=30.0)}, "stitch"),
        ({"stitch": StitchSettings(width=256, level=False, face=32)}, "calibration"),
        (
            {"reflections": ReflectionSettings(patches=(Patch("front", 20.0, 15.0, 85.0, 94.0),))},
            "reflections",
        ),
        ({"lens": LensSettings(fov=191.0)}, "views"),
        ({"radiance": RadianceSettings(ghosts=False)}, "light"),
        ({"radiance": RadianceSettings(response="sRGB")}, "response"),
        ({"radiance": RadianceSettings(align=False)}, "motions"),
    ],
)
def test_a_change_runs_only_what_follows_it(after: FisheyeRun, change: dict[str, object], again: str) -> None:
    after.run(_photographs(), SMALL, Job("capture"))
    assert after.made == [], "nothing changed"
    after.run(_photographs(), replace(SMALL, **change), Job("capture"))  # type: ignore[arg-type]
    assert after.made == list(STAGES[STAGES.index(again) :])


def test_states_are_published_in_order_and_progress_never_goes_back(after: FisheyeRun) -> None:
    states: list[CaptureState] = []
    progress: list[float] = []
    job = Job("capture", lambda j: progress.append(j.done / j.total), states.append)
    last = after.run(_photographs(), SMALL, job)
    filled = [
        sum(bool(getattr(s, f.name)) for f in dataclasses.fields(s) if f.name != "notes") for s in states
    ]
    assert filled == sorted(filled)
    assert states[-1] is last
    assert progress == sorted(progress)
    assert progress[-1] == 1.0


def test_a_cancelled_capture_goes_on_where_it_was(run: FisheyeRun) -> None:
    job = Job("capture")

    def stop(state: CaptureState) -> None:
        if state.registration is not None:
            job.cancel()

    job._on_publish = stop
    with pytest.raises(Cancelled):
        run.run(_photographs(), SMALL, job)
    made = list(run.made)
    assert "light" in made
    run.made.clear()
    run.run(_photographs(), SMALL, Job("capture"))
    assert run.made == list(STAGES[STAGES.index("reflections") :])


def test_until_a_step(after: FisheyeRun) -> None:
    state = after.run(_photographs(), SMALL, Job("capture"), until="radiance")
    assert state.lights
    assert state.registration is None
    state = after.run(_photographs(), SMALL, Job("capture"), until="bracket")
    assert state.brackets is not None
    assert not state.lights


def test_a_front_without_a_back_is_filled_and_told(run: FisheyeRun) -> None:
    state = run.run(shots().front, SMALL, Job("capture"))
    assert state.captured is not None
    assert (state.captured.unresolved == 3).mean() > 0.3
    assert np.isfinite(state.captured.environment.pixels).all()
    assert any("one view" in note for note in state.notes)


def test_one_exposure_each_is_told(run: FisheyeRun) -> None:
    made = shots()
    state = run.run((made.front[2], made.back[2]), SMALL, Job("capture"))
    assert state.captured is not None
    assert state.response is not None
    assert not state.response.measured
    assert any("one exposure" in note for note in state.notes)


def test_two_circles_in_one_picture(run: FisheyeRun) -> None:
    made = shots()
    both = tuple(
        replace(front, pixels=np.concatenate([front.pixels, back.pixels], axis=1), digest=f"dual {i}")
        for i, (front, back) in enumerate(zip(made.front, made.back, strict=True))
    )
    settings = replace(SMALL, bracket=replace(SMALL.bracket, layout="two circles in one picture"))
    state = run.run(both, settings, Job("capture"))
    assert state.captured is not None
    assert set(state.circles) == {"front", "back"}
    assert _irradiance_error(state.captured.environment.pixels, room()) < 0.03


def test_an_equirectangular_bracket(run: FisheyeRun) -> None:
    light = room()
    pictures = []
    for i, ev in enumerate((-5.0, -2.5, 0.0, 2.5)):
        encoded = np.clip(light * 2.0**ev, 0, 1) ** (1 / 2.2)
        facts = ShotFacts(f"pano{i}.jpg", seconds=2.0**ev / 60, iso=100.0, aperture=2.0, taken=float(i))
        pictures.append(Photograph(np.rint(encoded * 255).astype(np.uint8), facts, f"pano {i}"))
    settings = replace(SMALL, bracket=replace(SMALL.bracket, layout=EQUIRECTANGULAR))
    state = run.run(pictures, settings, Job("capture"))
    assert state.captured is not None
    assert not state.circles
    assert _irradiance_error(state.captured.environment.pixels, light) < 0.03


def test_what_gives_no_result_is_said_in_one_sentence(run: FisheyeRun) -> None:
    with pytest.raises(InputError) as caught:
        run.run((), SMALL, Job("capture"))
    assert str(caught.value).count("\n") == 0
    bad = replace(SMALL, lens=LensSettings(model="Kannala–Brandt", coefficients=(-5.0,)))
    with pytest.raises(InputError, match="lens"):
        run.run(_photographs(), bad, Job("capture"))


def test_a_circle_by_hand_counts(after: FisheyeRun) -> None:
    drawn = Circle(LITTLE.circle.x + 1.0, LITTLE.circle.y, LITTLE.circle.radius)
    state = after.run(_photographs(), replace(SMALL, lens=LensSettings(front=drawn)), Job("capture"))
    assert state.circles["front"].circle == drawn
    assert state.circles["front"].by_hand
    assert not state.circles["back"].by_hand
    after.made.clear()
    nudged = Circle(drawn.x + 0.5, drawn.y, drawn.radius)
    after.run(_photographs(), replace(SMALL, lens=LensSettings(front=nudged)), Job("capture"))
    assert after.made[0] == "views", "a nudge merges nothing anew"


def test_a_picture_without_a_circle_is_taken_whole(run: FisheyeRun) -> None:
    rng = np.random.default_rng(2)
    light = np.exp(rng.normal(size=(12, 16, 3))).repeat(16, 0).repeat(16, 1)
    pictures = []
    for i, ev in enumerate((-4.0, -2.0, 0.0)):
        encoded = np.clip(light * 2.0**ev, 0, 1) ** (1 / 2.2)
        pictures.append(
            Photograph(np.rint(encoded * 255).astype(np.uint8), ShotFacts(f"{i}.png"), f"flat {i}")
        )
    state = run.run(pictures, SMALL, Job("capture"))
    assert state.circles["front"].circle == Circle(128, 96, 160)
    assert any("corner to corner" in note for note in state.notes)
