"""Sides of faces against NumPy in double precision."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from studio_core.kernels.facing import NO_FACE, mark_faces, mark_vertices, shown_sides

PLACES = st.tuples(*[st.floats(-1e4, 1e4, width=32)] * 3)


def soup(seed, shift=(0.0, 0.0, 0.0)):
    """Faces of which every other has a back with vertices of its own."""
    rng = np.random.default_rng(seed)
    front = (rng.normal(size=(20, 3)) + shift).astype(np.float32)
    faces = rng.permuted(np.tile(np.arange(20), (12, 1)), axis=1)[:, :3].astype(np.uint32)
    back = np.where(np.arange(12)[:, None] % 2 == 0, faces + 20, NO_FACE).astype(np.uint32)
    return np.concatenate([front, front]), faces, back


def heights(places, faces, eye):
    a, b, c = np.moveaxis(places[faces].astype(np.float64), 1, 0)
    normal = np.cross(b - a, c - a)
    return ((a - eye) * normal).sum(axis=1) / np.linalg.norm(normal, axis=1)


@given(st.integers(0, 100), PLACES, PLACES)
def test_a_face_shows_the_side_its_plane_turns_to_the_eye(seed, shift, aside):
    places, faces, back = soup(seed, shift)
    eye = np.array(shift) + np.array(aside)
    shown, height = np.empty((12, 3), np.uint32), np.empty(12, np.float32)
    for start, stop in ((0, 5), (5, 12)):
        shown_sides(start, stop, places, faces, back, eye, shown, height)
    with np.errstate(invalid="ignore"):
        expected = heights(places, faces, eye)
    sure = np.isfinite(expected)
    np.testing.assert_allclose(height[sure], expected[sure], rtol=1e-6, atol=1e-8)
    turned = (height > 0) & (back[:, 0] != NO_FACE)
    np.testing.assert_array_equal(shown, np.where(turned[:, None], back, faces))


@given(st.integers(0, 100), st.lists(st.integers(-1, 11), max_size=30))
def test_marked_are_the_corners_that_are_shown(seed, hits):
    places, faces, back = soup(seed)
    eye, touched, seen = np.array([0.3, 0.1, 4.0]), np.zeros(12, np.bool_), np.zeros(40, np.bool_)
    mark_faces(np.array(hits, np.int32), touched)
    assert set(np.flatnonzero(touched)) == set(hits) - {-1}
    mark_vertices(touched, places, faces, back, eye, seen)
    shown, height = np.empty((12, 3), np.uint32), np.empty(12, np.float32)
    shown_sides(0, 12, places, faces, back, eye, shown, height)
    clear = touched & (np.abs(height) > 1e-3)
    assert seen[shown[touched]].all()
    if (clear == touched).all():
        assert set(np.flatnonzero(seen)) == set(shown[touched].ravel())


def test_both_sides_of_a_face_seen_edge_on_are_marked():
    places = np.tile(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32), (2, 1))
    faces, back = np.array([[0, 1, 2]], np.uint32), np.array([[3, 4, 5]], np.uint32)
    for height, expected in ((0.0, 6), (1e-7, 6), (-1e-7, 6), (0.1, 3), (-0.1, 3)):
        seen = np.zeros(6, np.bool_)
        mark_vertices(np.ones(1, np.bool_), places, faces, back, np.array([5.0, 0, height]), seen)
        assert seen.sum() == expected
