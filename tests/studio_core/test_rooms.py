"""Rooms as nodes: made, edited, undone, saved; and what of the scene an edit of them touches."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from scenes import cube, fingerprint

from studio_core.copies import duplicate
from studio_core.document import Document
from studio_core.edits import Assign, Edit, Move, SetFields, SetGeometry
from studio_core.errors import EditError, ProjectError
from studio_core.project import codec
from studio_core.project.canonical import loads
from studio_core.project.records import History
from studio_core.project.store import load, save
from studio_core.rooms import new_room
from studio_core.scene.diff import Aspect, diff
from studio_core.scene.nodes import Scene
from studio_core.scene.room import SLOTS, Room
from studio_core.scene.room_plans import l_plan
from studio_core.scene.room_shape import Opening
from studio_core.scene.transform import Transform

WINDOW = Opening(width=1.5)


def furnished() -> tuple[Document, str]:
    """A document with a room, and the room's id."""
    add = new_room(5, 4, 2.6, openings=(WINDOW,))
    document = Document(Scene())
    document.apply(add)
    return document, add.nodes[0].id


def room_of(document: Document, room: str) -> Room:
    found = document.scene[room]
    assert isinstance(found, Room)
    return found


def test_a_new_room_has_a_material_for_each_part() -> None:
    document, room = furnished()
    names = [document.scene.material(m).name for m in room_of(document, room).materials]
    assert names == ["Room floor", "Room walls", "Room ceiling", "Room skirting", "Room frames"]
    assert len(names) == len(SLOTS)
    assert document.history[-1].label == "New room"


def test_sizes_change_and_the_room_follows_and_comes_back() -> None:
    document, room = furnished()
    start = fingerprint(document.scene)
    before = room_of(document, room).geometry
    document.apply(SetFields(room, {"width": 6.5}))
    assert room_of(document, room).geometry.bounds[1, 0] == pytest.approx(3.45)
    changed = fingerprint(document.scene)
    document.undo()
    assert room_of(document, room).geometry is before
    assert fingerprint(document.scene) == start
    document.redo()
    assert fingerprint(document.scene) == changed


def test_a_drag_of_a_size_is_one_step_and_touches_the_room_s_mesh_alone() -> None:
    document, room = furnished()
    steps = len(document.history)
    seen: list[Aspect] = []
    document.changed.connect(lambda _before, _after, changes: seen.append(changes.nodes[room]))
    with document.gesture("Width of Room") as gesture:
        for k in range(1, 6):
            gesture.apply(SetFields(room, {"width": 5 + 0.1 * k}))
    assert len(document.history) == steps + 1
    assert set(seen) == {Aspect.GEOMETRY | Aspect.NAME}
    assert room_of(document, room).openings == (WINDOW,)


@pytest.mark.parametrize(
    ("values", "aspect"),
    [
        ({"name": "Hall"}, Aspect.NAME),
        ({"skirting": 0.1}, Aspect.NAME | Aspect.GEOMETRY),
        ({"without": (2,)}, Aspect.NAME | Aspect.GEOMETRY),
        ({"openings": ()}, Aspect.NAME | Aspect.GEOMETRY),
        ({"openings": (dataclasses.replace(WINDOW, along=0.1),)}, Aspect.NAME | Aspect.GEOMETRY),
        ({"openings": (WINDOW, Opening(sill=2.58))}, Aspect.NAME),
        ({"openings": (Opening(sill=2.58), WINDOW)}, Aspect.NAME),
        ({"hidden": True}, Aspect.STRUCTURE),
    ],
)
def test_what_an_edit_changes(values: dict[str, Any], aspect: Aspect) -> None:
    document, room = furnished()
    before = document.scene
    document.apply(SetFields(room, values))
    assert diff(before, document.scene).nodes[room] == aspect


