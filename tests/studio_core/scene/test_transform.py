"""Transforms as a group: composition, inverse, rotations, cameras."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from studio_core.scene.transform import (
    IDENTITY,
    Quat,
    Transform,
    axis_angle,
    looking,
    multiply,
    normalized,
    quaternion,
    rotation_matrix,
)

COORDINATES = st.floats(-1e4, 1e4)
POINTS = st.tuples(COORDINATES, COORDINATES, COORDINATES)
UNIT = st.floats(-1, 1)


@st.composite
def quaternions(draw: st.DrawFn) -> Quat:
    raw = draw(st.tuples(UNIT, UNIT, UNIT, UNIT))
    assume(math.hypot(*raw) > 1e-3)
    return normalized(raw)


TRANSFORMS = st.builds(Transform, POINTS, quaternions(), st.floats(0.01, 100))


def scipy_rotation(rotation: Quat) -> Rotation:
    w, x, y, z = rotation
    return Rotation.from_quat([x, y, z, w])


@given(TRANSFORMS, TRANSFORMS)
def test_composition_is_that_of_matrices(a: Transform, b: Transform) -> None:
    wanted = a.matrix() @ b.matrix()
    assert np.allclose((a @ b).matrix(), wanted, rtol=1e-12, atol=1e-9 * np.abs(wanted).max())


@given(TRANSFORMS)
def test_the_inverse_undoes(t: Transform) -> None:
    size = 1 + math.hypot(*t.translation)
    for both in (t @ t.inverse(), t.inverse() @ t):
        assert np.allclose(both.matrix(), np.eye(4), atol=1e-13 * size * max(t.scale, 1 / t.scale))


@given(TRANSFORMS)
def test_identity_changes_nothing_but_rounding(t: Transform) -> None:
    for same in (IDENTITY @ t, t @ IDENTITY):
        assert np.allclose(same.matrix(), t.matrix(), rtol=1e-15, atol=1e-14 * t.scale)


@given(quaternions(), quaternions())
def test_rotations_agree_with_scipy(a: Quat, b: Quat) -> None:
    assert np.allclose(rotation_matrix(a), scipy_rotation(a).as_matrix(), atol=1e-12)
    both = scipy_rotation(a) * scipy_rotation(b)
    assert np.allclose(rotation_matrix(multiply(a, b)), both.as_matrix(), atol=1e-12)


@given(quaternions())
def test_matrix_and_quaternion_are_two_ways_to_say_it(rotation: Quat) -> None:
    matrix = rotation_matrix(rotation)
    back = quaternion(matrix)
    assert back[0] >= 0
    assert math.hypot(*back) == pytest.approx(1, abs=1e-15)
    assert np.allclose(rotation_matrix(back), matrix, atol=1e-12)


@given(st.tuples(UNIT, UNIT, UNIT), st.floats(-720, 720))
def test_axis_angle_agrees_with_scipy(axis: tuple[float, float, float], degrees: float) -> None:
    length = math.hypot(*axis)
    assume(length > 1e-3)
    wanted = Rotation.from_rotvec(np.radians(degrees) * np.array(axis) / length).as_matrix()
    assert np.allclose(rotation_matrix(axis_angle(axis, degrees)), wanted, atol=1e-12)


def test_right_handed() -> None:
    assert np.allclose(rotation_matrix(axis_angle((0, 1, 0), 90)) @ (0, 0, 1), (1, 0, 0))


@given(POINTS, POINTS, st.sampled_from([(0, 1, 0), (0, 0, 1), (1, 2, 3)]))
def test_looking_points_minus_z_at_the_target(eye: object, target: object, up: object) -> None:
    away = np.subtract(target, eye)
    assume(np.linalg.norm(away) > 1e-3)
    t = looking(eye, target, up)
    matrix = t.matrix()
    assert t.scale == 1
    assert np.allclose(matrix[:3, 3], eye)
    assert np.allclose(-matrix[:3, 2], away / np.linalg.norm(away), atol=1e-9)
    assert matrix[:3, 1] @ np.array(up) >= -1e-9
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1)


def test_looking_straight_down_works_and_at_oneself_does_not() -> None:
    assert np.allclose(-looking((0, 3, 0), (0, 0, 0)).matrix()[:3, 2], (0, -1, 0))
    with pytest.raises(ValueError, match="coincide"):
        looking((1, 2, 3), (1, 2, 3))


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ({"translation": (math.nan, 0.0, 0.0)}, "finite"),
        ({"scale": math.inf}, "finite"),
        ({"scale": 0.0}, "positive"),
        ({"scale": -1.0}, "positive"),
        ({"rotation": (1.0, 1.0, 0.0, 0.0)}, "unit quaternion"),
        ({"rotation": (0.0, 0.0, 0.0, 0.0)}, "unit quaternion"),
    ],
)
def test_what_is_no_rigid_motion_is_refused(arguments: dict, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        Transform(**arguments)


def test_a_zero_quaternion_is_no_rotation() -> None:
    with pytest.raises(ValueError, match="zero quaternion"):
        normalized((0.0, 0.0, 0.0, 0.0))
