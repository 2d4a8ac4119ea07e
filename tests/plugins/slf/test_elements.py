"""Elements stand for all vertices: as many as are wanted, evenly spread, each vertex near its own."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree
from transport_support import Stand, ball, scene_of, thing, walls

from studio_plugins.slf.elements import ALIKE, Elements, thin


@pytest.fixture(scope="module")
def mesh():
    scene = scene_of(thing("room", walls(4, 3, 5)), thing("ball", ball(0.5, 24), (0, 1, 0)))
    return Stand(scene, 6000).mesh


@pytest.mark.parametrize("count", [200, 1000, 2500])
def test_there_are_as_many_as_are_wanted_and_none_is_near_another(mesh, count):
    made = Elements.of(mesh, np.ones(len(mesh), np.bool_), count)
    assert abs(len(made) - count) <= 0.03 * count
    assert made.area.sum() == pytest.approx(mesh.area.sum(), rel=1e-5)
    for one in range(len(mesh.objects)):
        own = made.vertex[mesh.object[made.vertex] == one]
        distance, other = cKDTree(mesh.positions[own]).query(mesh.positions[own], k=min(8, len(own)))
        alike = (mesh.normals[own][:, None] * mesh.normals[own[other]]).sum(axis=2) > ALIKE
        gap = np.where(alike & (other != np.arange(len(own))[:, None]), distance, np.inf).min(axis=1)
        assert gap.min() > 0.35 * np.sqrt(mesh.area.sum() / count)


def test_every_vertex_belongs_to_an_element_of_its_object_that_faces_its_way(mesh):
    made = Elements.of(mesh, np.ones(len(mesh), np.bool_), 1000)
    own = made.vertex[made.owner]
    np.testing.assert_array_equal(mesh.object[own], mesh.object)
    alike = (mesh.normals[own] * mesh.normals).sum(axis=1)
    assert (alike > ALIKE).mean() > 0.99
    away = np.linalg.norm(mesh.positions[own] - mesh.positions, axis=1)
    assert np.median(away) < 1.2 * np.sqrt(mesh.area.sum() / 1000)
    np.testing.assert_array_equal(made.owner[made.vertex], np.arange(len(made)))


def test_only_what_is_wanted_has_elements(mesh):
    wanted = mesh.object == 1
    made = Elements.of(mesh, wanted, 300)
    assert wanted[made.vertex].all()
    assert (made.owner[~wanted] == -1).all()
    assert (made.owner[wanted] >= 0).all()
    nothing = Elements.of(mesh, np.zeros(len(mesh), np.bool_))
    assert len(nothing) == 0
    assert (nothing.owner == -1).all()


def test_few_vertices_are_all_elements(mesh):
    made = Elements.of(mesh, np.ones(len(mesh), np.bool_), len(mesh))
    np.testing.assert_array_equal(made.vertex, np.arange(len(mesh)))
    np.testing.assert_array_equal(made.owner, np.arange(len(mesh)))


def test_thinning_is_what_a_loop_over_all_pairs_does():
    rng = np.random.default_rng(4)
    places = rng.uniform(-1, 1, (400, 3)).astype(np.float32)
    normals = rng.normal(size=(400, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    objects = rng.integers(0, 2, 400).astype(np.int32)
    order = rng.permutation(400)
    chosen, links = np.zeros(400, np.bool_), np.empty(400, np.int32)
    thin(0.6, order, places, normals, objects, np.full(64, -1, np.int32), links, chosen)
    oracle = []
    for one in order:
        near = [o for o in oracle if np.linalg.norm(places[one] - places[o]) < 0.6]
        if not any(normals[one] @ normals[o] > ALIKE and objects[one] == objects[o] for o in near):
            oracle.append(one)
    np.testing.assert_array_equal(np.flatnonzero(chosen), np.sort(oracle))
