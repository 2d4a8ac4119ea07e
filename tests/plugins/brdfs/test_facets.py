"""What one bounce between GGX facets returns, and the curves that stand for it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from oracles.brdf import unit

from studio_core.brdfs.quadrature import over_hemisphere
from studio_plugins.brdfs import facets
from studio_plugins.brdfs.curves import at

Array = npt.NDArray[np.float64]
MU = np.array([1.0, 0.8, 0.4, 0.1, 0.02])
ALPHAS = (0.01, 0.1, 0.4, 1.0)


def one_bounce(alpha: float, index: float) -> Array:
    """(N, 2) albedo of D G / (4 …) and of D G F / (4 …), by quadrature of the textbook's formula."""
    wo = np.stack([np.sqrt(1 - MU**2), 0 * MU, MU], -1)

    def g1(c: Array) -> Array:
        return 2 / (1 + np.sqrt(1 + alpha**2 * (1 - c**2) / c**2))

    def f(row: int, wi: npt.NDArray[np.float32]) -> Array:
        w, o = unit(wi), wo[row]
        h = unit(w + o)
        d = alpha**2 / (np.pi * (alpha**2 * h[:, 2] ** 2 + h[:, 0] ** 2 + h[:, 1] ** 2) ** 2)
        c = np.clip(h @ o, 0, 1)
        inside = np.sqrt(1 - (1 - c**2) / index**2)
        across, along = (
            (c - index * inside) / (c + index * inside),
            (index * c - inside) / (index * c + inside),
        )
        lobe = d * g1(w[:, 2]) * g1(o[2:]) / (4 * o[2])
        return np.stack([lobe, lobe * (across**2 + along**2) / 2], 1)

    return over_hemisphere(f, wo, 2e-6)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_one_bounce_is_the_integral_over_the_hemisphere(alpha: float) -> None:
    made = np.stack(facets.bounce(MU, alpha, 1.5), 1)
    np.testing.assert_allclose(made, one_bounce(alpha, 1.5), atol=1e-4)


@pytest.mark.parametrize("alpha", [1e-4, 1e-3, *ALPHAS])
def test_curves_follow_what_they_stand_for(alpha: float) -> None:
    mu = np.geomspace(1e-3, 1, 97)
    gap, passage = facets.missing(alpha), facets.mean_passage(alpha, 1.5)
    mirrors, reflected = facets.bounce(mu, alpha, 1.5)
    np.testing.assert_allclose(facets.left_out(gap.curve, mu), 1 - mirrors, atol=5e-4)
    np.testing.assert_allclose(at(passage, mu), 1 - reflected / mirrors, atol=2e-3)
    by_kernel = [facets.lost(np.float32(m), tuple(gap.curve)) for m in mu]
    np.testing.assert_allclose(by_kernel, facets.left_out(gap.curve, mu), atol=3e-6)


@pytest.mark.parametrize("alpha", [1e-3, 0.05, 0.5, 1.0])
def test_several_bounces_return_what_one_leaves_out(alpha: float) -> None:
    gap = facets.missing(alpha)
    mean = facets.hemispherical(lambda mu: facets.left_out(gap.curve, mu), alpha)
    np.testing.assert_allclose(np.pi * gap.share * mean, 1.0, rtol=1e-6)
    np.testing.assert_allclose(1 - gap.average, facets.average_bounce(np.sqrt(alpha)), atol=2e-5)


def test_the_kept_average_is_what_the_integrals_give() -> None:
    np.testing.assert_allclose(facets.AVERAGE, facets.fitted_average(), atol=2e-6)


@pytest.mark.parametrize("index", [1.01, 1.33, 1.5, 3.0])
def test_the_mean_of_fresnels_term(index: float) -> None:
    x, w = np.polynomial.legendre.leggauss(200)
    mu = (x + 1) / 2
    np.testing.assert_allclose(
        facets.mean_fresnel(index), (w * mu * facets.fresnel(mu, index)).sum(), atol=1e-6
    )
