"""Refined vertices while something moves."""

from __future__ import annotations

import numpy as np

from studio_plugins.cuts.fill import fill


def made(rng, count, base):
    between = np.repeat(np.arange(count)[:, None], 2, axis=1)
    for i in range(base, count):
        between[i] = rng.choice(i, 2, replace=False)
    return between


def test_refined_vertices_have_their_own_light_and_their_neighbours_reflectance():
    rng = np.random.default_rng(1)
    count, base = 60, 20
    between = made(rng, count, base)
    irradiance = rng.uniform(0.1, 5, (count, 3)).astype(np.float32)
    share = rng.uniform(0, 1, (1, 3, 3)).astype(np.float32)  # the same everywhere: so it must come out
    terms = (irradiance[:, None] * share).astype(np.float32)
    truth = terms.copy()
    terms[base:] = 0
    summed, wanted = np.arange(count) < base, np.arange(count) >= base
    fill(between, summed, wanted, np.ones(count, np.bool_), terms, irradiance)
    np.testing.assert_allclose(terms, truth, rtol=1e-5)


def test_without_light_of_their_own_they_get_the_mean_of_it():
    rng = np.random.default_rng(2)
    count, base = 40, 12
    between = made(rng, count, base)
    irradiance = rng.uniform(0.1, 5, (count, 3)).astype(np.float32)
    irradiance[3] = 0  # in the dark
    terms = np.repeat(irradiance[:, None] / np.pi, 3, axis=1).astype(np.float32)
    settled, before = rng.random(count) < 0.3, irradiance.copy()
    summed, wanted = np.arange(count) < base, np.arange(count) >= base
    fill(between, summed, wanted, settled, terms, irradiance)
    expected = before.copy()
    for i in np.flatnonzero(wanted & ~settled):
        expected[i] = (expected[between[i, 0]] + expected[between[i, 1]]) / 2
    np.testing.assert_allclose(irradiance, expected, rtol=1e-6)
    assert np.isfinite(terms).all()
    assert (terms >= 0).all()


def test_others_are_left_alone():
    between = np.array([[0, 0], [1, 1], [0, 1], [0, 1]])
    terms, irradiance = np.ones((4, 3, 3), np.float32), np.full((4, 3), 2, np.float32)
    terms[3] = 7
    wanted = np.array([False, False, True, False])
    fill(between, np.array([True, True, False, False]), wanted, np.zeros(4, np.bool_), terms, irradiance)
    assert (terms[3] == 7).all()
    np.testing.assert_allclose(terms[2], 1)


def test_what_nobody_sees_is_passed_through_and_keeps_what_it_has():
    between = np.array([[0, 0], [1, 1], [2, 2], [0, 1], [2, 3]])
    summed, wanted = np.arange(5) < 3, np.arange(5) == 4
    irradiance = np.array([[1], [3], [4], [np.nan], [0]], np.float32) * np.ones(3, np.float32)
    terms = np.repeat(irradiance[:, None] / 2, 3, axis=1)
    for settled in (np.zeros(5, np.bool_), np.arange(5) == 3):
        fill(between, summed, wanted, settled, terms, irradiance)
        np.testing.assert_allclose(irradiance[4], 3)  # of 4 and the mean of 1 and 3
        np.testing.assert_allclose(terms[4], 1.5)
        assert np.isnan(terms[3]).all()
        assert np.isnan(irradiance[3]).all()
