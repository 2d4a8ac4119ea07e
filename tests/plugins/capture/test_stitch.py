"""Stitching: the finished picture shows what was there, all around, whichever way the lenses were held."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stitch_support import (
    HALF_TURN,
    irradiance,
    lens_view,
    pair,
    registration,
    relative,
    smooth_sky,
    sphere,
    turn,
)

from studio.bench.phone import Phone, lens_light
from studio_core.capturing.artifacts import View
from studio_core.capturing.settings import FEATHER, GRADIENT, MULTIBAND, StitchSettings
from studio_core.errors import Cancelled, InputError
from studio_core.imaging.environment import load_environment
from studio_core.imaging.latlong import pixel_solid_angles
from studio_core.imaging.projection import Circle, Lens
from studio_core.parallel import Workers
from studio_core.shading.job import Job
from studio_plugins.capture.stitch import stitch, stitch_equirectangular, turned

LENS = Lens(fov=195.0)
BLENDS = [MULTIBAND, GRADIENT, FEATHER]


def still(width: int = 256, blend: str = MULTIBAND, **more: float) -> StitchSettings:
    return StitchSettings(width=width, blend=blend, level=False, **more)


@pytest.mark.parametrize("blend", BLENDS)
@pytest.mark.parametrize("model", ["equidistant", "equisolid", "stereographic"])
def test_two_lenses_make_the_sky_that_they_saw(blend: str, model: str) -> None:
    lens = Lens(model, 195.0)
    rotation = HALF_TURN @ turn((1, 2, -1), 4)
    made = stitch(
        pair(smooth_sky, lens, rotation), registration(lens, rotation), still(blend=blend), Job("x")
    )
    wanted = smooth_sky(sphere(128))
    assert not made.unseen.any()
    assert not made.clipped.any()
    np.testing.assert_allclose(made.light, wanted, rtol=0.02)
    assert relative(irradiance(made.light), irradiance(wanted)) < 0.002
    np.testing.assert_array_equal(made.upright, HALF_TURN)
    middle = made.from_front[40:88]
    assert (middle[:, 100:156] == 1).all()
    assert (middle[:, :28] == 0).all()


@given(st.floats(0, 360), st.floats(-12, 12), st.floats(-12, 12), st.sampled_from([90.0, 180.0, -90.0, 0.0]))
@settings(max_examples=8)
def test_however_the_back_lens_was_held(azimuth: float, nod: float, turned_by: float, roll: float) -> None:
    axis = (np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0.0)
    rotation = HALF_TURN @ turn(axis, nod) @ turn((0, 1, 0), turned_by / 3) @ turn((0, 0, 1), roll)
    lens = Lens(fov=210.0)
    made = stitch(pair(smooth_sky, lens, rotation), registration(lens, rotation), still(128), Job("x"))
    assert np.isfinite(made.light).all()
    assert made.unseen.mean() < 0.02
    wanted = smooth_sky(sphere(64))
    error = np.abs(np.log(made.light / wanted)).max(axis=2)
    assert np.quantile(error[~made.unseen], 0.995) < 0.03


def test_falloff_and_gain_are_undone() -> None:
    coefficients = (-0.2, 0.05, -0.15)

    def darkened(view: View, gain: float) -> View:
        y, x = np.mgrid[0:200, 0:200] + 0.5
        s = np.hypot(x - view.circle.x, y - view.circle.y) / view.circle.radius  # equidistant: θ / θ_max
        a, b, c = coefficients
        share = (1 + a * s**2 + b * s**4 + c * s**6) * gain
        return View((view.light * share[..., None]).astype(np.float32), view.usable, view.circle, view.lens)

    views = pair(smooth_sky, LENS, HALF_TURN)
    views = {"front": darkened(views["front"], 1.0), "back": darkened(views["back"], 1 / 1.4)}
    made = stitch(views, registration(LENS, HALF_TURN, 1.4, coefficients), still(), Job("x"))
    np.testing.assert_allclose(made.light, smooth_sky(sphere(128)), rtol=0.02)


@pytest.mark.parametrize("blend", BLENDS)
def test_a_wrong_gain_leaves_no_line(blend: str) -> None:
    """Where both lenses meet the picture may not change quicker than the sky, but for what is spread."""
    views = pair(smooth_sky, LENS, HALF_TURN, 400)
    back = views["back"]
    views["back"] = View(back.light * np.float32(1.2), back.usable, back.circle, back.lens)
    made = stitch(views, registration(LENS, HALF_TURN), still(512, blend), Job("x"))
    grey = np.log(made.light[..., 1]) - np.log(smooth_sky(sphere(256))[..., 1])
    assert grey.min() > -0.02
    assert grey.max() < np.log(1.2) + 0.02
    middle = grey[64:192]  # away from the poles, where columns are dense
    step = np.abs(np.diff(middle, axis=1)).max()
    assert step < (0.055 if blend == FEATHER else 0.035)  # all at once would be 0.18
    rows = grey[[0, -1]]  # each pole is one place
    assert (rows.max(axis=1) - rows.min(axis=1)).max() < 0.06


def test_turning_the_settings_turns_the_picture() -> None:
    views, known = pair(smooth_sky, LENS, HALF_TURN), registration(LENS, HALF_TURN)
    plain = stitch(views, known, still(), Job("x")).light
    moved = stitch(views, known, still(north=90.0), Job("x")).light
    np.testing.assert_allclose(moved, np.roll(plain, 64, axis=1), rtol=0.01)  # to the right
    chosen = still(pitch=20.0, roll=-35.0, north=50.0)
    made = stitch(views, known, chosen, Job("x"))
    wanted = smooth_sky(sphere(128) @ turned(chosen))
    np.testing.assert_allclose(made.light, wanted, rtol=0.02)


def test_what_the_angles_mean() -> None:
    middle, up = np.array([0.0, 0, 1]), np.array([0.0, 1, 0])
    assert (turned(StitchSettings(pitch=20)) @ middle)[1] > 0  # goes up
    assert (turned(StitchSettings(north=20)) @ middle)[0] < 0  # to the right: u grows towards −x
    assert (turned(StitchSettings(roll=20)) @ up)[0] < 0  # clockwise: up goes to the right
    for settings_ in (StitchSettings(pitch=33), StitchSettings(roll=-71), StitchSettings(north=200, roll=5)):
        np.testing.assert_allclose(turned(settings_) @ turned(settings_).T, np.eye(3), atol=1e-12)


def test_one_lens_sees_half_and_the_rest_is_a_guess() -> None:
    view = lens_view(smooth_sky, LENS, HALF_TURN)
    made = stitch({"front": view}, None, still(), Job("x"))
    wanted = smooth_sky(sphere(128))
    seen = ~made.unseen
    np.testing.assert_allclose(made.light[seen], wanted[seen], rtol=0.02)
    assert 0.4 < made.unseen.mean() < 0.5
    assert (made.from_front == seen).all()
    guess = made.light[made.unseen]
    assert np.isfinite(guess).all()
    assert (guess > 0.5 * wanted[seen].min(axis=0)).all()
    assert (guess < 2 * wanted[seen].max(axis=0)).all()
    away = np.abs(np.log(made.light / wanted)).max(axis=2)
    edge = made.unseen & np.roll(seen, 2, axis=1)
    assert np.quantile(away[edge], 0.9) < 0.15  # it begins with what is next to it
    only_back = stitch({"back": view}, None, still(), Job("x"))
    np.testing.assert_array_equal(only_back.light, made.light)


def test_lenses_that_leave_a_gap_have_it_filled_and_marked() -> None:
    lens = Lens(fov=170.0)
    made = stitch(pair(smooth_sky, lens, HALF_TURN), registration(lens, HALF_TURN), still(), Job("x"))
    wanted = smooth_sky(sphere(128))
    share = pixel_solid_angles(128, 256) @ made.unseen.sum(axis=1) / (4 * np.pi)
    assert share == pytest.approx(np.sin(np.radians(6.4)), abs=0.01)  # lenses lose 1.5 pixels at the rim
    np.testing.assert_allclose(made.light[~made.unseen], wanted[~made.unseen], rtol=0.02)
    assert np.abs(np.log(made.light / wanted)).max() < 0.5


def test_what_no_exposure_resolved_is_carried_over() -> None:
    views = pair(smooth_sky, LENS, HALF_TURN)
    front = views["front"]
    clipped, dark = np.zeros((2, 200, 200), np.bool_)
    clipped[60:80, 90:110] = True
    dark[120:140, 90:110] = True
    views["front"] = View(front.light, front.usable, front.circle, front.lens, clipped, dark)
    made = stitch(views, registration(LENS, HALF_TURN), still(), Job("x"))
    assert made.dark is not None
    up, down = np.argwhere(made.clipped).mean(axis=0), np.argwhere(made.dark).mean(axis=0)
    assert up[0] < 64 < down[0]
    assert abs(up[1] - 128) < 4
    assert abs(down[1] - 128) < 4


def test_threads_change_nothing_and_a_cancelled_job_stops(workers: Workers) -> None:
    views, known = pair(smooth_sky, LENS, HALF_TURN), registration(LENS, HALF_TURN)
    alone = stitch(views, known, still(600), Job("x"))
    together = stitch(views, known, still(600), Job("x"), workers)
    np.testing.assert_array_equal(alone.light, together.light)
    job = Job("x", lambda job: job.cancel() if job.done > 2 else None)
    with pytest.raises(Cancelled):
        stitch(views, known, still(600), job)
    assert job.done < job.total


def test_two_lenses_must_be_registered_and_there_must_be_one() -> None:
    with pytest.raises(ValueError, match="how the two lenses stand"):
        stitch(pair(smooth_sky, LENS, HALF_TURN), None, still(), Job("x"))
    with pytest.raises(ValueError, match="nothing to join"):
        stitch({}, None, still(), Job("x"))


def equirect_view(light: np.ndarray) -> View:
    return View(light, np.ones(light.shape[:2], np.bool_), Circle(1, 1, 1), Lens())


def test_an_equirectangular_picture_passes_bit_for_bit_or_turned() -> None:
    light = smooth_sky(sphere(128))
    plain = stitch_equirectangular(equirect_view(light), still(), Job("x"))
    np.testing.assert_array_equal(plain.light, light)
    assert plain.light is not light
    np.testing.assert_array_equal(plain.upright, np.eye(3))
    chosen = still(pitch=40.0, north=-130.0, roll=15.0)
    made = stitch_equirectangular(equirect_view(light), chosen, Job("x"))
    np.testing.assert_allclose(made.light, smooth_sky(sphere(128) @ turned(chosen)), rtol=0.003)
    smaller = stitch_equirectangular(equirect_view(light), still(64), Job("x"))
    np.testing.assert_allclose(smaller.light, smooth_sky(sphere(32)), rtol=0.01)
    with pytest.raises(InputError, match=r"256 × 100.*twice as wide"):
        stitch_equirectangular(equirect_view(light[:100]), still(), Job("x"))
    nearly = stitch_equirectangular(equirect_view(light[1:, :-1]), still(254), Job("x"))
    assert nearly.light.shape == (127, 254, 3)


def test_turning_noise_keeps_its_light() -> None:
    light = (np.random.default_rng(4).random((96, 192, 3)) ** 8).astype(np.float32)
    light[30, 40] = 60
    made = stitch_equirectangular(equirect_view(light), still(192, pitch=30.0, roll=20.0), Job("x"))
    before, after = irradiance(light), irradiance(made.light)
    assert after.mean() == pytest.approx(before.mean(), rel=0.03)
    assert made.light.min() >= 0


@pytest.mark.parametrize("name", ["courtyard", "interior", "studio", "sunset"])
def test_rooms_keep_their_light(shared_data: Path, name: str) -> None:
    """Ideal lenses in real rooms, misaligned and with near things: irradiance within half a percent."""
    room = load_environment(shared_data / "cc0" / "hdri_polyhaven_cc0" / f"{name}.exr")[0].pixels
    phone = Phone(
        size=(320, 320),
        lens=LENS,
        circle=Circle(162, 158, 150),
        misalignment=(1.5, -1.0, 2.0),
        falloff=0.3,
        samples=4,
    )
    truth = lens_light(room, phone, 3)
    known = registration(LENS, truth.rotation, 1.0, (-0.15, -0.15, 0.0))
    made = stitch({side: truth.view(side) for side in ("front", "back")}, known, still(512), Job("x"))
    assert np.isfinite(made.light).all()
    assert not made.unseen.any()
    assert relative(irradiance(made.light), irradiance(room)) < 0.005
    half = room.reshape(256, 2, 512, 2, 3).mean(axis=(1, 3, 4))
    apart = np.abs(np.log2((made.light.mean(axis=2) + 1e-5) / (half + 1e-5)))
    assert np.median(apart) < 0.06
