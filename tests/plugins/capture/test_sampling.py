"""Resampling of what lenses see: true, without ringing, without aliasing, and no light lost."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stitch_support import HALF_TURN, lens_view, smooth_sky, sphere

from studio_core.capturing.artifacts import View
from studio_core.imaging.latlong import pixel_solid_angles
from studio_core.imaging.projection import MODELS, OCAM, Circle, Lens, pixel_points, unproject
from studio_plugins.capture.sampling import lens_source, look_through


def lens_areas(lens: Lens, circle: Circle, size: int) -> np.ndarray:
    """(size, size) solid angles of a lens' pixels, by the corners' triangles."""
    corners, _ = unproject(lens, circle, pixel_points(size + 1, size + 1) - 0.5)
    a, b, c, d = corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]
    return 0.5 * np.linalg.norm(np.cross(c - a, d - b), axis=-1)


@pytest.mark.parametrize("model", [m for m in MODELS if m != OCAM])
@pytest.mark.parametrize("height", [32, 128, 512])
def test_a_smooth_sky_is_seen_as_it_is(model: str, height: int) -> None:
    view = lens_view(smooth_sky, Lens(model, 180.0), HALF_TURN)
    directions = sphere(height) @ HALF_TURN
    seen = look_through(lens_source(view, np.pi / height), directions)
    wanted = smooth_sky(sphere(height))
    share = pixel_solid_angles(height, 2 * height) @ seen.seen.sum(axis=1) / (4 * np.pi)
    lost = 0.1 if model == "orthographic" else 0.035 if height == 32 else 0.02  # its rim is 10° a pixel
    assert share == pytest.approx(0.5, abs=lost)
    assert not seen.light[~seen.seen].any()
    inside = seen.seen & (directions[..., 2] < -np.cos(np.radians(70)))  # pixels of the rim cover too much
    np.testing.assert_allclose(seen.light[inside], wanted[inside], rtol=0.004 if height > 32 else 0.03)


@given(st.integers(0, 2**32 - 1), st.sampled_from([64, 128, 256]))
@settings(max_examples=10)
def test_lamps_of_one_pixel_keep_their_light(seed: int, height: int) -> None:
    rng = np.random.default_rng(seed)
    size, lens = 128, Lens(fov=185.0)
    circle = Circle(64.0, 64.0, 60.0)
    light = np.full((size, size, 3), 0.01, np.float32)
    for _ in range(60):
        angle, reach = rng.uniform(0, 2 * np.pi), 54 * np.sqrt(rng.random())
        light[int(64 + reach * np.sin(angle)), int(64 + reach * np.cos(angle))] = rng.uniform(5, 50)
    view = View(light, np.ones((size, size), np.bool_), circle, lens)
    seen = look_through(lens_source(view, np.pi / height), sphere(height))
    made = (seen.light.astype(np.float64) * pixel_solid_angles(height, 2 * height)[:, None, None]).sum()
    _, inside = unproject(lens, circle, pixel_points(size, size))
    wanted = (light * (lens_areas(lens, circle, size) * inside)[..., None]).sum()
    assert made == pytest.approx(wanted, rel=0.03)
    assert seen.light.min() >= 0
    assert seen.light.max() <= light.max() * 1.0001


def test_next_to_a_lamp_nothing_rings() -> None:
    light = np.ones((100, 100, 3), np.float32)
    light[40:55, 45:52] = 5000
    view = View(light, np.ones((100, 100), np.bool_), Circle(50, 50, 48), Lens(fov=180.0))
    seen = look_through(lens_source(view, np.pi / 512), sphere(512) @ HALF_TURN)
    assert seen.light[seen.seen].min() >= 1 - 1e-5
    assert seen.light.max() <= 5000.01


def test_noise_finer_than_the_new_pixels_is_averaged() -> None:
    noise = np.random.default_rng(1).random((400, 400, 3)).astype(np.float32)
    view = View(noise, np.ones((400, 400), np.bool_), Circle(200, 200, 195), Lens(fov=180.0))
    shown = {}
    for height in (24, 48, 96):
        seen = look_through(lens_source(view, np.pi / height), sphere(height) @ HALF_TURN)
        middle = seen.light[height // 3 : -height // 3][seen.seen[height // 3 : -height // 3]]
        shown[height] = float(middle.std())
    single = float(noise.std())
    for height, spread in shown.items():
        assert spread < 1.3 * single * height / 195 + 0.01, height


def test_what_is_not_finite_or_not_usable_is_not_seen() -> None:
    view = lens_view(smooth_sky, Lens(fov=180.0), HALF_TURN)
    light, usable = view.light.copy(), view.usable.copy()
    light[80:90, 90:100] = np.nan
    light[100:104, 60:64] = np.inf
    usable[120:130, 120:130] = False
    spoiled = View(light, usable, view.circle, view.lens)
    for height in (32, 200):
        seen = look_through(lens_source(spoiled, np.pi / height), sphere(height) @ HALF_TURN)
        assert np.isfinite(seen.light).all()
        wanted = smooth_sky(sphere(height))
        np.testing.assert_allclose(seen.light[seen.seen], wanted[seen.seen], rtol=0.03)
        whole = look_through(lens_source(view, np.pi / height), sphere(height) @ HALF_TURN)
        assert 50 / 200**2 * seen.seen.size / 4 < (whole.seen & ~seen.seen).sum()


def test_clipped_and_dark_places_stay_where_they_are() -> None:
    view = lens_view(smooth_sky, Lens(fov=180.0), HALF_TURN)
    clipped, dark = np.zeros((2, 200, 200), np.bool_)
    clipped[60:75, 80:95] = True
    dark[130:140, 100:120] = True
    view = View(view.light, view.usable, view.circle, view.lens, clipped, dark)
    areas = lens_areas(view.lens, view.circle, 200)
    for height in (64, 256):
        seen = look_through(lens_source(view, np.pi / height), sphere(height) @ HALF_TURN)
        area = pixel_solid_angles(height, 2 * height)[:, None]
        assert (area * seen.clipped).sum() == pytest.approx(areas[clipped].sum(), rel=0.35)
        assert (area * seen.dark).sum() == pytest.approx(areas[dark].sum(), rel=0.25)
        assert not (seen.clipped & seen.dark).any()
