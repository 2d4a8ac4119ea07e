"""Strokes in scripts: on what is looked at or through a camera, one step each."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scenes import little_scene

from studio_core.contract import Services
from studio_core.document import Document
from studio_core.errors import EditError, InputError
from studio_core.scene.nodes import Camera, Light, MeshObject
from studio_core.scripting import Names
from studio_core.session import Session, View
from studio_core.strokes.stroke import Stroke

SIZE = (96, 64)
CUBE = [(0.48, 0.45), (0.52, 0.45)]


@pytest.fixture
def names(host, workers):
    document = Document(little_scene(cube_values={"base_color": (0.4, 0.4, 0.4)}))
    session = Session(View.of(next(document.scene.of(Camera)), document.scene, 320, 200))
    session.shade_with("reference", {"directions": "1024", "vertices": "600"})
    session.bounce(False)
    return Names(document, session, host, lambda: Services(workers, host))


def test_what_is_looked_at_is_painted_and_explained(names):
    (found,) = names.paint(CUBE, colour=(0.4, 0.1, 0.1), size=SIZE, brush=0.15, name="Redder", weight=2)
    assert found.node == "cube"
    assert found.reasons[0].meaning == "colour"
    (stroke,) = names.scene.of(Stroke)
    assert (stroke.name, stroke.weight, stroke.tool) == ("Redder", 2.0, "replace")
    assert names.scene["cube"].paint is not None
    names.undo()
    assert names.scene["cube"].paint is None
    assert not [*names.scene.of(Stroke)]


def test_another_camera_and_a_file(names, tmp_path: Path):
    names.paint(CUBE, "brighten", camera="Camera", size=SIZE, stops=0.5)
    file = tmp_path / "s.json"
    plain = {"size": SIZE, "path": CUBE}
    file.write_text(json.dumps([{**plain, "tool": "darken"}, {**plain, "tool": "fixate"}]))
    names.paint_strokes(file)
    assert [stroke.tool for stroke in names.scene.of(Stroke)] == ["brighten", "darken", "fixate"]
    assert len(names.namespace["document"].history) == 3


def test_the_background_is_said(names, capsys):
    before = names.scene
    assert names.paint([(0.5, 0.02)], size=SIZE) == ()
    assert "background" in capsys.readouterr().out
    assert names.scene is before


@pytest.mark.parametrize(
    ("values", "error", "words"),
    [
        ({"tool": "spray"}, InputError, "replace"),
        ({"tool": "clone"}, InputError, "source"),
        ({"path": [(0.1,)]}, InputError, "a path is"),
        ({"colour": (1, 2)}, InputError, "colour"),
        ({"colr": 1}, InputError, "colour"),
        ({"weight": -1}, InputError, "weight"),
        ({"brush": 99.0}, InputError, "size"),
        ({"camera": "Attic"}, EditError, "Attic"),
    ],
)
def test_mistakes_are_told(names, values, error, words):
    with pytest.raises(error, match=words):
        names.paint(**{"path": CUBE, "size": SIZE} | values)


def test_strokes_are_matched_again_when_lamps_have_changed(names):
    names.paint(CUBE, "darken", size=SIZE, brush=0.15, stops=1.0, name="Darker")
    document = names.namespace["document"]
    assert names.match_strokes() <= 0.01
    steps, painted = len(document.history), names.scene["cube"].paint
    for light in names.scene.of(Light):
        names.change(light, intensity=0.8 * light.intensity)
    dimmed = names.scene
    assert names.match_strokes("Darker") <= 0.01
    assert document.history[-1].label == "Match strokes"
    was, now = (paint.change("diffuse").mean() for paint in (painted, names.scene["cube"].paint))
    assert was < now < 0, "it is to be less dark than before"
    names.undo()
    assert names.scene is dimmed
    assert len(document.history) > steps


@pytest.mark.parametrize(
    ("asked", "words"), [(("Cube",), "is no stroke"), (("Attic",), "Attic"), ((), "no stroke")]
)
def test_what_cannot_be_matched_is_told(names, asked, words):
    with pytest.raises((InputError, EditError), match=words):
        names.match_strokes(*asked)


def test_a_scene_is_sharpened_in_one_step(names):
    before = names.scene
    names.stylise(1.0)
    painted = [node.id for node in names.scene.of(MeshObject) if node.paint is not None]
    assert painted
    (_, step) = names.namespace["document"].history
    assert step.label == "Stylise"
    names.undo()
    assert names.scene is before
