"""What a stroke in one flat colour comes to: its own light says how much, what lies beside it only what."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from plugins.slf.strokes import MODEL, painted, reflectance

from studio_plugins.slf.explaining import as_painted
from studio_plugins.slf.joint import Change, decide
from studio_plugins.slf.samples import Samples

NOW = reflectance((0.2, 0.3, 0.5), (0.1, 0.1, 0.1), 8)
OTHERS = {
    Change.DIFFUSE: reflectance((0.6, 0.3, 0.1), (0.1, 0.1, 0.1), 8),
    Change.SPECULAR: reflectance((0.2, 0.3, 0.5), (0.4, 0.4, 0.4), 8),
    Change.GLOSS: reflectance((0.2, 0.3, 0.5), (0.1, 0.1, 0.1), 11.5),
}


def flat(change: Change) -> tuple[Samples, Samples]:
    """The mean of places that want a change, with a fifth as many that want to stay; and it alone."""
    every = painted(np.random.default_rng(3), NOW, OTHERS[change])
    mean = every.some(np.arange(50)).mean()
    beside = every.some(np.arange(50, 60))
    return mean + dataclasses.replace(beside, wanted=beside.before), mean


@pytest.mark.parametrize("change", OTHERS)
def test_what_is_beside_tells_what_changes_and_not_how_much(change: Change) -> None:
    both, mean = flat(change)
    verdict = decide(both, MODEL, NOW, (Change.NONE, *OTHERS))
    made = as_painted(verdict, mean, mean, MODEL, NOW)
    before, after = (
        next(one for one in which.explanations if one.change == change) for which in (verdict, made)
    )
    assert [one.change for one in made.explanations] == [one.change for one in verdict.explanations]
    assert after.score == before.score
    assert after.explained > 0.9, "of what was painted, and not of what lies beside it"
    assert after.explained > before.explained
    own = change is not Change.GLOSS
    off, was = (
        np.abs(mean.made(MODEL, one.reflectance, own) / mean.wanted - 1).max() for one in (after, before)
    )
    assert off < 0.02
    assert off < was
    then = OTHERS[change]
    assert after.reflectance.diffuse == pytest.approx(then.diffuse, abs=0.02)
    assert after.reflectance.specular == pytest.approx(then.specular, abs=0.01)
    assert abs(after.reflectance.level - then.level) <= abs(before.reflectance.level - then.level)


def test_where_surfaces_curve_the_highlight_counts_as_it_will_be() -> None:
    both, mean = flat(Change.SPECULAR)
    verdict = decide(both, MODEL, NOW, (Change.NONE, *OTHERS))
    narrow = mean.own.copy()
    narrow[:, 1] *= 1.5
    curved = dataclasses.replace(mean, own=narrow)
    (shine,) = (
        one.reflectance.specular
        for one in as_painted(verdict, mean, curved, MODEL, NOW).explanations
        if one.change is Change.SPECULAR
    )
    assert shine == pytest.approx(OTHERS[Change.SPECULAR].specular / 1.5, abs=0.01)


def test_light_that_is_no_number_leaves_all_as_it_is() -> None:
    both, mean = flat(Change.DIFFUSE)
    verdict = decide(both, MODEL, NOW, (Change.NONE, *OTHERS))
    lost = dataclasses.replace(mean, wanted=np.full((1, 3), np.nan))
    assert as_painted(verdict, lost, lost, MODEL, NOW) is verdict
