"""Looking around: every movement makes a new view from an old one."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import AreaLamp, Environment, NodeId, Scene
from studio_core.scene.transform import Transform, axis_angle, looking, multiply, vec3
from studio_core.session import View
from studio_ui.canvas.projection import axes_of, extent, eye_of, own_corners, ray

F64 = npt.NDArray[np.float64]
STEEPEST = 89.0  # degrees above or below the horizon
NEAREST, FARTHEST = 0.02, 1e4  # metres to the point that is orbited
LEAST = 0.3  # metres to the target, where it is pushed ahead rather than reached
TURN = 260.0  # degrees for a drag across the picture's height
MARGIN = 1.12  # of the room that what is framed takes
_MARK = 0.25  # metres around a lamp or camera that is framed
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
    turned = multiply(axis_angle((0, 1, 0), -dx * TURN), tip)
    about = Transform(rotation=turned)
    moved = vec3(centre + about.matrix()[:3, :3] @ (eye_of(view) - centre))
    rotation = multiply(turned, view.transform.rotation)
    return dataclasses.replace(view, transform=Transform(moved, rotation))


def turn(view: View, dx: float, dy: float) -> View:
    """Turn the head: what is seen follows a drag in shares of the picture's height."""
    degrees = 2 * np.degrees(np.arctan(extent(view)[1]))
    return orbit(view, -dx * degrees / TURN, -dy * degrees / TURN, eye_of(view))


def pan(view: View, dx: float, dy: float, depth: float | None = None) -> View:
    """Slide so that what is `depth` ahead (default: the target) follows a drag in shares of the height."""
    across, up, _ = axes_of(view)
    reach = 2 * extent(view)[1] * (view.focus if depth is None else depth)
    eye = eye_of(view) - across * dx * reach + up * dy * reach
    return dataclasses.replace(view, transform=dataclasses.replace(view.transform, translation=vec3(eye)))


def depth(view: View, point: npt.ArrayLike) -> float:
    """Metres ahead of the eye at which a point of the world lies; negative behind it."""
    return -float((np.asarray(point, np.float64) - eye_of(view)) @ axes_of(view)[2])


def approach(view: View, factor: float, point: npt.ArrayLike) -> View:
    """Go towards (or from) a point of the world, which keeps its place in the picture.

    `factor` is the share of the distance that is left; the point is never reached.
    """
    start, goal = eye_of(view), np.asarray(point, np.float64)
    distance = float(np.linalg.norm(start - goal))
    if distance < 1e-9:
        return view
    low, high = min(NEAREST / distance, 1.0), max(FARTHEST / distance, 1.0)
    factor = float(np.clip(factor, low, high))
    focus = float(np.clip(view.focus * factor, NEAREST, FARTHEST))
    moved = dataclasses.replace(view.transform, translation=vec3(goal + (start - goal) * factor))
    return dataclasses.replace(view, transform=moved, focus=focus)


def zoom(view: View, factor: float, x: float = 0.5, y: float = 0.5, distance: float | None = None) -> View:
    """Go towards what is seen at (x, y), `distance` metres along its ray, to `factor` times that.

    Where nothing is seen (None or inf) that is as far as the target; once the target is near, it is pushed
    ahead, so that one can go through an empty room.
    """
    towards = ray(view, x, y)
    if distance is not None and np.isfinite(distance):
        return approach(view, factor, eye_of(view) + towards * distance)
    reach = view.focus / max(float(-towards @ axes_of(view)[2]), 1e-3)
    if factor < 1 and view.focus * factor < LEAST:
        ahead = vec3(eye_of(view) + towards * max(reach, LEAST) * (1 - factor))
        return dataclasses.replace(view, transform=dataclasses.replace(view.transform, translation=ahead))
    return approach(view, factor, eye_of(view) + towards * reach)


def frame(view: View, low: npt.ArrayLike, high: npt.ArrayLike) -> View:
    """The same direction, the whole box in sight, a margin around it."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    centre = (low + high) / 2
    half = np.maximum((high - low) / 2, 0.025)
    box = np.array(np.meshgrid(*zip(-half, half, strict=True))).reshape(3, -1).T @ axes_of(view).T
    right, top = extent(view)
    ahead = np.maximum(np.abs(box[:, 0]) / right, np.abs(box[:, 1]) / top) * MARGIN + box[:, 2]
    distance = float(np.clip(ahead.max(), NEAREST, FARTHEST))
    moved = dataclasses.replace(view.transform, translation=vec3(centre + axes_of(view)[2] * distance))
    return dataclasses.replace(view, transform=moved, focus=distance)


def seen_box(scene: Scene, nodes: tuple[NodeId, ...]) -> tuple[F64, F64] | None:
    """Lowest and highest corner of what framing these nodes shows; lamps and cameras have a size, too."""
    below = [n for n in dict.fromkeys(b for node in nodes for b in scene.subtree(node)) if scene.shown(n)]
    points = np.concatenate([np.zeros((0, 3)), *(own_corners(scene, n) for n in below)])
    if not len(points):
        marks = [n for n in below if not isinstance(scene[n], Environment)]
        points = np.concatenate([np.zeros((0, 3)), *(_mark(scene, n) for n in marks)])
    return (points.min(axis=0), points.max(axis=0)) if len(points) else None


def _mark(scene: Scene, node_id: NodeId) -> F64:
    """(N, 3) around what has no surface: an area lamp's rectangle, or a box about the place."""
    node, world = scene[node_id], scene.world(node_id)
    if isinstance(node, AreaLamp):
        x, y = node.width / 2, node.height / 2
        rim = np.array([(-x, -y, 0, 1), (x, -y, 0, 1), (x, y, 0, 1), (-x, y, 0, 1)])
        made: F64 = (rim @ world.matrix().T)[:, :3]
        return made
    return np.array(world.translation) + _MARK * np.array([(-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)])


def along_axis(view: View, name: str, about: npt.ArrayLike | None = None) -> View:
    """Look at the target (or at `about`) from an axis: front is from +z, right from +x, top from +y."""
    return from_direction(view, AXES[name], about)


def from_direction(view: View, direction: npt.ArrayLike, about: npt.ArrayLike | None = None) -> View:
    """Look at the target (or at `about`) from a side of the world, upright, from as far as before."""
    target = np.array(view.target if about is None else about, np.float64)
    way = np.asarray(direction, np.float64)
    way = way / np.linalg.norm(way)
    steep = abs(way[1]) > 1 - 1e-9
    up = (0.0, 0.0, -float(np.sign(way[1]))) if steep else (0.0, 1.0, 0.0)
    return dataclasses.replace(view, transform=looking(target + view.focus * way, target, up))


def nudge_axes(view: View) -> tuple[F64, F64]:
    """The horizontal world axes that look most like right and away in the picture."""
    right, _, back = axes_of(view)
    along = np.zeros(3)
    axis = 0 if abs(right[0]) >= abs(right[2]) else 2
    along[axis] = np.sign(right[axis]) or 1.0
    away = np.cross((0.0, 1.0, 0.0), along)
    if away @ -back < 0:
        away = -away
    return along, away
