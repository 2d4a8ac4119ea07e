"""Errors of what is shown against what is true, by hand and by their invariants."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.shading.compared import Compared, Looked, compare
from studio_core.shading.measured_error import Error


@given(st.floats(0.1, 10), st.floats(-0.5, 0.5), st.integers(1, 50))
def test_a_constant_factor_is_its_own_error(level, wrong, count):
    true = np.full((count, 3), level)
    assert compare(true * (1 + wrong), true).relative_rmse == pytest.approx(abs(wrong), abs=1e-12)


def test_the_stated_uncertainty_covers_the_scatter():
    rng = np.random.default_rng(0)
    errors = []
    for trial in range(60):
        true = rng.uniform(0.5, 1.5, (200, 3))
        errors.append(compare(true + rng.normal(0, 0.1, true.shape), true, trial))
    scatter = np.std([e.relative_rmse for e in errors])
    assert 0.5 * scatter < np.mean([e.uncertainty for e in errors]) < 2 * scatter


def test_nothing_to_compare_is_no_error():
    for count in (0, 5):
        made = compare(np.zeros((count, 3)), np.zeros((count, 3)))
        assert (made.relative_rmse, made.uncertainty, made.p99, made.places) == (0, 0, 0, count)


@given(st.floats(1e-4, 1e6), st.integers(1, 50))
def test_light_where_there_is_none_is_all_wrong(level, count):
    made = compare(np.full((count, 3), level), np.zeros((count, 3)))
    assert made.relative_rmse == pytest.approx(1)
    assert made.p99 == pytest.approx(1)
    spot = np.zeros((count + 1, 3))
    spot[0] = level
    assert compare(spot, np.zeros((count + 1, 3))).relative_rmse > 1


def test_a_few_bad_places_show_in_the_percentile():
    true = np.ones((1000, 3))
    shown = true.copy()
    shown[:15] += 0.5
    made = compare(shown, true)
    assert made.p99 == pytest.approx(0.5)
    shown[10:15] = 1
    assert compare(shown, true).p99 < 0.5


def some(seed, count):
    rng = np.random.default_rng(seed)
    true = rng.uniform(0.5, 1.5, (count, 3))
    return Compared(true + rng.normal(0, 0.1, true.shape), true, true + rng.normal(0, 0.05, true.shape))


@given(st.integers(0, 99), st.integers(1, 30), st.integers(1, 30))
def test_what_was_looked_at_in_turn_counts_like_what_was_looked_at_at_once(seed, first, second):
    one, other = some(seed, first), some(seed + 1, second)
    both = Looked(one, one, {"lamp": one}, one) + Looked(other, other, {"lamp": other}, other)
    made = both.error()
    arrays = zip((one.shown, one.true, one.again), (other.shown, other.true, other.again), strict=True)
    shown, true, again = (np.concatenate(pair) for pair in arrays)
    assert made.picture == made.vertices == made.layers["lamp"] == made.indirect
    assert made.picture == compare(shown, true, again=again)


def test_light_between_surfaces_is_told_only_where_there_is_some():
    one = some(0, 5)
    assert (Looked(one, one) + Looked(one, one)).error().indirect is None


@pytest.mark.parametrize(
    ("error", "sure"),
    [
        (Error(0.1, 0.014, 256), True),
        (Error(0.1, 0.016, 256), False),
        (Error(0.001, 0.0019, 256), True),
        (Error(0.1, 0.05, 2048), True),
    ],
)
def test_an_error_is_sure_when_its_uncertainty_is_small_or_enough_was_looked_at(error, sure):
    assert error.sure is sure
