"""Rotations of a capture and their angles: how the back lens stands, how the finished picture is turned."""

from __future__ import annotations

import math

import numpy as np

from studio_core.capturing.artifacts import F64

HALF_TURN = np.diag([-1.0, 1.0, -1.0])
"""(3, 3): from one lens' frame to the other's when they look exactly apart; and the finished picture's frame
from the front lens' frame when nothing is levelled or turned."""


def euler(yaw: float, pitch: float, roll: float) -> F64:
    """(3, 3) right-handed turn by degrees about z (roll), then x (pitch), then y (yaw)."""
    y, x, z = np.radians([yaw, pitch, roll])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    return np.asarray(about_y @ about_x @ about_z, np.float64)


def euler_angles(rotation: F64) -> tuple[float, float, float]:
    """Yaw, pitch and roll in degrees of `euler`; at a pitch of ±90° the roll is 0."""
    m = np.asarray(rotation, np.float64)
    pitch = math.asin(min(max(-m[1, 2], -1.0), 1.0))
    if math.hypot(m[0, 2], m[2, 2]) < 1e-6:
        return math.degrees(math.atan2(-m[2, 0], m[0, 0])), math.degrees(pitch), 0.0
    yaw, roll = math.atan2(m[0, 2], m[2, 2]), math.atan2(m[1, 0], m[1, 1])
    return math.degrees(yaw), math.degrees(pitch), math.degrees(roll)


def rotation_from(yaw: float, pitch: float, roll: float) -> F64:
    """(3, 3): the front lens' frame from the back lens'; half a turn about y when all are 0. Degrees.

    From half a turn the back lens is turned about its own y (yaw), then x (pitch), then z (roll).
    """
    return np.asarray(HALF_TURN @ euler(yaw, pitch, roll), np.float64)


def angles_of(rotation: F64) -> tuple[float, float, float]:
    """Yaw, pitch and roll in degrees of `rotation_from`; at a pitch of ±90° the roll is 0."""
    return euler_angles(HALF_TURN @ np.asarray(rotation, np.float64))


def user_turn(pitch: float, roll: float, north: float) -> F64:
    """(3, 3) what a designer turns the finished picture by, after levelling. Degrees.

    `roll` turns the picture clockwise, `pitch` moves its middle up, `north` then moves it to the right.
    """
    return euler(-north, -pitch, roll)


def user_angles(rotation: F64) -> tuple[float, float, float]:
    """Pitch, roll and north in degrees of `user_turn`."""
    yaw, pitch, roll = euler_angles(rotation)
    return -pitch, roll, -yaw
