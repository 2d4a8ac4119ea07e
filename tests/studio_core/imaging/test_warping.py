"""Undoing a hand's motion: points there and back, pictures against where their points go."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.capturing.artifacts import Motion
from studio_core.imaging.projection import EQUIDISTANT, EQUISOLID, Circle, Lens, pixel_points, unproject
from studio_core.imaging.warping import moved_points, turn, warp

SIZE = (320, 240)
CIRCLE = Circle(161.3, 118.7, 105.0)
LENS = Lens(EQUIDISTANT, 190.0)
small = st.floats(-3, 3)


@given(small, small, small)
def test_turns_are_rotations_and_turn_back(x: float, y: float, z: float) -> None:
    made = turn((x, y, z))
    np.testing.assert_allclose(made @ made.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(made) == pytest.approx(1)
    np.testing.assert_allclose(turn((-x, -y, -z)), made.T, atol=1e-12)
    angle = math.radians(math.sqrt(x * x + y * y + z * z))
    assert np.trace(made) == pytest.approx(1 + 2 * math.cos(angle), abs=1e-9)


@given(small, small, small, st.sampled_from([EQUIDISTANT, EQUISOLID]))
def test_points_come_back_from_a_turn_in_space(x: float, y: float, z: float, model: str) -> None:
    points = np.random.default_rng(1).uniform(-60, 60, (50, 2)) + np.array([CIRCLE.x, CIRCLE.y])
    lens = Lens(model, 190.0)
    there = moved_points(points, Motion(rotation=(x, y, z)), SIZE, CIRCLE, lens)
    back = moved_points(there, Motion(rotation=(-x, -y, -z)), SIZE, CIRCLE, lens)
    np.testing.assert_allclose(back, points, atol=2e-4)


@given(st.floats(-30, 30), st.floats(-30, 30), st.floats(-20, 20))
def test_motions_in_the_plane_keep_distances(dx: float, dy: float, degrees: float) -> None:
    points = np.random.default_rng(2).uniform(0, 240, (20, 2))
    moved = moved_points(points, Motion(dx, dy, degrees), SIZE)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(moved, axis=0), axis=1), np.linalg.norm(np.diff(points, axis=0), axis=1)
    )
    centre = np.array(SIZE) / 2
    np.testing.assert_allclose(
        moved_points(centre, Motion(dx, dy, degrees), SIZE), centre + np.array([dx, dy]), atol=1e-9
    )


def test_a_positive_turn_is_clockwise_as_seen() -> None:
    right_of_centre = np.array([200.0, 120.0])
    np.testing.assert_allclose(moved_points(right_of_centre, Motion(degrees=90), SIZE), [160, 160])


def test_a_turn_about_the_axis_is_a_turn_in_the_picture() -> None:
    """The axis looks at us: counter-clockwise about +z (out of the picture) is counter-clockwise as seen."""
    points = np.array([[CIRCLE.x + 80, CIRCLE.y], [CIRCLE.x, CIRCLE.y - 50]])
    moved = moved_points(points, Motion(rotation=(0, 0, 90)), SIZE, CIRCLE, LENS)
    np.testing.assert_allclose(moved, [[CIRCLE.x, CIRCLE.y - 80], [CIRCLE.x - 50, CIRCLE.y]], atol=1e-3)


def test_a_turn_in_space_is_refused_without_a_lens() -> None:
    with pytest.raises(ValueError, match="lens"):
        moved_points(np.zeros((1, 2)), Motion(rotation=(1, 0, 0)), SIZE)


def _picture(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float32]:
    x, y = points[..., 0], points[..., 1]
    made = 100 + 40 * np.sin(x / 23) * np.cos(y / 31) + 30 * np.cos((x - 2 * y) / 47)
    return made.astype(np.float32)


@pytest.mark.parametrize(
    "motion",
    [Motion(3.3, -7.6, 1.4), Motion(rotation=(1.3, -0.8, 2.0)), Motion(2.0, 1.0, 0.0, rotation=(0, 1.0, 0))],
)
def test_a_warped_picture_shows_what_lies_at_the_moved_points(motion: Motion) -> None:
    points = pixel_points(SIZE[1], SIZE[0])
    made, known = warp(_picture(points), motion, CIRCLE, LENS)
    truth = _picture(moved_points(points, motion, SIZE, CIRCLE, LENS))
    inside = known & (np.hypot(points[..., 0] - CIRCLE.x, points[..., 1] - CIRCLE.y) < CIRCLE.radius)
    assert inside.sum() > 0.9 * math.pi * CIRCLE.radius**2
    assert np.abs(made - truth)[inside].max() < 0.05


def test_rows_are_those_of_the_whole() -> None:
    picture = np.random.default_rng(3).integers(0, 255, (240, 320, 3), np.uint8)
    motion = Motion(rotation=(1.0, 2.0, -1.0))
    whole, known = warp(picture, motion, CIRCLE, LENS)
    for first, last in ((0, 50), (50, 83), (83, 240)):
        part, known_part = warp(picture, motion, CIRCLE, LENS, (first, last))
        np.testing.assert_array_equal(part, whole[first:last])
        np.testing.assert_array_equal(known_part, known[first:last])
    assert whole.dtype == np.uint8


def test_without_motion_nothing_changes() -> None:
    picture = np.random.default_rng(4).integers(0, 65535, (24, 32), np.uint16)
    made, known = warp(picture, Motion(), CIRCLE, LENS, (5, 20))
    np.testing.assert_array_equal(made, picture[5:20])
    assert known.all()


def test_what_the_lens_did_not_see_is_not_known() -> None:
    """Turned to the right by 3 degrees: the world's strip at the right edge was not seen before."""
    picture = np.ones((240, 320), np.float32)
    points = pixel_points(240, 320)
    _, known = warp(picture, Motion(rotation=(0, -3.0, 0)), CIRCLE, LENS)
    directions, seen = unproject(LENS, CIRCLE, points)
    theta = np.arccos(-(directions @ turn((0, -3.0, 0)).T)[..., 2])
    lost = seen & (theta > LENS.half + 0.005)
    kept = seen & (theta < LENS.half - 0.005)
    assert lost.sum() > 100
    assert not known[lost].any()
    assert known[kept].all()


def test_shifted_beyond_the_frame_is_not_known() -> None:
    _, known = warp(np.zeros((20, 30), np.uint8), Motion(dx=4.0))
    assert known[:, :26].all()
    assert not known[:, 26:].any()
