"""Shading meshes of scenes that grow and shrink: what stays, and that it is the scene alone which decides."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from oracles.meshes import box, floor, ring
from scenes import little_scene

from studio_core.scene.diff import everything
from studio_core.scene.nodes import MeshObject, Scene
from studio_core.scene.transform import Transform
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import scene_view
from studio_core.shading.pipeline import Inputs
from studio_core.shading.surfaces import SurfaceParams, SurfaceStage

BUDGET = 4000


class Grown:
    """A stage that follows a scene."""

    def __init__(self, scene: Scene) -> None:
        self.stage = SurfaceStage()
        self.made: Surfaces | None = None
        self.follow(scene)

    def follow(self, scene: Scene) -> Surfaces:
        frame = Frame(scene, scene_view(scene, None, 32, 24), SurfaceParams(vertices=BUDGET))
        self.made = self.stage.run(frame, Inputs({}, everything(scene), self.made), Job("test"))
        return self.made


def meshes(surfaces: Surfaces) -> dict[str, object]:
    return {placed.node: placed.mesh for placed in surfaces.mesh.objects}


@pytest.fixture
def room() -> Scene:
    """A floor, two things that are split and one that never is."""
    things = (
        MeshObject(id="hall", name="Hall", geometry=floor(6.0), materials=("matt",)),
        MeshObject(id="chest", name="Chest", geometry=box((1.2, 0.7, 0.5)), materials=("paint",)),
        MeshObject(id="hoop", name="Hoop", geometry=ring(60, 20, 0.2), materials=("matt",)),
    )
    return little_scene().with_nodes(*things)


def more(number: int) -> MeshObject:
    """Chairs come by the dozen; each is a mesh of 200 vertices."""
    place = Transform((0.3 * number, 0.5, -1.0), scale=0.25)
    geometry = ring(20, 10, 0.2)
    return MeshObject(id=f"c{number}", name="C", geometry=geometry, materials=("paint",), transform=place)


def test_a_scene_that_grows_splits_its_objects_anew_one_by_one(room: Scene) -> None:
    grown = Grown(room)
    before, changed = meshes(grown.made), []
    for number in range(8):
        room = room.with_nodes(more(number))
        now = meshes(grown.follow(room))
        changed.append(sum(now[node] is not mesh for node, mesh in before.items()))
        before = now
    assert changed.count(0) >= 5
    assert max(changed) <= 2
    assert 0.6 * BUDGET < len(grown.made.mesh) < 1.5 * BUDGET


def test_meshes_depend_on_the_scene_alone(room: Scene) -> None:
    grown = Grown(room)
    first = meshes(grown.made)
    for number in range(30):
        grown.follow(room.with_nodes(*(more(n) for n in range(number + 1))))
    large = meshes(grown.made)
    assert any(large[node] is not mesh for node, mesh in first.items())
    for node, mesh in meshes(grown.follow(room)).items():
        assert mesh is first[node]  # an undo gives back the very same
    fresh = Grown(room.with_nodes(*(more(n) for n in range(30)))).made
    for node, mesh in meshes(fresh).items():
        assert mesh.edge == large[node].edge
        np.testing.assert_array_equal(mesh.positions, large[node].positions)


def test_an_object_that_goes_leaves_the_others_as_they_are(room: Scene) -> None:
    grown = Grown(room)
    before = meshes(grown.made)
    gone = dataclasses.replace(room["cube"], hidden=True)
    after = meshes(grown.follow(room.with_nodes(gone)))
    assert after == {node: mesh for node, mesh in before.items() if node != "cube"}
