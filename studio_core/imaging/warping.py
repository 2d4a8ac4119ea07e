"""Undoing the motion of a hand: a frame resampled to lie on its bracket's reference.

A flat picture is shifted and turned in its plane. Behind a fisheye the lens' circle stays where it is on the
sensor while the world turns under it, so there a small turn of the lens in space is undone: near the
circle's edge that is up to the whole shift away from what a plane's motion would do.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Mask, Motion
from studio_core.imaging.projection import Circle, Lens, project, unproject

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
_CELL = 16  # pixels, less for small circles; between its corners a motion is as good as linear


def turn(degrees: tuple[float, float, float] | F64) -> F64:
    """(3, 3) right-handed rotation about the axis `degrees` by its length (Rodrigues' formula)."""
    x, y, z = (math.radians(float(a)) for a in degrees)
    angle = math.sqrt(x * x + y * y + z * z)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    if angle < 1e-12:
        return np.asarray(np.eye(3) + cross, np.float64)
    sine, versed = math.sin(angle) / angle, (1 - math.cos(angle)) / angle**2
    return np.asarray(np.eye(3) + sine * cross + versed * (cross @ cross), np.float64)


def degrees_of(rotation: F64) -> tuple[float, float, float]:
    """The axis times degrees of a rotation by less than half a turn: `turn` undone."""
    axis = np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    twice_sine = float(np.linalg.norm(axis))
    angle = math.atan2(twice_sine, float(np.trace(rotation)) - 1)
    scale = math.degrees(angle / twice_sine) if twice_sine > 1e-12 else math.degrees(0.5)
    x, y, z = (float(a) * scale for a in axis)
    return x, y, z


def moved_points(
    points: npt.NDArray[Any],
    motion: Motion,
    size: tuple[int, int],
    circle: Circle | None = None,
    lens: Lens | None = None,
) -> F64:
    """Where points (..., 2) of the reference lie in the frame, pixels. `size`: width and height.

    First the turn in space, through circle and lens; then the motion in the plane about the picture's
    centre. ValueError when a turn in space lacks circle or lens.
    """
    p = np.asarray(points, np.float64)
    if any(motion.rotation):
        if circle is None or lens is None:
            raise ValueError("a turn in space needs the lens and its circle")
        directions, _ = unproject(lens, circle, p)
        p, _ = project(lens, circle, directions @ turn(motion.rotation).T)
    if motion.dx or motion.dy or motion.degrees:
        centre = np.array(size) / 2
        c, s = math.cos(math.radians(motion.degrees)), math.sin(math.radians(motion.degrees))
        p = (p - centre) @ np.array([[c, s], [-s, c]]) + centre + (motion.dx, motion.dy)
    return p


def warp(
    frame: npt.NDArray[Any],
    motion: Motion,
    circle: Circle | None = None,
    lens: Lens | None = None,
    rows: tuple[int, int] | None = None,
) -> tuple[npt.NDArray[Any], Mask]:
    """`frame` as its reference would show it, of the same type, and where that is known.

    `frame` (H, W) or (H, W, C), bytes, 16 bit or float32. `rows` (first, last + 1): only these rows of the
    result, to keep memory small. Known is what lies inside the frame; of what is inside the circle, what the
    lens saw in the frame too. Between pixels it is linear; without motion the pixels are the frame's own.
    """
    import cv2

    height, width = frame.shape[:2]
    first, last = rows or (0, height)
    if not (any(motion.rotation) or motion.dx or motion.dy or motion.degrees):
        return frame[first:last].copy(), np.ones((last - first, width), np.bool_)
    at = source_points(motion, (width, height), circle, lens, (first, last))
    x, y = at[..., 0], at[..., 1]
    known = (x >= 0.5) & (x <= width - 0.5) & (y >= 0.5) & (y <= height - 0.5)
    if circle is not None:
        shift_x, shift_y = motion.dx, motion.dy
        if motion.degrees:
            moved = moved_points(np.array([circle.x, circle.y]), _in_plane(motion), (width, height))
            shift_x, shift_y = moved[0] - circle.x, moved[1] - circle.y
        over = np.hypot(x - np.float32(circle.x + shift_x), y - np.float32(circle.y + shift_y))
        here = np.hypot(
            np.arange(width, dtype=np.float32)[None, :] + np.float32(0.5 - circle.x),
            np.arange(first, last, dtype=np.float32)[:, None] + np.float32(0.5 - circle.y),
        )
        known &= (over <= circle.radius) | (here > circle.radius)
    made = cv2.remap(frame, x - 0.5, y - 0.5, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return made, known


def _in_plane(motion: Motion) -> Motion:
    return Motion(motion.dx, motion.dy, motion.degrees)


def source_points(
    motion: Motion,
    size: tuple[int, int],
    circle: Circle | None = None,
    lens: Lens | None = None,
    rows: tuple[int, int] | None = None,
) -> F32:
    """(rows, W, 2) points of the frame for the pixels of these rows: exact at a grid, linear between."""
    import cv2

    width = size[0]
    first, last = rows or (0, size[1])
    cell = _CELL if circle is None else max(2, min(_CELL, int(circle.radius / 24)))
    columns = -(-width // cell) + 2
    start = first // cell - 1
    lines = -(-last // cell) + 1 - start
    x, y = np.meshgrid((np.arange(columns) - 0.5) * cell, (np.arange(start, start + lines) + 0.5) * cell)
    nodes = np.stack([x, y], axis=-1)
    shift = (moved_points(nodes, motion, size, circle, lens) - nodes).astype(np.float32)
    fine = cv2.resize(shift, (columns * cell, lines * cell), interpolation=cv2.INTER_LINEAR)
    skip = first - start * cell
    at = np.ascontiguousarray(fine[skip : skip + last - first, cell : cell + width])
    at[..., 0] += np.arange(width, dtype=np.float32) + 0.5
    at[..., 1] += np.arange(first, last, dtype=np.float32)[:, None] + 0.5
    return at
