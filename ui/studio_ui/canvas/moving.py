"""Moving things: along an axis, in a plane, over the floor and whatever else they can stand on."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.edits import Move
from studio_core.scene.arranging import shifted
from studio_core.scene.bounds import exact_bounds
from studio_core.scene.nodes import NodeId, Scene
from studio_core.scene.standing import Ground, Seat
from studio_core.session import View
from studio_ui.canvas.drags import Hold
from studio_ui.canvas.gizmos import NAMES, Frame, Handle, metres_per_pixel
from studio_ui.canvas.overlay import Overlay
from studio_ui.canvas.projection import axes_of, extent, eye_of, ray
from studio_ui.canvas.snapping import Met, Neighbours, Pull, rounded, tolerance_at
from studio_ui.canvas.viewport import Pointer

F64 = npt.NDArray[np.float64]
FLAT = 0.03
"""Sine of the lowest angle at which a plane is followed; below it the hand is, in the picture's plane."""
FURTHEST = 12.0
"""Times the distance at the press: where the mouse points beyond, things stay this near."""
STANDS = 0.02
"""Metres between a foot and what is below it, where it still stands."""
CLIMB = 0.05
"""Metres that things climb by themselves, as onto a rug."""
_UP = np.array([0.0, 1.0, 0.0])
_HIDES = 8  # most things that may hide a foot at the press


