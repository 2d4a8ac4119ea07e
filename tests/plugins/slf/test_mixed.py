"""One pass over elements chooses as the paper's choice does, of one channel or three, of any systems."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from plugins.slf.test_paper import cost, systems

from studio_plugins.slf.mixed import choose_all
from studio_plugins.slf.paper import choose


def same(made, true, one):
    assert np.array_equal(made.flagged, true.flagged)
    scale = one.bb.reshape(-1, one.channels).sum(axis=1)[~true.flagged] + 1e-12
    assert (np.abs(made.residual - true.residual)[~true.flagged] < 1e-9 * scale).all()
    alike = (made.level == true.level) & (made.kind == true.kind)  # ties, but for rounding
    assert alike.mean() > 0.99
    rows = np.repeat(alike, one.channels)
    assert np.allclose(made.reflectance[rows], true.reflectance[rows], atol=1e-9)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("solver", ["l0", "mixed", "l2"])
def test_it_chooses_as_the_papers_choice_does(solver, channels):
    rng = np.random.default_rng(3)
    one = systems(rng, 900)
    one = dataclasses.replace(one, level=one.level[::channels], channels=channels)
    same(choose_all(one, solver), choose(one, solver), one)


def test_a_colour_has_one_gloss_and_one_kind_of_change():
    one = systems(np.random.default_rng(4), 300)
    one = dataclasses.replace(one, level=one.level[::3], channels=3)
    made = choose(one, "mixed")
    assert made.level.shape == made.kind.shape == made.residual.shape == (100,)
    assert made.reflectance.shape == (300, 2)
    whole = cost(one, *made.reflectance.T, np.repeat(made.level, 3)).reshape(100, 3).sum(axis=1)
    assert np.allclose(whole, made.residual)


def test_strange_systems_are_flagged_and_stay_as_they_are():
    one = systems(np.random.default_rng(5), 60, 10 ** np.linspace(0, 16, 60))
    arrays = {name: getattr(one, name).copy() for name in ("c11", "c12", "c22", "d1", "d2", "bb")}
    arrays["c22"][3] = np.nan
    arrays["d1"][4] = np.inf
    for name in arrays:
        arrays[name][5] = 0
    one = dataclasses.replace(one, **arrays)
    made = choose_all(one, "mixed")
    assert made.flagged[3:6].all()
    assert made.flagged.sum() == 3
    assert (made.reflectance >= 0).all()
    assert (made.reflectance.sum(axis=1) <= 1 + 1e-9).all()
    assert np.isfinite(made.residual).all()
