"""The formulas of other programs' surfaces against our models where they say the same, and against energy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from studio_core.brdfs.albedo import flat_coefficients
from studio_core.exchange.reflectance import reflectance
from studio_core.exchange.surface import Surface
from studio_core.kernels.pairs import evaluate_pairs
from studio_core.params import defaults
from studio_plugins.brdfs.ggx_conductor import MODEL as CONDUCTOR
from studio_plugins.brdfs.lambert import MODEL as LAMBERT
from studio_plugins.brdfs.oren_nayar import MODEL as OREN_NAYAR
from studio_plugins.brdfs.ward import MODEL as WARD

RED = (0.8, 0.3, 0.1)


def pairs(count: int, seed: int = 0, lowest: float = 0.05) -> tuple[Any, Any]:
    rng = np.random.default_rng(seed)
    made = rng.normal(size=(2, count, 3))
    made[..., 2] = np.abs(made[..., 2]) + lowest
    made /= np.linalg.norm(made, axis=2, keepdims=True)
    return made[0], made[1]


def ours(brdf: Any, wi: Any, wo: Any, **values: Any) -> Any:
    whole = {**defaults(brdf.Params), **values}
    terms = evaluate_pairs(brdf, np.atleast_1d(brdf.shape(whole)), wo, wi)
    return terms @ flat_coefficients(brdf, whole)


def test_without_reflection_it_is_matte() -> None:
    wi, wo = pairs(200)
    found = reflectance(Surface(base_color=RED, specular=0.0, roughness=0.3), wi, wo)
    np.testing.assert_allclose(found, ours(LAMBERT, wi, wo, base_color=RED), rtol=1e-6)


@pytest.mark.parametrize("rough", [0.2, 1.0])
def test_rough_matte_is_oren_nayar(rough: float) -> None:
    wi, wo = pairs(400)
    found = reflectance(Surface(base_color=RED, specular=0.0, diffuse_roughness=rough), wi, wo)
    np.testing.assert_allclose(found, ours(OREN_NAYAR, wi, wo, base_color=RED, roughness=rough), rtol=2e-5)


@pytest.mark.parametrize("edge", [(1.0, 1.0, 1.0), (0.9, 0.5, 0.7)])
def test_metal_is_our_metal_where_facets_do_not_shadow_each_other(edge: Any) -> None:
    """Masking is separable here and correlated there; both vanish with roughness, away from the horizon."""
    wo, _ = pairs(400, 1, lowest=0.4)
    tilt = np.random.default_rng(2).normal(scale=0.05**2, size=(400, 3)) * [1, 1, 0]
    h = np.array([0, 0, 1.0]) + tilt
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    wi = 2 * (wo * h).sum(axis=1, keepdims=True) * h - wo
    found = reflectance(Surface(base_color=RED, metallic=1, roughness=0.05, edge_tint=edge), wi, wo)
    expected = ours(CONDUCTOR, wi, wo, base_color=RED, roughness=0.05, edge_tint=edge)
    np.testing.assert_allclose(found, expected, rtol=5e-3)


def test_the_wide_direction_is_across_our_grain() -> None:
    surface = Surface(metallic=1.0, roughness=0.3, anisotropy=0.5, anisotropy_rotation=110.0)
    wide, narrow = surface.alphas
    grain = {
        "diffuse": (0.0, 0.0, 0.0),
        "specular": (1.0, 1.0, 1.0),
        "roughness": (wide * narrow) ** 0.25,
        "anisotropy": (1 - narrow / wide) / 0.9,
        "direction": 20.0,
    }
    view = np.tile([0, 0, 1.0], (2, 1))
    for degrees in (20.0, 110.0):
        turn = np.radians([degrees, degrees + 90])
        light = np.stack([np.sin(0.3) * np.cos(turn), np.sin(0.3) * np.sin(turn), [np.cos(0.3)] * 2], 1)
        theirs, mine = reflectance(surface, light, view)[:, 0], ours(WARD, light, view, **grain)[:, 0]
        assert (theirs[1] > theirs[0]) == (mine[1] > mine[0])
        assert max(theirs.max() / theirs.min(), mine.max() / mine.min()) > 2


@pytest.mark.parametrize(
    "surface",
    [
        Surface(roughness=0.5),
        Surface(roughness=1.0, metallic=1.0),
        Surface(roughness=0.6, clearcoat=1.0, clearcoat_roughness=0.3),
        Surface(roughness=0.6, metallic=0.5, anisotropy=0.7, ior=2.0),
        Surface(roughness=0.9, sheen_color=(1.0, 0.5, 0.2), sheen_roughness=0.5, specular=0.0),
    ],
)
@pytest.mark.parametrize("angle", [0.0, 60.0, 80.0])
def test_no_more_light_leaves_than_arrives(surface: Surface, angle: float) -> None:
    """White all over; by glTF's own rules gloss gains up to 8 % at grazing angles."""
    z, turn = np.meshgrid((np.arange(200) + 0.5) / 200, 2 * np.pi * (np.arange(400) + 0.5) / 400)
    wi = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], -1).reshape(
        -1, 3
    )
    wo = np.broadcast_to([np.sin(np.radians(angle)), 0, np.cos(np.radians(angle))], wi.shape)
    albedo = 2 * np.pi * (reflectance(surface, wi, wo) * wi[:, 2:]).mean(axis=0)
    assert albedo.max() < 1.1
    assert albedo.min() > 0.25


def test_below_the_horizon_there_is_nothing() -> None:
    down = np.array([[0.6, 0, -0.8]])
    up = np.array([[0.6, 0, 0.8]])
    assert (reflectance(Surface(clearcoat=1.0), down, up) == 0).all()
    assert (reflectance(Surface(clearcoat=1.0), up, down) == 0).all()
    assert np.isfinite(reflectance(Surface(roughness=0.0, metallic=1.0), up, up)).all()
