"""Changes found by identity: nothing that matters is missed, nothing untouched is named, undo is symmetric.

The oracle compares what a picture depends on by value: world transforms, who is shown, geometry, gains.
"""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_edits import random_edit
from scenes import cube, little_scene, sky

from studio_core import edits
from studio_core.errors import EditError
from studio_core.scene.diff import EVERYTHING, Aspect, Changes, diff, everything
from studio_core.scene.nodes import (
    AreaLamp,
    Camera,
    Environment,
    Group,
    Light,
    MeshObject,
    Node,
    NodeId,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.scene.transform import Transform

NONE = Aspect.NONE
SEEDS = st.integers(0, 2**32)
GROUPED = little_scene().with_nodes(
    Group(id="group"),
    PointLamp(id="lamp", parent="group"),
    Group(id="inner", parent="group"),
    MeshObject(id="chair", parent="inner", geometry=cube(), materials=("matt",)),
)


def walk(seed: int, steps: int) -> list[Scene]:
    """Scenes that follow from each other by random edits."""
    rng = Random(seed)
    scenes = [GROUPED]
    serial = 0
    while len(scenes) <= steps:
        serial += 1
        try:
            scenes.append(random_edit(rng, scenes[-1], serial)(scenes[-1]))
        except EditError:
            continue
    return scenes


def lineage(scene: Scene, node: NodeId) -> list[Node]:
    return [scene[node], *scene.ancestors(node)]


def must_be_named(before: Scene, after: Scene, node: NodeId) -> Aspect:
    """Aspects that somebody who shades must hear of, by value and without looking at identity."""
    old, new = before.nodes.get(node), after.nodes.get(node)
    kinds = [type(n) for n in (old, new) if n is not None]
    lights = any(issubclass(kind, Light) for kind in kinds)
    lit = Aspect.LIGHT | Aspect.GAIN if lights else NONE
    if all(kind is Camera for kind in kinds):
        return Aspect.NAME if old is None or new is None or before.world(node) != after.world(node) else NONE
    if old is None or new is None or type(old) is not type(new):
        return Aspect.STRUCTURE | lit
    must = NONE
    if before.shown(node) != after.shown(node):
        must |= Aspect.STRUCTURE | lit
    if before.world(node) != after.world(node):
        must |= Aspect.TRANSFORM | (Aspect.LIGHT if lights else NONE)
    if isinstance(old, MeshObject) and isinstance(new, MeshObject):
        if old.geometry is not new.geometry:
            must |= Aspect.GEOMETRY
        if old.materials != new.materials:
            must |= Aspect.MATERIAL | Aspect.STRUCTURE
    if isinstance(old, Light) and isinstance(new, Light) and old.gain() != new.gain():
        must |= Aspect.GAIN
    if isinstance(old, Environment) and isinstance(new, Environment):
        if old.image is not new.image or (old.azimuth, old.tilt) != (new.azimuth, new.tilt):
            must |= Aspect.LIGHT
        if old.background != new.background:
            must |= Aspect.GAIN
    if isinstance(old, AreaLamp) and isinstance(new, AreaLamp) and old.width != new.width:
        must |= Aspect.LIGHT
    if isinstance(old, SpotLamp) and isinstance(new, SpotLamp) and old.cone != new.cone:
        must |= Aspect.LIGHT
    return must


@given(SEEDS, st.integers(1, 6))
def test_nothing_that_matters_is_missed(seed: int, steps: int) -> None:
    before, after = (scenes := walk(seed, 8))[8 - steps], scenes[8]
    changes = diff(before, after)
    for node in before.nodes | after.nodes:
        missed = must_be_named(before, after, node) & ~changes.nodes.get(node, NONE)
        assert not missed, node
    for material in before.materials | after.materials:
        old, new = before.materials.get(material), after.materials.get(material)
        if old != new:
            assert material in changes.materials
            assert Aspect.MATERIAL in changes.aspects
        if old is not None and new is not None and old.casts_shadow != new.casts_shadow:
            assert Aspect.STRUCTURE in changes.aspects


@given(SEEDS, st.integers(1, 6))
def test_nothing_untouched_is_named(seed: int, steps: int) -> None:
    before, after = (scenes := walk(seed, 8))[8 - steps], scenes[8]
    changes = diff(before, after)
    for node in before.nodes.keys() & after.nodes.keys():
        old, new = lineage(before, node), lineage(after, node)
        if len(old) == len(new) and all(a is b for a, b in zip(old, new, strict=True)):
            assert node not in changes.nodes
    for material in changes.materials:
        assert before.materials.get(material) is not after.materials.get(material)
    told = NONE
    for aspect in changes.nodes.values():
        assert aspect
        told |= aspect
    extra = changes.aspects & ~told
    order = [[n.id for n in scene.of(Environment)] for scene in (before, after)]
    lit = Aspect.LIGHT if order[0] != order[1] else NONE  # the first gives the light
    assert not extra & ~(Aspect.MATERIAL | Aspect.STRUCTURE | Aspect.NAME | lit)
    if extra & (Aspect.MATERIAL | Aspect.STRUCTURE):
        assert changes.materials


@given(SEEDS)
def test_undo_dirties_what_the_edit_dirtied(seed: int) -> None:
    before, after = walk(seed, 6)[-2:]
    there, back = diff(before, after), diff(after, before)
    assert there.aspects == back.aspects
    assert there.materials == back.materials
    assert there.nodes.keys() == back.nodes.keys()


@given(SEEDS, st.integers(1, 5))
def test_changes_add_up_to_at_least_the_whole(seed: int, middle: int) -> None:
    scenes = walk(seed, 6)
    whole = diff(scenes[0], scenes[-1])
    summed = Changes()
    for before, after in pairwise(scenes):
        summed |= diff(before, after)
    assert not whole.aspects & ~summed.aspects & ~Aspect.NAME
    assert whole.materials <= summed.materials
    for node, aspect in whole.nodes.items():
        kinds = [type(scene.nodes[node]) for scene in (scenes[0], scenes[-1]) if node in scene.nodes]
        stayed = len(kinds) == 2 and kinds[0] is kinds[1]
        needed = aspect if stayed else Aspect.NAME if set(kinds) == {Camera} else Aspect.STRUCTURE
        told = summed.nodes.get(node, NONE)
        assert not needed & ~(told | (Aspect.NAME if told & Aspect.STRUCTURE else NONE))
    halves = diff(scenes[0], scenes[middle]) | diff(scenes[middle], scenes[-1])
    assert not whole.aspects & ~halves.aspects & ~Aspect.NAME


@given(SEEDS)
def test_a_scene_does_not_differ_from_itself_or_an_equal_copy(seed: int) -> None:
    scene = walk(seed, 4)[-1]
    assert not diff(scene, scene)
    assert not diff(scene, dataclasses.replace(scene))
    copied = dataclasses.replace(scene, nodes={n: dataclasses.replace(v) for n, v in scene.nodes.items()})
    assert not diff(scene, copied).nodes


def test_everything_names_everything() -> None:
    scene = little_scene()
    made = everything(scene)
    assert made.aspects == EVERYTHING
    assert made.nodes.keys() == scene.nodes.keys()
    assert made.materials == scene.materials.keys()
    assert made.of(Aspect.GEOMETRY) == tuple(scene.nodes)


LIT = Aspect.LIGHT | Aspect.GAIN


@pytest.mark.parametrize(
    ("edit", "named"),
    [
        (
            edits.SetFields("group", {"hidden": True}),
            {
                "group": Aspect.STRUCTURE,
                "inner": Aspect.STRUCTURE,
                "chair": Aspect.STRUCTURE,
                "lamp": Aspect.STRUCTURE | LIT,
            },
        ),
        (
            edits.Move({"group": Transform((1.0, 0.0, 0.0))}),
            {
                "group": Aspect.TRANSFORM,
                "inner": Aspect.TRANSFORM,
                "chair": Aspect.TRANSFORM,
                "lamp": Aspect.TRANSFORM | LIT,
            },
        ),
        (
            edits.Remove(("inner",)),
            {"inner": Aspect.STRUCTURE, "chair": Aspect.STRUCTURE},
        ),
        (edits.SetFields("lamp", {"intensity": 3}), {"lamp": Aspect.GAIN}),
        (edits.SetFields("sky", {"temperature": 3000}), {"sky": Aspect.GAIN}),
        (edits.SetFields("sky", {"azimuth": 30}), {"sky": Aspect.LIGHT}),
        (edits.SetFields("sky", {"image": sky(8)}), {"sky": Aspect.LIGHT}),
        (edits.SetFields("sky", {"background": False}), {"sky": Aspect.GAIN}),
        (edits.SetFields("cube", {"name": "Box"}), {"cube": Aspect.NAME}),
        (edits.SetFields("camera", {"fov": 20}), {"camera": Aspect.NAME}),
        (edits.Move({"camera": Transform((0.0, 9.0, 0.0))}), {"camera": Aspect.NAME}),
        (edits.Remove(("camera",)), {"camera": Aspect.NAME}),
        (edits.SetGeometry("cube", cube(2)), {"cube": Aspect.GEOMETRY}),
        (edits.Assign("cube", "matt"), {"cube": Aspect.MATERIAL | Aspect.STRUCTURE}),
        (edits.SetFields("cube", {"name": "Cube"}), {}),
        (edits.Move({"cube": Transform((0.0, 0.5, 0.0))}), {}),
    ],
)
def test_what_is_named(edit: edits.Edit, named: dict[str, Any]) -> None:
    changes = diff(GROUPED, edit(GROUPED))
    assert dict(changes.nodes) == named
    assert changes.aspects == _all(named)
    assert not changes.materials


def _all(named: dict[str, Aspect]) -> Aspect:
    made = NONE
    for aspect in named.values():
        made |= aspect
    return made


def test_what_hangs_on_a_camera_moves_with_it() -> None:
    lamp = PointLamp(id="flash", parent="camera")
    held = GROUPED.with_nodes(lamp)
    changes = diff(held, edits.Move({"camera": Transform((0.0, 9.0, 0.0))})(held))
    assert dict(changes.nodes) == {"camera": Aspect.NAME, "flash": Aspect.TRANSFORM | LIT}


def test_another_order_is_a_matter_of_names() -> None:
    assert diff(GROUPED, edits.Order(("cube",), None)(GROUPED)).aspects == Aspect.NAME


def test_a_node_that_becomes_another_kind_is_both() -> None:
    swapped = edits.Compound("Swap", (edits.Remove(("lamp",)), edits.Add((Group(id="lamp"),))))(GROUPED)
    assert Aspect.LIGHT in diff(GROUPED, swapped).aspects
    assert Aspect.LIGHT in diff(swapped, GROUPED).aspects


@pytest.mark.parametrize(
    ("edit", "aspects"),
    [
        (edits.SetMaterial("paint", {"base_color": (1.0, 0.0, 0.0)}), Aspect.MATERIAL),
        (edits.SetMaterial("paint", opacity=0.7), Aspect.MATERIAL),
        (edits.SetMaterial("paint", opacity=0.2), Aspect.MATERIAL | Aspect.STRUCTURE),
    ],
)
def test_materials(edit: edits.Edit, aspects: Aspect) -> None:
    changes = diff(GROUPED, edit(GROUPED))
    assert changes.materials == {"paint"}
    assert changes.aspects == aspects
    assert not changes.nodes
