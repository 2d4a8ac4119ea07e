"""Rotations as three angles that a person can type: turn about y, then tilt about x, then roll about z.

rotation = Y(turn) · X(tilt) · Z(roll), shown as (x, y, z) = (tilt, turn, roll) in degrees.
"""

from __future__ import annotations

import math

from studio_core.scene.transform import Quat, Vec3, axis_angle, multiply, rotation_matrix


def from_euler(angles: Vec3) -> Quat:
    """The rotation of tilt, turn and roll."""
    tilt, turn, roll = angles
    return multiply(
        axis_angle((0, 1, 0), turn), multiply(axis_angle((1, 0, 0), tilt), axis_angle((0, 0, 1), roll))
    )


def to_euler(rotation: Quat) -> Vec3:
    """Tilt -90…90°, turn and roll -180…180°; at ±90° of tilt the roll is 0."""
    m = rotation_matrix(rotation)
    sine = max(-1.0, min(1.0, -float(m[1, 2])))
    tilt = math.asin(sine)
    if abs(sine) > 1 - 1e-9:
        turn, roll = math.atan2(-float(m[2, 0]), float(m[0, 0])), 0.0
    else:
        turn = math.atan2(float(m[0, 2]), float(m[2, 2]))
        roll = math.atan2(float(m[1, 0]), float(m[1, 1]))
    return (_tidy(tilt), _tidy(turn), _tidy(roll))


def _tidy(radians: float) -> float:
    degrees = round(math.degrees(radians), 6)
    return degrees + 0.0  # no -0
