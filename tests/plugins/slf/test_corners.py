"""Columns from corners of faces: which they are and how they are weighed."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from studio_core.scene.shading_mesh import NO_BACK
from studio_plugins.slf.corners import Corners
from studio_plugins.slf.places import Places

SQUARE = np.array([[0, 0, 0], [2, 0, 0], [2, 0, 2], [0, 0, 2]], np.float32)
EYE = np.array([0.3, 2.0, 0.4])


class Flat:
    """A caster that knows one square in the plane y = 0, of two faces."""

    def __init__(self, front=True, met=True):
        self.front, self.met = front, met

    def closest(self, origins, directions, tnear, tfar, workers):
        along = -origins[:, 1] / directions[:, 1]
        assert ((along > tnear) & (along < tfar)).all()
        x, z = (origins + along[:, None] * directions)[:, [0, 2]].T / 2
        second = z > x  # faces (0, 1, 2) and (0, 2, 3)
        u, v = np.where(second, x, x - z), np.where(second, z - x, z)
        count = len(origins)
        owner = np.zeros(count, np.int32) if self.met else np.full(count, -1, np.int32)
        return SimpleNamespace(
            object=owner, face=second.astype(np.int32), u=u, v=v, front=np.full(count, self.front)
        )


def lit(**given):
    up = np.tile(np.array([0, 1, 0], np.float32), (4, 1))
    mesh = SimpleNamespace(
        origin=np.zeros(3),
        positions=SQUARE,
        normals=up,
        tangents=np.tile(np.array([1, 0, 0, 1], np.float32), (4, 1)),
        object=np.zeros(4, np.int32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
        back_faces=np.full((2, 3), NO_BACK, np.uint32),
        face_offsets=np.array([0, 2]),
    )
    surfaces = SimpleNamespace(unrefined=SimpleNamespace(mesh=mesh))
    return SimpleNamespace(surfaces=surfaces, casters=SimpleNamespace(primary=Flat(**given)))


def places(rng, count):
    """Anywhere on the square, seen from the eye."""
    at = np.insert(rng.uniform(0.05, 1.95, (count, 2)), 1, 0.0, axis=1)
    axes = np.tile(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), (count, 1, 1))
    wo = np.einsum("nij,nj->ni", axes, EYE - at)
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    none = np.zeros(count, np.int64)
    return Places(at, axes, wo, none + 3, none, none, np.arange(count))


def test_a_place_lies_between_the_corners_of_its_face(workers):
    given = places(np.random.default_rng(0), 40)
    made = Corners.of(lit(), given, np.tile(EYE, (40, 1)), workers)
    assert len(made.places) == 4  # two faces share two corners
    corner = made.places.position[made.which]
    np.testing.assert_allclose(np.einsum("nk,nkc->nc", made.weight, corner), given.position, atol=1e-6)
    towards = np.einsum("nji,nj->ni", made.places.axes, made.places.wo)
    aside = np.cross(towards, EYE - made.places.position)
    np.testing.assert_allclose(aside, 0, atol=1e-6)
    sums = np.random.default_rng(1).uniform(size=(3, 4, 2, 3))
    for n in range(40):
        plain = sum(made.weight[n, k] * sums[:, made.which[n, k]] for k in range(3))
        np.testing.assert_allclose(made.between(sums)[:, n], plain)


def test_marks_of_faces_that_curve_have_places_of_their_own_too(workers):
    given, there = places(np.random.default_rng(0), 40), lit()
    assert not len(Corners.of(there, given, np.tile(EYE, (40, 1)), workers).bent)
    there.surfaces.unrefined.mesh.normals[1] = (np.sin(0.2), np.cos(0.2), 0)  # of the first face alone
    made = Corners.of(there, given, np.tile(EYE, (40, 1)), workers)
    x, _, z = given.position.T
    np.testing.assert_array_equal(made.bent, np.flatnonzero(z < x))
    np.testing.assert_array_equal(made.own.position, given.position[made.bent])
    shares = np.stack([2 - x, x - z, z, 0 * x], axis=1)[made.bent]
    np.testing.assert_array_equal(made.own.vertex, shares.argmax(axis=1))


def test_eyes_have_corners_of_their_own(workers):
    given = places(np.random.default_rng(0), 40)
    eyes = np.where(np.arange(40)[:, None] < 20, EYE, EYE + np.array([0.0, 1.0, 0.0]))
    assert len(Corners.of(lit(), given, eyes, workers).places) == 8


def test_where_corners_are_many_each_place_has_its_heaviest_alone(workers):
    given = places(np.random.default_rng(0), 2)
    made = Corners.of(lit(), given, np.tile(EYE, (2, 1)), workers, few=2)
    assert made.which.shape == (2, 1)
    assert (made.weight == 1).all()
    for (x, _, z), which in zip(given.position / 2, made.which, strict=True):
        shares = [1 - x, x - z, z, 0] if x > z else [1 - z, 0, x, z - x]
        assert made.places.vertex[which[0]] == np.argmax(shares)


def test_where_no_face_is_met_the_vertex_stands_for_the_place(workers):
    given = places(np.random.default_rng(0), 5)
    made = Corners.of(lit(met=False), given, np.tile(EYE, (5, 1)), workers)
    assert made.places.vertex.tolist() == [3]
    np.testing.assert_allclose(made.weight.sum(axis=1), 1)
