"""Dragging the finished picture: the rotation that brings one place of it to another."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from studio_core.capturing.standing import euler
from studio_core.imaging.warping import turn

F64 = npt.NDArray[np.float64]


def between(start: tuple[float, float], end: tuple[float, float], *, level: bool) -> F64:
    """The rotation that brings what is at (u, v) `start` to `end`; `level` keeps the horizon."""
    sideways = euler(-360 * (end[0] - start[0]), 0, 0)
    if level:
        return sideways
    longitude = 2 * math.pi * (0.5 - end[0])
    raised = 180 * (start[1] - end[1])
    axis = np.array([-math.cos(longitude), 0.0, math.sin(longitude)])
    return np.asarray(turn(axis * raised) @ sideways, np.float64)
