"""Coefficients of texels: against the oracle, with outliers, with lights that do not tell, with nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import residual as oracle

from studio.bench.lab import dome, row
from studio_plugins.residual.bases import BASES, columns
from studio_plugins.residual.solve import Solver, solve

PLAIN = Solver(tukey=False, shrink=False)
RNG = np.random.default_rng


@given(st.integers(0, 10_000), st.integers(1, 14), st.integers(1, 6), st.sampled_from([1e-6, 0.03, 0.5]))
def test_least_squares_are_the_oracles(seed: int, lights: int, size: int, truncation: float) -> None:
    rng = RNG(seed)
    a = rng.normal(size=(3, lights, size)).astype(np.float32)
    b = rng.normal(size=(3, lights, 3)).astype(np.float32)
    w = rng.uniform(0.1, 1, size=(3, lights)).astype(np.float32)
    made = solve(a, b, w, Solver(truncation, False, False))
    for t in range(3):
        assert np.allclose(
            made.coefficients[t], oracle.least_squares(a[t], b[t], w[t], truncation), atol=1e-3, rtol=1e-3
        )


def test_one_row_of_lights_tells_nothing_across() -> None:
    middle = row().directions + np.array([0.0, 0.0, 1.0])
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    middle[:, 1] += RNG(0).normal(size=12) * 0.003  # lamps are never quite at one height
    a = middle[None].astype(np.float32)
    seen = (middle @ [0.1, 0.3, 0.2])[None, :, None].repeat(3, axis=2) + RNG(1).normal(size=(1, 12, 3)) * 0.01
    cut = solve(a, seen.astype(np.float32), np.ones((1, 12), np.float32), PLAIN)
    loose = solve(a, seen.astype(np.float32), np.ones((1, 12), np.float32), Solver(1e-10, False, False))
    assert cut.rank[0] == 2
    assert loose.rank[0] == 3
    assert np.abs(cut.coefficients[0, 1]).max() < 0.05  # nothing is made up about y
    assert np.abs(loose.coefficients[0, 1] - 0.3).max() > 0.3  # else noise is: a hundred times too much


def test_shadows_and_glints_are_left_out() -> None:
    rng = RNG(2)
    a = np.concatenate([dome().directions] * 1)[None].repeat(20, axis=0).astype(np.float32)
    truth = rng.normal(size=(20, 3, 3)).astype(np.float32)
    b = a @ truth + rng.normal(size=(20, a.shape[1], 3)).astype(np.float32) * 1e-3
    bad = rng.random((20, a.shape[1])) < 0.2
    b[bad] -= 2
    ones = np.ones(bad.shape, np.float32)
    assert np.abs(solve(a, b, ones, Solver(shrink=False)).coefficients - truth).max() < 0.02
    assert np.abs(solve(a, b, ones, PLAIN).coefficients - truth).max() > 0.2


def test_what_others_do_not_bear_out_is_shrunk() -> None:
    rng = RNG(3)
    a = rng.normal(size=(400, 12, 3)).astype(np.float32)
    noise = rng.normal(size=(400, 12, 3)).astype(np.float32)
    ones = np.ones((400, 12), np.float32)
    how = Solver(1e-9, False, True)
    only_noise = solve(a, noise, ones, how)
    assert np.median(only_noise.kept) < 0.05
    truth = rng.normal(size=(400, 3, 3)).astype(np.float32)
    assert solve(a, a @ truth + 0.01 * noise, ones, how).kept.min() > 0.98
    t = 7
    guess = oracle.left_out(a[t], noise[t] + a[t] @ truth[t], 1e-9)
    wanted = (guess * (noise[t] + a[t] @ truth[t])).sum() / (guess**2).sum()
    assert solve(a, noise + a @ truth, ones, how).kept[t] == pytest.approx(np.clip(wanted, 0, 1), abs=2e-3)


@given(st.integers(0, 1000), st.floats(0, 16), st.booleans())
def test_everything_stays_finite(seed: int, condition: float, black: bool) -> None:
    rng = RNG(seed)
    a = rng.normal(size=(4, 7, 4))
    a[:, :, 3] = a[:, :, 0] + a[:, :, 3] * 10.0**-condition
    a[1] = 0
    b = rng.normal(size=(4, 7, 3)) * (0 if black else 1e6)
    w = rng.uniform(0, 1, size=(4, 7))
    w[2] = 0
    made = solve(a.astype(np.float32), b.astype(np.float32), w.astype(np.float32), Solver())
    assert np.isfinite(made.coefficients).all()
    assert (made.coefficients[1:3] == 0).all()
    assert (made.rank[1:3] == 0).all()
    assert ((made.kept >= 0) & (made.kept <= 1)).all()


@pytest.mark.parametrize("name", list(BASES))
def test_a_basis_has_the_columns_that_it_says(name: str) -> None:
    d = dome().directions.astype(np.float32)
    made = columns(name, d, d, d[:, 2], d[:, 2] ** 9, np.ones_like(d[:, 2]))
    assert made.shape == (len(d), BASES[name].size)
    assert np.linalg.matrix_rank(made) == BASES[name].size - (name in ("albedo-half", "albedo-light"))
    assert BASES[name].bytes_per_texel == 6 * BASES[name].size
