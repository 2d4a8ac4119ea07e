"""Cloth: what its fibres return, what they leave to the ground, and what its numbers mean."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.fibres import Pile

from studio_core.brdfs.albedo import albedo_table, quadrature_albedo
from studio_core.brdfs.promises import seen_from
from studio_core.params import defaults
from studio_plugins.brdfs import fibres
from studio_plugins.brdfs.cloth import MODEL, Params
from studio_plugins.brdfs.curves import at

MU = np.concatenate([np.geomspace(1e-3, 0.1, 13), np.linspace(0.13, 1, 20)])
ROUGHNESSES = (0.07, 0.12, 0.33, 0.71, 1.0)
colour = st.tuples(*[st.floats(0, 1, width=32)] * 3)


def look(**changed: Any) -> dict[str, Any]:
    return {**defaults(Params), **changed}


@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_curves_follow_what_they_stand_for(roughness: float) -> None:
    known, made = Pile(roughness), fibres.pile(roughness)
    np.testing.assert_allclose(at(made.area, 1 - MU, 0, 2), known.area(MU), rtol=2e-3)
    np.testing.assert_allclose(fibres.let_through(made.through, MU), known.passing(MU), atol=1.5e-3)
    np.testing.assert_allclose(made.average, known.average, atol=1e-3)


@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_fibres_return_no_more_than_arrives_even_along_the_surface(roughness: float) -> None:
    wo = seen_from(np.radians([0, 40, 80, 88, 89.5, 89.9]))
    found = quadrature_albedo(MODEL, MODEL.shape(look(roughness=roughness)), wo, 3e-5)[:, 2]
    assert found.max() <= 1
    assert (np.diff(found) > 0).all()
    assert found[-1] > 0.9  # what is seen along the surface is fibres alone


@settings(max_examples=15, deadline=None)
@given(sheen=colour, roughness=st.floats(0, 1))
def test_a_white_ground_returns_all_light_whatever_the_sheen(sheen: Any, roughness: float) -> None:
    values = look(base_color=(1.0, 1.0, 1.0), sheen=sheen, roughness=roughness)
    found = albedo_table(MODEL, values, np.radians([0, 30, 60, 80, 88]))
    np.testing.assert_allclose(found, 1.0, atol=2.5e-3)


def test_without_sheen_it_is_matte_and_the_sheen_is_at_the_rim() -> None:
    angles = np.radians([0, 45, 80])
    matte = albedo_table(MODEL, look(base_color=(0.3, 0.2, 0.1), sheen=(0.0, 0.0, 0.0)), angles)
    np.testing.assert_allclose(matte, np.tile([0.3, 0.2, 0.1], (3, 1)), rtol=1e-3)
    velvet = albedo_table(MODEL, look(base_color=(0.05,) * 3, sheen=(0.8,) * 3, roughness=0.3), angles)
    assert velvet[2].min() > 4 * velvet[0].max()


def test_the_kept_curves_are_of_the_nearest_roughness_that_is_allowed() -> None:
    np.testing.assert_array_equal(MODEL.shape(look(roughness=0.0)), MODEL.shape(look(roughness=0.07)))
    assert not np.array_equal(MODEL.shape(look(roughness=0.2)), MODEL.shape(look(roughness=0.21)))
