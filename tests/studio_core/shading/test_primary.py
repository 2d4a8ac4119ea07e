"""Primary hits: what is kept when objects move, what glass leaves to be seen, which vertices that shows."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import edges as oracle
from scenes import little_scene as make_little_scene

from studio_core import edits
from studio_core.contract import Services
from studio_core.parallel import Workers
from studio_core.scene.diff import everything
from studio_core.scene.nodes import Camera, Material, MeshObject
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.scene.transform import Transform, looking
from studio_core.session import View
from studio_core.shading.artifacts import Casters, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_core.shading.primary import PrimaryStage, screen_box, visible_vertices
from studio_core.shading.stages import CasterStage, SurfaceParams, SurfaceStage

ARRAYS = ("face", "u", "v", "distance")
SHIFTS = st.tuples(*[st.floats(-2.5, 2.5)] * 3)
TURNS = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.hypot.reduce(q) > 0.1)


def unit(quaternion):
    return tuple(float(c) for c in np.array(quaternion) / np.linalg.norm(quaternion))


class Looking:
    """The first stages by hand, each with what it gave before."""

    def __init__(self, scene, host, workers, *, width=90, height=61, antialias=1, fine=False):
        self.services = Services(workers, host)
        self.surface, self.caster, self.primary = SurfaceStage(), CasterStage(), PrimaryStage(self.services)
        self.view = View.of(next(scene.of(Camera)), scene, width, height)
        self.view = dataclasses.replace(self.view, antialias=antialias, fine_edges=fine)
        self.surfaces = self.casters = self.hits = None
        self.see(scene)

    def see(self, scene, view=None):
        self.view = view or self.view
        frame, job = Frame(scene, self.view, SurfaceParams(vertices=600)), Job("Looking")
        changes = everything(scene)
        self.surfaces = self.surface.run(frame, Inputs({}, changes, self.surfaces), job)
        made = {Surfaces: self.surfaces}
        self.casters = self.caster.run(frame, Inputs(made, changes, self.casters), job)
        made[Casters] = self.casters
        self.hits = self.primary.run(frame, Inputs(made, changes, self.hits), job)
        self.anew = PrimaryStage(self.services).run(frame, Inputs(made, changes), job)
        return self.hits


def layers(hits):
    """(index or None, hits) of every layer, also of pixels in which something ends."""
    made = [(None, hits)]
    if hits.edges is not None:
        made.append((hits.edges.pixels, hits.edges.hits))
    for _, layer in made:
        made.extend(layer.behind)
    return made


def assert_same(hits, others):
    assert (hits.edges is None) == (others.edges is None)
    ours, theirs = layers(hits), layers(others)
    assert len(ours) == len(theirs)
    for (index, a), (other, b) in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(index, other)
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def glazed(scene, opacity=0.4):
    """With the first object see-through."""
    first = next(scene.of(MeshObject))
    scene = scene.with_materials(Material(id="glass", name="Glass", opacity=opacity))
    return scene.with_nodes(dataclasses.replace(first, materials=("glass",) * len(first.materials)))


@given(st.data(), st.booleans())
@settings(max_examples=12)
def test_kept_hits_are_those_of_tracing_all_again(host, workers, data, see_through):
    scene = make_little_scene()
    scene = glazed(scene) if see_through else scene
    looking_ = Looking(
        scene, host, workers, antialias=data.draw(st.integers(1, 2)), fine=data.draw(st.booleans())
    )
    objects = [node.id for node in scene.of(MeshObject)]
    for _ in range(4):
        moves = {}
        for node in data.draw(st.lists(st.sampled_from(objects), min_size=1, max_size=2)):
            shift, scale = data.draw(SHIFTS), data.draw(st.sampled_from([1.0, 1.0, 0.4]))
            moves[node] = Transform(shift, unit(data.draw(TURNS)), scale)
        scene = edits.Move(moves)(scene)
        looking_.see(scene)
        assert_same(looking_.hits, looking_.anew)


def test_a_small_move_traces_a_part_of_the_picture(host, workers, little_scene):
    scene = little_scene()
    eye = Looking(scene, host, workers, width=160, height=120)
    assert eye.hits.traced >= 160 * 120
    small = next(n for n in scene.of(MeshObject) if np.ptp(n.geometry.positions, axis=0).max() < 2)
    shift = np.add(small.transform.translation, (0.01, 0, 0))
    moved = edits.Move({small.id: dataclasses.replace(small.transform, translation=tuple(shift))})(scene)
    eye.see(moved)
    assert 0 < eye.hits.traced < 0.6 * eye.anew.traced
    before = Looking(scene, host, workers, width=160, height=120).hits
    assert not np.array_equal(eye.hits.distance, before.distance)
    assert_same(eye.hits, eye.anew)


def test_nothing_moved_gives_the_same_hits_back(host, workers, little_scene):
    scene = little_scene()
    eye = Looking(scene, host, workers)
    before = eye.hits
    assert eye.see(scene) is before
    assert eye.see(scene, dataclasses.replace(eye.view, fov=30.0)) is not before
    assert_same(eye.hits, eye.anew)


def test_an_object_that_moves_unseen_behind_the_eye_costs_no_ray(host, workers, little_scene):
    scene = little_scene()
    camera, first = next(scene.of(Camera)), next(scene.of(MeshObject))
    behind = camera.transform.matrix() @ (0, 0, 40, 1)
    scene = edits.Move({first.id: dataclasses.replace(first.transform, translation=tuple(behind[:3]))})(scene)
    eye = Looking(scene, host, workers)
    further = camera.transform.matrix() @ (3, 0, 45, 1)
    move = edits.Move({first.id: dataclasses.replace(first.transform, translation=tuple(further[:3]))})
    eye.see(move(scene))
    assert eye.hits.traced == 0
    assert_same(eye.hits, eye.anew)


def test_glass_that_comes_and_goes_changes_what_is_seen_behind_it(host, workers, little_scene):
    scene = glazed(little_scene(), 1.0)
    eye = Looking(scene, host, workers)
    assert not eye.hits.behind
    for opacity in (0.5, 0.2, 1.0):
        eye.see(glazed(scene, opacity))
        assert bool(eye.hits.behind) == (opacity < 1)
        assert_same(eye.hits, eye.anew)


def test_hits_of_an_earlier_frame_are_not_taken_for_the_newest(host, workers, little_scene):
    scene = little_scene()
    eye = Looking(scene, host, workers)
    first = eye.hits
    node = next(scene.of(MeshObject))
    moved = edits.Move({node.id: dataclasses.replace(node.transform, translation=(0.4, 0.3, 0.2))})(scene)
    eye.see(moved)
    eye.hits = first
    eye.see(moved)
    assert_same(eye.hits, eye.anew)


def test_another_object_or_a_hidden_one_is_traced_anew(host, workers, little_scene):
    scene = little_scene()
    eye = Looking(scene, host, workers)
    first = next(scene.of(MeshObject))
    for other in (scene.with_nodes(dataclasses.replace(first, hidden=True)), scene):
        eye.see(other)
        assert_same(eye.hits, eye.anew)


@given(
    st.tuples(*[st.floats(-3, 3)] * 3), st.tuples(*[st.floats(0, 2)] * 3), SHIFTS, TURNS, st.floats(0, 0.1)
)
def test_a_screen_box_holds_every_point_of_the_box(low, size, shift, turn, margin):
    low, size = np.array(low), np.array(size)
    transform = Transform(tuple(3 * s for s in shift), unit(turn), 0.7)
    view = View(looking((1, 2, 5), (0, 0.5, 0)), fov=60, width=40, height=30, antialias=2)
    left, top, right, bottom = screen_box(low, low + size, transform, view, margin)
    rng = np.random.default_rng(0)
    points = (low + rng.random((400, 3)) * size) @ transform.matrix()[:3, :3].T + transform.matrix()[:3, 3]
    points += rng.uniform(-1, 1, points.shape) * margin / 2
    local = np.linalg.inv(view.transform.matrix()) @ np.column_stack([points, np.ones(len(points))]).T
    local = local[:3, local[2] < -1e-6]
    up = np.tan(np.radians(30))
    x = (local[0] / -local[2] / (up * 4 / 3) + 1) / 2 * 80
    y = (1 - local[1] / -local[2] / up) / 2 * 60
    seen = (x >= 0) & (x < 80) & (y >= 0) & (y < 60)
    assert ((x >= left) & (x < right) & (y >= top) & (y < bottom))[seen].all()


@pytest.mark.parametrize("see_through", [False, True])
@pytest.mark.parametrize("fine", [False, True])
def test_visible_vertices_are_the_corners_of_seen_sides(host, workers, little_scene, see_through, fine):
    scene = glazed(little_scene()) if see_through else little_scene()
    eye = Looking(scene, host, workers, fine=fine)
    mesh = eye.surfaces.mesh
    place = np.asarray(eye.view.transform.translation) - mesh.origin
    expected = set()
    for _, layer in layers(eye.hits):
        for face in np.unique(layer.face[layer.face >= 0]):
            a, b, c = mesh.positions[mesh.faces[face]].astype(np.float64)
            behind = np.cross(b - a, c - a) @ (a - place) > 0
            back = behind and mesh.back_faces[face, 0] != NO_BACK
            expected |= set((mesh.back_faces if back else mesh.faces)[face].tolist())
    assert set(np.flatnonzero(visible_vertices(eye.surfaces, eye.hits)).tolist()) == expected


def test_the_number_of_threads_changes_nothing(host, little_scene, workers):
    with Workers(1) as alone:
        one = Looking(glazed(little_scene()), host, alone, antialias=2, fine=True)
    assert_same(one.hits, Looking(glazed(little_scene()), host, workers, antialias=2, fine=True).hits)


@pytest.mark.parametrize("see_through", [False, True])
@pytest.mark.parametrize("antialias", [1, 2, 3])
def test_pixels_in_which_something_ends_have_the_hits_of_sixteen_samples(
    host, workers, little_scene, see_through, antialias
):
    scene = glazed(little_scene()) if see_through else little_scene()
    eye = Looking(scene, host, workers, antialias=antialias, fine=True)
    plain = Looking(scene, host, workers, antialias=antialias).hits
    whole = Looking(scene, host, workers, antialias=4, fine=True).hits
    assert whole.edges is None, "there are as many everywhere"
    pixels = eye.hits.edges.pixels
    assert 0 < len(pixels) < 0.4 * 90 * 61
    assert_same(dataclasses.replace(eye.hits, edges=None), plain)
    ours, theirs, own = eye.hits.edges.hits, whole, np.arange(16 * len(pixels))
    at = eye.hits.edges.of_picture(own)
    np.testing.assert_array_equal(at, (pixels[:, None] * 16 + np.arange(16)).ravel())
    while True:
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name)[at])
        assert bool(ours.behind) == bool(np.isin(at, [i for index, _ in theirs.behind for i in index]).any())
        if not ours.behind:
            break
        ((index, ours),), ((all_, theirs),) = ours.behind, theirs.behind
        order = np.argsort(at[index], kind="stable")
        np.testing.assert_array_equal(np.sort(at[index]), at[index][order])
        at = np.searchsorted(all_, at[index])
    assert eye.hits.traced == plain.traced + eye.hits.edges.hits.traced
    if not see_through:
        assert eye.hits.edges.hits.traced == 16 * len(pixels)


@pytest.mark.parametrize("see_through", [False, True])
def test_edge_pixels_are_those_of_the_oracle(host, workers, little_scene, see_through):
    scene = glazed(little_scene()) if see_through else little_scene()
    eye = Looking(scene, host, workers, width=40, height=31, antialias=2, fine=True)
    hits, mesh = eye.hits, eye.surfaces.mesh
    expected, unsure = np.zeros((2, 40 * 31), np.bool_)
    seen = [getattr(hits, name).copy() for name in ARRAYS]
    at, rests = np.arange(len(hits.face)), hits.behind
    while True:
        found, doubt = oracle.edge_pixels(mesh, *seen, 40, 2)
        expected, unsure = expected | found, unsure | doubt
        if not rests:
            break
        ((index, rest),) = rests
        at, rests = at[index], rest.behind
        for array, name in zip(seen, ARRAYS, strict=True):
            array[at] = getattr(rest, name)
    made = np.zeros(40 * 31, np.bool_)
    made[hits.edges.pixels] = True
    assert unsure.mean() < 0.02
    np.testing.assert_array_equal(made[~unsure], expected[~unsure])


def test_a_small_move_traces_edges_again_only_where_it_was_seen(host, workers, little_scene):
    scene = little_scene()
    eye = Looking(scene, host, workers, width=160, height=120, antialias=2, fine=True)
    cube = scene["cube"].transform
    higher = dataclasses.replace(cube, translation=tuple(np.add(cube.translation, (0, 0.01, 0))))
    eye.see(edits.Move({"cube": higher})(scene))
    again, anew = eye.hits.edges.hits, eye.anew.edges.hits
    assert 0 < again.traced < anew.traced == 16 * len(eye.hits.edges.pixels)
    assert_same(eye.hits, eye.anew)


def test_another_border_between_materials_is_another_edge(host, workers):
    scene = make_little_scene()
    top = scene["floor"]
    halves = dataclasses.replace(top.geometry, slots=np.array([0, 1], np.uint16))
    scene = scene.with_nodes(dataclasses.replace(top, geometry=halves, materials=("matt", "matt")))
    eye = Looking(scene, host, workers, fine=True)
    alike = eye.hits
    eye.see(scene.with_nodes(dataclasses.replace(scene["floor"], materials=("matt", "paint"))))
    assert len(eye.hits.edges.pixels) > len(alike.edges.pixels)
    assert_same(eye.hits, eye.anew)


@pytest.mark.parametrize("antialias", [1, 2, 3])
def test_a_part_sees_what_the_whole_picture_sees_there(host, workers, little_scene, antialias):
    eye = Looking(little_scene(), host, workers, width=45, height=30, antialias=antialias)
    whole = [getattr(eye.hits, name).reshape(30, -1) for name in ARRAYS]
    for top, height in ((0, 8), (8, 16), (24, 6)):
        part = eye.see(little_scene(), View.part(eye.view, top, height))
        for name, expected in zip(ARRAYS, whole, strict=True):
            seen = getattr(part, name).reshape(height, -1)
            np.testing.assert_array_equal(seen, expected[top : top + height])


@given(st.tuples(*[st.floats(-2, 2)] * 3), st.integers(0, 20), st.integers(1, 10))
@settings(max_examples=20)
def test_the_screen_box_in_a_part_is_that_of_the_whole_moved_up(place, top, height):
    view = View(looking((0.2, 1.0, 6.0), (0, 0, 0)), width=40, height=30, antialias=2)
    low, high = np.full(3, -0.4), np.full(3, 0.4)
    left, above, right, below = screen_box(low, high, Transform(place), view, 1e-3)
    moved = screen_box(low, high, Transform(place), view.part(top, height), 1e-3)
    assert moved == (left, above - 2 * top, right, below - 2 * top)
