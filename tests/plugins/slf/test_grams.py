"""The best reflectance against a general optimiser, and what it must never do."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from plugins.slf.strokes import LEVELS, MODEL, painted, reflectance
from scipy.optimize import minimize

from studio_plugins.slf.grams import Grams, Rungs, Shines, best, errors_of

NOW = reflectance((0.5, 0.3, 0.2), (0.1, 0.1, 0.1), 8)


def cost(samples, diffuse, specular, level):
    made = samples.made(MODEL, reflectance(diffuse, specular, level))
    return float((samples.importance * (made - samples.wanted) ** 2).sum())


def found_in(samples, levels, diffuse, tint):
    grams = Grams.of(samples, np.asarray(levels, float), samples.importance)
    found = best(grams, MODEL, NOW, diffuse, Shines.start(MODEL, NOW, tint))
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


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.lists(st.floats(0, LEVELS - 1), min_size=1, max_size=5))
def test_grams_between_levels_are_those_of_terms_between_levels(seed, levels):
    rng = np.random.default_rng(seed)
    samples = painted(rng, NOW, reflectance(rng.uniform(0, 0.8, 3), NOW.specular, 8))
    importance = samples.importance * rng.uniform(0, 1, (len(samples), 1))
    made = Rungs.of(samples, importance).at(np.array(levels))
    exact = Grams.of(samples, np.array(levels), importance)
    for name in ("aa", "ab", "yy"):
        wanted = getattr(exact, name)
        np.testing.assert_allclose(getattr(made, name), wanted, rtol=1e-11, atol=1e-11 * np.abs(wanted).max())


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000), st.booleans())
def test_errors_of_all_shines_at_once(seed, diffuse):
    """Against residuals place by place."""
    rng = np.random.default_rng(seed)
    samples = painted(rng, NOW, reflectance(rng.uniform(0, 0.8, 3), NOW.specular, 8), 0.1)
    levels, shines = np.array([3.0, 8.5]), Shines.start(MODEL, NOW, np.array([1.0, 0.5, 0.25]))
    grams = Grams.of(samples, levels, samples.importance)
    errors, matte = errors_of(grams, NOW, diffuse, shines)
    for m, k in ((0, 0), (0, 9), (1, 30)):
        exact = cost(samples, matte[m, k], shines.shine[k], levels[m])
        assert abs(errors[m, k] - exact) <= 1e-9 * grams.yy.sum()
        if diffuse:
            for off in (-0.01, 0.01):
                moved = np.clip(matte[m, k] + off, 0, shines.room[k])
                assert cost(samples, moved, shines.shine[k], levels[m]) >= exact - 1e-9 * grams.yy.sum()
        else:
            np.testing.assert_array_equal(matte[m, k], np.minimum(NOW.diffuse, shines.room[k]))
