"""GGX where it is sharpest, and what its parameters mean."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.brdf import unit

from studio_core.brdfs.albedo import quadrature_albedo
from studio_core.brdfs.promises import seen_from
from studio_core.kernels import brdf
from studio_core.params import defaults
from studio_plugins.brdfs.facets import bounce, missing, surviving
from studio_plugins.brdfs.ggx import MODEL, Params


def values(**changed: object) -> dict[str, object]:
    return {k: np.asarray(v, np.float32) for k, v in {**defaults(Params), **changed}.items()}


def test_a_dielectric_reflects_four_per_cent_head_on() -> None:
    np.testing.assert_allclose(MODEL.coefficients(values())[1], 0.04, rtol=1e-6)


def test_a_metal_has_no_matte_part_and_its_own_colour() -> None:
    made = MODEL.coefficients(values(metallic=1.0, base_color=(0.9, 0.6, 0.2)))
    assert not made[0].any()
    np.testing.assert_allclose(made[1], [0.9, 0.6, 0.2], rtol=1e-6)


def test_roughness_is_squared_and_has_a_floor() -> None:
    assert MODEL.shape({"roughness": 0.5})[0] == np.float32(0.25)
    assert MODEL.shape({"roughness": 0.0})[0] == np.float32(1e-4)


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.35, 0.7, 1.0])
@pytest.mark.parametrize("metallic", [0.0, 1.0])
@pytest.mark.parametrize("specular", [0.0, 1.0])
def test_white_returns_all_light(roughness: float, metallic: float, specular: float) -> None:
    white = {"base_color": (1.0, 1.0, 1.0), "metallic": metallic, "specular": specular}
    look = {**defaults(Params), **white, "roughness": roughness}
    wo = seen_from(np.radians([0, 30, 60, 80, 88.5]))
    found = quadrature_albedo(MODEL, MODEL.shape(look), wo, 1e-5) @ MODEL.coefficients(values(**look))
    np.testing.assert_allclose(found, 1.0, atol=1e-3)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.5, 0.7, 0.85, 1.0])
def test_a_metals_bounces_have_nearly_the_colour_of_kulla_and_conty(roughness: float) -> None:
    """Their F_ms with F̄ = F0 + (1 − F0) / 21, times all that one bounce leaves out."""
    f0, alpha = np.linspace(0, 1, 101), roughness**2
    mu = np.concatenate([np.geomspace(1e-3, 0.1, 9), np.linspace(0.15, 1, 12)])
    missed, mean = 1 - bounce(mu, alpha)[0], f0 + (1 - f0) / 21
    gap = missing(alpha)
    truth = surviving(mean, 1 - gap.average)
    shape = MODEL.shape({"roughness": roughness})
    grey = np.repeat(f0[:, None], 3, axis=1)
    made = MODEL.coefficients(values(base_color=grey, metallic=np.ones(101)))[..., 0]
    kept = (shape[1] * made[:, 1] + shape[2] * made[:, 3]) / gap.share
    assert np.abs((kept - truth)[:, None] * missed).max() < 0.01
    np.testing.assert_allclose(kept[-1], 1, rtol=1e-5)
    assert (np.diff(kept) > 0).all()


@pytest.mark.parametrize("roughness", [0.3, 1.0])
def test_without_bounces_a_white_metal_returns_what_one_does(roughness: float) -> None:
    look = {**defaults(Params), "base_color": (1.0, 1.0, 1.0), "metallic": 1.0, "roughness": roughness}
    look["keep_energy"] = False
    angles = np.radians([0, 45, 80])
    found = quadrature_albedo(MODEL, MODEL.shape(look), seen_from(angles), 1e-5)
    found = found @ MODEL.coefficients(values(**look))
    np.testing.assert_allclose(found[:, 0], bounce(np.cos(angles), roughness**2)[0], atol=2e-4)


def test_colours_do_not_depend_on_the_roughness_and_dielectrics_are_lines() -> None:
    shown = [MODEL.coefficients(values(roughness=r, metallic=0.7)) for r in (0.0, 0.4, 1.0)]
    np.testing.assert_array_equal(shown[0], shown[1])
    np.testing.assert_array_equal(shown[0], shown[2])
    level = np.linspace(0, 1, 11)
    for name in ("specular", "base_color"):
        varied = level if name == "specular" else np.repeat(level[:, None], 3, axis=1)
        made = MODEL.coefficients({**values(), name: varied.astype(np.float32)})
        np.testing.assert_allclose(made, made[:1] + (made[-1:] - made[:1]) * level[:, None, None], atol=1e-6)


@pytest.mark.parametrize("alpha", [1e-6, 1e-4, 1e-2, 0.3, 1.0])
@pytest.mark.parametrize("theta", [0.0, 0.3, 1.0, 1.5])
def test_the_distribution_is_exact_when_sharp(alpha: float, theta: float) -> None:
    for offset in (0.0, 0.5 * alpha, 3 * alpha):
        o = np.array([np.sin(theta), 0, np.cos(theta)])
        m = np.array([np.sin(offset), 0, np.cos(offset)])
        x, y, z = (np.float32(c) for c in 1.7 * m)
        made = brdf.ggx_distribution(x, y, z, np.float32(alpha))
        truth = alpha**2 / (np.pi * (alpha**2 * np.cos(offset) ** 2 + np.sin(offset) ** 2) ** 2)
        np.testing.assert_allclose(made, truth, rtol=1e-5)
        masked = brdf.smith_factor(np.float32(o[2]), np.float32(alpha))
        c = float(np.float32(o[2]))
        g1 = 2 / (1 + np.sqrt(1 + alpha**2 * (1 - c**2) / c**2))
        np.testing.assert_allclose(masked, g1 / (2 * c), rtol=1e-5)


def test_smith_masking_balances_the_visible_facets() -> None:
    """∫ D G1 ⟨ω·m⟩ dm = cos θ for every direction (Walter et al. 2007, eq. 25 and Heitz 2014, eq. 9)."""
    alpha = 0.4
    t, wt = np.polynomial.legendre.leggauss(200)
    p, wp = np.polynomial.legendre.leggauss(200)
    theta, phi = (t + 1) * np.pi / 4, (p + 1) * np.pi
    m = np.stack(
        [
            np.outer(np.sin(theta), np.cos(phi)),
            np.outer(np.sin(theta), np.sin(phi)),
            np.outer(np.cos(theta), 1 + 0 * phi),
        ],
        -1,
    )
    weight = np.outer(wt * np.pi / 4 * np.sin(theta), wp * np.pi)
    d = np.vectorize(lambda x, y, z: brdf.ggx_distribution(x, y, z, np.float32(alpha)))(
        *np.moveaxis(m.astype(np.float32), -1, 0)
    )
    for angle in (0.0, 0.7, 1.3):
        o = unit(np.array([np.sin(angle), 0, np.cos(angle)]))
        g1 = 2 * o[2] * brdf.smith_factor(np.float32(o[2]), np.float32(alpha))
        np.testing.assert_allclose((d * g1 * np.clip(m @ o, 0, None) * weight).sum(), o[2], rtol=2e-3)
