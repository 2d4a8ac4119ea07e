"""Rotations of a capture: what their angles mean, and angles there and back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.capturing.standing import (
    HALF_TURN,
    angles_of,
    euler,
    euler_angles,
    rotation_from,
    user_angles,
    user_turn,
)
from studio_core.imaging.warping import turn

angles = st.floats(-179, 179)
below_upright = st.floats(-85, 85)
upright = st.sampled_from((-90.0, 90.0))


@given(angles, angles, angles)
def test_roll_then_pitch_then_yaw_right_handed(yaw: float, pitch: float, roll: float) -> None:
    made = euler(yaw, pitch, roll)
    np.testing.assert_allclose(made, turn((0, yaw, 0)) @ turn((pitch, 0, 0)) @ turn((0, 0, roll)), atol=1e-12)
    assert np.linalg.det(made) == pytest.approx(1)


@given(angles, below_upright, angles)
def test_angles_there_and_back(yaw: float, pitch: float, roll: float) -> None:
    assert euler_angles(euler(yaw, pitch, roll)) == pytest.approx((yaw, pitch, roll), abs=1e-5)
    assert angles_of(rotation_from(yaw, pitch, roll)) == pytest.approx((yaw, pitch, roll), abs=1e-5)
    assert user_angles(user_turn(pitch, roll, yaw)) == pytest.approx((pitch, roll, yaw), abs=1e-5)


@given(angles, upright, angles)
def test_straight_up_the_rotation_is_the_same(yaw: float, pitch: float, roll: float) -> None:
    rotation = rotation_from(yaw, pitch, roll)
    assert rotation_from(*angles_of(rotation)) == pytest.approx(rotation, abs=1e-5)
    turned = user_turn(pitch, roll, yaw)
    assert user_turn(*user_angles(turned)) == pytest.approx(turned, abs=1e-5)


def test_lenses_look_exactly_apart_at_no_angles() -> None:
    np.testing.assert_array_equal(rotation_from(0, 0, 0), HALF_TURN)
    np.testing.assert_array_equal(HALF_TURN @ [0, 0, -1], [0, 0, 1])
    np.testing.assert_array_equal(HALF_TURN @ HALF_TURN, np.eye(3))


def test_what_a_designer_turns() -> None:
    middle, up = np.array([0.0, 0, 1]), np.array([0.0, 1, 0])
    assert (user_turn(20, 0, 0) @ middle)[1] > 0  # goes up
    assert (user_turn(0, 0, 20) @ middle)[0] < 0  # to the right: u grows towards −x
    assert (user_turn(0, 20, 0) @ up)[0] < 0  # clockwise: up goes to the right
