"""Samples on concentric cubes made round: positions, neighbours, weights."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_plugins.cuts.paper.operations import ONE
from studio_plugins.cuts.paper.shells import (
    BEYOND,
    FARTHEST,
    INSIDE,
    NEAREST,
    WITHIN,
    receivers,
    sample_points,
)

coordinates = st.floats(-5, 5)


def every_sample(shells: int, m: int) -> np.ndarray:
    return np.arange(shells * 6 * m * m)


def test_samples_lie_on_the_spheres() -> None:
    points = sample_points(every_sample(5, 3), 2.0, 5, 3)
    length = np.linalg.norm(points, axis=1).reshape(5, -1)
    assert np.allclose(length, 2.0 * np.linspace(NEAREST, FARTHEST, 5)[:, None])
    unit = points[:54] / length.ravel()[:54, None]
    apart = np.arccos(np.clip(unit @ unit.T, -1, 1)) + 9 * np.eye(54)
    assert apart.min() > 0.3
    assert apart.min(axis=1).max() < 0.65


@pytest.mark.parametrize("m", [2, 3, 8])
def test_a_sample_is_its_own_neighbour(m: int) -> None:
    points = sample_points(every_sample(4, m), 0.7, 4, m)
    samples, weights, places = receivers(points, 0.7, 4, m)
    own = (samples == every_sample(4, m)[:, None]) & (weights > 0.999 * ONE)
    assert own.any(axis=1).all()
    assert (places[6 * m * m : -6 * m * m] == WITHIN).all()


@given(coordinates, coordinates, coordinates, st.sampled_from([2, 3, 8, 32]))
def test_neighbours_surround_the_receiver(x: float, y: float, z: float, m: int) -> None:
    shells, radius = 9, 1.0
    point = np.array([[x, y, z]])
    distance = np.linalg.norm(point)
    samples, weights, places = receivers(point, radius, shells, m)
    there = samples[0] >= 0
    assert 1 <= there.sum() <= 8
    assert (weights[0, there] > 0).all()
    assert len(set(samples[0, there].tolist())) == there.sum()
    if distance > FARTHEST:
        assert places[0] == BEYOND
        assert weights.sum() == pytest.approx(ONE * (FARTHEST / distance) ** 2, abs=1)
    else:
        assert places[0] == (INSIDE if distance < NEAREST else WITHIN)
        assert weights.sum() == ONE
    around = sample_points(samples[0, there], radius, shells, m)
    shell = np.unique(np.round(np.linalg.norm(around, axis=1), 9))
    if places[0] == WITHIN:
        assert shell.min() - 1e-6 <= distance <= shell.max() + 1e-6
        assert len(shell) <= 2
    if distance > 1e-6:
        cosine = around @ point[0] / np.linalg.norm(around, axis=1) / distance
        assert cosine.min() > np.cos(1.5 * np.pi / 2 / m)


@given(st.floats(-1, 1), st.floats(-1, 1), st.integers(0, 11), st.sampled_from([2, 3, 8]))
def test_interpolation_is_continuous_across_the_cube(s: float, t: float, edge: int, m: int) -> None:
    """Two places a hair apart, on either side of an edge or near a corner, have nearly the same weights."""
    axis, first, second = edge % 3, 1 - 2 * (edge // 3 % 2), 1 - 2 * (edge // 6)
    middle = np.zeros(3)
    middle[axis], middle[(axis + 1) % 3], middle[(axis + 2) % 3] = s, first, second
    step = np.zeros(3)
    step[(axis + 1) % 3] = 1e-6
    samples, weights, _ = receivers(np.array([middle - step, middle + step]), 1.0, 9, m)
    dense = np.zeros((2, 9 * 6 * m * m))
    for row in range(2):
        there = samples[row] >= 0
        dense[row, samples[row, there]] = weights[row, there]
    assert np.abs(dense[0] - dense[1]).max() < 1e-4 * ONE


@given(coordinates, coordinates, coordinates)
def test_weighted_samples_lie_at_the_receiver(x: float, y: float, z: float) -> None:
    point = np.array([[x, y, z]])
    distance = np.linalg.norm(point)
    if not NEAREST < distance < FARTHEST:
        return
    shells, m = 33, 32
    samples, weights, _ = receivers(point, 1.0, shells, m)
    there = samples[0] >= 0
    around = sample_points(samples[0, there], 1.0, shells, m)
    share = weights[0, there, None] / ONE
    off = np.linalg.norm((share * around).sum(axis=0) - point[0])
    major = np.sort(np.abs(point[0]))
    cell = distance * np.pi / 2 / m
    near_an_edge = major[1] > 0.9 * major[2]  # rows of two faces meet at an angle there
    assert off < (0.4 if near_an_edge else 0.06) * cell + 1e-6
