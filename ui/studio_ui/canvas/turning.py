"""Turning and scaling things about the middle of their foot."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.edits import Move
from studio_core.scene.arranging import scaled, turned
from studio_core.session import View
from studio_ui.canvas.drags import Hold
from studio_ui.canvas.gizmos import NAMES, Frame, Handle
from studio_ui.canvas.moving import on_plane
from studio_ui.canvas.overlay import Overlay, Wires
from studio_ui.canvas.projection import eye_of, project
from studio_ui.canvas.snapping import SCALE_STEP, rounded
from studio_ui.canvas.viewport import Pointer

F64 = npt.NDArray[np.float64]
TURN = 360.0
"""Degrees for a drag of the thing itself across the picture."""
_EDGE_ON = 0.25  # cosine: rings that are seen at a lower angle are turned as they look in the picture
_SMALLEST, _LARGEST = 0.01, 100.0
_FAR = 24.0  # logical pixels from the middle at which a drag outwards scales by the ratio of distances
_DOUBLE = 0.25  # of the picture's height: a drag from the middle that doubles the size


class TurnDrag:
    """About the axis of a ring or of the line of sight; without a handle about the vertical."""

    unit: str | None = "°"

    def __init__(self, hold: Hold, handle: Handle | None = None) -> None:
        self._hold, self._handle = hold, handle
        self._axis = self._axis_of(handle)
        self._degrees = 0.0
        self._typed: float | None = None
        self._reached = self._angle(hold.press)
        self._sum = 0.0  # of all small turns: more than one turn can be made

    @property
    def label(self) -> str:
        """`Turn Chair 45° about X`; about the vertical the axis is not told."""
        title = self._hold.title("Turn")
        if self._degrees == 0:
            return title
        about = ""
        if self._handle is not None and self._handle.kind == "ring":
            own = "" if self._hold.world_axes else "its "
            about = "" if self._handle.axis == 1 and not own else f" about {own}{NAMES[self._handle.axis]}"
        elif self._handle is not None:
            about = " about the line of sight"
        return f"{title} {self._hold.words.angle(self._degrees)}{about}"

    def told(self) -> str:
        """The angle."""
        ring = self._handle is not None and self._handle.kind == "ring"
        name = f"{NAMES[self._handle.axis]} " if ring and self._handle is not None else ""
        return f"{name}{self._hold.words.angle(self._degrees)}"

    def type(self, amount: float | None) -> None:
        """Degrees, right-handed about the axis."""
        self._typed = amount

    @property
    def frame(self) -> Frame:
        """The gizmo stays."""
        return self._hold.frame

    def marks(self) -> Overlay:
        """From the middle to where the mouse was pressed, and to where that has come."""
        if self._handle is None or self._degrees == 0:
            return Overlay()
        pivot = self._hold.frame.pivot
        start = on_plane(self._hold.view, pivot, self._axis, self._hold.press.x, self._hold.press.y) - pivot
        angle = np.radians(self._degrees)
        end = start * np.cos(angle) + np.cross(self._axis, start) * np.sin(angle)
        lines = np.array([[pivot, pivot + start], [pivot, pivot + end]])
        return Overlay((Wires(lines, "#ffd54a", 1.0, bare=True),))

    def edit(self, pointer: Pointer) -> Move:
        """The nodes turned as far as the mouse has gone round, or as was typed."""
        if self._typed is not None:
            self._degrees = self._typed
        else:
            if self._handle is None:
                self._sum = (pointer.x - self._hold.press.x) * TURN
            else:
                angle = self._angle(pointer)
                self._sum += (angle - self._reached + 180) % 360 - 180
                self._reached = angle
            step = self._hold.snap.angle if self._hold.magnet(pointer) else 0.0
            self._degrees = rounded(self._sum, step)
        hold = self._hold
        made = turned(hold.scene, hold.nodes, self._degrees, hold.frame.pivot, self._axis)
        return Move(made, self.label)

    def _axis_of(self, handle: Handle | None) -> F64:
        if handle is None:
            return np.array([0.0, 1.0, 0.0])
        if handle.kind == "ring":
            along: F64 = self._hold.frame.axes[handle.axis]
            return along
        return _sight(self._hold.view, self._hold.frame.pivot)

    def _angle(self, pointer: Pointer) -> float:
        """Degrees about the axis at which the mouse is seen from the pivot."""
        view, pivot = self._hold.view, self._hold.frame.pivot
        facing = float(self._axis @ _sight(view, pivot))
        if abs(facing) > _EDGE_ON:
            away = on_plane(view, pivot, self._axis, pointer.x, pointer.y) - pivot
            u, v = _across(self._axis)
            return float(np.degrees(np.arctan2(away @ v, away @ u)))
        # seen from the side a ring is a line: along it, a drag over its picture is half a turn
        size = np.array(pointer.pixels, np.float64)
        towards = np.cross(self._axis, _sight(view, pivot))
        length = max(float(np.linalg.norm(towards)), 1e-9)
        far = max(float(np.linalg.norm(pivot - eye_of(view))), 1e-6) * 0.05
        ends = project(view, [pivot, pivot + towards / length * far]) * size
        way = ends[1] - ends[0]
        pixels = max(float(np.linalg.norm(way)), 1e-9)
        gone = (np.array([pointer.x, pointer.y]) * size - ends[0]) @ way / pixels
        return float(gone / (_DOUBLE * size[1]) * 90)


class SizeDrag:
    """All sides alike: a thing has one scale. Away from the middle of its foot it grows."""

    unit: str | None = ""

    def __init__(self, hold: Hold, handle: Handle | None = None) -> None:
        self._hold = hold
        self._factor = 1.0
        self._typed: float | None = None

    @property
    def label(self) -> str:
        """`Scale Chair to 120%`."""
        title = self._hold.title("Scale")
        return title if self._factor == 1 else f"{title} to {self.told()}"

    def told(self) -> str:
        """The factor as a percentage."""
        return self._hold.words.factor(self._factor)

    def type(self, amount: float | None) -> None:
        """A factor; `120%` is 1.2."""
        self._typed = amount

    @property
    def frame(self) -> Frame:
        """The gizmo stays."""
        return self._hold.frame

    def marks(self) -> Overlay:
        """Nothing: the size is seen."""
        return Overlay()

    def edit(self, pointer: Pointer) -> Move:
        """The nodes as large as the mouse, or what was typed, says."""
        hold = self._hold
        if self._typed is not None:
            self._factor = abs(self._typed) or 1.0
        else:
            self._factor = self._dragged(pointer)
            if hold.magnet(pointer):
                self._factor = max(rounded(self._factor, SCALE_STEP), SCALE_STEP)
        self._factor = float(np.clip(self._factor, _SMALLEST, _LARGEST))
        return Move(scaled(hold.scene, hold.nodes, self._factor, hold.frame.pivot), self.label)

    def _dragged(self, pointer: Pointer) -> float:
        size = np.array(pointer.pixels, np.float64)
        pivot = project(self._hold.view, self._hold.frame.pivot)[0] * size
        press, now = (np.array([p.x, p.y]) * size for p in (self._hold.press, pointer))
        start = float(np.linalg.norm(press - pivot))
        if not np.isfinite(start) or start < _FAR:
            right_and_up = float((now - press) @ (1.0, -1.0)) / max(size[1], 1.0)
            return float(2 ** (right_and_up / _DOUBLE))
        return float(np.linalg.norm(now - pivot)) / start


def _sight(view: View, point: F64) -> F64:
    """(3,) unit, from a point to the eye."""
    away = eye_of(view) - point
    made: F64 = away / max(float(np.linalg.norm(away)), 1e-12)
    return made


def _across(axis: F64) -> tuple[F64, F64]:
    """Two unit vectors across an axis; the three are right-handed."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    u = np.cross(axis, other)
    u /= np.linalg.norm(u)
    return u, np.cross(axis, u)
