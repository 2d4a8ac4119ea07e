"""The simulated phone: what its photographs show is where and as bright as its truth says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio.bench.phone import Arc, Phone, Shots, lens_light, shoot
from studio.bench.phone_files import as_dual, write_shots
from studio.bench.phone_random import OTHER, TUNED, random_phone
from studio.bench.phone_response import FAMILIES, Curve
from studio_core.capturing.settings import BACK, FRONT
from studio_core.imaging.latlong import pixel_directions
from studio_core.imaging.projection import Circle, Lens, project
from studio_core.imaging.warping import moved_points

SMALL = Phone(size=(120, 100), circle=Circle(61.0, 49.0, 44.0))


def room(height: int = 64) -> np.ndarray:
    """Smooth light that is different everywhere, (H, 2H, 3)."""
    d = pixel_directions(height, 2 * height)
    return (1 + 0.5 * d + 0.2 * d[..., [1, 2, 0]] ** 2).astype(np.float32)


def light_in(d: np.ndarray) -> np.ndarray:
    """What `room` shows in directions (..., 3)."""
    return 1 + 0.5 * d + 0.2 * d[..., [1, 2, 0]] ** 2


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), st.sampled_from([FRONT, BACK]))
@settings(max_examples=8)
def test_a_direction_of_the_room_lies_where_the_truth_projects_it(
    yaw: float, pitch: float, roll: float, side: str
) -> None:
    phone = replace(SMALL, tilt=(yaw, 0, roll), misalignment=(roll, pitch, yaw), back_scale=1.05)
    truth = lens_light(room(), phone)
    lens_way = np.array([[0.3, 0.2, -1], [-0.5, 0.1, -0.8], [0.0, -0.9, -0.2]])
    in_front = lens_way if side == FRONT else lens_way @ truth.rotation.T
    expected = light_in(_unit(in_front @ truth.room_from_front.T))
    points, seen = project(phone.lens, truth.side(side).circle, lens_way)
    assert seen.all()
    for point, colour in zip(points, expected, strict=True):
        x, y = (point - 0.5).astype(int)
        around = truth.side(side).light[y : y + 2, x : x + 2].mean((0, 1))
        np.testing.assert_allclose(around, colour, rtol=0.02)


def _unit(d: np.ndarray) -> np.ndarray:
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


def test_without_misalignment_the_back_lens_looks_the_other_way() -> None:
    truth = lens_light(room(), SMALL)
    np.testing.assert_allclose(truth.rotation, np.diag([-1, 1, -1]), atol=1e-12)
    np.testing.assert_allclose(truth.room_from_front @ [0, 0, -1], [0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("family", FAMILIES)
def test_numbers_give_back_the_exposure(family: str) -> None:
    curve = Curve(family, 2.1, 0.7, pedestal=0.05)
    for channel in range(3):
        x = np.linspace(0.001, 1 / curve.gains[channel], 300)
        numbers = curve.encode(x, channel)
        assert (np.diff(numbers) > 0).all()
        assert curve.encode(np.array([0.0, 1.0, 9.0]), channel) == pytest.approx([0.05, 1, 1])
        np.testing.assert_allclose(curve.exposure(numbers, channel), x, rtol=2e-3)
    log = curve.log_exposure(257)
    assert log[:, 128] == pytest.approx([0, 0, 0], abs=1e-12)
    grey = [float(curve.exposure(0.525, channel)) for channel in range(3)]
    assert grey == pytest.approx([grey[1]] * 3, rel=1e-3)


def test_photographs_are_the_light_through_exposure_and_response() -> None:
    phone = replace(SMALL, curve=Curve("filmic"), bits=16, full_well=1e12, read_noise=0.0, evs=(-3, -1, 1))
    shots = shoot(room(), phone, 3)
    truth = shots.truth.front
    inside = shots.truth.view(FRONT).usable
    found = []
    for shot, ev in zip(shots.front, truth.evs, strict=True):
        number = shot.pixels[inside][:, 1] / 65535
        fine = (number > 0.02) & (number < 0.99)
        back = phone.curve.exposure(number[fine], 1) / 2.0**ev
        found.append(np.median(back / truth.light[inside][fine, 1]))
        np.testing.assert_allclose(back / truth.light[inside][fine, 1], found[0], rtol=5e-3)
    assert phone.key == pytest.approx(found[0] * np.median(truth.light[inside].mean(1)), rel=0.01)


def test_files_may_lie_about_exposures() -> None:
    phone = replace(SMALL, listed_errors=((0, 0, 0.8), ()), back_ev=0.5)
    shots = shoot(room(), phone)
    said = [shot.facts.ev for shot in shots.front]
    assert np.diff(said) == pytest.approx([2, 2.8])
    assert shots.truth.front.evs == (-2, 0, 2)
    assert shots.back[0].facts.ev == pytest.approx(said[0] + 0.5)


def test_an_arc_is_as_strong_as_asked_and_only_there() -> None:
    arc = Arc(FRONT, 90, 60, 8, 1.5)
    truth = lens_light(room(), replace(SMALL, arcs=(arc,), samples=3))
    stops, circle = truth.front.stops, truth.front.circle
    y, x = np.mgrid[0 : stops.shape[0], 0 : stops.shape[1]] + 0.5
    reach = np.hypot(x - circle.x, y - circle.y)
    azimuth = np.degrees(np.arctan2(circle.y - y, x - circle.x))
    within = (np.abs(azimuth - 90) < 30) & (reach < circle.radius)
    assert (stops[~within & (np.abs(azimuth - 90) > 34)] == 0).all()
    assert (stops[reach < circle.radius * (1 - 9 / 95)] == 0).all()
    core = within & (reach > circle.radius * (1 - 5 / 95)) & (reach < circle.radius * 0.98)
    assert np.median(stops[core]) == pytest.approx(1.5, abs=0.35)
    assert (truth.back.stops == 0).all()
    np.testing.assert_array_equal(truth.back.light, truth.back.clean)


def test_a_shaken_shot_shows_the_room_where_its_motion_says() -> None:
    lamp = np.full((128, 256, 3), 0.02, np.float32)
    lamp[63:65, 127:129] = 5.0  # straight ahead
    phone = replace(SMALL, size=(300, 300), circle=Circle(150, 150, 140), shake=1.0, read_noise=0, key=0.02)
    shots = shoot(lamp, phone, 5)
    assert shots.truth.front.motions[1].rotation == (0, 0, 0)
    found = []
    for shot, motion in zip(shots.front, shots.truth.front.motions, strict=True):
        bright = (shot.pixels[:, :, 1] > 0.8 * shot.pixels.max()).astype(float)
        y, x = np.mgrid[0:300, 0:300] + 0.5
        middle = np.array([(bright * x).sum(), (bright * y).sum()]) / bright.sum()
        there = moved_points(np.array([150, 150]), motion, phone.size, phone.circle, phone.lens)
        assert middle == pytest.approx(there, abs=0.5)
        found.append(there)
    assert np.ptp(found, axis=0).max() > 0.5


def test_parallax_moves_what_both_lenses_see_by_as_much_as_asked() -> None:
    still, moved = (lens_light(room(), replace(SMALL, parallax=p), 4) for p in (0.0, 2.5))
    change = np.abs(moved.front.light - still.front.light)[still.view(FRONT).usable]
    assert 0.001 < change.max() < 0.05  # 1.25° of light that changes by less than 1 a radian
    assert change.max() > np.abs(moved.front.light - still.front.light)[44:54, 56:66].max()


def test_parallax_turns_what_both_lenses_see() -> None:
    still, moved = (
        lens_light(room(16), replace(SMALL, parallax=p, misalignment=(1, 2, -1)), 4) for p in (0.0, 2.5)
    )
    np.testing.assert_allclose(still.seen, still.rotation, atol=1e-9)
    turned = np.degrees(np.arccos((np.trace(moved.seen.T @ moved.rotation) - 1) / 2))
    assert 0.01 < turned < 2.5
    assert np.linalg.det(moved.seen) == pytest.approx(1)


def test_what_moves_is_marked_and_in_the_photographs() -> None:
    phone = replace(SMALL, mover=8.0, read_noise=0, full_well=1e12)
    moving, still = shoot(room(), phone, 2), shoot(room(), replace(phone, mover=0), 2)
    assert not still.truth.front.moved.any()
    assert not moving.truth.back.moved.any()
    for a, b in zip(moving.front, still.front, strict=True):
        differs = (np.abs(a.pixels.astype(int) - b.pixels) > 1).any(axis=2)
        assert differs.any()
        assert not (differs & ~moving.truth.front.moved).any()


def test_the_same_seed_gives_the_same_pixels() -> None:
    one, again, other = (shoot(room(), SMALL, seed) for seed in (7, 7, 8))
    assert [s.digest for s in one.front + one.back] == [s.digest for s in again.front + again.back]
    assert one.front[0].digest != other.front[0].digest


def test_random_phones_come_from_two_sets_with_nothing_in_common() -> None:
    for name in ("fov", "falloff", "arc_width", "arc_depth", "arc_stops", "full_well", "gamma", "glare"):
        for low, high in getattr(TUNED, name):
            assert all(high <= a or b <= low for a, b in getattr(OTHER, name)), name
    assert not set(TUNED.curves) & set(OTHER.curves)
    assert not {m for m, _ in TUNED.lenses} & {m for m, _ in OTHER.lenses}
    for tuned in (True, False):
        phones = [random_phone(seed, tuned) for seed in range(30)]
        assert len({phone.lens for phone in phones}) > 25
        assert 10 <= sum(bool(phone.arcs) for phone in phones) < 30
        assert all(190 <= phone.lens.fov <= 205 for phone in phones)
        assert not random_phone(1, tuned, reflections=False).arcs


def test_files_hold_exif_and_the_pixels(tmp_path: Path) -> None:
    from PIL import Image

    shots: Shots = shoot(room(), SMALL)
    front, back = write_shots(shots, tmp_path, position=True)
    assert [p.name for p in front + back] == [f"{s}_{i}.jpg" for s in (FRONT, BACK) for i in (1, 2, 3)]
    with Image.open(back[2]) as picture:
        part = picture.getexif().get_ifd(0x8769)
        assert float(part[33434]) == pytest.approx(4 / 60, rel=1e-4)
        assert (part[34855], float(part[33437])) == (100, 2.0)
        assert 2 in picture.getexif().get_ifd(0x8825)
        off = np.abs(np.asarray(picture).astype(int) - shots.back[2].pixels)
    assert np.median(off) <= 2
    sixteen = shoot(room(), replace(SMALL, bits=16))
    (path, *_), _ = write_shots(sixteen, tmp_path, kind="png")
    import cv2

    read = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read[:, :, ::-1], sixteen.front[0].pixels)


@pytest.mark.parametrize("turns", [(0, 0), (1, 3), (2, 1)])
def test_two_circles_in_one_picture_lie_where_it_is_told(turns: tuple[int, int]) -> None:
    phone = replace(SMALL, back_shift=(5, 3), back_scale=0.9)
    shots = shoot(np.ones((16, 32, 3), np.float32), phone)
    dual, front, back = as_dual(shots, turns)
    assert len(dual) == 3
    pixels = dual[-1].pixels
    y, x = np.mgrid[0 : pixels.shape[0], 0 : pixels.shape[1]] + 0.5
    inside = np.zeros(pixels.shape[:2], bool)
    for circle in (front, back):
        reach = np.hypot(x - circle.x, y - circle.y)
        assert pixels[reach < circle.radius - 2].min() > 100
        inside |= reach < circle.radius + 1
    assert pixels[~inside].max() < 40
    assert front.x < back.x


def test_lens_models_may_be_any() -> None:
    for lens in (
        Lens("equisolid", 200),
        Lens("Kannala–Brandt", 195, (-0.02, 0.002)),
        Lens("orthographic", 180),
    ):
        made = lens_light(room(), replace(SMALL, lens=lens))
        assert np.isfinite(made.front.light).all()
        assert made.front.light[49, 61].min() > 0