class MoveDrag:
    """With an `axis` or `plane` handle along these; otherwise over the floor, with Shift up and down.

    What stands on something goes where the mouse sees something to stand on, while surfaces snap. What hangs
    or floats keeps its height; with the `free` handle it follows the hand in the picture's plane.
    """

    unit: str | None = "m"

    def __init__(self, hold: Hold, handle: Handle | None = None) -> None:
        self._hold, self._handle = hold, handle
        self._delta = np.zeros(3)
        self._met: list[Met] = []
        self._typed: float | None = None
        self._way: F64 | None = None  # unit: where what is typed goes
        self._vertical = False
        self._base, self._grip = np.zeros(3), hold.grip
        self._neighbours = Neighbours(hold.scene, hold.nodes)
        self._ground = Ground(hold.scene, set(hold.nodes))
        self._lead = hold.scene.world(hold.nodes[0]).translation
        self._stands = _stands(hold.scene, hold.nodes, self._ground)
        if self._stands and self._kind == "floor":
            self._ground = self._without_what_hides()
        self._start = self._touched(hold.press)

    @property
    def _kind(self) -> str:
        """axis, plane, floor or view."""
        if self._handle is None:
            return "floor"
        if self._handle.kind == "free":
            return "floor" if self._stands else "view"
        return self._handle.kind

    @property
    def label(self) -> str:
        """`Move Chair 80 cm along X`."""
        title = self._hold.title("Move")
        if not self._delta.any():
            return title
        if self._kind == "axis" and self._handle is not None:
            own = "" if self._hold.world_axes else "its "
            return f"{title} {self._hold.words.length(self._along())} along {own}{NAMES[self._handle.axis]}"
        return f"{title} {self._hold.words.length(float(np.linalg.norm(self._delta)))}"

    def told(self) -> str:
        """The distance, by axis where there is one."""
        if self._kind == "axis" and self._handle is not None:
            return f"{NAMES[self._handle.axis]} {self._hold.words.length(self._along())}"
        if self._kind == "floor" and self._vertical and abs(self._delta[1]) > 0:
            return f"Y {self._hold.words.length(float(self._delta[1]))}"
        if self._kind == "plane" and self._handle is not None:
            parts = self._hold.frame.axes @ self._delta
            told = [
                f"{NAMES[i]} {self._hold.words.length(float(parts[i]))}"
                for i in range(3)
                if i != self._handle.axis
            ]
            return "   ".join(told)
        return self._hold.words.length(float(np.linalg.norm(self._delta)))

    def type(self, amount: float | None) -> None:
        """Metres along the axis, or the way that the hand went."""
        if self._way is None:
            length = float(np.linalg.norm(self._delta))
            self._way = self._delta / length if length > 1e-6 else self._hold.frame.axes[0]
            if self._kind == "axis" and self._handle is not None:
                self._way = self._hold.frame.axes[self._handle.axis]
        self._typed = amount
        if amount is None:
            self._way = None

    @property
    def frame(self) -> Frame:
        """The gizmo goes along."""
        return Frame(self._hold.frame.pivot + self._delta, self._hold.frame.axes)

    def marks(self) -> Overlay:
        """The axis, and what was met."""
        made = Overlay()
        if self._kind == "axis" and self._handle is not None:
            made += self._hold.axis_line(self._handle.axis)
        return made + self._neighbours.guides(self._delta, self._met, self._hold.words.length)

    def edit(self, pointer: Pointer) -> Move:
        """The nodes where the mouse, or what was typed, wants them."""
        self._met = []
        if self._typed is not None and self._way is not None:
            delta = self._way * self._typed
        elif self._kind == "floor":
            delta = self._over_the_floor(pointer)
        else:
            delta = self._touched(pointer) - self._start
            if self._kind == "axis" and self._handle is not None:
                along = self._hold.frame.axes[self._handle.axis]
                delta = along * float(delta @ along)
            if self._hold.magnet(pointer):
                delta = self._snapped(pointer, delta, self._axes())
        self._delta = delta
        return Move(shifted(self._hold.scene, self._hold.nodes, delta), self.label)

    # where the mouse is

    def _touched(self, pointer: Pointer) -> F64:
        """The point of the axis or plane through what was grabbed that is under the mouse."""
        hold, grip = self._hold, self._grip
        if self._kind == "axis" and self._handle is not None:
            along = hold.frame.axes[self._handle.axis]
            made: F64 = grip + along * on_axis(hold.view, grip, along, pointer.x, pointer.y)
            return made
        if self._kind == "plane" and self._handle is not None:
            return on_plane(hold.view, grip, hold.frame.axes[self._handle.axis], pointer.x, pointer.y)
        normal = axes_of(hold.view)[2] if self._kind == "view" else _UP
        return on_plane(hold.view, grip, normal, pointer.x, pointer.y)

    def _over_the_floor(self, pointer: Pointer) -> F64:
        if pointer.shift != self._vertical:  # go on from here along the other directions
            self._vertical = pointer.shift
            self._base = self._delta
            self._grip = self._plane_point(pointer, self._hold.grip + self._base)
        delta = self._base + self._plane_point(pointer, self._hold.grip + self._base) - self._grip
        magnet = self._hold.magnet(pointer)
        if self._vertical:
            return self._snapped(pointer, delta, [1]) if magnet else delta
        if not (magnet and self._hold.snap.surfaces and self._stands):
            return self._snapped(pointer, delta, [0, 2]) if magnet else delta
        seat = self._seat(pointer)
        if seat is not None:
            delta = seat - self._hold.frame.pivot
        return self._landed(self._snapped(pointer, delta, [0, 2]))

    def _plane_point(self, pointer: Pointer, through: F64) -> F64:
        """On the horizontal plane through a point; with Shift on the vertical line through it."""
        if not self._vertical:
            return on_plane(self._hold.view, through, _UP, pointer.x, pointer.y)
        made: F64 = through + _UP * on_axis(self._hold.view, through, _UP, pointer.x, pointer.y)
        return made

    def _seat(self, pointer: Pointer) -> F64 | None:
        """(3,) where the mouse sees something to stand on, for the middle of the foot; else on y = 0."""
        start, towards = self._foot_ray(pointer)
        furthest = FURTHEST * max(float(np.linalg.norm(self._hold.grip - eye_of(self._hold.view))), 0.1)
        seat = self._ground.along(start, towards)
        if seat is not None and float((seat.at - start) @ towards) < furthest:
            return seat.at
        if towards[1] < -FLAT and 0 < -start[1] / towards[1] < furthest:
            made: F64 = start - towards * (start[1] / towards[1])
            return made
        return None

    def _foot_ray(self, pointer: Pointer) -> tuple[F64, F64]:
        """The mouse's ray, shifted from what was grabbed to the middle of the foot."""
        hold = self._hold
        offset = hold.frame.pivot - hold.grip
        return eye_of(hold.view) + offset, ray(hold.view, pointer.x, pointer.y)

    # where things want to be

    def _axes(self) -> list[int]:
        if self._kind == "axis" and self._handle is not None:
            return [self._handle.axis]
        return [i for i in range(3) if self._handle is None or i != self._handle.axis]

    def _snapped(self, pointer: Pointer, delta: F64, axes: list[int]) -> F64:
        hold, snap = self._hold, self._hold.snap
        if not hold.world_axes and self._kind in ("axis", "plane"):
            parts = hold.frame.axes @ delta
            for axis in axes:
                parts[axis] = rounded(float(parts[axis]), snap.grid * snap.step)
            made: F64 = parts @ hold.frame.axes
            return made
        tolerance = tolerance_at(metres_per_pixel(hold.view, pointer.pixels[1], hold.grip))
        pull = Pull(
            tolerance,
            snap.grid * snap.step,
            self._lead,
            snap.objects,
            self._heights(delta, tolerance) if 1 in axes else (),
        )
        made, self._met = self._neighbours.snapped(delta, axes, pull)
        return made

    def _heights(self, delta: F64, tolerance: float) -> tuple[float, ...]:
        """What a foot could stand on: the floor, and what is below it now."""
        box = self._neighbours.box
        if box is None or not self._hold.snap.surfaces:
            return (0.0,)
        low, high = box + delta
        found = self._ground.support(low, high, float(low[1]) + tolerance)
        return (0.0, found) if np.isfinite(found) else (0.0,)

    def _landed(self, delta: F64) -> F64:
        """On the highest of what is below the footprint, as far as things climb."""
        box = self._neighbours.box
        if box is None:
            return delta
        low, high = box + delta
        found = self._ground.support(low, high, float(low[1]) + CLIMB)
        if np.isfinite(found) and found > low[1] - CLIMB:
            delta = delta + _UP * (found - low[1])
        return delta

    def _without_what_hides(self) -> Ground:
        """What lies between the eye and the foot already does not count: nothing jumps when it is grabbed."""
        foot, left_out = self._hold.frame.pivot, set(self._hold.nodes)
        ground = self._ground
        for _ in range(_HIDES):
            seat: Seat | None = ground.along(*self._foot_ray(self._hold.press))
            if seat is None or seat.at[1] < foot[1] + CLIMB:
                break
            left_out.add(seat.node)
            ground = Ground(self._hold.scene, left_out)
        return ground

    def _along(self) -> float:
        assert self._handle is not None
        return float(self._delta @ self._hold.frame.axes[self._handle.axis])