def test_moving_naming_and_painting_keep_the_mesh() -> None:
    document, room = furnished()
    mesh = room_of(document, room).geometry
    paint = room_of(document, room).materials[1]
    edits: list[Edit] = [
        Move({room: Transform((1, 0, 2))}),
        SetFields(room, {"name": "Hall", "locked": True}),
        Assign(room, paint, 0),
        SetFields(room, {"width": 5.0}),
    ]
    for edit in edits:
        document.apply(edit)
        assert room_of(document, room).geometry is mesh
    document.apply(duplicate(document.scene, (room,)))
    assert [node.geometry is mesh for node in document.scene.of(Room)] == [True, True]


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"width": 0.1}, "width = 0.1 does not fit"),
        ({"height": float("nan")}, "height = nan does not fit"),
        ({"without": (4,)}, "'Room' cannot be like that: there is no wall 5"),
        ({"without": ("front",)}, "by their numbers"),
        ({"openings": (Opening(wall=7),)}, "no wall 8 for a window"),
        ({"openings": ("window",)}, "windows, doors and passages"),
        ({"openings": 3}, "'Room' cannot be like that"),
        ({"plan": ((0, 0), (1, 0))}, "three corners"),
        ({"plan": ((0, 0), (1, 0), (1, "a"))}, "'Room' cannot be like that"),
        ({"plan": ((0, 0), (0, 3), (3, 0))}, "clockwise"),
        ({"geometry": None}, "no property 'geometry'"),
    ],
)
def test_what_does_not_fit_is_refused_and_changes_nothing(values: dict[str, Any], told: str) -> None:
    document, room = furnished()
    before = document.scene
    with pytest.raises(EditError, match=told):
        document.apply(SetFields(room, values))
    assert document.scene is before


def test_a_room_takes_no_other_mesh() -> None:
    document, room = furnished()
    with pytest.raises(EditError, match="'Room' cannot have another mesh"):
        document.apply(SetGeometry(room, cube()))


def test_new_rooms_that_cannot_be_are_refused() -> None:
    for change in ({"width": -1.0}, {"height": 1e9}, {"without": (9,)}, {"plan": ((0, 0), (1, 1), (2, 2))}):
        with pytest.raises(EditError, match="no such room can be made"):
            new_room(**change)  # type: ignore[arg-type]


def test_a_plan_in_metres_gives_the_sizes() -> None:
    (room,) = new_room(plan=l_plan(6, 5, 2, 1.5)).nodes
    assert isinstance(room, Room)
    assert (room.width, room.depth) == (6, 5)
    assert room.walls == ("Back", "Right 1", "Front 1", "Right 2", "Front 2", "Left")
    wider = dataclasses.replace(room, width=9.0)
    assert wider.geometry.bounds[1, 0] == pytest.approx(4.7)
    assert [node.walls for node in new_room().nodes if isinstance(node, Room)] == [
        ("Back", "Right", "Front", "Left")
    ]


def test_a_room_and_its_history_come_back_from_a_file_to_the_bit(tmp_path: Path) -> None:
    document, room = furnished()
    document.apply(SetFields(room, {"plan": l_plan(6, 5, 2, 1.5), "without": (5,)}))
    document.apply(SetFields(room, {"openings": (WINDOW, Opening(kind="door", wall=4, sill=0.0))}))
    path = tmp_path / "flat.lucarne"
    save(path, document.scene, history=History(document.history, document.position))
    loaded = load(path)
    assert fingerprint(loaded.scene) == fingerprint(document.scene)
    assert loaded.history is not None
    for step, saved in zip(document.history, loaded.history.steps, strict=True):
        assert fingerprint(saved.scene) == fingerprint(step.scene)


def test_the_file_holds_a_room_s_numbers_and_no_mesh() -> None:
    document, room = furnished()
    text, blobs = codec.encode_item(room_of(document, room))
    assert not blobs
    assert "geometry" not in loads(text, "the room")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"without": [9]}, "no wall 10"),
        ({"plan": [[0.0, 0.0], [0.0, 3.0], [3.0, 0.0]]}, "clockwise"),
        ({"openings": [{"kind": "hatch"}]}, "one of window, door, opening"),
        ({"openings": [{"wall": -2}]}, "a number from 0"),
        ({"openings": [{"depth": 1.0}]}, "unknown field 'depth'"),
        ({"geometry": {}}, "unknown field 'geometry'"),
    ],
)
def test_damaged_rooms_are_refused_when_read(change: dict[str, Any], told: str) -> None:
    document, room = furnished()
    value = loads(codec.encode_item(room_of(document, room))[0], "the room") | change

    def refuse(*_: Any) -> Any:
        raise AssertionError("no array is needed")

    with pytest.raises(ProjectError, match=told):
        codec.Inward(refuse).item(value, "an item")


def test_sizes_out_of_range_are_brought_into_it_when_read() -> None:
    document, room = furnished()
    value = loads(codec.encode_item(room_of(document, room))[0], "the room")
    value |= {"width": 1e9, "openings": [{"sill": -5.0, "width": 0.0}]}

    def refuse(*_: Any) -> Any:
        raise AssertionError("no array is needed")

    read = codec.Inward(refuse).item(value, "an item")
    assert isinstance(read, Room)
    assert (read.width, read.openings[0].sill, read.openings[0].width) == (300.0, 0.0, 0.1)
