"""Changes become paint: what is wanted at vertices, few points, in objects' own frames."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import cube, floor
from spread_support import checkered_floor, disc
from transport_support import Stand, ball, scene_of, thing

from studio_core.contract import Services
from studio_core.scene.transform import Transform, axis_angle
from studio_core.shading.looks import PictureLooks
from studio_core.strokes.marks import Marks
from studio_core.strokes.stroke import Stroke
from studio_plugins.slf.elements import Elements
from studio_plugins.slf.field import Decided, Field, Varied
from studio_plugins.slf.similarity import Reach
from studio_plugins.slf.spread import Spread
from studio_plugins.slf.upsampling import Upsampling

RED = {"base_color": (0.3, -0.2, -0.1)}


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def room(where=None):
    at = where or Transform()
    ground = dataclasses.replace(thing("floor", floor(4.0)), transform=at)
    return scene_of(ground, thing("ball", ball(0.4, 24), (0, 0.4, 0)), thing("box", cube(0.5), (1, 0.3, 1)))


def laid(stand, services, field, under=None):
    spread = Spread(services)
    return spread(stand.scene, stand.surfaces, field, under), spread


def at_vertices(stand, services, node, paint, name="base_color"):
    """What paint has at the unrefined vertices."""
    index = stand.mesh.index_of(node)
    mesh = stand.mesh.objects[index].mesh
    looks = None
    if paint.looks is not None:
        reader = PictureLooks(services.registry)
        looks = reader.of_mesh(reader.pictures(stand.scene, stand.scene[node]), mesh)
    return paint.weights(mesh.positions, mesh.normals, mesh.slot, looks)(paint.change(name))


def test_a_uniform_change_takes_one_point_a_slot(services):
    stand = Stand(room(), 3000)
    vertices = Spread(services).spots(stand.scene, stand.surfaces)
    marks = disc(stand, vertices, 0, (0.5, 0, 0.5), 0.2)
    made, _ = laid(stand, services, Field([[Decided(marks, Reach(), RED)]]))
    assert set(made) == {"floor"}
    assert len(made["floor"].places) == 1
    values = at_vertices(stand, services, "floor", made["floor"])
    np.testing.assert_allclose(values, np.broadcast_to(RED["base_color"], values.shape), rtol=1e-6)


@pytest.mark.parametrize("near", [1.0, 8.0, 60.0])
def test_vertices_have_what_is_wanted_within_a_hundredth(services, near):
    stand = Stand(room(Transform((0.3, 0.1, -0.2), axis_angle((0, 1, 0), 30), 1.5)), 3000)
    spread = Spread(services)
    vertices = spread.spots(stand.scene, stand.surfaces)
    marks = disc(stand, vertices, 0, (0.5, 0, 0.5), 0.25)
    field = Field([[Decided(marks, Reach(near=near, facing=1.0), RED)]])
    made = spread(stand.scene, stand.surfaces, field)
    own = stand.mesh.vertices_of(0)
    wanted = field.at(vertices)["base_color"][own]
    assert np.abs(wanted).max() == pytest.approx(0.3, rel=0.02)
    off = np.abs(at_vertices(stand, services, "floor", made["floor"]) - wanted).max()
    assert off < 0.01 * 0.3
    # What was meant for the marks is there, however coarse the mesh: paint knows it between vertices.
    paint = made["floor"]
    places = np.stack([0.5 + 0.1 * np.cos(np.arange(8)), np.zeros(8), 0.5 + 0.1 * np.sin(np.arange(8))], 1)
    up = np.broadcast_to([0.0, 1.0, 0.0], (8, 3))
    within = paint.weights(places, up, np.zeros(8))(paint.change("base_color"))
    np.testing.assert_allclose(within, np.broadcast_to(RED["base_color"], (8, 3)), atol=0.03)


def test_a_disc_smaller_than_a_face_is_not_lost(services):
    spread = Spread(services)
    coarse = scene_of(thing("floor", floor(4.0)), thing("ball", ball(0.4, 64), (0, 5, 0)))
    stand = Stand(coarse, 500)
    vertices = spread.spots(stand.scene, stand.surfaces)
    marks = disc(stand, vertices, 0, (0.61, 0, 0.47), 0.05, 100)
    field = Field([[Decided(marks, Reach(near=100.0), {"roughness": -0.2})]])
    paint = spread(stand.scene, stand.surfaces, field)["floor"]
    up = np.array([[0.0, 1.0, 0.0]])
    within, beside = (
        paint.weights([place], up, [0])(paint.change("roughness"))[0, 0]
        for place in ((0.61, 0, 0.47), (0.75, 0, 0.47))
    )
    assert within == pytest.approx(-0.2, rel=0.05)
    assert abs(beside) < 0.01
    assert len(paint.places) < 3000


def test_paint_moves_with_its_object(services):
    here, there = Stand(room(), 3000), Stand(room(Transform((2, 1, 0), axis_angle((0, 1, 0), 50))), 3000)
    made = []
    for stand in (here, there):
        spread = Spread(services)
        vertices = spread.spots(stand.scene, stand.surfaces)
        marks = disc(stand, vertices, 0, (0.5, 0, 0.5), 0.3)
        field = Field([[Decided(marks, Reach(near=10), RED)]])
        made.append(spread(stand.scene, stand.surfaces, field)["floor"])
    np.testing.assert_allclose(made[0].places.mean(axis=0), made[1].places.mean(axis=0), atol=0.05)
    up = np.broadcast_to([0.0, 1.0, 0.0], (200, 3))
    places = np.random.default_rng(0).uniform(-1, 1, (200, 3)) * [1, 0, 1]
    one, other = (p.weights(places, up, np.zeros(200))(p.change("base_color")) for p in made)
    np.testing.assert_allclose(one, other, atol=0.02)


def test_paint_is_laid_on_what_is_there_or_replaces_it(services):
    stand = Stand(room(), 3000)
    spread = Spread(services)
    vertices = spread.spots(stand.scene, stand.surfaces)
    first = disc(stand, vertices, 0, (0.8, 0, 0.5), 0.3)
    second = disc(stand, vertices, 0, (-0.8, 0, 0.5), 0.3)
    one = Field([[Decided(first, Reach(near=8), RED)]])
    other = Field([[Decided(second, Reach(near=8), {"roughness": (0.25,)})]])
    under = spread(stand.scene, stand.surfaces, one)
    both = spread(stand.scene, stand.surfaces, other, under)["floor"]
    own = stand.mesh.vertices_of(0)
    for name, field in (("base_color", one), ("roughness", other)):
        wanted = field.at(vertices)[name][own]
        off = np.abs(at_vertices(stand, services, "floor", both, name) - wanted).max()
        assert off < 0.02 * np.abs(wanted).max()
    alone = spread(stand.scene, stand.surfaces, other)["floor"]
    assert set(alone.changes) == {"roughness"}


def test_where_strokes_meet_changes_are_averaged_and_layers_add_up(services):
    stand = Stand(room(), 1500)
    vertices = Spread(services).spots(stand.scene, stand.surfaces)
    marks = disc(stand, vertices, 0, (0, 0, 0), 0.3)
    one, other = Decided(marks, Reach(), {"roughness": 0.2}), Decided(marks, Reach(), {"roughness": 0.1})
    together, after = Field([[one, other]]).at(vertices), Field([[one], [other]]).at(vertices)
    floor_part = vertices.part == 0
    np.testing.assert_allclose(together["roughness"][floor_part], 0.15, rtol=1e-5)
    np.testing.assert_allclose(after["roughness"][floor_part], 0.3, rtol=1e-5)
    assert not together["roughness"][~floor_part].any()


def test_what_looks_the_same_on_other_objects_is_reached_by_likeness_alone(services):
    stand = Stand(room(), 2000)
    spread = Spread(services)
    vertices = spread.spots(stand.scene, stand.surfaces)
    marks = disc(stand, vertices, 0, (0, 0, 0), 0.3)
    made = spread(stand.scene, stand.surfaces, Field([[Decided(marks, Reach(alike=1.0), RED)]]))
    assert set(made) == {"floor", "ball", "box"}  # one grey for all of them
    near = spread(stand.scene, stand.surfaces, Field([[Decided(marks, Reach(near=1.0), RED)]]))
    assert set(near) == {"floor"}


def test_a_checker_keeps_its_edges(services):
    """Only the dark squares under the stroke change (figure 13)."""
    stand = Stand(checkered_floor(), 6000)
    spread = Spread(services)
    vertices = spread.spots(stand.scene, stand.surfaces)
    marks = disc(stand, vertices, 0, (0.25, 0, 0.25), 0.1)
    field = Field([[Decided(marks, Reach(near=0.3, alike=20.0), RED)]])
    paint = spread(stand.scene, stand.surfaces, field)["floor"]
    assert paint.looks is not None
    rng = np.random.default_rng(0)
    places = rng.uniform(-1.9, 1.9, (4000, 3)) * [1, 0, 1]
    uv = np.stack([places[:, 0] / 4 + 0.5, 0.5 - places[:, 2] / 4], axis=1).astype(np.float32)
    reader = PictureLooks(services.registry)
    pictures = reader.pictures(stand.scene, stand.scene["floor"])
    nothing = np.zeros(len(uv))
    looks = reader.at(pictures, uv, nothing.astype(np.int64), nothing.astype(np.float32))
    up = np.broadcast_to([0.0, 1.0, 0.0], places.shape)
    made = paint.weights(places, up, nothing, looks)(paint.change("base_color"))[:, 0] / 0.3
    blind = paint.weights(places, up, nothing)(paint.change("base_color"))[:, 0] / 0.3
    away = np.linalg.norm(places - [0.25, 0, 0.25], axis=1)
    dark = looks[:, 0] < 0.7
    alike = dark if marks.look[0, 0] < vertices.look[:, 0].mean() else ~dark
    wanted = np.where(alike, np.exp(-0.3 * np.maximum(away - 0.1, 0)), 0)
    error, error_blind = np.sqrt(((made - wanted) ** 2).mean()), np.sqrt(((blind - wanted) ** 2).mean())
    print("checker", error, error_blind, len(paint.places))
    assert error < 0.1
    assert error < 0.6 * error_blind


def test_changes_of_elements_are_spread_over_their_part(services):
    stand = Stand(room(), 3000)
    spread = Spread(services)
    vertices = spread.spots(stand.scene, stand.surfaces)
    own = Elements.of(stand.mesh, vertices.part == 0, 600).vertex
    elements = vertices.some(own)
    smooth = (0.2 * np.sin(2 * elements.place[:, :1])).astype(np.float32)
    field = Field(varied=[Varied(elements, {"roughness": smooth}, np.ones(len(own), np.float32))])
    made = spread(stand.scene, stand.surfaces, field)
    assert set(made) == {"floor"}
    mine = vertices.place[vertices.part == 0]
    got = at_vertices(stand, services, "floor", made["floor"], "roughness")[:, 0]
    off = got - 0.2 * np.sin(2 * mine[:, 0])
    assert np.sqrt((off**2).mean()) < 0.02
    between = Upsampling.of(elements, vertices)(smooth)[vertices.part == 0, 0]
    assert np.abs(got - between).max() < 0.01 * 0.2


def test_a_stroke_says_what_is_alike(services):
    stand = Stand(room(), 2000)
    spread = Spread(services)
    count = 40
    rng = np.random.default_rng(0)
    places = (rng.uniform(-0.2, 0.2, (count, 3)) * [1, 0, 1]).astype(np.float32)
    nothing, up = np.zeros((count, 3), np.float32), np.tile(np.array([0, 1, 0], np.float32), (count, 1))
    wanted, weight = nothing + 1, np.ones(count, np.float32)
    places[0], weight[0] = (1.5, 0, 1.5), 0.1  # the rim
    places[1], wanted[1] = (-1.5, 0, 1.5), 0.0  # is to stay as it is
    first = np.zeros(count, np.int64)
    marks = Marks(first, places, up, first, nothing, nothing, wanted, weight, nothing)
    stroke = Stroke(id="s", objects=("floor",), table=marks.table())
    whole = spread.likeness(stand.scene, stand.surfaces, stroke)
    np.testing.assert_array_equal(whole, spread.spots(stand.scene, stand.surfaces).part == 0)
    near = spread.likeness(stand.scene, stand.surfaces, dataclasses.replace(stroke, near=10.0))
    away = np.linalg.norm(stand.mesh.positions + stand.mesh.origin, axis=1)
    assert near[np.argmin(np.where(whole > 0, away, np.inf))] > 0.9
    assert not near[away > 1.2].any()
    assert len(spread.marks(stand.scene, stand.surfaces, stroke)) == count - 2
    assert not spread.likeness(stand.scene, stand.surfaces, Stroke(id="e")).any()


def test_marks_on_objects_that_are_gone_reach_nothing(services):
    stand = Stand(room(), 1500)
    spread = Spread(services)
    vertices = spread.spots(stand.scene, stand.surfaces)
    nobody = vertices.some(np.zeros(0, np.int64))
    assert spread(stand.scene, stand.surfaces, Field([[Decided(nobody, Reach(), RED)]])) == {}
    assert spread(stand.scene, stand.surfaces, Field()) == {}


def test_several_changes_are_laid_at_once_on_the_points_of_one(services):
    stand = Stand(room(), 3000)
    spread = Spread(services)
    marks = disc(stand, spread.spots(stand.scene, stand.surfaces), 0, (0.5, 0, 0.5), 0.25)

    def paint(changes):
        return spread(stand.scene, stand.surfaces, Field([[Decided(marks, Reach(near=20.0), changes)]]))[
            "floor"
        ]

    alone, both = paint(RED), paint({"0/base_color": RED["base_color"], "1/roughness": 0.3})
    same = both.only({"base_color": "0/base_color"})
    np.testing.assert_array_equal(same.places, alone.places)
    np.testing.assert_array_equal(same.change("base_color"), alone.change("base_color"))
    assert set(both.only({"roughness": "1/roughness"}).changes) == {"roughness"}
