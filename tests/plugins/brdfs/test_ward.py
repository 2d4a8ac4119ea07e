"""Ward's highlight and the direction of its grain."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.brdfs.albedo import quadrature_albedo
from studio_core.brdfs.calls import evaluate
from studio_core.params import defaults
from studio_plugins.brdfs.ward import MODEL, Params


def lobe(turn: float, tilt: float, **changed: Any) -> float:
    """The highlight seen from above, of light tilted in an azimuth."""
    values = {**defaults(Params), "roughness": 0.5, **changed}
    wi = [[np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)]]
    return float(evaluate(MODEL, MODEL.shape(values), (0, 0, 1), wi)[0, 1])


def test_brushed_metal_shines_across_its_grain() -> None:
    along, across = lobe(0.0, 0.4, anisotropy=0.8), lobe(np.pi / 2, 0.4, anisotropy=0.8)
    assert across > 3 * along


@settings(max_examples=50, deadline=None)
@given(angle=st.floats(-180, 180), turn=st.floats(0, 2 * np.pi))
def test_turning_the_grain_turns_the_highlight(angle: float, turn: float) -> None:
    turned = lobe(turn + np.radians(angle), 0.3, anisotropy=0.9, direction=angle)
    np.testing.assert_allclose(turned, lobe(turn, 0.3, anisotropy=0.9), rtol=1e-3)


@pytest.mark.parametrize("roughness", [0.1, 0.4, 0.7, 1.0])
def test_the_highlight_returns_at_most_all_light_from_any_side(roughness: float) -> None:
    theta, turn = np.radians(np.linspace(0, 89.5, 12)), np.linspace(0, np.pi, 12)
    wo = np.stack([np.sin(theta) * np.cos(turn), np.sin(theta) * np.sin(turn), np.cos(theta)], -1)
    shape = MODEL.shape({**defaults(Params), "roughness": roughness, "anisotropy": 1.0})
    assert quadrature_albedo(MODEL, shape, wo, 3e-5)[:, 1].max() <= 1.001
