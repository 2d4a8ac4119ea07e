"""Directions: the same both ways, of equal solid angle, nested, and with cones that hold them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import directions as oracle

from studio_core.kernels.directions import cell_of_leaf, direction_set, leaf_of_cell

ALL = range(10, 18)


@pytest.mark.parametrize("k", ALL)
def test_leaves_and_directions_are_inverse(k: int) -> None:
    directions = direction_set(k)
    np.testing.assert_array_equal(directions.leaf_of(directions.directions), np.arange(directions.size))
    np.testing.assert_allclose(np.linalg.norm(directions.directions, axis=1), 1.0, atol=2e-6)


@settings(max_examples=200, deadline=None)
@given(k=st.sampled_from(ALL), data=st.data())
def test_directions_agree_with_the_paper(k: int, data: st.DataObject) -> None:
    leaf = data.draw(st.integers(0, 2**k - 1))
    np.testing.assert_allclose(direction_set(k).directions[leaf], oracle.direction(leaf, k), atol=1e-6)


@settings(max_examples=300, deadline=None)
@given(
    k=st.sampled_from(ALL),
    x=st.floats(-1, 1),
    y=st.sampled_from([0.0, -0.0, 1e-30, -1e-7, 0.5, 1.0, -1.0, 1e-3]),
    z=st.floats(-1, 1),
)
def test_every_direction_lies_in_a_cell_next_to_its_leaf(k: int, x: float, y: float, z: float) -> None:
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-20:
        x, y, z, length = 0.0, 1.0, 0.0, 1.0
    directions = direction_set(k)
    unit = np.array([[x, y, z]]) / length
    leaf = int(directions.leaf_of(unit)[0])
    assert 0 <= leaf < directions.size
    angle = math.acos(min(1.0, float(unit[0] @ directions.directions[leaf])))
    assert angle < 1.6 * math.sqrt(directions.solid_angle)
    if y > 1e-6 * length:
        assert leaf < directions.size // 2
    if y < -1e-6 * length:
        assert leaf >= directions.size // 2


@pytest.mark.parametrize("k", [10, 11, 12])
def test_cells_hold_equal_solid_angles(k: int) -> None:
    """Uniform directions fall into the cells evenly (χ² within six deviations)."""
    rng = np.random.default_rng(k)
    directions = direction_set(k)
    total = 400 * directions.size
    counts = np.zeros(directions.size)
    for _ in range(8):
        points = rng.normal(size=(total // 8, 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        counts += np.bincount(directions.leaf_of(points), minlength=directions.size)
    chi = ((counts - 400) ** 2 / 400).sum()
    assert abs(chi - (directions.size - 1)) < 6 * math.sqrt(2 * directions.size)
    assert directions.solid_angle * directions.size == pytest.approx(4 * math.pi)


def test_the_map_keeps_area_exactly() -> None:
    """|∂ω/∂s × ∂ω/∂t| is 2π all over the square, by central differences of the float64 oracle."""
    rng = np.random.default_rng(0)
    step = 1e-5
    for s, t in rng.uniform(0.01, 0.99, (300, 2)):
        a, b = 2 * s - 1, 2 * t - 1
        if abs(abs(a) - abs(b)) < 1e-3 or max(abs(a), abs(b)) < 1e-2:
            continue  # the map bends at the diagonals
        ds = np.subtract(oracle.on_hemisphere(0, s + step, t), oracle.on_hemisphere(0, s - step, t))
        dt = np.subtract(oracle.on_hemisphere(0, s, t + step), oracle.on_hemisphere(0, s, t - step))
        area = np.linalg.norm(np.cross(ds, dt)) / (2 * step) ** 2
        assert area == pytest.approx(2 * math.pi, rel=1e-4)


@pytest.mark.parametrize("k", range(11, 18))
def test_coarser_cells_are_nodes_of_the_tree(k: int) -> None:
    fine, coarse = direction_set(k), direction_set(k - 1)
    np.testing.assert_array_equal(coarse.leaf_of(fine.directions), np.arange(fine.size) >> 1)


def test_a_floor_cuts_the_tree_into_two_nodes() -> None:
    directions = direction_set(15)
    up = directions.directions[:, 1] > 0
    assert up[: directions.size // 2].all()
    assert not up[directions.size // 2 :].any()


@given(k=st.sampled_from(ALL), data=st.data())
def test_cells_and_leaves_are_inverse(k: int, data: st.DataObject) -> None:
    leaf = data.draw(st.integers(0, 2**k - 1))
    hemisphere, column, row = cell_of_leaf(leaf, k)
    assert column < 2 ** (k // 2)
    assert row < 2 ** ((k - 1) // 2)
    assert leaf_of_cell(hemisphere, column, row, k) == leaf


@pytest.mark.parametrize("k", [10, 13, 15])
def test_cones_hold_their_leaves_and_are_not_wasteful(k: int) -> None:
    rng = np.random.default_rng(1)
    directions = direction_set(k)
    cones = directions.cones
    points = rng.normal(size=(200_000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    points = np.concatenate([points.astype(np.float32), directions.points(0, 0), directions.points(1, 0.5)])
    node = directions.leaf_of(points).astype(np.int64) + directions.size
    while (node > 0).all():
        cosine = np.einsum("ij,ij->i", points, cones.axis[node])
        assert (cosine >= cones.cos_half_angle[node] - 2e-6).all()
        node >>= 1
    for level in range(4, k + 1):
        spread = np.arccos(cones.cos_half_angle[1 << level : 2 << level])
        assert spread.max() < 1.9 * math.sqrt(4 * math.pi / (1 << level))
    np.testing.assert_allclose(np.linalg.norm(cones.axis, axis=1), 1.0, atol=1e-6)


def test_sets_are_made_once_and_read_only() -> None:
    assert direction_set(12) is direction_set(12)
    with pytest.raises(ValueError, match="read-only"):
        direction_set(12).directions[0, 0] = 1.0
    for k in (9, 18):
        with pytest.raises(ValueError, match="not 2"):
            direction_set(k)
