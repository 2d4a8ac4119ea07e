"""Completion, hints, and edits as lines of a script."""

from __future__ import annotations

from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_edits import random_edit
from scenes import fingerprint, little_scene

from studio_core.document import Document
from studio_core.edits import Add, Move, Remove, SetFields, SetMaterial
from studio_core.errors import EditError
from studio_core.registry import PluginHost
from studio_core.scene.nodes import Group, Scene
from studio_core.scene.transform import Transform
from studio_core.scripting import Names, completions, hint, spelled
from studio_core.session import Session


@pytest.fixture
def document() -> Document:
    return Document(little_scene())


@pytest.fixture
def namespace(document: Document) -> dict[str, Any]:
    return Names(document, Session(), PluginHost(), lambda: pytest.fail("nothing is rendered")).namespace


def texts(before: str, namespace: dict[str, Any], scene: Scene) -> list[str]:
    return [found.text for found in completions(before, namespace, scene)]


def test_names_come_before_what_python_has(document: Document, namespace: dict[str, Any]) -> None:
    found = texts("x = se", namespace, document.scene)
    assert found[:3] == ["select", "selected", "session"]
    assert texts("Mo", namespace, document.scene)[0] == "Move"
    assert "__builtins__" not in texts("b", namespace, document.scene)
    first = completions("select", namespace, document.scene)[0]
    assert (first.length, first.signature) == (6, "(*things)")
    assert first.summary.startswith("Choose these things")


def test_attributes_are_looked_up_without_calling(document: Document, namespace: dict[str, Any]) -> None:
    assert texts("document.can_", namespace, document.scene) == ["can_redo", "can_undo"]
    assert texts("scene.na", namespace, document.scene) == ["named"]
    assert texts("nobody.", namespace, document.scene) == []
    assert texts("3", namespace, document.scene) == []
    assert texts("", namespace, document.scene) == []

    class Trap:
        @property
        def trap(self) -> int:
            raise AssertionError("asked")

    namespace["thing"] = Trap()
    assert "trap" in texts("thing.t", namespace, document.scene)
    assert texts("thing.trap.", namespace, document.scene) == []


def test_strings_are_completed_with_the_scenes_names(document: Document, namespace: dict[str, Any]) -> None:
    assert "Cube" in texts("move('C", namespace, document.scene)
    assert "Cube" not in texts("material('", namespace, document.scene)
    assert "Paint" in texts("assign('Cube', 'pa", namespace, document.scene)
    assert texts("# it's Cub", namespace, document.scene) == []
    assert completions("find('Cu", namespace, document.scene)[0].summary == "MeshObject"


def test_hints_tell_of_the_open_bracket(namespace: dict[str, Any]) -> None:
    assert hint("move('Cube', ", namespace).startswith("move(thing, to=None, by=None)  Put a thing")
    assert hint("move(find('Cube'), ", namespace).startswith("move(thing")
    assert hint("move('Cube')", namespace) == ""
    assert hint("nobody(", namespace) == ""
    assert hint("[1, 2", namespace) == ""


@given(st.text(alphabet="abmove.scn('\"([{)]} #,=\\\n", max_size=40))
def test_nothing_that_is_typed_breaks_it(text: str) -> None:
    document = Document(little_scene())
    namespace = {"scene": document.scene, "move": document.apply}
    for found in completions(text, namespace, document.scene):
        assert found.length <= len(text)
    assert isinstance(hint(text, namespace), str)


def test_edits_are_spelled_as_scripts() -> None:
    move = Move({"cube": Transform((1.0, 0.5, 0.1 + 0.2))}, "Move Cube")
    assert spelled(move) == "apply(Move({'cube': Transform((1, 0.5, 0.3))}, label='Move Cube'))"
    assert spelled(Remove(("a",))) == "apply(Remove(('a',)))"
    assert spelled(SetFields("a", {"hidden": True})) == "apply(SetFields('a', {'hidden': True}))"
    paint = SetMaterial("paint", {"base_color": (0.25, 0.5, 1.0)}, opacity=0.5)
    assert spelled(paint) == "apply(SetMaterial('paint', {'base_color': (0.25, 0.5, 1)}, opacity=0.5))"
    assert spelled(Add((Group(id="g"),))) is None
    assert spelled(SetFields("sky", {"image": np.zeros(3)})) is None


@given(st.integers(0, 2**32))
def test_what_is_spelled_does_the_same(seed: int) -> None:
    scene = little_scene()
    edit = random_edit(Random(seed), scene, 0)
    text = spelled(edit)
    try:
        wanted = edit(scene)
    except EditError:
        return
    if text is None:
        return
    document = Document(scene)
    names = Names(document, Session(), PluginHost(), lambda: pytest.fail("nothing is rendered"))
    exec(text, names.namespace)
    assert set(document.scene.nodes) == set(wanted.nodes)
    for node_id, node in wanted.nodes.items():
        made = document.scene[node_id]
        assert (made.name, made.parent, made.hidden, made.locked) == (
            node.name,
            node.parent,
            node.hidden,
            node.locked,
        )
        assert np.allclose(made.transform.matrix(), node.transform.matrix(), rtol=1e-4, atol=1e-4)
    if fingerprint(wanted) == fingerprint(scene):
        assert not document.can_undo
