"""Circles of lenses in made-up photographs, hard ones among them, and in two real ones."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio.bench.phone import shoot
from studio.bench.phone_random import random_phone
from studio_core.errors import Cancelled
from studio_core.imaging.latlong import direction_to_uv
from studio_core.imaging.projection import Circle, Lens, pixel_points, unproject
from studio_core.shading.job import Job
from studio_plugins.capture.circle import find_circles

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]


def room(seed: int = 0) -> F32:
    """An equirectangular room of pictures and lamps on walls, (H, 2H, 3)."""
    rng = np.random.default_rng(seed)
    made = np.full((256, 512, 3), 0.3, np.float32)
    for _ in range(260):
        x, y = rng.integers(512), rng.integers(256)
        w, h = rng.integers(6, 40), rng.integers(6, 34)
        light = rng.uniform(0.03, 0.9) * rng.uniform(0.7, 1.3, 3) * (30 if rng.random() < 0.04 else 1)
        made[y : y + h, x : x + w] = light
    return made


def light_of(circles: list[Circle], size: tuple[int, int], seed: int = 0, edge: float = 0.004) -> F32:
    """(H, W, 3) light behind fisheyes of 190°, fading to nothing over the last `edge` of their radii."""
    width, height = size
    points = pixel_points(2 * height, 2 * width) / 2
    light = np.zeros((2 * height, 2 * width, 3), np.float32)
    picture = room(seed)
    for index, circle in enumerate(circles):
        directions, _ = unproject(Lens(), circle, points)
        u, v = direction_to_uv(directions * (np.array([-1, 1, -1]) if index % 2 else 1))
        seen = picture[np.minimum((v * 256).astype(int), 255), np.minimum((u * 512).astype(int), 511)]
        reach = np.hypot(points[..., 0] - circle.x, points[..., 1] - circle.y) / circle.radius
        light += seen * np.clip((1 - reach) / edge, 0, 1)[..., None].astype(np.float32)
    return np.asarray(light.reshape(height, 2, width, 2, 3).mean(axis=(1, 3)), np.float32)


def photograph(light: npt.NDArray[np.generic], ev: float, seed: int = 0) -> npt.NDArray[np.uint8]:
    """Bytes of a noisy sensor behind a power curve."""
    exposure = light * 2.0**ev
    noise = np.random.default_rng(seed).normal(0, 1, exposure.shape)
    numbers = np.clip(exposure + noise * np.sqrt(exposure / 5000 + 4e-7), 0, 1) ** (1 / 2.2)
    return np.rint(255 * numbers).astype(np.uint8)


def bracket(light: npt.NDArray[np.generic], seed: int = 0) -> list[npt.NDArray[np.uint8]]:
    return [photograph(light, ev, seed + i) for i, ev in enumerate((-3.0, -1.0, 1.0))]


def apart(found: Circle, truth: Circle) -> float:
    """The largest distance between both edges, in radii."""
    centres = math.hypot(found.x - truth.x, found.y - truth.y)
    return (centres + abs(found.radius - truth.radius)) / truth.radius


SIZE, ONE = (400, 330), Circle(197.3, 166.4, 142.6)


@pytest.mark.parametrize("seed", [0, 1, 5, 6])
def test_circles_of_simulated_phones(seed: int) -> None:
    """With soft edges, light that leaks over them, shiny rims and reflections of the frame."""
    phone = replace(random_phone(seed, tuned=seed % 2 == 0, radius=130.0), samples=1)
    shots = shoot(room(seed), phone, seed)
    for side, pictures in (("front", shots.front), ("back", shots.back)):
        (found,) = find_circles([p.pixels for p in pictures], 1)
        assert apart(found.circle, shots.truth.side(side).circle) < 0.01


def test_a_sharp_edge_is_found_to_a_third_of_a_pixel() -> None:
    (found,) = find_circles(bracket(light_of([ONE], SIZE)), 1)
    assert found.confidence > 0.8
    assert apart(found.circle, ONE) * ONE.radius < 0.4
    assert not found.by_hand


@given(st.floats(-25, 25), st.floats(-20, 20), st.floats(0.7, 1.05))
@settings(max_examples=5, deadline=None)
def test_wherever_it_lies(x: float, y: float, size: float) -> None:
    circle = Circle(200 + x, 165 + y, 145 * size)
    (found,) = find_circles([photograph(light_of([circle], SIZE), 0)], 1)
    assert apart(found.circle, circle) < 0.006


def test_it_grows_with_the_picture() -> None:
    import cv2

    frames = bracket(light_of([ONE], SIZE))
    large = [cv2.resize(f, None, fx=3, fy=3, interpolation=cv2.INTER_LINEAR) for f in frames]
    (small,), (found,) = find_circles(frames, 1), find_circles(large, 1)
    assert apart(found.circle, small.circle.scaled(3)) < 0.005


def test_sixteen_bits_and_light_itself() -> None:
    light = light_of([ONE], SIZE)
    wide = [np.rint(65535 * np.clip(light * gain, 0, 1) ** (1 / 2.2)).astype(np.uint16) for gain in (0.2, 1)]
    for pictures in (wide, [light]):
        (found,) = find_circles(pictures, 1)
        assert apart(found.circle, ONE) < 0.005


@pytest.mark.parametrize("stacked", [False, True])
@pytest.mark.parametrize("gap", [0.0, 14.0])
def test_two_circles_beside_or_above_each_other(stacked: bool, gap: float) -> None:
    """They may touch, and the phone was not quite level."""
    radius = 112.0
    circles = [Circle(121 - gap / 2, 125, radius), Circle(121 + 2 * radius + gap / 2, 129, radius)]
    size = (470, 252)
    if stacked:
        circles, size = [Circle(c.y, c.x, c.radius) for c in circles], (252, 470)
    pictures = bracket(light_of(circles, size, 3))
    found = find_circles(pictures, 2)
    assert len(found) == 2
    for one, truth in zip(found, circles, strict=True):
        assert apart(one.circle, truth) < 0.01
    assert len(find_circles(pictures, None)) == 2


def test_left_to_itself_it_sees_one_circle_in_a_picture_of_one() -> None:
    assert len(find_circles(bracket(light_of([ONE], SIZE)), None)) == 1
    wide = Circle(300.0, 140.0, 118.0)
    (found,) = find_circles(bracket(light_of([wide], (600, 280))), None)
    assert apart(found.circle, wide) < 0.01


def test_a_second_circle_that_is_not_there_is_a_guess() -> None:
    pictures = bracket(light_of([Circle(120, 125, 112)], (470, 250)))
    first, second = find_circles(pictures, 2)
    assert apart(first.circle, Circle(120, 125, 112)) < 0.01
    assert second.confidence < 0.1 < first.confidence
    assert second.circle.x > 235


@pytest.mark.parametrize("size", [(400, 236), (250, 330)])
def test_a_circle_that_the_picture_cuts_off(size: tuple[int, int]) -> None:
    circle = Circle(size[0] / 2 + 4.2, size[1] / 2 - 3.1, 141.5)
    (found,) = find_circles(bracket(light_of([circle], size)), 1)
    assert apart(found.circle, circle) < 0.01


def test_a_dark_room_is_no_darker_than_its_edge() -> None:
    (found,) = find_circles([photograph(light_of([ONE], SIZE), ev) for ev in (-9, -7, -5)], 1)
    assert apart(found.circle, ONE) < 0.01


def test_flare_over_a_part_of_the_edge_does_not_move_it() -> None:
    light = light_of([ONE], SIZE)
    points = pixel_points(SIZE[1], SIZE[0])
    x, y = points[..., 0] - ONE.x, points[..., 1] - ONE.y
    reach, angle = np.hypot(x, y) / ONE.radius, np.arctan2(y, x)
    light += (0.3 * np.exp(-((angle / 0.4) ** 2) - np.abs(reach - 1) * 15))[..., None].astype(np.float32)
    (found,) = find_circles(bracket(light), 1)
    assert apart(found.circle, ONE) < 0.01


@pytest.mark.parametrize(("seed", "bright"), [(1, 0.1), (2, 1.0)])
def test_a_shiny_rim_is_not_the_edge(seed: int, bright: float) -> None:
    """Not even one that outshines the room."""
    light = light_of([ONE], SIZE, seed)
    points = pixel_points(SIZE[1], SIZE[0])
    reach = np.hypot(points[..., 0] - ONE.x, points[..., 1] - ONE.y) / ONE.radius
    rim = bright * np.exp(-(((reach - 1.05) / 0.008) ** 2))
    light += rim[..., None].astype(np.float32)
    (found,) = find_circles(bracket(light), 1)
    assert apart(found.circle, ONE) < 0.01


def test_where_there_is_no_circle_it_is_not_confident() -> None:
    everywhere = light_of([Circle(200, 165, 600)], SIZE)
    noise = np.random.default_rng(0).integers(0, 20, (*SIZE[::-1], 3), np.uint8)
    for picture in (
        photograph(everywhere, 0),
        np.zeros((*SIZE[::-1], 3), np.uint8),
        np.full((*SIZE[::-1], 3), 255, np.uint8),
        noise,
        np.full((8, 6, 3), 7, np.uint8),
        np.full((*SIZE[::-1], 3), np.nan, np.float32),
    ):
        (found,) = find_circles([picture], 1)
        assert found.confidence < 0.5
        assert math.isfinite(found.circle.x + found.circle.y)
        assert found.circle.radius > 0


def test_a_lens_that_fills_the_picture_is_taken_to_reach_its_corners() -> None:
    everywhere = photograph(light_of([Circle(200, 165, 600)], SIZE, 2), -1)
    (found,) = find_circles([everywhere], 1)
    assert found.confidence == 0
    assert found.circle == Circle(200, 165, math.hypot(200, 165))


def test_real_fisheyes(shared_data: Path) -> None:
    """A luminance camera's fills its square picture; a photograph's fades out beyond it, with flare."""
    import cv2

    from studio_core.imaging.io import read_image

    square = read_image(shared_data / "third_party/radiance_bsd/testimage.hdr").pixels
    (found,) = find_circles([square], 1)
    assert apart(found.circle, Circle(393, 393, 393)) < 0.006
    photo = cv2.imread(str(shared_data / "third_party/fisheye_ocamcalib_mit/ocamcamera/img0.jpg"))
    assert photo is not None
    (found,) = find_circles([photo], 1)
    calibrated = Circle(798.7, 794.8, found.circle.radius)  # the centre is its calibration's
    assert apart(found.circle, calibrated) < 0.01
    assert 790 < found.circle.radius < 850


def test_it_can_be_cancelled_and_reports() -> None:
    told: list[float] = []
    job = Job("circle", on_progress=lambda j: told.append(j.done / j.total))
    frames = [photograph(light_of([ONE], SIZE), 0)]
    find_circles(frames, 1, job)
    assert told == sorted(told)
    assert len(told) > 3
    assert told[-1] <= 1
    job.cancel()
    with pytest.raises(Cancelled):
        find_circles(frames, 1, job)
