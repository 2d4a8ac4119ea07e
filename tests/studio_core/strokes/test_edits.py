"""Strokes in the history: one step, undone, copied, saved, and left over when objects go."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scenes import fingerprint, little_scene

from studio_core.copies import duplicate
from studio_core.document import Document
from studio_core.edits import Add, Remove, SetFields, SetPaint
from studio_core.errors import EditError
from studio_core.project.store import compact, load, save
from studio_core.scene.nodes import Scene
from studio_core.scene.paint import Paint
from studio_core.strokes.edits import applied, bared, concerned, removed
from studio_core.strokes.marks import Marks
from studio_core.strokes.solution import Solution
from studio_core.strokes.stroke import Stroke

PAINT = Paint.of([(0, 0, 0)], [(0, 1, 0)], [0], {"base_color": np.array([[0.2, 0, 0]])})


def stroke(ident="stroke", objects=("cube",), **fields):
    three = np.ones((len(objects), 3), np.float32)
    number = np.arange(len(objects))
    marks = Marks(number, three, three, 0 * number, three, three, three, three[:, 0], np.nan * three)
    return Stroke(id=ident, name=ident, objects=objects, table=marks.table(), **fields)


def painted(*strokes: Stroke, on=("cube",)) -> Scene:
    scene = Add(strokes)(little_scene())
    for node in on:
        scene = SetPaint(node, PAINT)(scene)
    return scene


def test_strokes_and_their_explanation_are_one_step():
    document = Document(little_scene())
    before = document.scene
    document.apply(applied("Red on Cube", (stroke(),), Solution(SetPaint("cube", PAINT))))
    assert document.scene["cube"].paint is PAINT
    assert [step.label for step in document.history][1:] == ["Red on Cube"]
    document.undo()
    assert document.scene is before
    document.redo()
    assert document.scene["stroke"].marks is not None


def test_strokes_are_weighed_and_switched_off_like_everything_else():
    scene = painted(stroke())
    scene = SetFields("stroke", {"weight": 3.0, "hidden": True, "meaning": "shine"})(scene)
    assert (scene["stroke"].weight, scene["stroke"].hidden, scene["stroke"].meaning) == (3.0, True, "shine")
    for values in ({"weight": -1.0}, {"meaning": "magic"}, {"objects": ()}):
        with pytest.raises(EditError):
            SetFields("stroke", values)(scene)


def test_paint_goes_with_the_last_stroke():
    scene = painted(stroke(), stroke("other", ("cube", "floor")), on=("cube", "floor"))
    one = removed(scene, ("other",))(scene)
    assert one["cube"].paint is PAINT, "there is a stroke left"
    assert one["floor"].paint is None
    both = removed(scene, ("other", "stroke"))(scene)
    assert both["cube"].paint is None
    hidden = SetFields("stroke", {"hidden": True})(one)
    assert bared(one, hidden) == ("cube",)
    assert bared(scene, scene) == ()


def test_strokes_on_the_same_objects_are_solved_together():
    a, b, c = stroke("a", ("cube",)), stroke("b", ("cube", "floor")), stroke("c", ("floor",))
    far, held, alone = (
        stroke("far", ("wall",), indirect=True),
        stroke("held", ("rug",), tool="fixate"),
        stroke("alone", ("lid",)),
    )
    scene = painted(a, b, c, far, held, alone)
    assert concerned(scene, (a,)) == ("a", "b", "c")
    assert concerned(scene, (alone,)) == ("alone",)
    assert concerned(scene, (far,)) == ("far", "held")
    gone = Remove(("b",))(scene)
    assert concerned(gone, (b,)) == ("a", "c"), "what it has left behind"
    assert concerned(scene, ()) == ()


def test_objects_that_go_leave_strokes_behind():
    scene = Remove(("cube",))(painted(stroke()))
    assert scene["stroke"].objects == ("cube",)
    assert len(scene["stroke"].marks) == 1


def test_copies_have_the_paint_and_no_stroke():
    scene = painted(stroke())
    made = duplicate(scene, ("cube",))(scene)
    copy = next(node for node in made.nodes.values() if node.id not in scene.nodes)
    assert copy.paint is PAINT
    assert len([*made.of(Stroke)]) == 1
    again = duplicate(made, ("stroke",))(made)
    assert len([*again.of(Stroke)]) == 2


def test_projects_keep_strokes(tmp_path: Path):
    scene = painted(stroke(), stroke("other", ("floor", "cube"), together=True))
    path = tmp_path / "painted.lucarne"
    save(path, scene)
    compact(path)
    there = load(path).scene
    assert fingerprint(there) == fingerprint(scene)
    assert np.isnan(there["other"].marks.offset).all()
    assert dataclasses.replace(there["stroke"], weight=2.0).marks is not None
