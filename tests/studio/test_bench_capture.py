"""`lucarne bench capture`: its measures on captures whose error is known, and rows of every case."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio.bench import (
    capture,
    capture_clone,
    capture_measure,
    capture_reflections,
    capture_registration,
)
from studio.bench.harness import Report
from studio.bench.phone import Arc, Phone, Shots, shoot
from studio.bench.phone_optics import look_up
from studio.bench.phone_random import random_phone
from studio.bench.phone_response import Curve
from studio.cli import main
from studio.headless import Headless
from studio_core.capturing.artifacts import (
    Calibration,
    Captured,
    CaptureState,
    Exposures,
    LensLight,
    Reflections,
    Registration,
    Response,
    Stitched,
)
from studio_core.capturing.settings import Patch
from studio_core.capturing.standing import HALF_TURN, euler
from studio_core.imaging.encode import write_exr
from studio_core.imaging.latlong import equirect_direction, pixel_directions
from studio_core.imaging.projection import Circle
from studio_core.scene.geometry import Image
from studio_core.shading.job import Job

PHONE = Phone(size=(80, 64), circle=Circle(40, 31, 29), samples=1, tilt=(10, 5, -3))


def room(height: int = 64) -> np.ndarray:
    d = pixel_directions(height, 2 * height)
    return (1 + 0.4 * d + 0.3 * d[..., [1, 2, 0]] ** 2).astype(np.float32)


def perfect(shots: Shots, light: np.ndarray, settings: Any = None) -> CaptureState:
    """What a capture without any error ends in; the finished picture is turned as it likes."""
    truth, height = shots.truth, light.shape[0]
    upright = euler(30, 0, 0) @ HALF_TURN
    finished = pixel_directions(height, 2 * height).reshape(-1, 3)
    pixels = 3 * look_up(light, finished @ upright @ truth.room_from_front.T).reshape(light.shape)
    none = np.zeros(light.shape[:2], bool)
    phone = truth.phone
    with np.errstate(invalid="ignore"):
        curve = phone.curve.log_exposure(256)
    curve[:, 0] = curve[:, 1] - 1
    lights = {
        side: LensLight(
            one.light, none, none, none, none, (), Exposures(one.listed, tuple(np.add(one.evs, 1.5)), ())
        )
        for side, one in (("front", truth.front), ("back", truth.back))
    }
    return CaptureState(
        response=Response(curve, 255.0, (0.0,) * 3, (255.0,) * 3, (0.0, 0.0)),
        lights=lights,
        registration=Registration(truth.rotation, phone.lens, np.ones(3), (0, 0, 0), 0.1, 50, True),
        stitched=Stitched(pixels, none, none, np.ones(light.shape[:2], np.float32), upright),
        captured=Captured(
            Image(pixels), np.ones((6, 4, 4, 3), np.float32), none.astype(np.uint8), Calibration()
        ),
        notes=("A note.",),
    )


def test_irradiance_of_even_light_is_pi() -> None:
    made = capture_measure.irradiance(np.ones((64, 128, 3), np.float32), capture_measure.NORMALS)
    assert made.shape == (26, 3)
    np.testing.assert_allclose(made, np.pi, rtol=2e-3)


def test_a_perfect_capture_has_no_error() -> None:
    shots = shoot(room(), PHONE, 1)
    found = capture.measured(perfect(shots, room()), shots, room())
    assert found["irradiance_rel_rmse"] < 1e-3
    assert found["pixel_log2_median"] < 1e-3
    assert found["pixel_log2_p95"] < 5e-3
    assert 0.8 < found["compared"] < 1
    assert found["registration_deg"] == pytest.approx(0, abs=1e-6)
    assert found["response_rms"] < 1e-3
    assert found["exposure_ev_max"] == pytest.approx(0, abs=1e-9)
    assert (found["nonfinite"], found["fov_error"], found["clipped_energy"]) == (0, 0, 0)


def test_a_lens_picture_with_its_true_geometry_is_the_room() -> None:
    shots = shoot(room(), replace(PHONE, size=(160, 128), circle=Circle(80, 63, 58), falloff=0.4), 1)
    found = capture.floor_of(shots, room(), 128)
    assert found["floor_irradiance_rel_rmse"] < 2e-3
    assert found["floor_pixel_log2_median"] < 5e-3
    bent = replace(shots.truth, rotation=shots.truth.rotation @ euler(20, 0, 0))
    assert capture.floor_of(replace(shots, truth=bent), room(), 128)["floor_irradiance_rel_rmse"] > 0.01


def test_errors_are_as_large_as_they_were_made() -> None:
    shots = shoot(room(), PHONE, 1)
    state = perfect(shots, room())
    assert state.captured is not None
    assert state.registration is not None
    assert state.response is not None
    pixels = state.captured.environment.pixels.copy()
    pixels[: len(pixels) // 2] *= 1.2  # light from above
    broken = pixels.copy()
    broken[3, 3, 0] = np.nan
    spoilt = replace(
        state,
        captured=replace(state.captured, environment=Image(pixels)),
        registration=replace(state.registration, rotation=state.registration.rotation @ euler(0, 0, 1.25)),
        response=replace(state.response, curve=state.response.curve * 1.1),
        lights={
            **state.lights,
            "back": replace(state.lights["back"], exposures=Exposures((0, 2, 4), (0, 2.3, 4), (1,))),
        },
    )
    found = capture.measured(spoilt, shots, room(), ("back", 1))
    assert 0.02 < found["irradiance_rel_rmse"] < 0.1
    assert found["pixel_log2_median"] == pytest.approx(np.log2(1.2) / 2, abs=np.log2(1.2) / 2 + 0.01)
    assert found["pixel_log2_p95"] > 0.1
    assert found["registration_deg"] == pytest.approx(1.25, abs=1e-6)
    assert found["exposure_ev_max"] == pytest.approx(0.3)
    assert found["response_rms"] > 0.01
    assert found["wrong_named"] == 1
    assert capture.measured(spoilt, shots, room(), ("front", 1))["wrong_named"] == 0
    assert capture.measured(spoilt, shots, room(), ("back", 2))["wrong_named"] == 1  # its neighbour
    lost = replace(spoilt, captured=SimpleNamespace(environment=SimpleNamespace(pixels=broken), faces=pixels))
    assert capture_measure.nonfinite(lost) == 1


@given(st.floats(-180, 180), st.floats(-80, 80), st.floats(0, 179))
@settings(max_examples=20)
def test_the_angle_between_turns(yaw: float, pitch: float, degrees: float) -> None:
    a = euler(yaw, pitch, 10)
    assert capture_measure.angle_between(a, a @ euler(degrees, 0, 0)) == pytest.approx(degrees, abs=1e-5)


def test_lamps_are_turned_down_to_what_the_darkest_exposure_resolves() -> None:
    bright = room()
    bright[20:22, 60:62] = 5000
    assert shoot(bright, PHONE, 1).truth.clipped > 0.1
    for phone in (
        PHONE,
        replace(PHONE, back_ev=0.8, falloff=0.5),
        replace(PHONE, curve=Curve("per channel")),
    ):
        within = capture.dimmed(bright, phone)
        assert (within == bright).mean() > 0.99
        shots = shoot(within, replace(phone, full_well=1e9, read_noise=0), 1)
        assert shots.truth.clipped == 0
        assert 150 < max(side[0].pixels.max() for side in (shots.front, shots.back)) < 255
    assert capture.ladder_of(bright, PHONE) == capture.LADDERS[-1]
    assert capture.ladder_of(room(), PHONE) == capture.LADDERS[0]


def test_a_meter_reads_the_room_without_and_with_what_is_clipped() -> None:
    bright = room()
    bright[20:22, 60:62] = 5000
    shots = shoot(bright, PHONE, 1)
    turned = euler(30, 0, 0)
    told = capture.with_meter(bright, shots, turned)
    u, v = 61 / 128, 21 / 64
    np.testing.assert_allclose(told.facing, turned @ equirect_direction(u, v), atol=0.01)
    assert told.sun_lux == 1000
    dark = capture_measure.irradiance(room(), np.array([turned.T @ told.facing]))[0]
    with_lamp = capture_measure.irradiance(bright, np.array([turned.T @ told.facing]))[0]
    weights = capture_measure.LUMINANCE
    assert told.lux == pytest.approx(1000 * (dark @ weights) / (with_lamp @ weights), rel=0.02)


def test_one_step_of_a_wrong_table_is_wrong() -> None:
    for seed in range(8):
        phone = random_phone(seed, tuned=False)
        lying, side, after = capture.wrong_table(phone, seed)
        shots = shoot(room(16), replace(lying, size=(40, 32), circle=Circle(20, 16, 14), samples=1), seed)
        off = {
            one: np.round(np.subtract(t.listed, t.evs), 9)
            for one, t in (("front", shots.truth.front), ("back", shots.truth.back))
        }
        (step,) = np.flatnonzero(np.diff(off.pop(side)))
        assert step + 1 == after
        assert not off.popitem()[1].any()


def test_cloning_is_compared_with_the_equations_themselves() -> None:
    target, source = capture_clone.picture(12, 15, 1), capture_clone.picture(12, 15, 2)
    mask = capture_clone.rectangle(12, 15)
    made = capture_clone.solved(target, source, mask)
    np.testing.assert_array_equal(made[~mask], target[~mask])
    wide = source.astype(float)
    lap = 4 * made[1:-1, 1:-1] - made[:-2, 1:-1] - made[2:, 1:-1] - made[1:-1, :-2] - made[1:-1, 2:]
    want = 4 * wide[1:-1, 1:-1] - wide[:-2, 1:-1] - wide[2:, 1:-1] - wide[1:-1, :-2] - wide[1:-1, 2:]
    np.testing.assert_allclose(lap, want, atol=1e-8)


class Perfect:
    """Knows what was photographed."""

    def __init__(self, light: np.ndarray) -> None:
        self.light = light
        self.taken: list[Shots] = []
        self.asked: list[Any] = []

    def open(self, services: Any) -> Perfect:
        return self

    def run(self, photographs: Sequence[Any], settings: Any, job: Any, until: str = "") -> CaptureState:
        self.asked.append(settings)
        digests = [p.digest for p in photographs]
        shots = next(s for s in self.taken if [p.digest for p in (*s.front, *s.back)] == digests)
        return perfect(shots, self.light)


def test_rows_of_every_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / capture.MAPS["sunset"]
    path.parent.mkdir(parents=True)
    write_exr(path, room())
    monkeypatch.setenv("LUCARNE_TEST_DATA", str(tmp_path))
    photographer = Perfect(room())

    def recorded(*arguments: Any) -> Shots:
        photographer.taken.append(shoot(*arguments))
        return photographer.taken[-1]

    monkeypatch.setattr(capture, "shoot", recorded)
    monkeypatch.setattr(capture, "QUICK", replace(capture.QUICK, radius=30.0, clone=(40, 40)))
    monkeypatch.setattr(capture_clone, "CHECKED", (20, 30))
    services = SimpleNamespace(get=lambda kind, name: photographer)
    monkeypatch.setattr(Headless, "registry", property(lambda program: services))
    rows = tmp_path / "rows.json"
    arguments = ["bench", "capture", "--quick", "--only", "sunset/*,clone", "--json", str(rows)]
    assert main(arguments) == 0
    found = {(row["case"], row["metric"]): row["value"] for row in json.loads(rows.read_text())["rows"]}
    cases = {case for case, _ in found}
    assert cases == {
        "sunset/default",
        "sunset/no-removal",
        "sunset/wrong-table",
        "sunset/glare",
        "sunset/near",
        "clone",
    }
    named = (
        "irradiance_rel_rmse",
        "pixel_log2_median",
        "registration_deg",
        "response_rms",
        "exposure_ev_max",
    )
    for case in cases - {"clone"}:
        assert {(case, metric) for metric in (*named, "nonfinite")} <= set(found)
    assert found["sunset/default", "irradiance_rel_rmse"] < 0.01
    assert found["sunset/wrong-table", "wrong_named"] == 0  # nothing was named
    assert found["clone", "rel_error"] < 1e-6
    assert [s.reflections.automatic for s in photographer.asked] == [True, False, True, True, True]
    assert all(len(s.bracket.shots) == 6 for s in photographer.asked)


def test_registration_of_many_phones(monkeypatch: pytest.MonkeyPatch) -> None:
    photographer = Perfect(room())

    def recorded(*arguments: Any) -> Shots:
        photographer.taken.append(shoot(*arguments))
        return photographer.taken[-1]

    def refused_or_off(photographs: Any, settings: Any, job: Any, until: str = "") -> CaptureState:
        assert until == "registration"
        state = Perfect.run(photographer, photographs, settings, job)
        number, found = len(photographer.taken), state.registration
        assert found is not None
        turned = euler(0.0, 0.0, (0.1, 0.2, 9.0, 0.4)[number - 1]) @ found.rotation
        return replace(state, registration=replace(found, rotation=turned, trusted=number != 3))

    monkeypatch.setattr(capture_registration, "shoot", recorded)
    monkeypatch.setattr(photographer, "run", refused_or_off)
    services = SimpleNamespace(get=lambda kind, name: photographer)
    monkeypatch.setattr(Headless, "registry", property(lambda program: services))
    report = Report("capture", quick=True)
    capture_registration.measure(report, Headless(quiet=True), {"a": room(), "b": room()}, 2, 30.0)
    rows = {row.metric: row.value for row in report.rows}
    assert rows["captures"] == 4
    assert rows["unregistered"] == 0.25
    assert rows["registration_median"] == pytest.approx(0.2, abs=1e-6)
    assert rows["registration_deg"] == pytest.approx(0.4, abs=1e-6)


def test_curves_that_differ_by_a_factor_are_one() -> None:
    curve = Curve("filmic", 2.2, 0.6)
    with np.errstate(invalid="ignore"):
        log = curve.log_exposure(256)
    response = Response(log + 0.7, 255.0, (2.0,) * 3, (250.0,) * 3, (0.0, 0.0))
    assert capture_measure.response_error(response, curve).rms < 1e-6
    other = capture_measure.response_error(response, Curve("sRGB"))
    assert other.rms > 0.01
    assert other.log2 > 0.05


def test_what_arcs_leave_in_the_lenses_is_counted_in_stops() -> None:
    phone = replace(PHONE, arcs=(Arc("front", 30, 60, 9, 1.2),))
    shots = shoot(room(), phone, 1)
    truth, state = shots.truth, perfect(shots, room())
    lights = {"front": 0.5 * truth.front.light, "back": 0.5 * truth.back.light}
    spoilt = replace(state, reflections=Reflections((), lights))
    left = capture_measure.left_in_lenses(spoilt, truth)
    assert left == pytest.approx(truth.front.stops[truth.front.stops > 0.3].mean(), rel=0.15)
    clean = replace(state, reflections=Reflections((), {**lights, "front": 2 * truth.front.clean}))
    assert capture_measure.left_in_lenses(clean, truth) == pytest.approx(0, abs=1e-3)
    assert capture_measure.left_in_lenses(state, truth) is None
    assert "lens_arcs_log2" in capture.measured(spoilt, shots, room())


def test_arcs_and_rectangles_are_counted_by_the_azimuths_they_share() -> None:
    arcs = [
        Arc("front", 350, 40, stops=1.0),
        Arc("front", 100, 30, stops=0.5),
        Arc("back", 350, 40, stops=2.0),
    ]
    over = Patch("front", 328, 44, 88, 95)  # 330 … 10 and a margin of 2
    half = Patch("back", 340, 15, 88, 95)
    beside = Patch("front", 200, 20, 88, 95)
    count = capture_reflections.Count()
    count.add(arcs, [over, half, beside])
    assert (count.strong, count.found) == (2, 1)
    assert (count.rectangles, count.right) == (3, 2)
    assert (count.clean, count.touched) == (0, 0)
    count.add([], [beside])
    count.add([], [])
    assert (count.clean, count.touched) == (2, 1)
    assert capture_reflections.azimuths(arcs[0])[[330, 359, 0, 9]].all()
    assert not capture_reflections.azimuths(arcs[0])[[329, 10]].any()


def test_reflections_are_looked_for_in_every_capture() -> None:
    report = Report("capture", True)
    rooms = {"even": np.ones((32, 64, 3), np.float32)}
    capture_reflections.measure(report, Job("x"), rooms, 3, radius=40.0)
    found = {row.metric: row.value for row in report.rows}
    assert found["captures"] == 3
    assert found["unregistered"] == 1  # there is nothing to register by
    assert found["clean_touched"] == 0
    assert found["arcs"] == sum(
        arc.stops > 0.7
        for index in range(3)
        for arc in random_phone(
            capture_reflections.FIRST + index, False, radius=40.0, reflections=index % 3 > 0
        ).arcs
    )
