"""Gizmos: the handles that a selection is moved, turned and scaled with: their shape, what the mouse is on.

They are as large on the screen from near and far. An axis that points at the eye, and a plane or ring seen
edge-on, fade and cannot be grabbed: a hand could not say what it means there. No toolkit here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from studio_core.scene.bounds import exact_bounds
from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_core.session import View
from studio_ui.canvas.overlay import Dot, Face, Mark, Overlay, Wires
from studio_ui.canvas.projection import axes_of, extent, eye_of, project

F64 = npt.NDArray[np.float64]
Kind = Literal["axis", "plane", "free", "ring", "view_ring", "size"]
ARM = 86.0
"""Logical pixels from the middle of a gizmo to the end of an arm."""
REACH = 7.0
"""Logical pixels from which a handle is grabbed."""
CLOSE = 4.0
"""The same over the thing itself, which can be dragged as well."""
COLOURS = ("#e5534b", "#7cb342", "#4c8dff")
"""Of x, y and z."""
LIT, PLAIN = "#ffd54a", "#f2f2f0"
NAMES = ("X", "Y", "Z")
_START, _RING, _VIEW_RING = 0.2, 0.92, 1.14  # of an arm
_PLANE = (0.32, 0.56)
_TIP, _TIP_WIDTH, _KNOB = 0.22, 0.07, 0.06
_ALONG, _EDGE_ON = 0.975, 0.2  # cosines: an axis too much along the line of sight, a plane too much across
_ROUND = 72


@dataclass(frozen=True)
class Frame:
    """Where a gizmo stands, (3,), and its axes x, y and z as unit rows (3, 3), right-handed."""

    pivot: F64
    axes: F64

    @classmethod
    def of(cls, scene: Scene, nodes: tuple[NodeId, ...], *, local: bool = False) -> Frame | None:
        """For a selection: the middle of its foot, where furniture stands; a lamp's or camera's own place.

        With `local` the axes are those of the first node. None when nothing of it is shown.
        """
        box = exact_bounds(scene, nodes)
        if box is None:
            return None
        low, high = box
        pivot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        if not any(isinstance(scene[below], MeshObject) for node in nodes for below in scene.subtree(node)):
            pivot = (low + high) / 2
        axes = np.eye(3)
        if local:
            world = scene.world(nodes[0])
            axes = world.matrix()[:3, :3].T / world.scale
        return cls(pivot, axes)


@dataclass(frozen=True)
class Handle:
    """A part that can be grabbed: `axis` is that of an arm or ring, or the normal of a plane."""

    kind: Kind
    axis: int = -1


def metres_per_pixel(view: View, height: float, point: npt.ArrayLike) -> float:
    """Of a canvas `height` logical pixels high, at the depth of a point; 0 behind the eye."""
    depth = float((np.asarray(point, np.float64) - eye_of(view)) @ -axes_of(view)[2])
    return max(depth, 0.0) * 2 * extent(view)[1] / max(height, 1.0)


class Gizmo:
    """The handles of a tool (`move`, `rotate`, `scale`) as a view sees them on `size` logical pixels."""

    def __init__(self, tool: str, frame: Frame, view: View, size: tuple[float, float]) -> None:
        self.tool, self.frame, self._view, self._size = tool, frame, view, size
        self.arm = ARM * metres_per_pixel(view, size[1], frame.pivot)
        towards = eye_of(view) - frame.pivot
        self._towards: F64 = towards / max(float(np.linalg.norm(towards)), 1e-12)
        self._cosines = np.abs(frame.axes @ self._towards)

    def handles(self) -> list[Handle]:
        """What can be grabbed, what lies on top first."""
        if self.arm <= 0:
            return []
        arms = [Handle("axis", axis) for axis in range(3) if self._cosines[axis] < _ALONG]
        if self.tool == "move":
            planes = [Handle("plane", axis) for axis in range(3) if self._cosines[axis] > _EDGE_ON]
            return [Handle("free"), *arms, *planes]
        if self.tool == "rotate":
            return [*(Handle("ring", axis) for axis in range(3)), Handle("view_ring")]
        return [Handle("size"), *(Handle("size", arm.axis) for arm in arms)]

    def pick(self, x: float, y: float, reach: float = REACH) -> Handle | None:
        """The handle at a point of the canvas (0…1): the nearest within reach, else a plane under it."""
        at = np.array([x, y]) * self._size
        best, found = reach, None
        for handle in self.handles():
            if handle.kind == "plane":
                if found is None and _inside(self._on_canvas(self._square(handle.axis)), at):
                    return handle
                continue
            if handle.axis < 0 and handle.kind in ("free", "size"):
                distance = float(np.linalg.norm(self._on_canvas(self.frame.pivot)[0] - at)) - 2.0
            else:
                distance = _distance(self._on_canvas(self._line(handle).reshape(-1, 3)).reshape(-1, 2, 2), at)
            if distance < best:
                best, found = distance, handle
        return found

    def marks(self, lit: Handle | None = None, only: Handle | None = None) -> Overlay:
        """To be drawn; `lit` is under the mouse, `only` is held: the others are left out."""
        made: list[Mark] = []
        handles = self.handles()
        for handle in reversed(handles):
            if only is None or handle == only:
                made += self._drawn(handle, handle in (lit, only))
        if only is None and self.arm > 0 and self.tool != "rotate":
            for axis in range(3):
                if self._cosines[axis] >= _ALONG:  # told, not to be grabbed
                    made.insert(0, Wires(self._arm(axis), _faded(COLOURS[axis]), 1.5, bare=True))
        return Overlay(tuple(made))

    # shapes

    def _drawn(self, handle: Handle, lit: bool) -> list[Mark]:
        colour = LIT if lit else COLOURS[handle.axis] if handle.axis >= 0 else PLAIN
        width = 3.5 if lit else 2.5
        if handle.kind == "plane":
            square = self._square(handle.axis)
            edges = np.stack([square, np.roll(square, -1, axis=0)], axis=1)
            return [Face(square, colour, 0.6 if lit else 0.35), Wires(edges, colour, 1.0, bare=True)]
        if handle.kind == "ring":
            front, back = self._ring(handle.axis)
            return [Wires(back, _faded(colour), 1.0, bare=True), Wires(front, colour, width)]
        if handle.kind == "view_ring":
            return [Wires(self._line(handle), colour if lit else _faded(PLAIN, 0.75), 1.5, bare=not lit)]
        if handle.axis < 0:
            return [Dot(self.frame.pivot, colour, 6.5 if lit else 5.0)]
        end = self.frame.pivot + self.arm * self.frame.axes[handle.axis]
        tip = self._knob(end) if handle.kind == "size" else self._arrow(handle.axis)
        return [Wires(self._arm(handle.axis), colour, width), Face(tip, colour, 1.0)]

    def _line(self, handle: Handle) -> F64:
        """(N, 2, 3) what has to be near the mouse."""
        if handle.kind == "ring":
            return self._ring(handle.axis)[0]
        if handle.kind == "view_ring":
            right, up, _ = axes_of(self._view)
            return _loop(self._circle(right, up, _VIEW_RING))
        return self._arm(handle.axis)

    def _arm(self, axis: int) -> F64:
        along = self.frame.axes[axis] * self.arm
        return np.array([[self.frame.pivot + _START * along, self.frame.pivot + along]])

    def _arrow(self, axis: int) -> F64:
        """(3, 3) a flat tip that faces the eye."""
        along = self.frame.axes[axis]
        side = np.cross(along, self._towards)
        side = side / max(float(np.linalg.norm(side)), 1e-9)
        foot = self.frame.pivot + along * self.arm * (1 - _TIP / 2)
        wide = side * self.arm * _TIP_WIDTH
        return np.array([foot - wide, foot + wide, foot + along * self.arm * _TIP])

    def _knob(self, at: F64) -> F64:
        right, up, _ = axes_of(self._view) * (self.arm * _KNOB)
        return np.array([at - right - up, at + right - up, at + right + up, at - right + up])

    def _square(self, normal: int) -> F64:
        u, v = (self.frame.axes[axis] * self.arm for axis in range(3) if axis != normal)
        low, high = _PLANE
        return np.array([self.frame.pivot + a * u + b * v for a, b in _square_corners(low, high)])

    def _ring(self, axis: int) -> tuple[F64, F64]:
        """(N, 2, 3) the half towards the eye, and the other one."""
        u, v = (self.frame.axes[other] for other in range(3) if other != axis)
        ring = _loop(self._circle(u, v, _RING))
        front = (ring.mean(axis=1) - self.frame.pivot) @ self._towards > -0.02 * self.arm
        if self._cosines[axis] > _ALONG:  # seen from straight above: all of it
            front[:] = True
        return ring[front], ring[~front]

    def _circle(self, u: F64, v: F64, radius: float) -> F64:
        angle = np.linspace(0, 2 * np.pi, _ROUND, endpoint=False)[:, None]
        made: F64 = self.frame.pivot + self.arm * radius * (np.cos(angle) * u + np.sin(angle) * v)
        return made

    def _on_canvas(self, points: F64) -> F64:
        return project(self._view, points) * self._size


def meaning(handle: Handle, local: bool = False) -> str:
    """What dragging a handle does, for the status bar."""
    own = "its own " if local else ""
    if handle.kind == "axis":
        return f"Drag to move along {own}{NAMES[handle.axis]}; type a distance while dragging"
    if handle.kind == "plane":
        u, v = (NAMES[axis] for axis in range(3) if axis != handle.axis)
        return f"Drag to move along {own}{u} and {v}"
    if handle.kind == "free":
        return "Drag to move as you see it"
    if handle.kind == "ring":
        return f"Drag to turn about {own}{NAMES[handle.axis]}; type an angle while dragging"
    if handle.kind == "view_ring":
        return "Drag to turn about the line of sight"
    return "Drag to scale; all sides grow alike"


def _faded(colour: str, opacity: float = 0.4) -> str:
    return f"#{round(255 * opacity):02x}{colour[1:]}"


def _square_corners(low: float, high: float) -> list[tuple[float, float]]:
    return [(low, low), (high, low), (high, high), (low, high)]


def _loop(rim: F64) -> F64:
    return np.stack([rim, np.roll(rim, -1, axis=0)], axis=1)


def _distance(segments: F64, at: F64) -> float:
    """Pixels to the nearest of (N, 2, 2) segments; infinite where all reach behind the eye."""
    segments = segments[np.isfinite(segments).all(axis=(1, 2))]
    if not len(segments):
        return float("inf")
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((at - start) * along).sum(axis=1) / length, 0, 1)
    return float(np.linalg.norm(start + share[:, None] * along - at, axis=1).min())


def _inside(corners: F64, at: F64) -> bool:
    """Whether a point lies in a convex polygon, whichever way round it goes."""
    if not np.isfinite(corners).all():
        return False
    edge, away = np.roll(corners, -1, axis=0) - corners, at - corners
    side = edge[:, 0] * away[:, 1] - edge[:, 1] * away[:, 0]
    return bool((side >= 0).all() or (side <= 0).all())
