"""Rooms on the command line of `lucarne new`."""

from __future__ import annotations

import argparse
import math
import re
from dataclasses import replace

from studio_core.edits import Add
from studio_core.errors import EditError, InputError
from studio_core.rooms import new_room
from studio_core.scene.nodes import Camera, new_id
from studio_core.scene.room import Room
from studio_core.scene.room_plans import l_plan
from studio_core.scene.room_shape import Opening, OpeningKind, Point, rectangle, wall_names
from studio_core.scene.transform import looking

_ROOM = re.compile(r"([\d.]+)x([\d.]+)x([\d.]+)(?:-([\d.]+)x([\d.]+))?")
_OPENING = re.compile(r"(\w+):([\d.]+)x([\d.]+)(?:@([-+\d.]+)(?:,([-+\d.]+))?)?")
_EYE, _LOOK, _FOV = 1.5, 1.1, 60.0  # metres above the floor; degrees
_CORNER = 0.35  # metres that the camera keeps from two walls


def room_from(options: argparse.Namespace) -> Add | None:
    """The edit for the room that the options ask for; InputError where they don't fit."""
    asked = {"--window": options.window, "--door": options.door, "--passage": options.passage}
    if options.room is None:
        for option, given in {**asked, "--without": options.without, "--open-top": options.open_top}.items():
            if given:
                raise InputError(f"{option} needs a room: --room WIDTHxDEPTHxHEIGHT")
        return None
    if options.floor is not None:
        raise InputError("--floor: a room has a floor of its own")
    width, depth, height, plan = _sizes(options.room)
    names = wall_names(plan or rectangle(width, depth))
    walls = [name.lower().replace(" ", "") for name in names]
    openings = [
        *(_opening("--window", text, "window", walls) for text in options.window),
        *(_opening("--door", text, "door", walls) for text in options.door),
        *(_opening("--passage", text, "opening", walls) for text in options.passage),
    ]
    without = tuple(_wall("--without", text, text, walls) for text in options.without)
    try:
        return new_room(
            width,
            depth,
            height,
            plan=plan,
            ceiling=not options.open_top,
            without=without,
            openings=tuple(openings),
        )
    except EditError as error:
        raise InputError(f"--room {options.room!r}: {error}") from None


def _sizes(text: str) -> tuple[float, float, float, tuple[Point, ...]]:
    found = _ROOM.fullmatch(text)
    if found is None:
        raise InputError(f"--room {text!r}: write WIDTHxDEPTHxHEIGHT in metres, -WIDTHxDEPTH for an L")
    width, depth, height = (_number("--room", text, part) for part in found.groups()[:3])
    if found[4] is None:
        return width, depth, height, ()
    try:
        cut = (_number("--room", text, found[4]), _number("--room", text, found[5]))
        return width, depth, height, l_plan(width, depth, *cut)
    except ValueError as error:
        raise InputError(f"--room {text!r}: {error}") from None


def _opening(option: str, text: str, kind: OpeningKind, walls: list[str]) -> Opening:
    """WALL:WIDTHxHEIGHT[@SILL[,ALONG]] of a window, [@ALONG] of what stands on the floor."""
    found = _OPENING.fullmatch(text)
    window = kind == "window"
    form = "WALL:WIDTHxHEIGHT[@SILL[,ALONG]]" if window else "WALL:WIDTHxHEIGHT[@ALONG]"
    if found is None or (not window and found[5] is not None):
        raise InputError(f"{option} {text!r}: write {form} in metres")
    wall, width, height = found[1], found[2], found[3]
    sill, along = (found[4], found[5]) if window else ("0", found[4])
    default = Opening()
    try:
        return replace(
            default,
            kind=kind,
            wall=_wall(option, text, wall, walls),
            width=_number(option, text, width),
            height=_number(option, text, height),
            sill=default.sill if sill is None else _number(option, text, sill),
            along=default.along if along is None else _number(option, text, along),
        )
    except ValueError as error:
        raise InputError(f"{option} {text!r}: {error}") from None


def _wall(option: str, text: str, name: str, walls: list[str]) -> int:
    if name.lower() not in walls:
        raise InputError(f"{option} {text!r}: there is no wall {name!r}; known: {', '.join(walls)}")
    return walls.index(name.lower())


def _number(option: str, text: str, part: str) -> float:
    try:
        made = float(part)
    except ValueError:
        made = math.nan
    if not math.isfinite(made):
        raise InputError(f"{option} {text!r}: {part!r} is no number")
    return made


def camera_in(room: Room) -> Camera:
    """A camera at eye height in the front left corner that looks across the room."""
    x, z = room.width / 2, room.depth / 2
    near = min(_CORNER, room.width / 4, room.depth / 4)
    eye = (near - x, min(_EYE, 0.6 * room.height), z - near)
    target = (x / 2, min(_LOOK, 0.42 * room.height), -z)
    return Camera(
        id=new_id("camera"),
        name="Camera",
        transform=room.transform @ looking(eye, target),
        fov=_FOV,
        focus=math.dist(eye, target),
    )
