"""Edits that make and furnish rooms; sizes of a room that is there are changed with `SetFields`."""

from __future__ import annotations

from typing import Any

from studio_core.edits import Add
from studio_core.errors import EditError, InputError
from studio_core.params import Colour, check, param_infos
from studio_core.scene.nodes import Material, new_id
from studio_core.scene.room import SLOTS, Room
from studio_core.scene.room_shape import Opening, Point
from studio_core.scene.transform import Transform, Vec3

_COLOURS: dict[str, Colour] = {
    "Floor": (0.36, 0.25, 0.16),
    "Walls": (0.78, 0.77, 0.74),
    "Ceiling": (0.84, 0.84, 0.83),
    "Skirting": (0.80, 0.80, 0.79),
    "Frames": (0.80, 0.80, 0.79),
}


def new_room(
    width: float = 5.0,
    depth: float = 4.0,
    height: float = 2.6,
    *,
    thickness: float = 0.2,
    ceiling: bool = True,
    skirting: float = 0.08,
    without: tuple[int, ...] = (),
    openings: tuple[Opening, ...] = (),
    plan: tuple[Point, ...] = (),
    centre: Vec3 = (0.0, 0.0, 0.0),
    name: str = "Room",
) -> Add:
    """The edit that adds a room with plain materials of its own; `centre` is the middle of its floor.

    A `plan` in metres gives width and depth itself. Raises EditError when no room can be made of it.
    """
    if plan:
        across, deep = zip(*plan, strict=True)
        width, depth = max(across) - min(across), max(deep) - min(deep)
    colours = [
        Material(id=new_id("material"), name=f"{name} {slot.lower()}", values={"base_color": _COLOURS[slot]})
        for slot in SLOTS
    ]
    sizes: dict[str, Any] = {
        "width": width,
        "depth": depth,
        "height": height,
        "thickness": thickness,
        "skirting": skirting,
    }
    try:
        infos = param_infos(Room)
        sizes = {name: check(name, infos[name], size) for name, size in sizes.items()}
        room = Room(
            id=new_id("mesh"),
            name=name,
            transform=Transform(centre),
            materials=tuple(colour.id for colour in colours),
            ceiling=ceiling,
            plan=plan,
            without=without,
            openings=openings,
            **sizes,
        )
    except (InputError, ValueError, TypeError) as error:
        raise EditError(f"no such room can be made: {error}") from None
    return Add((room,), tuple(colours), f"New {name.lower()}")
