"""Looking around: every movement makes a new view from an old one."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from studio_core.scene.transform import Transform, axis_angle, looking, multiply, vec3
from studio_core.session import View
from studio_ui.canvas.projection import axes_of, extent, eye_of, ray

STEEPEST = 89.0  # degrees above or below the horizon
NEAREST, FARTHEST = 0.02, 1e4  # metres to the point that is orbited
TURN = 260.0  # degrees for a drag across the picture's height
AXES = {
    "front": (0.0, 0.0, 1.0),
    "back": (0.0, 0.0, -1.0),
    "right": (1.0, 0.0, 0.0),
    "left": (-1.0, 0.0, 0.0),
    "top": (0.0, 1.0, 0.0),
    "bottom": (0.0, -1.0, 0.0),
}


def orbit(view: View, dx: float, dy: float, pivot: npt.ArrayLike | None = None) -> View:
    """Turn about `pivot` (default: the view's target) by a drag in shares of the picture's height."""
    centre = np.asarray(view.target if pivot is None else pivot, np.float64)
    right, _, back = axes_of(view)
    height = float(np.degrees(np.arcsin(np.clip(back[1], -1, 1))))
    low, high = min(-STEEPEST, height), max(STEEPEST, height)
    pitch = float(np.clip(height + dy * TURN, low, high)) - height
    tip = axis_angle(right, -pitch)
    turn = multiply(axis_angle((0, 1, 0), -dx * TURN), tip)
    about = Transform(rotation=turn)
    moved = vec3(centre + about.matrix()[:3, :3] @ (eye_of(view) - centre))
    rotation = multiply(turn, view.transform.rotation)
    return dataclasses.replace(view, transform=Transform(moved, rotation))


def pan(view: View, dx: float, dy: float, distance: float | None = None) -> View:
    """Slide so that what is `distance` away (default: the target) follows a drag in shares of the height."""
    across, up, _ = axes_of(view)
    reach = 2 * extent(view)[1] * (view.focus if distance is None else distance)
    eye = eye_of(view) - across * dx * reach + up * dy * reach
    return dataclasses.replace(view, transform=dataclasses.replace(view.transform, translation=vec3(eye)))


def zoom(view: View, factor: float, x: float = 0.5, y: float = 0.5, distance: float | None = None) -> View:
    """Go towards what is seen at (x, y), `distance` metres along its ray, to `factor` times that."""
    towards = ray(view, x, y)
    if distance is None or not np.isfinite(distance):
        distance = view.focus / max(float(-towards @ axes_of(view)[2]), 1e-3)
    factor = float(np.clip(factor, NEAREST / view.focus, FARTHEST / view.focus))
    if factor < 1 and distance * factor < NEAREST:
        return view
    eye = eye_of(view) + towards * distance * (1 - factor)
    moved = dataclasses.replace(view.transform, translation=vec3(eye))
    return dataclasses.replace(view, transform=moved, focus=view.focus * factor)


def frame(view: View, low: npt.ArrayLike, high: npt.ArrayLike) -> View:
    """The same direction, the whole box in sight."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    radius = max(float(np.linalg.norm(high - low)) / 2, 0.05)
    half = min(np.arctan(extent(view)[0]), np.arctan(extent(view)[1]))
    distance = float(np.clip(1.05 * radius / np.sin(half), NEAREST, FARTHEST))
    eye = (low + high) / 2 + axes_of(view)[2] * distance
    moved = dataclasses.replace(view.transform, translation=vec3(eye))
    return dataclasses.replace(view, transform=moved, focus=distance)


def along_axis(view: View, name: str) -> View:
    """Look at the target from an axis: front is from +z, right from +x, top from +y."""
    target = np.array(view.target)
    up = (0, 1, 0) if name not in ("top", "bottom") else (0, 0, -1 if name == "top" else 1)
    eye = target + view.focus * np.array(AXES[name])
    return dataclasses.replace(view, transform=looking(eye, target, up))


def nudge_axes(view: View) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """The horizontal world axes that look most like right and away in the picture."""
    right, _, back = axes_of(view)
    along = np.zeros(3)
    axis = 0 if abs(right[0]) >= abs(right[2]) else 2
    along[axis] = np.sign(right[axis]) or 1.0
    away = np.cross((0.0, 1.0, 0.0), along)
    if away @ -back < 0:
        away = -away
    return along, away
