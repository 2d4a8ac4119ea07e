"""Floors that catch shadows, under what stands there."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import little_scene

from studio_core.edits import Move
from studio_core.photographs import LEAST, shadow_floor, stand_in_photograph
from studio_core.scene.bounds import mesh_box, scene_bounds
from studio_core.scene.nodes import ON_THE_GROUND, Environment, MeshObject, Scene
from studio_core.scene.transform import Transform


def floor_of(scene: Scene) -> MeshObject:
    (made,) = [node for node in scene.of(MeshObject) if node.name == "Shadow floor"]
    return made


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(0.1, 20))
def test_it_lies_under_what_there_is_and_reaches_beyond_it(x, z, scale):
    scene = little_scene(floor_size=0.5)
    scene = Move({"cube": Transform((x, scale / 2, z), scale=scale)})(scene)
    made = shadow_floor(scene)(scene)
    box = mesh_box(made, floor_of(made).id)
    low, high = scene_bounds(scene)
    assert (box[0] <= low + 1e-3).all()
    assert (box[1][[0, 2]] >= high[[0, 2]] - 1e-3).all()
    assert (box[1] - box[0])[[0, 2]].min() >= LEAST - 1e-3
    np.testing.assert_allclose(box[:, 1], 0, atol=1e-6)


def test_it_catches_and_is_not_in_the_way(host):
    scene = little_scene()
    made = shadow_floor(scene, 7.0)(scene)
    floor = floor_of(made)
    assert made.material(floor.materials[0]).catches
    assert not made.material(floor.materials[0]).casts_shadow
    assert floor.locked
    box = mesh_box(made, floor.id)
    np.testing.assert_allclose((box[1] - box[0])[[0, 2]], 7.0, rtol=1e-6)


def test_it_lies_where_the_photographs_ground_lies():
    scene = little_scene()
    sky = next(scene.of(Environment))
    scene = scene.with_nodes(dataclasses.replace(sky, transform=Transform((0, -0.4, 0))))
    made = stand_in_photograph(scene)(scene)
    np.testing.assert_allclose(mesh_box(made, floor_of(made).id)[:, 1], -0.4)
    assert next(made.of(Environment)).projection == ON_THE_GROUND
    assert next(made.of(Environment)).background


@pytest.mark.parametrize("empty", [False, True])
def test_without_an_environment_there_is_the_floor_alone(empty):
    scene = Scene()
    if not empty:
        scene = dataclasses.replace(little_scene())
        scene = scene.with_nodes(dataclasses.replace(next(scene.of(Environment)), hidden=True))
    made = stand_in_photograph(scene)(scene)
    assert floor_of(made)
    assert all(sky.projection != ON_THE_GROUND for sky in made.of(Environment))


def test_views_are_framed_without_it():
    scene = little_scene(floor_size=1.0)
    before = scene_bounds(scene)
    after = scene_bounds(shadow_floor(scene, 40.0)(scene))
    np.testing.assert_array_equal(before, after)
    alone = Scene()
    low, high = scene_bounds(shadow_floor(alone, 40.0)(alone))
    np.testing.assert_allclose(high[0] - low[0], 40, rtol=1e-6)
