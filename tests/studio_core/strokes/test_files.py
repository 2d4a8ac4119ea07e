"""STROKES.json: what people write, and what they write wrong."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import little_scene

from studio_core.errors import InputError
from studio_core.scene.nodes import Scene
from studio_core.strokes.files import strokes_from_file, strokes_from_json, strokes_json
from studio_core.strokes.marks import Marks
from studio_core.strokes.planned import MarkedStroke, PaintedStroke
from studio_core.strokes.stroke import Stroke

PATH = [[0.2, 0.5], [0.4, 0.5]]


def read(*strokes, **top):
    return strokes_from_json(json.dumps({"strokes": strokes, **top}), "s.json")


def test_a_path_is_enough():
    (made,) = strokes_from_json(json.dumps([{"path": PATH}]))
    assert isinstance(made, PaintedStroke)
    assert made.tool == "replace"
    np.testing.assert_array_equal(made.gesture.path, [[0.2, 0.5, 1], [0.4, 0.5, 1]])
    assert (made.look.camera, made.look.width, made.look.height) == (None, 960, 540)
    assert made.notes == ()


def test_everything_that_can_be_said():
    (made,) = read(
        {
            "name": "Redder", "tool": "replace", "colour": [0.5, 0.1, 0.05], "shading": True,
            "path": [[0.1, 0.2, 0.5], [0.3, 0.4, 1.0]],
            "brush": {"size": 0.1, "hardness": 0.2, "opacity": 0.9},
            "camera": {"from": [1, 2, 3], "to": [0, 1, 0], "fov": 30}, "size": [320, 200],
            "indirect": True, "weight": 2, "meaning": "shine", "together": False,
            "reach": {"near": 0.1, "facing": 0.2, "alike": 0.3}, "stops": 1, "radius": 0.02, "amount": 1.5,
            "source": [0.9, 0.9],
        }
    )  # fmt: skip
    assert made.settings.colour == (0.5, 0.1, 0.05)
    assert made.settings.source == (0.9, 0.9)
    assert (made.gesture.brush.size, made.gesture.brush.opacity) == (0.1, 0.9)
    stroke = Stroke(id="s", tool=made.tool, **made.fields)
    assert (stroke.name, stroke.indirect, stroke.weight, stroke.meaning) == ("Redder", True, 2.0, "shine")
    assert (stroke.near, stroke.facing, stroke.alike, stroke.together) == (0.1, 0.2, 0.3, False)
    view = made.look.view(Scene())
    assert (view.fov, view.width, view.height) == (30, 320, 200)
    np.testing.assert_allclose(view.transform.translation, (1, 2, 3))


def test_what_holds_for_all_is_said_once():
    both = read({"path": PATH}, {"path": PATH, "camera": "Side"}, camera="Front", size=[64, 48])
    assert [one.look.camera for one in both] == ["Front", "Side"]
    assert {(one.look.width, one.look.height) for one in both} == {(64, 48)}


def test_colours_of_the_screen_are_turned_into_light():
    plain, bright = read(
        {"path": PATH, "colour": "#808080"}, {"path": PATH, "colour": "#808080", "exposure": 2}
    )
    np.testing.assert_allclose(plain.settings.colour, [0.2159] * 3, atol=1e-3)
    np.testing.assert_allclose(bright.settings.colour, np.array(plain.settings.colour) / 4)
    (clipped,) = read({"path": PATH, "colour": "#ff8000"})
    assert "#ff8000" in clipped.notes[0]
    assert clipped.settings.colour[0] == 1


def scene_with(marks, objects=("cube", "floor"), **fields):
    return little_scene().with_nodes(
        Stroke(id="s", name="Red", objects=objects, table=marks.table(), **fields)
    )


def some_marks(seed=0, count=4):
    rng = np.random.default_rng(seed)
    three = [rng.normal(size=(count, 3)).astype(np.float32) for _ in range(5)]
    place, normal, eye, shown, wanted = three
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    offset = rng.normal(size=(count, 3)).astype(np.float32)
    offset[::2] = np.nan
    number = rng.integers(0, 2, count)
    return Marks(number, place, normal, number, eye, shown, wanted, rng.random(count, np.float32), offset)


@given(st.integers(0, 2**20), st.integers(1, 40))
def test_marks_come_back_to_the_last_bit(seed, count):
    marks = some_marks(seed, count)
    (made,) = strokes_from_json(strokes_json(scene_with(marks, weight=0.3, tool="blur", flat=True)))
    assert isinstance(made, MarkedStroke)
    assert made.objects == ("Cube", "Floor")
    assert made.marks.table().key == marks.table().key
    assert (made.tool, made.fields["weight"], made.fields["flat"]) == ("blur", 0.3, True)


def test_objects_without_a_name_of_their_own_go_by_id():
    scene = scene_with(some_marks(), ("cube", "gone"))
    (made,) = strokes_from_json(strokes_json(scene))
    assert made.objects == ("Cube", "gone")
    both = scene.with_nodes(Stroke(id="cube-2", name="Cube"))
    assert strokes_from_json(strokes_json(both))[0].objects == ("cube", "gone")


def test_what_changes_for_a_stroke_is_told_by_its_name():
    scene = scene_with(some_marks(), indirect=True, through="floor", through_slot=0)
    (made,) = strokes_from_json(strokes_json(scene))
    assert made.fields["through"] == "Floor"
    gone = scene_with(some_marks(), indirect=True, through="gone")
    assert "through" not in strokes_from_json(strokes_json(gone))[0].fields


MARKS = json.loads(strokes_json(scene_with(some_marks())))["strokes"][0]["marks"]
WRONG = [
    ({"path": PATH, "colr": 1}, "'colr'"),
    ({"path": []}, "path: expected a list of 1"),
    ({"path": [[0.1]]}, "2 or 3 numbers"),
    ({"path": [[0.1, 0.2], [0.1, 0.2, 0.3]]}, "2 numbers in each"),
    ({"path": [[0.1, "x"]]}, "2 numbers"),
    ({"path": [[0.1, True]]}, "2 numbers"),
    ({"path": [[99.0, 0.0]]}, "from 0 to 1"),
    ({"path": [[0.0, 0.0]] * 20_001}, "1 to 20000"),
    ({}, 'needs a "path"'),
    ({"path": PATH, "tool": "spray"}, "no tool 'spray'"),
    ({"path": PATH, "tool": ["x"]}, "no tool"),
    ({"path": PATH, "tool": "clone"}, "source"),
    ({"path": PATH, "colour": "red"}, "#rrggbb"),
    ({"path": PATH, "colour": "#12345g"}, "#rrggbb"),
    ({"path": PATH, "colour": [1, 2]}, "3 numbers"),
    ({"path": PATH, "colour": [1, 2, -1]}, "colour"),
    ({"path": PATH, "tonemap": "agx"}, "view transform"),
    ({"path": PATH, "tonemap": {}}, "view transform"),
    ({"path": PATH, "exposure": 1e9}, "exposure"),
    ({"path": PATH, "brush": {"size": 0}}, "size"),
    ({"path": PATH, "brush": {"size": "big"}}, "expected a number"),
    ({"path": PATH, "brush": 3}, "expected an object"),
    ({"path": PATH, "brush": {"width": 1}}, "'width'"),
    ({"path": PATH, "size": [1, 100_000]}, "4096"),
    ({"path": PATH, "size": [1.5, 2]}, "4096"),
    ({"path": PATH, "camera": 3}, "expected an object"),
    ({"path": PATH, "camera": {"from": [0, 0, 0]}}, "3 numbers"),
    ({"path": PATH, "camera": {"from": [0, 0, 0], "to": [0, 0, 0]}}, "looks from where"),
    ({"path": PATH, "camera": {"from": [0, 0, 0], "to": [0, 0, 1], "fov": 200}}, "fov"),
    ({"path": PATH, "weight": -1}, "weight"),
    ({"path": PATH, "through": 3}, "through"),
    ({"path": PATH, "weight": "1"}, "expected a number"),
    ({"path": PATH, "meaning": "magic"}, "meaning"),
    ({"path": PATH, "meaning": 3}, "expected a text"),
    ({"path": PATH, "indirect": 1}, "indirect"),
    ({"path": PATH, "name": ""}, "name"),
    ({"path": PATH, "name": "x" * 201}, "name"),
    ({"path": PATH, "reach": {"far": 1}}, "'far'"),
    ({"path": PATH, "marks": MARKS}, "'path'"),
    ({"marks": []}, "marks: expected an object"),
    ({"marks": {**MARKS, "objects": []}}, "objects"),
    ({"marks": {**MARKS, "objects": [1]}}, "objects"),
    ({"marks": {**MARKS, "object": [0, 0, 0, 9]}}, "object"),
    ({"marks": {**MARKS, "object": [0]}}, "4 whole numbers"),
    ({"marks": {**MARKS, "slot": [0, 0, 0, 0.5]}}, "whole numbers"),
    ({"marks": {**MARKS, "shown": MARKS["shown"][:2]}}, "4 places and 2"),
    ({"marks": {**MARKS, "weight": [1, 1, 1, 2]}}, "0 to 1"),
    ({"marks": {**MARKS, "weight": [1]}}, "4 places and 1"),
    ({"marks": {**MARKS, "normal": [[0, 0, 2]] * 4}}, "unit"),
    ({"marks": {**MARKS, "wanted": [[0, 0, 1e31]] * 4}}, "size"),
    ({"marks": {**MARKS, "offset": [0, 0, 0, 0]}}, "offset"),
    ({"marks": {**MARKS, "flat": True}}, "'flat'"),
    ({"marks": MARKS, "flat": 1}, "flat"),
    (7, "expected an object"),
]  # fmt: skip


@pytest.mark.parametrize(("stroke", "words"), WRONG)
def test_mistakes_are_one_line_that_names_the_place(stroke, words):
    with pytest.raises(InputError) as error:
        read({"path": PATH}, stroke)
    text = str(error.value)
    assert text.startswith("s.json: stroke 2")
    assert words in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "damaged"),
        ("{", "damaged"),
        ("3", "expected an object"),
        ("{}", "strokes"),
        ('{"strokes": []}', "1 to 1000"),
        ('{"strokes": [{"path": [[NaN, 0]]}]}', "finite"),
        ('{"strokes": [{"path": [[1e999, 0]]}]}', "finite"),
        ('{"strokes": [], "strokes": []}', "twice"),
        ("[" * 100_000, "deep"),
        ('{"strokes": [{}], "tool": 1}', "'tool'"),
        (json.dumps([{"path": PATH}] * 1001), "1 to 1000"),
    ],
)
def test_what_is_no_list_of_strokes(text, words):
    with pytest.raises(InputError, match=words):
        strokes_from_json(text)


@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(max_size=5),
        lambda s: (
            st.lists(s, max_size=3)
            | st.dictionaries(
                st.sampled_from(
                    ["path", "marks", "colour", "brush", "camera", "size", "reach", "source", "x"]
                ),
                s,
                max_size=4,
            )
        ),
    )
)
def test_whatever_stands_there_is_read_or_refused(value):
    text = json.dumps({"strokes": [value]})
    try:
        made = strokes_from_json(text)
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert all(math.isfinite(one) for one in made[0].gesture.path.ravel())


def test_files(tmp_path):
    file = tmp_path / "strokes.json"
    for made, words in (
        (None, "No such file"),
        (b"\xff\xfe\x00", "no text"),
        (b" " * ((64 << 20) + 1), "64 MB"),
    ):
        if made is not None:
            file.write_bytes(made)
        with pytest.raises(InputError, match=words):
            strokes_from_file(file)
    file.write_text('\ufeff[{"path": [[0.5, 0.5]]}]', encoding="utf-8")
    assert len(strokes_from_file(file)) == 1
