"""The best reflectance against a general optimiser, and what it must never do."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from plugins.slf.strokes import LEVELS, MODEL, painted, reflectance
from scipy.optimize import minimize

from studio_plugins.slf.grams import Grams, best

NOW = reflectance((0.5, 0.3, 0.2), (0.1, 0.1, 0.1), 8)


def cost(samples, diffuse, specular, level):
    made = samples.made(MODEL, reflectance(diffuse, specular, level))
    return float((samples.importance * (made - samples.wanted) ** 2).sum())


def found_in(samples, levels, diffuse, tint):
    grams = Grams.of(samples, np.asarray(levels, float), samples.importance)
    found = best(grams, MODEL, NOW, diffuse, tint)
    made = found.reflectance
    assert (made.diffuse >= 0).all()
    assert (made.specular >= 0).all()
    assert (made.diffuse + made.specular <= 1 + 1e-12).all()
    return found


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.floats(0, 1.2), st.floats(0, 1.2), st.booleans())
def test_both_parts_are_at_the_constrained_minimum(seed, matte, shine, coloured):
    rng = np.random.default_rng(seed)
    tint = np.array([1.0, 0.7, 0.3]) if coloured else np.ones(3)
    samples = painted(rng, NOW, reflectance(matte * rng.uniform(0, 1, 3), shine * tint, 12), 0.2)
    level = float(rng.uniform(0, LEVELS - 1))
    ours = found_in(samples, [level], True, tint)
    exact = cost(samples, ours.reflectance.diffuse, ours.reflectance.specular, level)
    assert abs(ours.left - exact) <= 1e-6 * max(exact, 1e-3)
    limits = [{"type": "ineq", "fun": lambda x, c=c: 1 - x[c] - x[3] * tint[c]} for c in range(3)]
    least = min(
        minimize(
            lambda x: cost(samples, x[:3], x[3] * tint, level),
            x0,
            bounds=[(0, 1)] * 4,
            constraints=limits,
        ).fun
        for x0 in (
            np.append(ours.reflectance.diffuse, ours.reflectance.specular.max()),
            np.array([0.2, 0.2, 0.2, 0.2]),
        )
    )
    assert exact <= least * 1.01 + 1e-6 * len(samples)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_the_matte_part_alone_is_exact_and_the_best_level_is_taken(seed):
    rng = np.random.default_rng(seed)
    samples = painted(rng, NOW, reflectance(rng.uniform(0, 0.8, 3), NOW.specular, 8))
    ours = found_in(samples, [8.0], True, None)
    assert ours.left <= 1e-9 * len(samples)
    gloss = painted(rng, NOW, reflectance(NOW.diffuse, NOW.specular, 14))
    assert found_in(gloss, np.arange(LEVELS), False, None).reflectance.level == 14


def test_what_shows_nothing_stays():
    samples = painted(np.random.default_rng(0), NOW, NOW)
    dark = dataclasses.replace(samples, terms=samples.terms * [[0.0], [1.0]])
    found = found_in(dark, [8.0], True, None)
    np.testing.assert_array_equal(found.reflectance.diffuse, NOW.diffuse)
