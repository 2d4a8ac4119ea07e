"""Calibration: a meter's reading is met, a lamp's light comes back, and doubts are told."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stitch_support import smooth_sky, sphere

from studio_core.capturing.artifacts import Stitched
from studio_core.capturing.settings import (
    GREY_CARD,
    KELVIN,
    LUMINANCE,
    LUX,
    CalibrationSettings,
)
from studio_core.colour import kelvin
from studio_core.imaging.latlong import direction_to_uv, equirect_direction, pixel_solid_angles
from studio_plugins.capture.calibrate import METER, calibrate, finished, illuminance
from studio_plugins.capture.clipped import lacking, places

WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
UP = (0.0, 1.0, 0.0)


def stitched(
    light: np.ndarray, clipped: np.ndarray | None = None, unseen: np.ndarray | None = None
) -> Stitched:
    none = np.zeros(light.shape[:2], np.bool_)
    light = light.astype(np.float32)
    return Stitched(
        light,
        none if clipped is None else clipped,
        none if unseen is None else unseen,
        np.ones(light.shape[:2], np.float32),
        np.eye(3),
    )


def disc(height: int, direction: tuple[float, float, float], degrees: float) -> np.ndarray:
    d = np.asarray(direction) / np.linalg.norm(direction)
    return sphere(height) @ d > np.cos(np.radians(degrees))


def meter(light: np.ndarray, facing: tuple[float, float, float]) -> float:
    """What a meter reads of radiance in cd/m², by the definition."""
    height, width = light.shape[:2]
    n = np.asarray(facing) / np.linalg.norm(facing)
    cosine = np.maximum(sphere(height) @ n, 0) * pixel_solid_angles(height, width)[:, None]
    return float(((light.astype(np.float64) @ WEIGHTS) * cosine).sum())


def test_a_uniform_sky_gives_pi_times_its_luminance() -> None:
    grey = np.full((128, 256, 3), 2.0, np.float32)
    for facing in (UP, (1.0, 0.0, 0.0), (0.3, -2.0, 1.0)):
        assert illuminance(grey, facing) == pytest.approx(2 * np.pi, rel=1e-3)


@given(
    st.floats(1.0, 1e5),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)).filter(lambda v: np.linalg.norm(v) > 0.1),
)
@settings(max_examples=25)
def test_the_scale_makes_the_picture_read_what_the_meter_read(
    lux: float, facing: tuple[float, float, float]
) -> None:
    light, made = calibrate(
        stitched(smooth_sky(sphere(48))), CalibrationSettings(scale=LUX, lux=lux, facing=facing)
    )
    assert made.luminance_scale is not None
    assert made.luminance_scale * meter(light, facing) == pytest.approx(lux, rel=1e-5)
    assert METER < made.scale_uncertainty < 0.07
    assert made.notes == ()
    assert made.sun == 1


def test_a_known_luminance_sets_the_scale_where_it_is() -> None:
    light = smooth_sky(sphere(96))
    u, v = direction_to_uv(np.array([0.2, 0.5, -0.7]))
    chosen = CalibrationSettings(scale=LUMINANCE, luminance=340.0, place=(float(u), float(v)), card_size=6.0)
    _, made = calibrate(stitched(light), chosen)
    assert made.luminance_scale is not None
    there = smooth_sky(equirect_direction(u, v)) @ WEIGHTS
    assert made.luminance_scale * there == pytest.approx(340, rel=0.01)
    assert METER <= made.scale_uncertainty < 0.06


@pytest.mark.parametrize("place", [(0.0, 0.5), (0.999, 0.4), (0.3, 0.001), (0.7, 0.999), (0.5, 0.0)])
def test_places_at_the_picture_s_ends_are_places_too(place: tuple[float, float]) -> None:
    chosen = CalibrationSettings(scale=LUMINANCE, luminance=10.0, place=place, card_size=8.0)
    _, made = calibrate(stitched(smooth_sky(sphere(64))), chosen)
    there = float(smooth_sky(equirect_direction(*place)) @ WEIGHTS)
    assert made.luminance_scale == pytest.approx(10 / there, rel=0.03)


def test_a_grey_card_becomes_grey_and_keeps_its_luminance() -> None:
    tint = np.array([1.3, 1.0, 0.45], np.float32)
    light = smooth_sky(sphere(96)) * 0 + 0.2
    card = disc(96, (0.0, 0.0, 1.0), 3.0)
    light[card] = 0.5
    light = light * tint
    light[0, 0] = 5
    made_light, made = calibrate(stitched(light), CalibrationSettings(white=GREY_CARD, card_size=4.0))
    inside = disc(96, (0.0, 0.0, 1.0), 2.0)
    colour = made_light[inside].mean(axis=0)
    np.testing.assert_allclose(colour, colour.mean(), rtol=1e-5)
    assert colour @ WEIGHTS == pytest.approx(light[inside].mean(axis=0) @ WEIGHTS, rel=1e-5)
    np.testing.assert_allclose(made_light, light * np.array(made.white), rtol=1e-5)


@given(st.floats(1500, 25000))
@settings(max_examples=20)
def test_a_temperature_makes_its_light_neutral(temperature: float) -> None:
    lamp = np.ones((16, 32, 3), np.float32) * np.array(kelvin(temperature), np.float32)
    light, made = calibrate(stitched(lamp), CalibrationSettings(white=KELVIN, kelvin=temperature))
    assert np.isfinite(light).all()
    if not made.notes:
        np.testing.assert_allclose(light, 1, rtol=1e-4)
    assert max(made.white) <= 20.001


def test_a_card_that_is_clipped_unseen_or_black_is_refused() -> None:
    light = smooth_sky(sphere(64))
    card = disc(64, (0.0, 0.0, 1.0), 8.0)
    chosen = CalibrationSettings(white=GREY_CARD, card_size=6.0)
    for picture, why in (
        (stitched(light, clipped=card), "brighter than any"),
        (stitched(light, unseen=card), "no lens"),
        (stitched(light * ~card[..., None]), "black"),
    ):
        made_light, made = calibrate(picture, chosen)
        assert made.white == (1, 1, 1)
        assert why in made.notes[0]
        np.testing.assert_array_equal(made_light, picture.light)


def room_with_a_lamp(factor: float, degrees: float = 4.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """cd/m² of a room with a lamp, the same clipped `factor` times too dark, and where."""
    true = smooth_sky(sphere(96)) * 50
    lamp = disc(96, (0.3, 0.8, 0.5), degrees)
    true[lamp] = np.array([60000.0, 55000.0, 50000.0], np.float32)
    clipped = true.copy()
    clipped[lamp] /= factor
    return true, clipped, lamp


@given(st.floats(3.0, 60.0), st.floats(0.05, 20.0))
@settings(max_examples=20)
def test_a_lamp_comes_back_from_one_place_twice_the_meter_shaded_and_not(factor: float, unit: float) -> None:
    true, captured, lamp = room_with_a_lamp(factor)
    facing = (0.2, 1.0, 0.1)
    shaded = meter(true * ~lamp[..., None], facing)
    chosen = CalibrationSettings(scale=LUX, lux=shaded, facing=facing, sun=True, sun_lux=meter(true, facing))
    light, made = calibrate(stitched(captured / unit, clipped=lamp), chosen)
    assert made.sun == pytest.approx(factor, rel=1e-3)
    assert made.luminance_scale == pytest.approx(unit, rel=1e-3)
    np.testing.assert_allclose(light * made.luminance_scale, true, rtol=2e-3)
    assert 0.05 * factor < made.sun_uncertainty < 0.5 * factor
    assert 0.05 < made.scale_uncertainty < 0.07


def test_a_lamp_comes_back_from_readings_in_two_directions() -> None:
    true, captured, lamp = room_with_a_lamp(12.0)
    for first in ((0.0, -1.0, 0.0), (-0.8, 0.5, 0.1)):  # the second still sees it a little
        second = (0.3, 0.8, 0.5)
        chosen = CalibrationSettings(
            scale=LUX, lux=meter(true, first), facing=first, sun=True, sun_lux=meter(true, second),
            sun_facing=second,
        )  # fmt: skip
        light, made = calibrate(stitched(captured, clipped=lamp), chosen)
        assert made.sun == pytest.approx(12, rel=1e-3)
        assert made.luminance_scale is not None
        assert made.luminance_scale * meter(light, second) == pytest.approx(chosen.sun_lux, rel=1e-4)


def test_a_lamp_comes_back_from_a_known_luminance_and_a_meter() -> None:
    true, captured, lamp = room_with_a_lamp(12.0)
    u, v = direction_to_uv(np.array([0.0, -0.6, -0.8]))
    known = float(smooth_sky(equirect_direction(u, v)) @ WEIGHTS) * 50
    chosen = CalibrationSettings(
        scale=LUMINANCE, luminance=known, place=(float(u), float(v)), sun=True, sun_lux=meter(true, UP)
    )
    _, made = calibrate(stitched(captured / 3, clipped=lamp), chosen)
    assert made.sun == pytest.approx(12, rel=0.03)
    assert made.luminance_scale == pytest.approx(3, rel=0.01)


def test_the_uncertainty_is_that_of_repeated_measurements() -> None:
    """Readings that are off as a meter is give factors that spread as is told."""
    true, captured, lamp = room_with_a_lamp(10.0)
    shaded, whole = meter(true * ~lamp[..., None], UP), meter(true, UP)
    rng = np.random.default_rng(7)
    base = CalibrationSettings(scale=LUX, facing=UP, sun=True, lux=shaded, sun_lux=whole)
    picture = stitched(captured, clipped=lamp)
    _, exact = calibrate(picture, base)
    factors = []
    for _ in range(60):
        a, b = rng.normal(1, METER, 2)
        factors.append(calibrate(picture, replace(base, lux=shaded * a, sun_lux=whole * b))[1].sun)
    spread = np.std(factors)
    assert spread < exact.sun_uncertainty * 1.25  # which has the picture's own doubts in it too
    assert spread > exact.sun_uncertainty * 0.25


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"sun_lux": 1.0}, "no more light"),
    ({"sun_lux": 1.03}, "within the uncertainty"),
    ({"facing": (0.0, -1.0, 0.0)}, "does not shine"),
    ({"scale": "not calibrated"}, "second measurement"),
]


@pytest.mark.parametrize(("changes", "why"), REFUSED)
def test_a_gap_that_is_none_or_doubtful_is_left(changes: dict[str, Any], why: str) -> None:
    true, captured, lamp = room_with_a_lamp(1.0, degrees=3.0)
    shaded = meter(true * ~lamp[..., None], UP)
    whole = meter(true, UP)
    settings_ = CalibrationSettings(scale=LUX, facing=UP, sun=True, lux=shaded, sun_lux=2 * whole)
    if "sun_lux" in changes:  # as a factor of what the picture has
        changes = {**changes, "sun_lux": changes["sun_lux"] * whole - (0.5 if changes["sun_lux"] == 1 else 0)}
    picture = stitched(captured, clipped=lamp)
    light, made = calibrate(picture, replace(settings_, **changes))
    assert made.sun == 1
    assert any("left as it was" in note or "left as it is" in note for note in made.notes)
    assert why in " ".join(made.notes)
    np.testing.assert_array_equal(light, picture.light)


def test_nothing_clipped_needs_no_recovery() -> None:
    chosen = CalibrationSettings(scale=LUX, sun=True)
    _, made = calibrate(stitched(smooth_sky(sphere(32))), chosen)
    assert "resolved by an exposure" in made.notes[-1]


def test_what_a_clipped_lamp_does_to_the_scale_is_told() -> None:
    true, captured, lamp = room_with_a_lamp(30.0)
    _, made = calibrate(stitched(captured, clipped=lamp), CalibrationSettings(scale=LUX, lux=meter(true, UP)))
    assert "no exposure resolved" in made.notes[0]
    assert made.scale_uncertainty > 0.08
    unseen = disc(96, (0.0, 1.0, 0.0), 40.0)
    _, made = calibrate(stitched(true, unseen=unseen), CalibrationSettings(scale=LUX))
    assert "guess" in made.notes[0]


def test_two_lamps_across_the_picture_s_edge_are_two() -> None:
    true, captured, _ = room_with_a_lamp(1.0)
    lamps = disc(96, (0.0, 0.4, -1.0), 6.0) | disc(96, (0.0, 0.4, 1.0), 6.0)  # the first lies at both ends
    captured[lamps] = 100
    true[lamps] = 9000
    shaded = meter(true * ~lamps[..., None], UP)
    chosen = CalibrationSettings(scale=LUX, lux=shaded, facing=UP, sun=True, sun_lux=meter(true, UP))
    _, made = calibrate(stitched(captured, clipped=lamps), chosen)
    assert made.sun > 50
    assert "2 separate" in made.notes[-1]


def test_a_strong_lamp_lacks_more_than_a_bright_curtain() -> None:
    """Both are clipped at 100; the curtain rises gently to twice that, the lamp is thirty times as bright."""
    directions = sphere(128)
    angle = np.degrees(np.arccos(np.clip(directions @ np.array([0.6, 0.8, 0.0]), -1, 1)))
    true = np.full((128, 256, 3), 5.0, np.float32)
    true += (195 * np.exp(-((angle / 14) ** 2)))[..., None].astype(np.float32)
    lamp = disc(128, (-0.6, 0.8, 0.0), 4.0)
    true[lamp] = 3000
    captured = np.minimum(true, 100)
    clipped = true[..., 1] > 100
    shaded = meter(true * ~clipped[..., None], UP)
    chosen = CalibrationSettings(scale=LUX, lux=shaded, facing=UP, sun=True, sun_lux=meter(true, UP))
    light, made = calibrate(stitched(captured, clipped=clipped), chosen)
    assert made.luminance_scale is not None
    scale = made.luminance_scale
    assert scale * meter(light, UP) == pytest.approx(meter(true, UP), rel=1e-3)
    curtain = clipped & ~lamp
    errors = [abs(np.log2(scale * light[m].mean() / true[m].mean())) for m in (lamp, curtain)]
    same = scale * made.sun * captured
    assert max(errors) < 0.75 * max(abs(np.log2(same[m].mean() / true[m].mean())) for m in (lamp, curtain))
    assert errors[0] < 1
    assert made.sun == pytest.approx((true[clipped].sum()) / captured[clipped].sum(), rel=0.3)


def test_places_are_numbered_around_the_picture_s_edge() -> None:
    mask = np.zeros((8, 16), np.bool_)
    mask[2, 0] = mask[2, 15] = mask[3, 15] = mask[5, 4:7] = mask[7, 9] = True
    labels, count = places(mask)
    assert count == 3
    assert labels[2, 0] == labels[3, 15] > 0
    assert len({labels[2, 0], labels[5, 5], labels[7, 9]}) == 3
    assert ((labels > 0) == mask).all()
    weights = lacking(np.where(mask, 10.0, 1.0), labels, count)
    assert weights[0] == 0
    assert weights.max() == 1
    assert (weights[1:] > 0).all()
    assert weights[labels[7, 9]] < weights[labels[5, 5]]  # of one contrast the larger one lacks more
    assert places(~mask & mask)[1] == 0


def test_the_end_of_a_capture_has_all_its_parts() -> None:
    light = smooth_sky(sphere(32))
    clipped, unseen = disc(32, (0, 0, 1.0), 15), disc(32, (0, -1.0, 0), 30)
    dark = disc(32, (1.0, 0, 0), 15)
    whole = replace(stitched(light, clipped, unseen), dark=dark)
    made_light, calibration = calibrate(whole, CalibrationSettings())
    end = finished(whole, made_light, calibration)
    assert end.environment.pixels.shape == (32, 64, 3)
    assert end.faces.shape == (6, 16, 16, 3)
    assert [int((end.unresolved == k).sum()) for k in (1, 2, 3)] == [clipped.sum(), dark.sum(), unseen.sum()]
    assert finished(whole, made_light, calibration, face=5).faces.shape == (6, 5, 5, 3)
    recovered = finished(whole, made_light, replace(calibration, sun=3.0))
    assert not (recovered.unresolved == 1).any()
