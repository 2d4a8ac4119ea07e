"""Triangulation covers a polygon exactly once, concave ones included."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_plugins.meshes.polygons import triangulate


def areas(points: np.ndarray, triangles: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Signed areas of triangles seen along `normal`."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    made: np.ndarray = np.cross(b - a, c - a) @ normal / 2
    return made


def shoelace(flat: np.ndarray) -> float:
    x, y = flat.T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


def in_space(flat: np.ndarray, turn: float) -> tuple[np.ndarray, np.ndarray]:
    """The polygon in a tilted plane far from the origin, and the plane's normal."""
    u = np.array([np.cos(turn), np.sin(turn), 0.3])
    u /= np.linalg.norm(u)
    w = np.cross(u, [0.2, -0.5, 1.0])
    w /= np.linalg.norm(w)
    return flat[:, :1] * u + flat[:, 1:] * w + [5.0, -3.0, 20.0], np.cross(u, w)


@given(
    radii=st.lists(st.floats(0.05, 3.0), min_size=3, max_size=14),
    turn=st.floats(0, 6.28),
    backwards=st.booleans(),
)
@settings(max_examples=200)
def test_star_shaped_polygons_keep_their_area_and_side(
    radii: list[float], turn: float, backwards: bool
) -> None:
    angles = 2 * np.pi * np.arange(len(radii)) / len(radii)
    flat = np.array(radii)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    if backwards:
        flat = flat[::-1]
    points, normal = in_space(flat, turn)
    triangles, owner = triangulate(points, np.arange(len(flat)), np.array([len(flat)]))
    got = areas(points, triangles, normal)
    area = shoelace(flat)
    assert len(triangles) == len(flat) - 2
    assert (owner == 0).all()
    np.testing.assert_allclose(got.sum(), area, atol=1e-9)
    assert (np.sign(area) * got >= -1e-9).all()


def test_a_comb_has_no_triangle_outside() -> None:
    teeth = [(x + dx, y) for x in range(5) for dx, y in ((0.0, 0.0), (0.4, 5.0), (0.8, 0.0))]
    flat = np.array([*teeth, (4.8, -1.0), (0.0, -1.0)])[::-1]
    points, normal = in_space(flat, 0.7)
    triangles, _ = triangulate(points, np.arange(len(flat)), np.array([len(flat)]))
    got = areas(points, triangles, normal)
    assert (got >= -1e-12).all()
    np.testing.assert_allclose(got.sum(), shoelace(flat))


def test_many_polygons_keep_their_order_and_corners() -> None:
    points = np.random.default_rng(0).random((20, 3))
    corners = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11])
    triangles, owner = triangulate(points, corners, np.array([3, 5, 4]))
    assert owner.tolist() == [0, 1, 1, 1, 2, 2]
    for start, stop, which in ((0, 3, 0), (3, 8, 1), (8, 12, 2)):
        assert set(triangles[owner == which].ravel()) == set(range(start, stop))


@pytest.mark.parametrize("count", [4, 5, 9])
def test_degenerate_and_crossing_polygons_still_give_triangles(count: int) -> None:
    rng = np.random.default_rng(count)
    crossing = rng.random((count, 3)) * [1, 1, 0]
    line = np.linspace(0, 1, count)[:, None] * np.ones(3)
    for points in (crossing, line, np.zeros((count, 3))):
        triangles, _ = triangulate(points, np.arange(count), np.array([count]))
        assert triangles.shape == (count - 2, 3)
        assert (np.sort(np.unique(triangles)) == np.arange(count)).all()


def test_nothing_gives_nothing() -> None:
    triangles, owner = triangulate(np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64))
    assert triangles.shape == (0, 3)
    assert len(owner) == 0
