"""A room as a node of the scene: its sizes are kept and edited, its mesh follows from them."""

from __future__ import annotations

from dataclasses import dataclass, field

from studio_core.params import param
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import MeshObject
from studio_core.scene.room_mesh import room_geometry
from studio_core.scene.room_shape import (
    FARTHEST,
    Opening,
    Placed,
    Point,
    RoomShape,
    rectangle,
    stretched,
    wall_names,
)

SLOTS = ("Floor", "Walls", "Ceiling", "Skirting", "Frames")
"""What the materials of a room are for, in their order."""


@dataclass(frozen=True, kw_only=True)
class Room(MeshObject):
    """A room about its own origin, floor at y = 0, with one material for each of `SLOTS`.

    Sizes are those inside; walls thicken outwards. `plan` is another floor plan than the rectangle: corners
    (x, z) clockwise as seen from above, stretched so that their box is `width` × `depth`. `without` are the
    indices of walls that are left out. `geometry` follows and is never given. Raises ValueError, in a
    sentence, where no room can be made of the numbers.
    """

    geometry: Geometry = field(init=False, repr=False)
    width: float = param(5.0, "Width", "From wall to wall, inside", unit="m", low=0.5, high=FARTHEST)
    depth: float = param(4.0, "Depth", "From front to back, inside", unit="m", low=0.5, high=FARTHEST)
    height: float = param(2.6, "Height", "From floor to ceiling", unit="m", low=0.5, high=FARTHEST)
    thickness: float = param(
        0.2, "Wall thickness", "Outwards: the room keeps its size", unit="m", low=0.02, high=1.0
    )
    ceiling: bool = param(True, "Ceiling", "Closes the room above")
    skirting: float = param(
        0.08, "Skirting", "Height of the board along the walls; 0 for none", unit="m", low=0.0, high=0.5
    )
    plan: tuple[Point, ...] = ()
    without: tuple[int, ...] = ()
    openings: tuple[Opening, ...] = ()

    def __post_init__(self) -> None:
        give = object.__setattr__
        for name in ("plan", "without", "openings"):
            give(self, name, tuple(getattr(self, name)))
        if any(isinstance(wall, bool) or not isinstance(wall, int) for wall in self.without):
            raise ValueError("walls that are left out are given by their numbers")
        if not all(isinstance(opening, Opening) for opening in self.openings):
            raise ValueError("a room's openings are windows, doors and passages")
        give(self, "geometry", room_geometry(self.shape))

    @property
    def shape(self) -> RoomShape:
        """Everything that the mesh follows from."""
        plan = stretched(self.plan, self.width, self.depth) if self.plan else ()
        return RoomShape(
            plan or rectangle(self.width, self.depth),
            self.height,
            self.thickness,
            self.ceiling,
            self.skirting,
            frozenset(self.without),
            self.openings,
        )

    @property
    def walls(self) -> tuple[str, ...]:
        """What the walls are called, by index: after where they are, numbered where several look that way."""
        return wall_names(self.shape.corners)

    def placed(self) -> tuple[Placed, ...]:
        """The openings that found room, as they are made."""
        return self.shape.placed()
