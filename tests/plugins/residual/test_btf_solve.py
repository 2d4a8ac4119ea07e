"""Least squares that grow with the pictures, against those of all at once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.parallel import Workers
from studio_plugins.residual.btf_solve import GrowingSolve


@given(st.integers(1, 6), st.integers(8, 90), st.integers(0, 10**6))
def test_it_is_what_all_rows_at_once_give(size: int, count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(count, size)).astype(np.float32)
    values = rng.normal(size=(count, 3, 3)).astype(np.float32)
    weights = rng.random((count, 3)).astype(np.float32) * (rng.random((count, 3)) > 0.2)
    state = GrowingSolve(3, size)
    for first in range(0, count, 7):
        some = slice(first, first + 7)
        state.add(rows[some], values[some], weights[some])
    found, rank = state.solved((size,), 1e-6)
    for t in range(3):
        root = np.sqrt(weights[:, t, None].astype(np.float64))
        wanted, _, told, singular = np.linalg.lstsq(rows * root, values[:, t] * root, rcond=1e-6)
        assert rank[t] == told
        assert np.allclose(np.linalg.svd(state.triangle[t], compute_uv=False), singular, atol=1e-4)
        if singular[-1] > 1e-2 * singular[0]:
            assert np.allclose(found[t], wanted, atol=2e-3 * (1 + np.abs(wanted).max()))


def test_what_rows_do_not_tell_is_left_at_nothing() -> None:
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(200, 3)).astype(np.float32)
    rows[:, 2] = 1e-3 * rng.normal(size=200)
    truth = np.array([[1.0, 2, 3], [4, 5, 6], [7, 8, 9]])
    values = (rows @ truth + 0.3 * rng.normal(size=(200, 3)))[:, None].astype(np.float32)
    state = GrowingSolve(1, 3)
    state.add(rows, values)
    found, rank = state.solved((3,), 0.03)
    assert rank == 2
    assert np.abs(found[0, :2] - truth[:2]).max() < 0.1
    assert np.abs(found[0, 2]).max() < 0.1
    loose, _ = state.solved((3,), 1e-10)
    assert np.abs(loose[0, 2] - truth[2]).max() > 1  # noise over next to nothing


def test_stages_are_fitted_one_after_the_other() -> None:
    rng = np.random.default_rng(4)
    rows = (rng.normal(size=(60, 4)) + 0.5).astype(np.float32)
    values = rng.normal(size=(60, 1, 3)).astype(np.float32)
    state = GrowingSolve(1, 4)
    state.add(rows[:32], values[:32])
    state.add(rows[32:], values[32:])
    found, _ = state.solved((1, 3), 1e-9)
    first = np.linalg.lstsq(rows[:, :1], values[:, 0], rcond=None)[0]
    rest = np.linalg.lstsq(rows[:, 1:], values[:, 0] - rows[:, :1] @ first, rcond=None)[0]
    assert np.allclose(found[0], np.concatenate([first, rest]), atol=1e-4)


@pytest.mark.parametrize("size", [0, 2])
def test_nothing_at_all_is_nothing(size: int) -> None:
    state = GrowingSolve(5, size)
    state.add(np.zeros((4, size), np.float32), np.ones((4, 5, 3), np.float32), np.zeros((4, 5), np.float32))
    found, rank = state.solved((size,) if size else (), 0.03)
    assert found.shape == (5, size, 3)
    assert not found.any()
    assert not rank.any()


def test_threads_do_not_change_it(workers: Workers) -> None:
    rng = np.random.default_rng(5)
    rows, values = (rng.normal(size=s).astype(np.float32) for s in ((20, 3), (20, 5000, 3)))
    alone, together = GrowingSolve(5000, 3), GrowingSolve(5000, 3, workers)
    for state in (alone, together):
        state.add(rows, values)
    assert np.array_equal(alone.triangle, together.triangle)
    assert np.array_equal(alone.rotated, together.rotated)
