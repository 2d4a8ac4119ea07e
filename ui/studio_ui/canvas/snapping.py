"""Where things want to be: on the grid, at the sides and middles of other things, on the floor.

Everything snaps along one axis of the world at a time; the nearest wins, and what is snapped stays where it
is when it is snapped again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.scene.bounds import exact_bounds
from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_ui.canvas.overlay import Dot, Label, Mark, Overlay, Wires

F64 = npt.NDArray[np.float64]
PIXELS = 8.0
"""How near counts as there, on the screen."""
NEAREST, FURTHEST = 0.003, 0.1
"""Metres that these pixels are at least and at most."""
AROUND = 1.5
"""Metres between two boxes across the axis: what is further off does not pull."""
SCALE_STEP = 0.05
_PASSES = 4
_STUDS = ((0, 0), (0, 1), (1, 0), (1, 1), (2, 2))  # low, high, middle of what moves, and of the other
_GUIDE = "#ffd54a"


@dataclass(frozen=True)
class Snap:
    """What snaps: steps in metres and degrees. `on` is the magnet."""

    on: bool = True
    grid: bool = True
    objects: bool = True
    surfaces: bool = True
    step: float = 0.05
    angle: float = 15.0


@dataclass(frozen=True, eq=False)
class Met:
    """What a movement has met along an axis: the plane at `at` metres, of `other` (None: the floor)."""

    axis: int
    at: float
    other: int | None


class Neighbours:
    """The boxes that something which moves can be aligned with."""

    def __init__(self, scene: Scene, moving: Sequence[NodeId]) -> None:
        box = exact_bounds(scene, moving)
        self.box: F64 | None = np.stack(box) if box is not None else None
        self.names: list[str] = []
        boxes: list[F64] = []
        if self.box is not None:
            for node, other in _others(scene, moving, self.box):
                self.names.append(scene[node].name)
                boxes.append(other)
        self.boxes: F64 = np.array(boxes).reshape(-1, 2, 3)

    def snapped(
        self,
        delta: npt.ArrayLike,
        axes: Sequence[int],
        tolerance: float,
        *,
        step: float = 0.0,
        lead: npt.ArrayLike = (0.0, 0.0, 0.0),
        objects: bool = True,
        floor: bool = True,
    ) -> tuple[F64, list[Met]]:
        """A displacement (3,) changed along `axes` so that the moved box meets something; and what it met.

        Where it meets nothing, the point `lead` comes to multiples of `step` metres (0: anywhere).
        """
        made = np.array(delta, np.float64)
        met: list[Met] = []
        for _ in range(_PASSES):
            before = made.copy()
            met = []
            for axis in axes:
                made[axis], found = self._along(made, axis, tolerance, step, np.asarray(lead), objects, floor)
                if found is not None:
                    met.append(found)
            if np.array_equal(before, made):
                break
        return made, met

    def _along(
        self, delta: F64, axis: int, tolerance: float, step: float, lead: F64, objects: bool, floor: bool
    ) -> tuple[float, Met | None]:
        places, mets = self._places(delta, axis, objects, floor)
        found = _nearest(places, delta[axis], tolerance)
        still = min(tolerance, step / 2) if step else tolerance / 2
        if abs(delta[axis]) < still and (
            found is None or abs(places[found] - delta[axis]) >= abs(delta[axis])
        ):
            return 0.0, next((mets[i] for i in np.flatnonzero(np.abs(places) < 1e-9)), None)
        if found is None and step:
            rounded = float(np.round((lead[axis] + delta[axis]) / step) * step - lead[axis])
            found = _nearest(places, rounded, tolerance)
            if found is None:
                return rounded, None
        return (float(places[found]), mets[found]) if found is not None else (float(delta[axis]), None)

    def _places(self, delta: F64, axis: int, objects: bool, floor: bool) -> tuple[F64, list[Met]]:
        """Displacements along an axis at which something is met."""
        places: list[float] = []
        mets: list[Met] = []
        if self.box is None:
            return np.zeros(0), mets
        mine = (self.box[0, axis], self.box[1, axis], self.box[:, axis].mean())
        if objects:
            moved = self.box + delta
            across = [other for other in range(3) if other != axis]
            gap = np.maximum(self.boxes[:, 0] - moved[1], moved[0] - self.boxes[:, 1])[:, across]
            for index in np.flatnonzero((gap <= AROUND).all(axis=1)):
                other = self.boxes[index]
                theirs = (other[0, axis], other[1, axis], other[:, axis].mean())
                for here, there in _STUDS:
                    places.append(theirs[there] - mine[here])
                    mets.append(Met(axis, float(theirs[there]), int(index)))
        if floor and axis == 1:
            places.append(-mine[0])
            mets.append(Met(1, 0.0, None))
        return np.array(places, np.float64), mets

    def guides(self, delta: F64, met: Sequence[Met], told: object = None) -> Overlay:
        """Lines to what was met, with the distance between the two; `told` makes words of metres."""
        words = told if callable(told) else (lambda metres: f"{metres:.2f} m")
        marks: list[Mark] = []
        if self.box is None:
            return Overlay()
        moved = self.box + delta
        for one in met:
            if one.other is None:
                continue  # that it stands on the floor is seen
            other = self.boxes[one.other]
            marks += _guide(one, moved, other, self.names[one.other], words)
        return Overlay(tuple(marks))


def tolerance_at(metres_per_pixel: float) -> float:
    """Metres within which things snap, where a pixel is so large."""
    return float(np.clip(PIXELS * metres_per_pixel, NEAREST, FURTHEST))


def rounded(value: float, step: float) -> float:
    """The nearest multiple of a step (0: any value)."""
    return round(value / step) * step if step > 0 else value


def _nearest(places: F64, value: float, tolerance: float) -> int | None:
    if not len(places):
        return None
    distance = np.abs(places - value)
    index = int(np.argmin(distance))
    return index if distance[index] <= tolerance else None


def _others(scene: Scene, moving: Sequence[NodeId], box: F64) -> list[tuple[NodeId, F64]]:
    """Shown things beside what moves; of what surrounds it (a room, its own group) the parts."""
    own = {above.id for node in moving for above in scene.ancestors(node)}
    found: list[tuple[NodeId, F64]] = []
    queue = [node.id for node in scene.children(None)]
    while queue:
        node = queue.pop()
        if node in moving or not scene.shown(node):
            continue
        has_mesh = any(isinstance(scene[below], MeshObject) for below in scene.subtree(node))
        around = exact_bounds(scene, (node,)) if has_mesh else None
        if around is None:
            continue
        inside = [child.id for child in scene.children(node)]
        holds = (around[0][[0, 2]] <= box[0, [0, 2]]).all() and (around[1][[0, 2]] >= box[1, [0, 2]]).all()
        if inside and (node in own or holds):
            queue += inside
        elif node not in own:
            found.append((node, np.stack(around)))
    return found


def _guide(met: Met, moved: F64, other: F64, name: str, words: object) -> list[Mark]:
    """In the plane that was met: from one box to the other, and around the other."""
    assert callable(words)
    start, end = np.zeros(3), np.zeros(3)
    gap = 0.0
    for axis in range(3):
        if axis == met.axis:
            start[axis] = end[axis] = met.at
            continue
        low, high = max(moved[0, axis], other[0, axis]), min(moved[1, axis], other[1, axis])
        if low <= high or axis == 1:
            start[axis] = end[axis] = moved[0, 1] if axis == 1 else (low + high) / 2
        elif moved[0, axis] > other[1, axis]:
            start[axis], end[axis] = moved[0, axis], other[1, axis]
            gap = max(gap, float(start[axis] - end[axis]))
        else:
            start[axis], end[axis] = moved[1, axis], other[0, axis]
            gap = max(gap, float(end[axis] - start[axis]))
    marks: list[Mark] = [Wires(_side(other, met.axis, met.at), _GUIDE, 1.0, bare=True)]
    if gap > 1e-3:
        marks += [
            Wires(np.array([[start, end]]), _GUIDE, 1.5),
            Dot(start, _GUIDE, 2.5),
            Dot(end, _GUIDE, 2.5),
        ]
        marks.append(Label((start + end) / 2, f"{name} · {words(gap)}", _GUIDE, (8.0, 6.0)))
    else:
        marks.append(Label(start, name, _GUIDE, (8.0, 6.0)))
    return marks


def _side(box: F64, axis: int, at: float) -> F64:
    """(4, 2, 3) the outline of a box where a plane cuts it."""
    u, v = (other for other in range(3) if other != axis)
    rim = np.full((4, 3), at)
    for row, (a, b) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        rim[row, u], rim[row, v] = box[a, u], box[b, v]
    return np.stack([rim, np.roll(rim, -1, axis=0)], axis=1)
