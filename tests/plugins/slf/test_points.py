"""What points of paint are found by: differences and lengths along edges."""

from __future__ import annotations

import numpy as np

from studio_plugins.slf.points import add_lengths, add_most_across


def test_differences_and_lengths_along_pairs():
    rng = np.random.default_rng(0)
    values, places = rng.normal(size=(50, 4)).astype(np.float32), rng.normal(size=(50, 3)).astype(np.float32)
    pairs = rng.integers(0, 50, (90, 2))
    most, length = np.zeros((2, 90), np.float32)
    add_most_across(values, pairs, most)
    add_lengths(places, pairs, length)
    np.testing.assert_array_equal(most, np.abs(values[pairs[:, 0]] - values[pairs[:, 1]]).max(axis=1))
    wanted = np.linalg.norm(places[pairs[:, 0]] - places[pairs[:, 1]], axis=1)
    np.testing.assert_allclose(length, wanted, rtol=1e-5)
