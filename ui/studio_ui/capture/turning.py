"""Horizon and turn as one rotation of the finished picture, and the angles of a rotation."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]


def about(axis: str, degrees: float) -> F64:
    """Right-handed rotation (3, 3) about x, y or z."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    made = {
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }[axis]
    return np.array(made, np.float64)


def user_turn(pitch: float, roll: float, north: float) -> F64:
    """What the settings turn the levelled picture by, as the stitching does.

    `roll` turns the picture clockwise, `pitch` moves its middle up, `north` then moves it to the right.
    """
    return about("y", -north) @ about("x", -pitch) @ about("z", roll)


def angles_of(turn: F64) -> tuple[float, float, float]:
    """Pitch, roll and north of a rotation, degrees."""
    pitch = math.asin(min(max(turn[1, 2], -1.0), 1.0))
    if abs(turn[1, 2]) > 1 - 1e-12:  # straight up or down: only one of the two angles is told
        return math.degrees(pitch), 0.0, math.degrees(math.atan2(turn[2, 0], turn[0, 0]))
    north = math.atan2(-turn[0, 2], turn[2, 2])
    roll = math.atan2(turn[1, 0], turn[1, 1])
    return math.degrees(pitch), math.degrees(roll), math.degrees(north)


def between(start: tuple[float, float], end: tuple[float, float], *, level: bool) -> F64:
    """The rotation that brings what is at (u, v) `start` to `end`; `level` keeps the horizon."""
    turn = about("y", -360 * (end[0] - start[0]))
    if level:
        return turn
    longitude = 2 * math.pi * (0.5 - end[0])
    raised = math.pi * (start[1] - end[1])
    axis = np.array([-math.cos(longitude), 0.0, math.sin(longitude)])
    return _about_axis(axis, raised) @ turn


def _about_axis(axis: F64, angle: float) -> F64:
    """Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    made: F64 = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return made
