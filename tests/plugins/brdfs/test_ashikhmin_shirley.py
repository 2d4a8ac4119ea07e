"""Ashikhmin and Shirley's coat: its grain, its rise towards the edge, and that the parts share the light."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.brdfs.albedo import albedo_table, quadrature_albedo
from studio_core.brdfs.calls import evaluate
from studio_core.brdfs.promises import seen_from
from studio_core.params import defaults
from studio_plugins.brdfs.ashikhmin_shirley import MODEL, Params
from studio_plugins.brdfs.blinn_phong import MODEL as BLINN


def look(**changed: Any) -> dict[str, Any]:
    return {**defaults(Params), **changed}


def lobe(turn: float, tilt: float, **changed: Any) -> float:
    """F0's term of light tilted in an azimuth, seen from above."""
    wi = [[np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)]]
    return float(evaluate(MODEL, MODEL.shape(look(**changed)), (0, 0, 1), wi)[0, 1])


def test_the_highlight_is_stretched_across_the_grain() -> None:
    sharp = {"sharpness_along": 500.0, "sharpness_across": 20.0}
    assert lobe(np.pi / 2, 0.3, **sharp) > 20 * lobe(0.0, 0.3, **sharp)


@settings(max_examples=50, deadline=None)
@given(angle=st.floats(-180, 180), turn=st.floats(0, 2 * np.pi))
def test_turning_the_grain_turns_the_highlight(angle: float, turn: float) -> None:
    turned = lobe(turn + np.radians(angle), 0.2, direction=angle)
    np.testing.assert_allclose(turned, lobe(turn, 0.2), rtol=2e-3)


@settings(max_examples=30, deadline=None)
@given(n=st.floats(1, 1e5), tilt=st.floats(0, 1.5), turn=st.floats(0, 6.28))
def test_without_a_grain_it_is_blinns_lobe_of_facets(n: float, tilt: float, turn: float) -> None:
    """Both are (n·h)^n times what depends on angles and n alone."""
    wi = np.array([[np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)]])
    made = evaluate(MODEL, MODEL.shape(look(sharpness_along=n, sharpness_across=n)), (0, 0, 1), wi)[0]
    shape = BLINN.shape({**defaults(BLINN.Params), "exponent": n})
    blinn = evaluate(BLINN, shape, (0, 0, 1), wi)[0, 1]
    half = np.cos(tilt / 2)
    expected = blinn / float(shape[1]) * (n + 1) / (8 * np.pi * half)  # seen head-on, max(…) is 1
    np.testing.assert_allclose(made[1] + made[2], expected, rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("along", [1.0, 30.0, 1e5])
@pytest.mark.parametrize("across", [1.0, 100.0])
def test_the_coat_returns_at_most_all_light_from_any_side(along: float, across: float) -> None:
    shape = MODEL.shape(look(sharpness_along=along, sharpness_across=across))
    wo = seen_from(np.radians(np.linspace(0, 89.5, 10)), np.linspace(0, np.pi, 10))
    found = quadrature_albedo(MODEL, shape, wo, 3e-5)
    assert (found[:, 1] + found[:, 2]).max() <= 1.0005


def test_what_the_coat_reflects_is_missing_below_it() -> None:
    angles = np.radians([0, 60, 80])
    sharp = {"sharpness_along": 1e4, "sharpness_across": 1e4, "diffuse": (1.0,) * 3}
    for f0 in (0.04, 0.5, 0.9):
        found = albedo_table(MODEL, look(**sharp, specular=(f0,) * 3), angles)
        assert found.max() <= 1.0005
        assert found[0].min() > 0.96
