"""Metals: colours head-on and at the edge, and nothing lost."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.brdfs.albedo import quadrature_albedo
from studio_core.params import defaults
from studio_plugins.brdfs.ggx_conductor import MODEL, Params

share = st.floats(0, 1, width=32)


def values(**changed: object) -> dict[str, object]:
    return {k: np.asarray(v, np.float32) for k, v in {**defaults(Params), **changed}.items()}


def fresnel(u: float, f0: float, edge: float) -> float:
    c = MODEL.coefficients(values(base_color=(f0,) * 3, edge_tint=(edge,) * 3))[:, 0].astype(np.float64)
    away = (1 - u) ** 5
    return float(c[0] * (1 - away) + c[1] * away + c[2] * u * (1 - u) * away)


@settings(deadline=None)
@given(f0=st.floats(0.4, 1), edge=st.floats(0.3, 1))
def test_the_edge_tint_is_the_share_of_schlicks_curve_at_82_degrees(f0: float, edge: float) -> None:
    schlick = f0 + (1 - f0) * (6 / 7) ** 5
    np.testing.assert_allclose(fresnel(1 / 7, f0, edge), edge * schlick, rtol=1e-4)
    np.testing.assert_allclose(fresnel(1.0, f0, edge), f0, rtol=1e-5)
    np.testing.assert_allclose(fresnel(0.0, f0, edge), 1.0, rtol=1e-5)


@settings(deadline=None)
@given(f0=share, edge=share, u=share)
def test_reflection_stays_between_none_and_all(f0: float, edge: float, u: float) -> None:
    assert -1e-5 <= fresnel(u, f0, edge) <= 1 + 1e-5


@pytest.mark.parametrize("roughness", [0.0, 0.2, 0.6, 1.0])
def test_a_white_metal_returns_everything(roughness: float) -> None:
    given = values(base_color=(1.0, 1.0, 1.0), roughness=roughness)
    angles = np.radians([0, 40, 70, 85])
    wo = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], -1)
    found = quadrature_albedo(MODEL, MODEL.shape(given), wo, 1e-5) @ MODEL.coefficients(given).astype(
        np.float64
    )
    np.testing.assert_allclose(found, 1.0, atol=1e-3)
