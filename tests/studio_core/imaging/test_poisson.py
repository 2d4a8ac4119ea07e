"""Seamless cloning against a sparse system solved directly, and what must always hold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import poisson as oracle

from studio_core.imaging.poisson import clone, clone_light, membrane


def pictures(seed, height, width, channels=3):
    rng = np.random.default_rng(seed)
    return (
        rng.lognormal(size=(height, width, channels)).astype(np.float32),
        rng.lognormal(size=(height, width, channels)).astype(np.float32),
    )


def off(made, exact):
    return np.abs(made - exact).max() / np.abs(exact).max()


@st.composite
def rectangles(draw):
    """A size, a rectangle in it, at edges or not, and whether the azimuth is closed."""
    height, width = draw(st.integers(1, 12)), draw(st.integers(1, 14))
    top, left = draw(st.integers(0, height - 1)), draw(st.integers(0, width - 1))
    rows = draw(st.integers(1, height - top))
    wrap = draw(st.booleans())
    columns = draw(st.integers(1, width if wrap else width - left))
    mask = np.zeros((height, width), bool)
    mask[top : top + rows, np.arange(left, left + columns) % width] = True
    return mask, wrap


@given(rectangles(), st.integers(0, 999))
@settings(max_examples=120, deadline=None)
def test_rectangles_are_exact(case, seed):
    mask, wrap = case
    target, source = pictures(seed, *mask.shape)
    if mask.all():
        np.testing.assert_array_equal(clone(target, source, mask, wrap), source)
    else:
        assert off(clone(target, source, mask, wrap), oracle.clone(target, source, mask, wrap)) <= 1e-6


@given(st.integers(0, 999), st.floats(0.05, 0.95), st.booleans())
@settings(max_examples=40, deadline=None)
def test_any_form_is_exact(seed, share, wrap):
    mask = np.random.default_rng(seed).random((11, 13)) < share
    mask[5, 6] = False
    target, source = pictures(seed, *mask.shape)
    assert off(clone(target, source, mask, wrap), oracle.clone(target, source, mask, wrap)) <= 1e-6


@pytest.mark.parametrize("size", [(64, 150), (97, 60), (1, 90), (120, 2)])
def test_larger_rectangles(size):
    target, source = pictures(3, size[0] + 2, size[1] + 2)
    mask = np.zeros(target.shape[:2], bool)
    mask[1:-1, 1:-1] = True
    assert off(clone(target, source, mask), oracle.clone(target, source, mask)) <= 1e-6


def test_a_disc_across_the_edge_of_the_azimuth():
    target, source = pictures(4, 50, 70)
    y, x = np.mgrid[:50, :70]
    mask = (((x - 66 + 35) % 70 - 35) ** 2 + (y - 30) ** 2) < 18**2
    made = clone(target, source, mask, wrap=True)
    assert off(made, oracle.clone(target, source, mask, wrap=True)) <= 1e-6
    np.testing.assert_array_equal(made[~mask], target[~mask])


@given(rectangles(), st.integers(0, 999))
@settings(max_examples=60, deadline=None)
def test_light_stays_positive_and_keeps_ratios(case, seed):
    mask, wrap = case
    target, source = pictures(seed, *mask.shape)
    source = source * np.float32(10) ** np.linspace(-3, 3, source.size, dtype=np.float32).reshape(
        source.shape
    )
    made = clone_light(target, source, mask, wrap, floor=1e-9)
    assert np.isfinite(made).all()
    assert (made > 0).all()
    np.testing.assert_array_equal(made[~mask], target[~mask])
    twice = clone_light(target, 2 * source, mask, wrap, floor=1e-9)
    if not mask.all():
        np.testing.assert_allclose(twice, made, rtol=1e-4)


def test_a_level_off_by_a_factor_is_taken_over():
    target, _ = pictures(5, 20, 30)
    mask = np.zeros((20, 30), bool)
    mask[4:15, 6:20] = True
    np.testing.assert_allclose(clone_light(target, 7 * target, mask), target, rtol=1e-5)
    np.testing.assert_allclose(clone(target, target + 7, mask), target, rtol=1e-5, atol=1e-5)


def test_the_membrane_stays_between_what_surrounds_it():
    rng = np.random.default_rng(6)
    values, mask = rng.normal(size=(30, 40, 1)), np.zeros((30, 40), bool)
    mask[3:30, 5:33] = True
    made = membrane(values, mask)
    rim = ~mask & (np.roll(mask, 1, 0) | np.roll(mask, -1, 0) | np.roll(mask, 1, 1) | np.roll(mask, -1, 1))
    assert values[rim].min() - 1e-12 <= made[mask].min()
    assert made[mask].max() <= values[rim].max() + 1e-12


def test_nothing_to_do_and_sizes_that_differ():
    target, source = pictures(7, 6, 8)
    np.testing.assert_array_equal(clone(target, source, np.zeros((6, 8), bool)), target)
    with pytest.raises(ValueError, match="one size"):
        clone(target, source[1:], np.zeros((6, 8), bool))
    with pytest.raises(ValueError, match="one size"):
        clone(target, source, np.zeros((6, 7), bool))
