"""What a whole stroke says: the right parameter, its value, and when nothing can be said."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from plugins.slf.strokes import MODEL, painted, reflectance

from studio_plugins.slf.joint import SINGLE, Change, decide

NOW = reflectance((0.5, 0.3, 0.2), (0.15, 0.15, 0.15), 9)
CHANGES = {
    Change.NONE: NOW,
    Change.DIFFUSE: reflectance((0.2, 0.5, 0.6), NOW.specular, 9),
    Change.SPECULAR: reflectance(NOW.diffuse, (0.4, 0.4, 0.4), 9),
    Change.GLOSS: reflectance(NOW.diffuse, NOW.specular, 15),
    Change.SPECULAR | Change.GLOSS: reflectance(NOW.diffuse, (0.4, 0.4, 0.4), 4),
    Change.DIFFUSE | Change.SPECULAR: reflectance((0.2, 0.5, 0.5), (0.4, 0.4, 0.4), 9),
}


@pytest.mark.parametrize("noise", [0.02, 0.1])
@pytest.mark.parametrize("change", list(CHANGES))
def test_the_right_parameters_are_named_and_their_values_found(change, noise):
    right, off = 0, []
    for seed in range(20):
        verdict = decide(painted(np.random.default_rng(seed), NOW, CHANGES[change], noise), MODEL, NOW)
        right += verdict.best.change == change
        if verdict.best.change == change:
            made, true = verdict.best.reflectance, CHANGES[change]
            off.append(np.abs(made.diffuse - true.diffuse).max() / true.diffuse.max())
    assert right >= (19 if noise <= 0.02 else 18)
    assert np.mean(off) < 0.05


def test_noise_of_many_places_hides_no_small_change():
    """And makes none."""
    small = reflectance(NOW.diffuse, NOW.specular, 10)
    for seed in range(4):
        for then, change in ((small, Change.GLOSS), (NOW, Change.NONE)):
            samples = painted(np.random.default_rng(seed), NOW, then, 0.1, views=600)
            assert decide(samples, MODEL, NOW).best.change == change


def test_a_stroke_on_what_no_light_reaches_says_nothing():
    samples = painted(np.random.default_rng(0), NOW, CHANGES[Change.DIFFUSE])
    dark = dataclasses.replace(
        samples, before=0 * samples.before, terms=0 * samples.terms, own=0 * samples.own
    )
    verdict = decide(dark, MODEL, NOW)
    assert verdict.best.change == Change.NONE
    assert verdict.silent == Change.DIFFUSE | Change.SPECULAR | Change.GLOSS
    assert decide(dark.some(np.zeros(0, int)), MODEL, NOW).best.change == Change.NONE


def test_numbers_that_are_none_are_left_out():
    samples = painted(np.random.default_rng(0), NOW, CHANGES[Change.GLOSS])
    before = decide(samples.some(np.arange(10, len(samples))), MODEL, NOW)
    samples.wanted[:5], samples.terms[3, 5:10, 1] = np.nan, np.inf
    after = decide(samples, MODEL, NOW)
    assert after.best.change == before.best.change == Change.GLOSS
    assert after.best.score == pytest.approx(before.best.score)


def test_where_no_highlight_is_seen_the_stroke_cannot_tell_of_it():
    samples = painted(np.random.default_rng(2), NOW, CHANGES[Change.DIFFUSE])
    faint = np.array([[1], [1e-3]])
    away = dataclasses.replace(samples, terms=samples.terms * faint, own=samples.own * faint)
    assert decide(away, MODEL, NOW).silent == Change.SPECULAR | Change.GLOSS
    assert decide(samples, MODEL, NOW).silent == Change.NONE


def test_another_colour_of_the_shine_is_found_among_those_that_are_offered():
    gold = np.array([1.0, 0.7, 0.3])
    samples = painted(np.random.default_rng(3), NOW, reflectance(NOW.diffuse, 0.45 * gold, 9), 0.02)
    made = decide(samples, MODEL, NOW, tints=[gold]).best
    assert made.change == Change.SPECULAR
    np.testing.assert_allclose(made.reflectance.specular, 0.45 * gold, rtol=0.05)


def test_single_changes_only_where_that_is_asked():
    samples = painted(np.random.default_rng(4), NOW, CHANGES[Change.SPECULAR | Change.GLOSS])
    verdict = decide(samples, MODEL, NOW, SINGLE)
    assert {one.change for one in verdict.explanations} == set(SINGLE)
    scores = [one.score for one in verdict.explanations]
    assert scores == sorted(scores)
