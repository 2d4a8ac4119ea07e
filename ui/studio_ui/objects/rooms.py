"""Rooms in the window: a new one round the furniture, and walls opened towards the viewer."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from studio_core.edits import Compound, Edit, SetFields
from studio_core.rooms import new_room
from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_core.scene.room import Room
from studio_core.scene.room_shape import Opening, RoomShape, outward
from studio_core.scene.transform import Vec3
from studio_core.session import View
from studio_ui.canvas.projection import own_corners
from studio_ui.context import Context

LEAST = (5.0, 4.0)  # metres: width and depth
MOST = 15.0  # what is wider is no furniture
ROUND = 0.6  # metres from furniture to walls, at least
_FLAT, _WIDE = 2e-3, 1.5  # metres: what is that low and that wide is a floor
WINDOW = Opening(wall=0, width=1.8, height=1.5, sill=0.8)
DOOR = Opening(kind="door", wall=1, width=0.9, height=2.05, sill=0.0)

F64 = npt.NDArray[np.float64]


class Rooms:
    """The actions of Object ▸ Room."""

    def __init__(self, context: Context, say: Callable[[str], object]) -> None:
        self._context, self._say = context, say

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {
            "room.new": self.add,
            "room.open_walls": self.open_walls,
            "room.close_walls": self.close_walls,
        }

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """Whether there is a room to change."""
        return {"room": lambda: bool(self._chosen())}

    def add(self) -> None:
        """A room round the furniture, with a window and a door, open towards the viewer; chosen."""
        scene, view = self._context.document.scene, self._context.session.view
        edit, room, floors = room_around(scene, view)
        if self._context.editing.apply(edit):
            self._context.session.select([room])
            if floors:
                names = " and ".join(scene[floor].name for floor in floors)
                self._say(f"The room has a floor of its own: {names} was hidden")

    def open_walls(self) -> None:
        """Leave out what stands between the viewer and the inside."""
        eye = np.array(self._context.session.view.transform.translation)
        scene = self._context.document.scene
        edits = []
        for room in self._chosen():
            own = _own(scene, room.id, eye)
            values = {"without": walls_before(room.shape, own), "ceiling": not is_above(room.shape, own)}
            edits.append(SetFields(room.id, values))
        self._context.editing.apply(Compound("Open walls towards the view", tuple(edits)))

    def close_walls(self) -> None:
        """All walls and the ceiling again."""
        edits = [SetFields(room.id, {"without": (), "ceiling": True}) for room in self._chosen()]
        self._context.editing.apply(Compound("Close all walls", tuple(edits)))

    def _chosen(self) -> list[Room]:
        """The chosen rooms; all, where nothing that is chosen is one."""
        scene = self._context.document.scene
        rooms = [room for room in scene.of(Room) if room.id in self._context.session.selection]
        return rooms or list(scene.of(Room))


def room_around(scene: Scene, view: View) -> tuple[Edit, NodeId, tuple[NodeId, ...]]:
    """The edit for a room round the furniture of a scene, its id, and the floors that it takes the place of.

    Walls that stand between the eye and the inside are left out, so that one sees something.
    """
    meshes = [node for node in scene.of(MeshObject) if len(node.geometry.positions)]
    shown = [node for node in meshes if scene.shown(node.id) and not isinstance(node, Room)]
    floors = tuple(node.id for node in shown if _is_floor(scene, node))
    furniture = [node for node in shown if node.id not in floors]
    width, depth = LEAST
    centre: Vec3 = (0.0, 0.0, 0.0)
    if furniture:
        corners = np.concatenate([own_corners(scene, node.id) for node in furniture])
        low, high = corners.min(axis=0), corners.max(axis=0)
        size = high - low
        if max(size[0], size[2]) <= MOST:
            width, depth = (max(a, _up(b + 2 * ROUND)) for a, b in zip(LEAST, size[[0, 2]], strict=True))
            middle = (low + high) / 2
            centre = (round(float(middle[0]), 2), 0.0, round(float(middle[2]), 2))
    taken = {node.name for node in scene.nodes.values()}
    name = next(n for n in ("Room", *(f"Room {k}" for k in range(2, len(taken) + 3))) if n not in taken)
    made = new_room(width, depth, openings=(WINDOW, DOOR), centre=centre, name=name)
    (room,) = made.nodes
    assert isinstance(room, Room)
    eye = np.array(view.transform.translation) - centre
    open_ = {"without": walls_before(room.shape, eye), "ceiling": not is_above(room.shape, eye)}
    hide = [SetFields(floor, {"hidden": True}) for floor in floors]
    return Compound(f"New {name.lower()}", (made, SetFields(room.id, open_), *hide)), room.id, floors


def walls_before(shape: RoomShape, eye: F64) -> tuple[int, ...]:
    """The walls that turn their outside to an eye (x, y, z) in the room's own frame."""
    plan = np.array(shape.corners)
    towards = ((eye[[0, 2]] - plan) * outward(plan)).sum(axis=1)
    return tuple(int(wall) for wall in np.flatnonzero(towards > shape.thickness))


def is_above(shape: RoomShape, eye: F64) -> bool:
    """Whether the eye is higher than the ceiling."""
    return bool(eye[1] > shape.height)


def _own(scene: Scene, node: NodeId, point: F64) -> F64:
    matrix = scene.world(node).inverse().matrix()
    made: F64 = matrix[:3, :3] @ point + matrix[:3, 3]
    return made


def _is_floor(scene: Scene, node: MeshObject) -> bool:
    """Whether something is as flat and wide as a floor, and lies where a room's floor will be."""
    corners = own_corners(scene, node.id)
    low, size = corners.min(axis=0), np.ptp(corners, axis=0)
    return bool(size[1] < _FLAT and min(size[0], size[2]) > _WIDE and abs(low[1]) < _FLAT)


def _up(length: float) -> float:
    """To the next decimetre."""
    return float(np.ceil(length * 10 - 1e-6) / 10)
