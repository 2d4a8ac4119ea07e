"""Refined vertices while something moves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import cuts as oracle

from studio_plugins.cuts.fill import USUAL, fill, lift


def made(rng, count, base):
    between = np.repeat(np.arange(count)[:, None], 2, axis=1)
    for i in range(base, count):
        between[i] = rng.choice(i, 2, replace=False)
    return between


def one_kind(count):
    return np.zeros(count, np.int32)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_it_is_as_written_down(seed):
    rng = np.random.default_rng(seed)
    count, base = 50, 20
    between, material = made(rng, count, base), rng.integers(-1, 3, count).astype(np.int32)
    summed = np.arange(count) < base
    wanted, settled = ~summed & (rng.random(count) < 0.7), rng.random(count) < 0.5
    irradiance = (rng.uniform(0, 3, (count, 3)) * (rng.random((count, 1)) < 0.6)).astype(np.float32)
    terms = (rng.uniform(0, 1, (count, 3, 3)) * irradiance[:, None]).astype(np.float32)
    expected = oracle.filled(between, material, summed, wanted, settled, terms, irradiance, USUAL)
    fill(between, material, summed, wanted, settled, terms, irradiance)
    np.testing.assert_allclose(terms, expected[0], rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(irradiance, expected[1], rtol=1e-5)


def test_refined_vertices_have_their_own_light_and_their_neighbours_reflectance():
    rng = np.random.default_rng(1)
    count, base = 60, 20
    between = made(rng, count, base)
    irradiance = rng.uniform(0.1, 5, (count, 3)).astype(np.float32)
    irradiance[rng.random(count) < 0.3] = 0  # in the dark
    share = rng.uniform(0, 1, (1, 3, 3)).astype(np.float32)  # the same everywhere: so it must come out
    terms = (irradiance[:, None] * share).astype(np.float32)
    truth = terms.copy()
    terms[base:] = 0
    summed, wanted = np.arange(count) < base, np.arange(count) >= base
    fill(between, one_kind(count), summed, wanted, np.ones(count, np.bool_), terms, irradiance)
    np.testing.assert_allclose(terms, truth, rtol=1e-5)


@pytest.mark.parametrize("dark", [(0,), (1,), (0, 1)])
def test_a_lit_vertex_is_lit_whoever_is_in_the_dark_beside_it(dark):
    """Light through a gap, seen while the eye moves: also where neither end of the edge gets any of it."""
    between = np.array([[0, 0], [1, 1], [2, 2], [0, 1], [0, 3]])
    summed, wanted = np.arange(5) < 3, np.arange(5) > 2
    irradiance = np.full((5, 3), 2, np.float32)
    irradiance[list(dark)] = 0
    terms = np.repeat(0.3 * irradiance[:, None], 3, axis=1).astype(np.float32)
    terms[3:] = 0
    fill(between, one_kind(5), summed, wanted, np.ones(5, np.bool_), terms, irradiance)
    np.testing.assert_allclose(terms[3:], 0.6, rtol=1e-5)


def test_other_materials_have_no_say():
    between = np.array([[0, 0], [1, 1], [2, 2], [0, 1]])
    summed, wanted = np.arange(4) < 3, np.arange(4) == 3
    irradiance = np.array([[0], [0], [9], [2]], np.float32) * np.ones(3, np.float32)
    terms = np.repeat(irradiance[:, None] / 3, 3, axis=1)
    terms[3] = 7
    material = np.array([0, 0, 1, 0], np.int32)
    fill(between, material, summed, wanted, np.ones(4, np.bool_), terms, irradiance)
    assert (terms[3] == 0).all()  # nothing is known of how it reflects


def test_without_light_of_their_own_they_get_the_mean_of_it():
    rng = np.random.default_rng(2)
    count, base = 40, 12
    between = made(rng, count, base)
    irradiance = rng.uniform(0.1, 5, (count, 3)).astype(np.float32)
    irradiance[3] = 0  # in the dark
    terms = np.repeat(irradiance[:, None] / np.pi, 3, axis=1).astype(np.float32)
    settled, before = rng.random(count) < 0.3, irradiance.copy()
    summed, wanted = np.arange(count) < base, np.arange(count) >= base
    fill(between, one_kind(count), summed, wanted, settled, terms, irradiance)
    expected = before.copy()
    for i in np.flatnonzero(wanted & ~settled):
        expected[i] = (expected[between[i, 0]] + expected[between[i, 1]]) / 2
    np.testing.assert_allclose(irradiance, expected, rtol=1e-6)
    np.testing.assert_allclose(terms, np.repeat(expected[:, None] / np.pi, 3, axis=1), rtol=1e-4)


def test_others_are_left_alone():
    between = np.array([[0, 0], [1, 1], [0, 1], [0, 1]])
    terms, irradiance = np.ones((4, 3, 3), np.float32), np.full((4, 3), 2, np.float32)
    terms[3] = 7
    wanted, none = np.array([False, False, True, False]), np.zeros(4, np.bool_)
    fill(between, one_kind(4), np.array([True, True, False, False]), wanted, none, terms, irradiance)
    assert (terms[3] == 7).all()
    np.testing.assert_allclose(terms[2], 1)


def test_what_nobody_sees_is_passed_through_and_keeps_what_it_has():
    between = np.array([[0, 0], [1, 1], [2, 2], [0, 1], [2, 3]])
    summed, wanted = np.arange(5) < 3, np.arange(5) == 4
    irradiance = np.array([[1], [3], [4], [np.nan], [0]], np.float32) * np.ones(3, np.float32)
    terms = np.repeat(irradiance[:, None] / 2, 3, axis=1)
    for settled in (np.zeros(5, np.bool_), np.arange(5) == 3):
        fill(between, one_kind(5), summed, wanted, settled, terms, irradiance)
        np.testing.assert_allclose(irradiance[4], 3)  # of 4 and the mean of 1 and 3
        np.testing.assert_allclose(terms[4], 1.5)
        assert np.isnan(terms[3]).all()
        assert np.isnan(irradiance[3]).all()


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_what_moves_takes_as_much_as_from_the_neighbours(seed):
    rng = np.random.default_rng(seed)
    count, base = 60, 20
    between = made(rng, count, base)
    summed, wanted = np.arange(count) < base, np.arange(count) >= base
    settled, known = rng.random(count) < 0.2, rng.random(count) < 0.9
    standing = rng.uniform(0, 3, (count, 3)).astype(np.float32)
    now = (standing * rng.uniform(0, 1, (count, 1))).astype(np.float32)
    irradiance = now.copy()
    lifted = lift(between, summed, wanted, settled, standing, known, irradiance)
    has = summed | (settled & wanted)
    expected = now.astype(np.float64)
    for i in range(base, count):
        a, b = between[i]
        sure = known[[i, a, b]].all() and has[a] and has[b] and not settled[i]
        assert lifted[i] == sure
        if sure:
            taken = (standing[a] - expected[a] + standing[b] - expected[b]) / 2
            expected[i] = np.maximum(standing[i] - taken, 0)
            has[i] = True
    np.testing.assert_allclose(irradiance, expected, atol=1e-5)
    assert not lifted[:base].any()


def test_fine_shadows_of_what_stands_still_stay():
    """Nothing moved takes any light: refined vertices have what they had."""
    rng = np.random.default_rng(5)
    between = made(rng, 60, 20)
    summed, wanted = np.arange(60) < 20, np.arange(60) >= 20
    standing = rng.uniform(0, 3, (60, 3)).astype(np.float32)
    irradiance = np.where(summed[:, None], standing, np.float32(0))
    nobody, everybody = np.zeros(60, np.bool_), np.ones(60, np.bool_)
    assert lift(between, summed, wanted, nobody, standing, everybody, irradiance)[20:].all()
    np.testing.assert_allclose(irradiance, standing, rtol=1e-6)
