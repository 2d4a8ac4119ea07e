"""Which pixels hold the end of something, against a slow count of all pairs of samples."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import edges as oracle

from studio_core.kernels.edges import mark_edges


def sheets(rng):
    """Faces that share vertices or do not, of three objects and two materials, some creased."""
    faces = rng.integers(0, 24, (20, 3)).astype(np.uint32)
    obj = np.repeat(np.arange(3), 8).astype(np.int32)
    normals = np.array([0, 0, 1]) + rng.choice([0.02, 0.5], (24, 1)) * rng.normal(size=(24, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    material = rng.integers(0, 2, 20).astype(np.int32)
    return SimpleNamespace(
        faces=faces, object=obj, normals=normals.astype(np.float32), face_material=material
    )


@given(st.integers(0, 2**32 - 1), st.integers(1, 7), st.integers(1, 6), st.integers(1, 3))
@settings(max_examples=60)
def test_marked_pixels_are_those_of_the_oracle(seed, width, height, n):
    rng = np.random.default_rng(seed)
    mesh = sheets(rng)
    count, usual = width * height * n * n, rng.integers(0, 20)
    face = np.where(rng.random(count) < 0.7, usual, rng.integers(-1, 20, count)).astype(np.int32)
    u, v = rng.uniform(0, 0.5, (2, count)).astype(np.float32)
    distance = (2 + rng.choice([0.01, 0.2], count) * rng.random(count)).astype(np.float32)
    distance[face < 0] = np.inf
    marked, whole = np.zeros((2, width * height), np.bool_)
    given_ = (width, n, face, u, v, distance, mesh.faces, mesh.normals, mesh.object, mesh.face_material)
    cut = rng.integers(0, width * height + 1)
    for start, stop in ((cut, width * height), (0, cut)):
        mark_edges(start, stop, *given_, marked)
    mark_edges(0, width * height, *given_, whole)
    np.testing.assert_array_equal(marked, whole)
    expected, unsure = oracle.edge_pixels(mesh, face, u, v, distance, width, n)
    np.testing.assert_array_equal(marked[~unsure], expected[~unsure])


def test_one_smooth_surface_has_no_edge_and_each_kind_of_end_is_found():
    quiet = SimpleNamespace(
        faces=np.array([(0, 1, 2), (3, 4, 5)], np.uint32), object=np.zeros(6, np.int32),
        normals=np.tile(np.array([0, 0, 1], np.float32), (6, 1)), face_material=np.zeros(2, np.int32),
    )  # fmt: skip
    face = np.repeat(np.array([0, 0, 1, 1, 1], np.int32), 2)  # 5 × 2 pixels, one sample each, by columns
    face = face.reshape(5, 2).T.reshape(-1).copy()

    def marked(face=face, distance=None, **other):
        mesh = SimpleNamespace(**{**vars(quiet), **other})
        distance = np.ones(10, np.float32) if distance is None else distance
        made, weights = np.zeros(10, np.bool_), np.full((2, 10), 0.3, np.float32)
        meant = (mesh.faces, mesh.normals, mesh.object, mesh.face_material)
        mark_edges(0, 10, 5, 1, face, *weights, distance, *meant, made)
        return made.reshape(2, 5)

    beside = np.tile([False, True, True, False, False], (2, 1))
    creased = quiet.normals.copy()
    creased[3:] = (0, np.sin(0.5), np.cos(0.5))
    slight = quiet.normals.copy()
    slight[3:] = (0, np.sin(0.2), np.cos(0.2))
    far = np.where(face == 1, np.float32(1.2), np.float32(1))
    assert not marked().any()
    assert not marked(normals=slight).any()
    assert not marked(normals=creased, faces=np.array([(0, 1, 2), (2, 4, 5)], np.uint32)).any()
    for ended in (
        marked(normals=creased),
        marked(distance=far),
        marked(object=np.repeat(np.arange(2), 3).astype(np.int32)),
        marked(face_material=np.arange(2, dtype=np.int32)),
        marked(np.where(face == 1, -1, face).astype(np.int32)),
    ):
        np.testing.assert_array_equal(ended, beside)
