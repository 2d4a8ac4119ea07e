"""What exact tracing is expected to take."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_plugins.cuts.forecast import LEAST, Forecast

COUNTS = st.integers(LEAST, 50_000)


@given(
    st.floats(1e-5, 1e-2), st.floats(1e-6, 1e-3), st.lists(st.tuples(COUNTS, COUNTS), min_size=3, max_size=5)
)
@settings(max_examples=50)
def test_it_learns_what_either_takes(new, known, work):
    forecast = Forecast()
    for _ in range(30):
        for one, other in work:
            forecast.learn(one, 0, one * new)
            forecast.learn(0, other, other * known)
    for one, other in work:
        assert forecast(one, other) == pytest.approx(one * new + other * known, rel=0.01)


@given(COUNTS, COUNTS, st.floats(0.0, 1e3))
def test_it_comes_nearer_but_trusts_nothing_wholly(new, known, seconds):
    forecast = Forecast()
    before = forecast(new, known)
    forecast.learn(new, known, seconds)
    after = forecast(new, known)
    assert before / 2.01 < after < before * 2.01
    assert abs(after - seconds) <= abs(before - seconds) * (1 + 1e-9)


def test_a_handful_of_vertices_tells_nothing():
    forecast = Forecast()
    before = forecast(1000, 1000)
    forecast.learn(LEAST - 1, 0, 100.0)
    assert forecast(1000, 1000) == before
