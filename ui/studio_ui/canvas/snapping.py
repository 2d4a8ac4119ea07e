"""Where things want to be: on the grid, at the sides and middles of other things, on the floor.

Everything snaps along one axis of the world at a time; the nearest wins, and what is snapped stays where it
is when it is snapped again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.scene.bounds import exact_bounds, rows_in_world
from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_core.scene.room import Room
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
_ABOVE = (8.0, -26.0)  # logical pixels: what is told of the movement itself stands below


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
class Pull:
    """What pulls at a movement, within `tolerance` metres.

    Where nothing is met, the point `lead` comes to multiples of `step` metres (0: anywhere). `heights` are
    those that a foot can stand on.
    """

    tolerance: float
    step: float = 0.0
    lead: tuple[float, float, float] = (0.0, 0.0, 0.0)
    objects: bool = True
    heights: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Met:
    """The plane at `at` metres along an axis, of `other` among the neighbours (None: what carries)."""

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

    def snapped(self, delta: npt.ArrayLike, axes: Sequence[int], pull: Pull) -> tuple[F64, list[Met]]:
        """A displacement (3,) changed along `axes` so that the moved box meets something; and what it met."""
        made = np.array(delta, np.float64)
        met: list[Met] = []
        for _ in range(_PASSES):
            before = made.copy()
            found = [self._along(made, axis, pull) for axis in axes]
            for axis, (at, _) in zip(axes, found, strict=True):
                made[axis] = at
            met = [one for _, one in found if one is not None]
            if np.array_equal(before, made):
                break
        return made, met

    def _along(self, delta: F64, axis: int, pull: Pull) -> tuple[float, Met | None]:
        here, step = float(delta[axis]), pull.step
        places, mets = self._places(delta, axis, pull)
        found = _nearest(places, here, pull.tolerance)
        still = min(pull.tolerance, step / 2) if step else pull.tolerance / 2
        if abs(here) < still and (found is None or abs(places[found] - here) >= abs(here)):
            return 0.0, next((mets[i] for i in np.flatnonzero(np.abs(places) < 1e-9)), None)
        if found is None and step:
            lead = float(pull.lead[axis])
            here = round((lead + here) / step) * step - lead
            found = _nearest(places, here, pull.tolerance)
        return (float(places[found]), mets[found]) if found is not None else (here, None)

    def _places(self, delta: F64, axis: int, pull: Pull) -> tuple[F64, list[Met]]:
        """Displacements along an axis at which something is met."""
        places: list[float] = []
        mets: list[Met] = []
        if self.box is None:
            return np.zeros(0), mets
        mine = (self.box[0, axis], self.box[1, axis], self.box[:, axis].mean())
        if pull.objects:
            moved = self.box + delta
            across = [other for other in range(3) if other != axis]
            gap = np.maximum(self.boxes[:, 0] - moved[1], moved[0] - self.boxes[:, 1])[:, across]
            for index in np.flatnonzero((gap <= AROUND).all(axis=1)):
                other = self.boxes[index]
                theirs = (other[0, axis], other[1, axis], other[:, axis].mean())
                for here, there in _STUDS:
                    places.append(theirs[there] - mine[here])
                    mets.append(Met(axis, float(theirs[there]), int(index)))
        for height in pull.heights if axis == 1 else ():
            places.append(height - mine[0])
            mets.append(Met(1, height, None))
        return np.array(places, np.float64), mets

    def guides(self, delta: F64, met: Sequence[Met], words: Callable[[float], str]) -> Overlay:
        """Lines to what was met, with the distance between the two; `words` tells metres."""
        marks: list[Mark] = []
        if self.box is None:
            return Overlay()
        moved = self.box + delta
        for one in met:
            if one.other is None:
                continue  # that it stands is seen
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
        room = _room_inside(scene, node)
        if room is not None:
            found.append((node, room))
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


def _room_inside(scene: Scene, node: NodeId) -> F64 | None:
    """(2, 3) between the walls, floor and ceiling of a room that stands straight; None for anything else."""
    made = scene[node]
    if not isinstance(made, Room):
        return None
    world = scene.world(node).matrix()
    turn = np.abs(world[:3, :3])
    if (turn > 1e-9 * turn.max()).sum() != 3:
        return None
    half = (made.width / 2, made.depth / 2)
    ends = rows_in_world(np.array([(-half[0], 0.0, -half[1]), (half[0], made.height, half[1])]), world)
    return np.stack([ends.min(axis=1), ends.max(axis=1)])


def _guide(met: Met, moved: F64, other: F64, name: str, words: Callable[[float], str]) -> list[Mark]:
    """In the plane that was met: from one box to the other, and around the other."""
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
        marks.append(Label((start + end) / 2, f"{name} · {words(gap)}", _GUIDE, _ABOVE))
    else:
        top = np.where(np.arange(3) == 1, other[1], other.mean(axis=0))
        top[met.axis] = met.at
        marks.append(Label(top, name, _GUIDE, _ABOVE))
    return marks


def _side(box: F64, axis: int, at: float) -> F64:
    """(4, 2, 3) the outline of a box where a plane cuts it."""
    u, v = (other for other in range(3) if other != axis)
    rim = np.full((4, 3), at)
    for row, (a, b) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        rim[row, u], rim[row, v] = box[a, u], box[b, v]
    return np.stack([rim, np.roll(rim, -1, axis=0)], axis=1)
