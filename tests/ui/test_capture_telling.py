"""What the steps say of settings and results."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from capture_support import FOUND, FakeRun, bracket
from hypothesis import given
from hypothesis import strategies as st

from studio_core.arrays import frozen_map
from studio_core.capturing.artifacts import Calibration, CaptureState, Reflections
from studio_core.capturing.settings import DUAL, CaptureSettings, LensSettings, Shot, StitchSettings
from studio_core.shading.job import Job
from studio_ui.capture.desk import SECTIONS, _after, merged, reached
from studio_ui.capture.steps.photographs import with_shot
from studio_ui.capture.telling import STEPS, Line, percent, report_lines, span, tell_all


def whole() -> CaptureState:
    return FakeRun().run(bracket(), CaptureSettings(), Job("capture"))


def marks(told: dict) -> list[str]:
    return [told[step.id].mark for step in STEPS]


def test_the_first_step_that_is_not_fresh_is_the_one_at_work() -> None:
    state, settings = whole(), CaptureSettings()
    parts = [
        "brackets",
        "response",
        "lights",
        "circles",
        "registration",
        "reflections",
        "stitched",
        "captured",
    ]
    assert reached(state) == set(parts)
    for count in range(len(parts)):
        fresh = frozenset(parts[:count])
        for busy, error, wanted in (
            (True, "", "working"),
            (False, "It broke.", "error"),
            (False, "", "waiting"),
        ):
            told = tell_all(state, settings, fresh, busy=busy, error=error)
            old = [mark for mark in marks(told) if mark in ("working", "error", "waiting")]
            assert old[0] == wanted
            assert set(old[1:]) <= {"waiting"}
            if error:
                assert [found.line for found in told.values() if found.mark == "error"] == ["It broke."]
    assert marks(tell_all(CaptureState(), settings, frozenset(), busy=False)) == ["waiting"] * 7


def test_lines_tell_what_is_special() -> None:
    state, settings = whole(), CaptureSettings()
    fresh = reached(state)
    dual = replace(state, brackets=replace(state.brackets, layout=DUAL))
    assert tell_all(dual, settings, fresh, busy=False)["photographs"].line == f"6 exposures, {DUAL}"
    told = tell_all(state, settings, fresh, busy=False, missing=("a.jpg is gone.",))["photographs"]
    assert (told.mark, told.warnings) == ("warning", ("a.jpg is gone.",))
    off = Reflections((replace(FOUND, used=False), FOUND), state.reflections.lights)
    told = tell_all(replace(state, reflections=off), settings, fresh, busy=False)["reflections"]
    assert told.line == "1 replaced, 1 switched off"
    sun = Calibration(luminance_scale=80.0, scale_uncertainty=0.05, sun=12.0, sun_uncertainty=0.1)
    bright = replace(state, captured=replace(state.captured, calibration=sun))
    line = tell_all(bright, settings, fresh, busy=False)["calibration"].line
    assert line == "80 cd/m² for 1, ± 5 %; clipped light × 12 ± 10 %"


def test_pictures_of_all_around_have_no_lens_to_tell_of() -> None:
    state = replace(whole(), circles=frozen_map(), registration=None, reflections=None)
    fresh = reached(state)
    told = tell_all(state, CaptureSettings(), fresh, busy=False)
    assert {"working", "error", "waiting"}.isdisjoint(marks(told))


def test_shares_in_percent() -> None:
    assert [percent(share) for share in (0.0, 0.00037, 0.058, 0.43, 0.999, 1.0, 2.1)] == [
        "0 %",
        "0.037 %",
        "5.8 %",
        "43 %",
        "100 %",
        "100 %",
        "210 %",
    ]


def test_one_lens_stands_to_no_other() -> None:
    state = whole()
    lost = replace(state.registration, trusted=False)
    both = tell_all(replace(state, registration=lost), CaptureSettings(), reached(state), busy=False)
    assert any("back to back" in text for text in both["lens"].warnings)
    one = replace(state, registration=lost, circles=frozen_map({"front": state.circles["front"]}))
    assert tell_all(one, CaptureSettings(), reached(state), busy=False)["lens"].warnings == ()


def test_noise_is_no_light() -> None:
    light = whole().lights["front"]
    made = np.full(light.light.shape, 1.0, np.float32)
    made[:20], made[20:30] = 1 / 16, 1e-6
    noise = np.zeros(light.noise.shape, np.float32)
    noise[20:30] = 1
    assert span(replace(light, light=made, noise=noise)) == 4.0


@given(st.sets(st.sampled_from(SECTIONS)))
def test_what_follows_a_change_is_old(changed: set[str]) -> None:
    old = CaptureSettings()
    other = {
        "bracket": replace(old.bracket, step=1.0),
        "radiance": replace(old.radiance, align=False),
        "lens": LensSettings(fov=200.0),
        "registration": replace(old.registration, yaw=1.0),
        "reflections": replace(old.reflections, automatic=False),
        "stitch": StitchSettings(width=512),
        "calibration": replace(old.calibration, kelvin=3000.0),
    }
    gone = _after(old, replace(old, **{name: other[name] for name in changed}))
    assert ("captured" in gone) == bool(changed)
    assert ("brackets" in gone) == ("bracket" in changed)
    assert ("stitched" in gone) == bool(changed - {"calibration"})


def test_older_parts_stay_until_newer_ones_are_there() -> None:
    old, new = whole(), whole()
    partial = CaptureState(brackets=new.brackets, lights=new.lights, notes=("new",))
    made = merged(old, partial)
    assert made.brackets is new.brackets
    assert made.lights is new.lights
    assert made.stitched is old.stitched
    assert made.notes == ("new",)


@given(st.lists(st.tuples(st.sampled_from("abc"), st.one_of(st.none(), st.floats(-9, 9)), st.booleans())))
def test_what_is_decided_of_photographs(steps: list) -> None:
    shots: tuple[Shot, ...] = ()
    known: dict[str, Shot] = {}
    for digest, ev, used in steps:
        shots = with_shot(shots, digest, ev=ev, used=used)
        known[digest] = Shot(digest, ev=ev, used=used)
    assert {shot.photograph: shot for shot in shots} == {d: s for d, s in known.items() if s != Shot(d)}
    assert len(shots) == len({shot.photograph for shot in shots})


def test_reports_are_told_line_by_line() -> None:
    report = {
        "lens_model": "equidistant",
        "fov": 195.90722,
        "gain": (1.0, 1.25, np.float32(0.5)),
        "curve": list(range(64)),
        "trusted": True,
        "scale": None,
        "photographs": [{"name": "a.jpg", "ev": 1.0}, {"name": "b.jpg", "ev": -1.0}],
        "notes": ["One.", "Two."],
        "map": {"inner": 2},
    }
    assert report_lines(report) == (
        Line("Lens model", "equidistant"),
        Line("Fov", "195.9"),
        Line("Gain", "1, 1.25, 0.5"),
        Line("Curve", "64 numbers"),
        Line("Trusted", "yes"),
        Line("Scale", "–"),
        Line(
            "Photographs",
            "2",
            (Line("1", "a.jpg", (Line("Ev", "1"),)), Line("2", "b.jpg", (Line("Ev", "-1"),))),
        ),
        Line("Notes", "2", (Line("1", "One."), Line("2", "Two."))),
        Line("Map", "", (Line("Inner", "2"),)),
    )
