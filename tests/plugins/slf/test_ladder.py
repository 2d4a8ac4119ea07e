"""Steps of gloss."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from studio_plugins.slf.ladder import (
    LEVELS,
    alpha_of_exponent,
    alpha_of_level,
    exponent_of_alpha,
    level_of_alpha,
)


@given(st.floats(0, LEVELS - 1))
def test_levels_and_roughness_are_inverse(level):
    np.testing.assert_allclose(level_of_alpha(alpha_of_level(level)), level, atol=1e-9)


@given(st.floats(0.01, 1e5))
def test_exponents_and_roughness_are_inverse(exponent):
    np.testing.assert_allclose(exponent_of_alpha(alpha_of_exponent(exponent)), exponent, rtol=1e-6, atol=1e-6)


def test_the_ladder_goes_from_dull_to_sharp_in_even_steps():
    alpha = alpha_of_level(np.arange(LEVELS))
    np.testing.assert_allclose(np.diff(alpha), alpha[1] - alpha[0])
    exponents = exponent_of_alpha(alpha)
    assert exponents[0] < 1.01
    assert 790 < exponents[-1] < 800
    assert level_of_alpha(5.0) == 0
    assert level_of_alpha(0.0) == LEVELS - 1