def on_axis(view: View, point: npt.ArrayLike, axis: npt.ArrayLike, x: float, y: float) -> float:
    """Metres along a unit axis (3,) from a point (3,) to the place on it that is seen nearest to (x, y).

    Beyond the axis' vanishing point, and further off than `FURTHEST`, it is as far as it gets.
    """
    away = axes_of(view) @ (np.asarray(point, np.float64) - eye_of(view))
    along = axes_of(view) @ np.asarray(axis, np.float64)
    right, top = extent(view)
    mouse = np.array([(2 * x - 1) * right, (1 - 2 * y) * top])
    depth, deeper = -float(away[2]), -float(along[2])
    if depth <= 1e-9:
        return 0.0
    start = away[:2] / depth
    slope = along[:2] - start * deeper  # where the point's picture goes, times its depth
    speed = float(np.linalg.norm(slope))
    furthest = FURTHEST * float(np.linalg.norm(away))
    if speed < 1e-6:
        return 0.0
    ahead = float((mouse - start) @ slope) / speed
    rest = speed - deeper * ahead
    if rest <= 1e-12:  # the vanishing point was passed
        return float(np.copysign(furthest, ahead))
    return float(np.clip(depth * ahead / rest, -furthest, furthest))


def on_plane(view: View, point: npt.ArrayLike, normal: npt.ArrayLike, x: float, y: float) -> F64:
    """(3,) where the ray through (x, y) meets the plane through a point with a unit normal.

    Where the plane is seen edge-on, or the ray leaves it: as the hand goes in the picture's plane, brought
    back to the plane. At most `FURTHEST` times as far as the point.
    """
    through, up = np.asarray(point, np.float64), np.asarray(normal, np.float64)
    eye, towards = eye_of(view), ray(view, x, y)
    furthest = FURTHEST * max(float(np.linalg.norm(through - eye)), 0.1)
    height = float((through - eye) @ up)
    slope = float(towards @ up)
    if abs(slope) >= FLAT and slope * height > 0:
        made: F64 = eye + towards * min(height / slope, furthest)
        return made - up * float((made - through) @ up)
    back = axes_of(view)[2]
    met = eye + towards * (float((through - eye) @ back) / min(float(towards @ back), -1e-6))
    flat: F64 = met - up * float((met - through) @ up)
    return flat


def _stands(scene: Scene, nodes: tuple[NodeId, ...], ground: Ground) -> bool:
    """Whether the lowest side of what moves lies on something, or on y = 0. What has no size does not."""
    box = exact_bounds(scene, nodes)
    if box is None or float((box[1] - box[0]).max()) < 1e-6:
        return False
    low, high = box
    return abs(float(low[1])) < STANDS or ground.support(low, high, float(low[1]) + STANDS) > low[1] - STANDS
