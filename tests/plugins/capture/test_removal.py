"""Reflections are replaced: nearer to the clean picture, nothing changed outside, wherever the source is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from capture_rooms import room
from hypothesis import given, settings
from hypothesis import strategies as st

from studio.bench.phone import Arc, Phone, lens_light
from studio_core.capturing.artifacts import Registration, View
from studio_core.capturing.settings import BACK, FRONT, OTHER_LENS, RING, Patch
from studio_core.imaging.projection import Circle, Lens, pixel_points, unproject
from studio_core.shading.job import Job
from studio_plugins.capture.removal import clean_azimuth, remove
from studio_plugins.capture.ring import angles, covers

PHONE = Phone(size=(300, 300), lens=Lens(fov=194.0), circle=Circle(151.0, 148.0, 130.0), samples=1)
ARC = Arc(FRONT, 70.0, 40.0, 5.0, 1.3)
OVER = Patch(FRONT, 47.0, 46.0, 91.0, 97.0)


def registered(truth, falloff=(0.0, 0.0, 0.0)):
    return Registration(truth.rotation, truth.phone.lens, np.ones(3), falloff, 0.1, 99, True)


def inside(view, *patches):
    way, _ = unproject(view.lens, view.circle, pixel_points(*view.usable.shape))
    return view.usable & np.any([covers(patch, *angles(way)) for patch in patches], axis=0)


def stops(light, clean, mask):
    return np.abs(np.log2((light[mask].mean(1) + 1e-9) / (clean[mask].mean(1) + 1e-9)))


def removed(phone, *patches, seed=0):
    truth = lens_light(room(seed), phone, seed)
    views = {FRONT: truth.view(FRONT), BACK: truth.view(BACK)}
    slope = phone.falloff / 2
    made = remove(views, registered(truth, (-slope, -slope, 0.0)), patches, Job("remove"))
    return truth, views, made


@pytest.mark.parametrize("parallax", [0.0, 2.0])
@pytest.mark.parametrize("side", [FRONT, BACK])
def test_what_the_other_lens_shows_comes_in(side, parallax):
    phone = replace(PHONE, arcs=(replace(ARC, side=side),), parallax=parallax, falloff=0.3)
    patch = replace(OVER, side=side)
    truth, views, made = removed(phone, patch)
    mask, clean = inside(views[side], patch), truth.side(side).clean
    before, after = stops(views[side].light, clean, mask), stops(made.lights[side], clean, mask)
    assert after.mean() < (0.55 if parallax else 0.25) * before.mean()
    assert made.patches == (patch,)
    assert made.notes == ()
    assert not np.array_equal(made.lights[side], views[side].light)
    np.testing.assert_array_equal(made.lights[side][~mask], views[side].light[~mask])
    other = BACK if side == FRONT else FRONT
    assert made.lights[other] is views[other].light


def test_a_rectangle_deeper_than_the_overlap_keeps_its_own_detail_there():
    """194° overlap by 14°; the reflection is 17° deep."""
    phone = replace(PHONE, arcs=(replace(ARC, depth=17.0),))
    patch = replace(OVER, inner=78.0)
    truth, views, made = removed(phone, patch)
    mask = inside(views[FRONT], patch)
    before = stops(views[FRONT].light, truth.front.clean, mask)
    after = stops(made.lights[FRONT], truth.front.clean, mask)
    assert after.mean() < 0.6 * before.mean()
    assert made.patches[0].source == OTHER_LENS


@settings(max_examples=10, deadline=None)
@given(
    st.floats(0, 360),
    st.floats(1, 360),
    st.floats(60, 95),
    st.floats(1, 30),
    st.sampled_from((OTHER_LENS, RING)),
    st.integers(0, 99),
)
def test_only_pixels_of_rectangles_change_and_all_stay_light(azimuth, width, low, deep, source, seed):
    rng = np.random.default_rng(seed)
    light = rng.lognormal(size=(90, 100, 3)).astype(np.float32)
    light[rng.random((90, 100)) < 0.2] = 0
    circle, lens = Circle(51.0, 44.0, 40.0), Lens(fov=196.0)
    usable = np.hypot(*np.moveaxis(pixel_points(90, 100) - (51, 44), -1, 0)) < 39.5
    usable &= rng.random(usable.shape) < 0.98
    views = {
        side: View(light[::turn].copy(), usable, circle, lens) for side, turn in ((FRONT, 1), (BACK, -1))
    }
    patch = Patch(FRONT, azimuth, width, low, low + deep, source, 100.0)
    known = Registration(np.diag([-1.0, 1.0, -1.0]), lens, np.ones(3), (0.0, 0.0, 0.0), 0.1, 9, True)
    made = remove(views, known, (patch,), Job("remove")).lights[FRONT]
    assert np.isfinite(made).all()
    assert (made >= 0).all()
    mask = inside(views[FRONT], patch)
    np.testing.assert_array_equal(made[~mask], light[~mask])


def smooth_view():
    """Light that is nearly the same all around, darker below, and a reflection at 70°."""
    circle, lens = Circle(151.0, 148.0, 130.0), Lens(fov=194.0)
    way, _ = unproject(lens, circle, pixel_points(300, 300))
    light = np.repeat((1.5 + 0.5 * way[..., 1])[..., None], 3, axis=2).astype(np.float32)
    usable = np.hypot(*np.moveaxis(pixel_points(300, 300) - (151, 148), -1, 0)) < 129
    return View(light, usable, circle, lens), way


def test_the_ring_fills_what_only_one_lens_sees():
    clean, way = smooth_view()
    azimuth, theta = angles(way)
    core = covers(replace(OVER, azimuth=50, width=40, inner=92), azimuth, theta)
    bright = replace(clean, light=np.where(core[..., None], clean.light * 2, clean.light))
    made = remove({FRONT: bright}, None, (OVER,), Job("remove"))
    assert made.patches[0].source == RING
    assert made.notes == ()
    mask = inside(bright, OVER)
    assert stops(bright.light, clean.light, mask).mean() > 0.4
    assert stops(made.lights[FRONT], clean.light, mask).max() < 0.1


def test_a_clean_part_is_clean_and_like_its_surroundings():
    """Of a ring in two halves, the half that the patch lies in is taken."""
    clean, way = smooth_view()
    azimuth, _ = angles(way)
    rough = np.random.default_rng(0).lognormal(size=(300, 300, 1)) * 5
    light = np.where((azimuth > np.pi)[..., None], rough, clean.light).astype(np.float32)
    view = replace(clean, light=light)
    others = (Patch(FRONT, 100.0, 30.0, 85.0, 97.0), Patch(BACK, 0.0, 40.0, 85.0, 97.0))
    patch = Patch(FRONT, 150.0, 20.0, 90.0, 97.0)
    start = clean_azimuth(view, patch, others)
    assert start is not None
    assert 0 <= start <= 80
    assert clean_azimuth(view, replace(patch, width=340.0), others) is None


def test_a_patch_without_any_source_stays_and_is_named():
    clean, _ = smooth_view()
    patch = replace(OVER, width=350.0)
    made = remove({FRONT: clean}, None, (patch,), Job("remove"))
    np.testing.assert_array_equal(made.lights[FRONT], clean.light)
    assert made.notes == (
        "The reflection at 222° of the front picture has no clean part of the ring to replace it.",
    )


def test_patches_that_are_not_used_do_nothing():
    clean, _ = smooth_view()
    patch = replace(OVER, used=False)
    made = remove({FRONT: clean}, None, (patch, replace(OVER, side=BACK)), Job("remove"))
    assert made.lights[FRONT] is clean.light
    assert made.patches[0] == patch


@pytest.mark.parametrize("side", [FRONT, BACK])
def test_lamps_that_one_lens_shows_neither_vanish_nor_come_in(side):
    """In the rectangle, one of the lenses sees a lamp that the other does not: near things are shifted."""
    clean, way = smooth_view()
    azimuth, theta = angles(way)
    core = covers(replace(OVER, azimuth=50, width=40, inner=92), azimuth, theta)[..., None]
    towards = np.array([np.cos(1.3) * np.sin(1.64), np.sin(1.3) * np.sin(1.64), -np.cos(1.64)])
    if side == BACK:
        towards = towards * [-1, 1, -1]
    lamp = (way @ towards > np.cos(0.02))[..., None]
    assert lamp.sum() > 4
    lights = {FRONT: np.where(core, clean.light * 2, clean.light), BACK: clean.light}
    lights[side] = np.where(lamp, np.float32(300), lights[side])
    views = {name: replace(clean, light=light) for name, light in lights.items()}
    known = Registration(np.diag([-1.0, 1.0, -1.0]), clean.lens, np.ones(3), (0.0, 0.0, 0.0), 0.1, 9, True)
    made = remove(views, known, (OVER,), Job("remove")).lights[FRONT]
    mask = inside(clean, OVER)
    if side == FRONT:
        assert made[lamp[..., 0] & mask].mean() > 200
        mask &= ~lamp[..., 0]
    assert made[mask].max() < 4.5
    assert stops(made, clean.light, mask).mean() < 0.1
