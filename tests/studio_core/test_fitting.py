"""What is told of a fit's errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.fitting import relative_error


@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 1e3))
def test_the_mean_square_of_the_map_is_the_error_of_the_lamp(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    seen = rng.uniform(0, scale, (5, 7, 3)).astype(np.float32)
    made = (seen * rng.uniform(0.5, 1.5, seen.shape)).astype(np.float32)
    trusted = rng.random((5, 7)) < 0.7
    trusted[2, 3] = True
    error = relative_error(made, seen, trusted)
    assert np.array_equal(np.isnan(error), ~trusted)
    off = (made[trusted].astype(float) - seen[trusted]) ** 2
    nmse = off.sum() / (seen[trusted].astype(float) ** 2).sum()
    assert float((error[trusted].astype(float) ** 2).mean()) == pytest.approx(nmse, rel=1e-4)


def test_where_nothing_counts_or_nothing_was_seen() -> None:
    dark = np.zeros((2, 2, 3), np.float32)
    assert np.isnan(relative_error(dark, dark, np.zeros((2, 2), np.bool_))).all()
    assert (relative_error(dark, dark, np.ones((2, 2), np.bool_)) == 0).all()
