"""Cells of directions above a surface."""

from __future__ import annotations

import numpy as np
import pytest

from studio_core.jit import kernel
from studio_core.transport.cells import (
    CELLS,
    cell_directions,
    cell_of,
    cell_projected_angles,
    cell_solid_angles,
)


@kernel
def _cells_of(directions: np.ndarray, out: np.ndarray) -> None:
    for i in range(len(directions)):
        out[i] = cell_of(directions[i, 0], directions[i, 1], directions[i, 2])


def test_middles_are_in_their_own_cells() -> None:
    found = np.empty(CELLS, np.int64)
    _cells_of(cell_directions(), found)
    assert (found == np.arange(CELLS)).all()


def test_angles_sum_to_the_hemisphere() -> None:
    assert cell_solid_angles().sum(dtype=np.float64) == pytest.approx(2 * np.pi, rel=1e-6)
    assert cell_projected_angles().sum(dtype=np.float64) == pytest.approx(np.pi, rel=1e-6)


def test_random_directions_fall_into_cells_by_their_angle() -> None:
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(200_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[:, 2] = np.abs(directions[:, 2])
    found = np.empty(len(directions), np.int64)
    _cells_of(directions, found)
    share = np.bincount(found // 64, minlength=16) / len(directions)
    expected = cell_solid_angles().reshape(16, 64).sum(axis=1) / (2 * np.pi)
    assert np.abs(share - expected).max() < 4e-3
    near = cell_directions()[found]
    assert np.arccos(np.clip((near * directions).sum(axis=1), -1, 1)).max() < np.radians(5)


def test_the_pole_and_the_horizon_have_cells() -> None:
    edge = np.array([[0, 0, 1], [1, 0, 0], [-1, 0, 0], [-1, -1e-30, 0], [0, 1, -1e-3]], float)
    found = np.empty(len(edge), np.int64)
    _cells_of(edge, found)
    assert ((found >= 0) & (found < CELLS)).all()
    assert found[0] < 64
    assert (found[1:] >= CELLS - 64).all()
