"""Places of strokes and their looks: where they stand now, and how the surface about them looks."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import cube, floor
from spread_support import checkered_floor
from transport_support import Stand, scene_of, thing

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material, MeshObject, Scene
from studio_core.scene.paint import Paint
from studio_core.scene.transform import Transform, axis_angle
from studio_core.strokes.marks import Marks
from studio_plugins.slf.looks import LookTable
from studio_plugins.slf.spots import SLOTS, Spots


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def marks(places, objects, slots):
    count = len(places)
    nothing, up = np.zeros((count, 3), np.float32), np.tile(np.array([0, 1, 0], np.float32), (count, 1))
    return Marks(
        np.asarray(objects), np.asarray(places, np.float32), up, np.asarray(slots), nothing, nothing, nothing,
        np.ones(count, np.float32), nothing,
    )  # fmt: skip


def test_marks_go_where_their_object_stands_and_look_like_it(services):
    at = Transform((1, 2, 3), axis_angle((0, 1, 0), 90), 2.0)
    scene = scene_of(thing("box", cube(1.0)), dataclasses.replace(thing("floor", floor(2.0)), transform=at))
    stand = Stand(scene, 1500)
    looks = LookTable(services)(scene, stand.surfaces)
    vertices = Spots.of_mesh(stand.mesh, looks)
    asked = marks([(0.2, 0, 0.1), (0, 0.5, 0), (0, 0, 0)], [0, 1, 2], [0, 0, 0])
    made = Spots.of_marks(asked, ("floor", "box", "gone"), stand.mesh, vertices)
    assert len(made) == 2
    world = made.place + stand.mesh.origin
    np.testing.assert_allclose(world[0], at.matrix()[:3, :3] @ [0.2, 0, 0.1] + [1, 2, 3], atol=1e-5)
    np.testing.assert_array_equal(
        made.part // SLOTS, [stand.mesh.index_of("floor"), stand.mesh.index_of("box")]
    )
    np.testing.assert_array_equal(made.look, np.broadcast_to(vertices.look[0], made.look.shape))
    assert (made.normal @ [0, 1, 0] > 0.99).all()


def test_marks_on_slots_that_are_not_there_are_left_out(services):
    stand = Stand(scene_of(thing("floor", floor(2.0))), 800)
    vertices = Spots.of_mesh(stand.mesh, LookTable(services)(stand.scene, stand.surfaces))
    made = Spots.of_marks(marks([(0, 0, 0)] * 2, [0, 0], [0, 7]), ("floor",), stand.mesh, vertices)
    assert len(made) == 1


def test_looks_are_uniform_in_lightness_and_know_roughness(services):
    grey = [Material(id=f"m{i}", model="ggx", values=frozen_map({"base_color": (c, c, c), "roughness": r}))
            for i, (c, r) in enumerate([(0.2, 0.5), (0.4, 0.5), (0.2, 0.9)])]  # fmt: skip
    nodes = [MeshObject(id=f"o{i}", geometry=floor(1.0), materials=(m.id,)) for i, m in enumerate(grey)]
    stand = Stand(Scene().with_materials(*grey).with_nodes(*nodes), 800)
    table = LookTable(services)
    looks = table(stand.scene, stand.surfaces)
    one, lighter, duller = (looks.values[stand.mesh.vertices_of(i)][0] for i in range(3))
    assert (looks.model == 0).all()
    np.testing.assert_allclose((lighter - one)[:3], np.cbrt(0.4) - np.cbrt(0.2), atol=0.02)
    assert abs(duller[-1] - one[-1]) > 0.1
    np.testing.assert_allclose(duller[:-1], one[:-1], atol=0.1)
    assert table(stand.scene, stand.surfaces) is looks
    nothing = table.models(stand.scene, stand.surfaces)
    np.testing.assert_array_equal(nothing.model, looks.model)
    assert nothing.values.shape == (len(looks.model), 0)


def test_a_picture_of_roughness_varies_looks(services):
    steps = Image(np.repeat(np.array([[0.2, 1.0]], np.float32)[..., None], 4, axis=0))
    material = Material(id="m", model="ggx", textures=frozen_map({"roughness": Texture(steps)}),
                        values=frozen_map({"roughness": 0.8}))  # fmt: skip
    node = MeshObject(id="o", geometry=floor(2.0), materials=("m",))
    stand = Stand(Scene().with_materials(material).with_nodes(node), 800)
    values = LookTable(services)(stand.scene, stand.surfaces).values
    assert np.ptp(values[:, -1]) > 0.3
    assert np.ptp(values[:, :-1]) >= 0


def test_paint_does_not_change_looks(services):
    scene = checkered_floor()
    stand = Stand(scene, 1500)
    table = LookTable(services)
    before = table(scene, stand.surfaces)
    paint = Paint.of(np.zeros((1, 3)), [(0, 1, 0)], [0], {"base_color": [(0.3, 0.0, 0.0)]})
    coated = scene.with_nodes(dataclasses.replace(scene["floor"], paint=paint))
    np.testing.assert_array_equal(table(coated, stand.surfaces).values, before.values)
    assert np.ptp(before.values[:, 0]) > 0.2
