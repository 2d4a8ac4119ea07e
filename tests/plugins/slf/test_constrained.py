"""The constrained minimum against a general optimiser, and what it must never do."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plugins.slf.strokes import LEVELS, painted, reflectance
from scipy.optimize import minimize

from studio_plugins.slf.constrained import Moments, fit_both, fit_diffuse, fit_specular

NOW = reflectance((0.5, 0.3, 0.2), (0.1, 0.1, 0.1), 8)


def cost(samples, diffuse, specular, level):
    made = samples.made(reflectance(diffuse, specular, level))
    return float((samples.importance * (made - samples.wanted) ** 2).sum())


def feasible(found):
    assert (found.diffuse >= 0).all()
    assert (found.specular >= 0).all()
    assert (found.diffuse + found.specular <= 1 + 1e-12).all()


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.floats(0, 1.2), st.floats(0, 1.2), st.booleans())
def test_both_parts_are_at_the_constrained_minimum(seed, matte, shine, coloured):
    rng = np.random.default_rng(seed)
    tint = np.array([1.0, 0.7, 0.3]) if coloured else np.ones(3)
    then = reflectance(matte * rng.uniform(0, 1, 3), shine * tint, 12)
    samples = painted(rng, NOW, then, 0.2)
    levels = np.array([0.0, 7.5, 12.0, 19.0])
    found = fit_both(Moments.of(samples, levels), NOW, tint)
    feasible(found)
    for m, level in enumerate(levels):
        ours = cost(samples, found.diffuse[m], found.specular[m], level)
        bounds = [(0, 1)] * 4
        limits = [{"type": "ineq", "fun": lambda x, c=c: 1 - x[c] - x[3] * tint[c]} for c in range(3)]
        start = np.append(found.diffuse[m], found.specular[m].max())
        best = min(
            minimize(
                lambda x, level=level: cost(samples, x[:3], x[3] * tint, level),
                x0,
                bounds=bounds,
                constraints=limits,
            ).fun
            for x0 in (start, np.array([0.2, 0.2, 0.2, 0.2]))
        )
        assert ours <= best * (1 + 1e-4) + 1e-12


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_parts_alone_are_at_the_minimum_along_their_line(seed):
    rng = np.random.default_rng(seed)
    samples = painted(rng, NOW, reflectance(rng.uniform(0, 1, 3), rng.uniform(0, 1) * np.ones(3), 5), 0.3)
    moments = Moments.of(samples, np.array([8.0]))
    diffuse, specular = fit_diffuse(moments, NOW), fit_specular(moments, NOW, NOW.tint)
    feasible(diffuse)
    feasible(specular)
    np.testing.assert_array_equal(diffuse.specular[0], NOW.specular)
    np.testing.assert_array_equal(specular.diffuse[0], NOW.diffuse)
    at = cost(samples, diffuse.diffuse[0], NOW.specular, 8)
    shine = cost(samples, NOW.diffuse, specular.specular[0], 8)
    for step in rng.uniform(0, 1, (50, 3)):
        assert cost(samples, step * (1 - NOW.specular), NOW.specular, 8) >= at * (1 - 1e-9)
        assert cost(samples, NOW.diffuse, step[0] * 0.5 * np.ones(3), 8) >= shine * (1 - 1e-9)


def test_columns_that_are_one_change_the_matte_part_alone():
    rng = np.random.default_rng(0)
    samples = painted(rng, NOW, reflectance((0.9, 0.1, 0.1), (0.1, 0.1, 0.1), 8))
    same = samples.specular.copy()
    same[3] = samples.diffuse
    moments = Moments.of(dataclasses.replace(samples, specular=same), np.array([3.0]))
    assert not moments.apart.any()
    found = fit_both(moments, NOW, NOW.tint)
    np.testing.assert_array_equal(found.specular[0], NOW.specular)
    feasible(found)


@pytest.mark.parametrize("scale", [0.0, 1e-150, 1e60])
def test_no_light_and_far_too_much_of_it_are_survived(scale):
    rng = np.random.default_rng(1)
    samples = painted(rng, NOW, NOW)
    dark = dataclasses.replace(samples, diffuse=samples.diffuse * scale, specular=samples.specular * scale)
    moments = Moments.of(dark, np.arange(float(LEVELS)))
    feasible(fit_both(moments, NOW, np.ones(3)))
    feasible(fit_diffuse(moments, NOW))
    feasible(fit_specular(moments, NOW, np.ones(3)))
