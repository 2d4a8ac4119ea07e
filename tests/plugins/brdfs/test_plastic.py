"""Plastic: a ground under a skin."""

from __future__ import annotations

import numpy as np
import pytest

from studio_core.brdfs.albedo import quadrature_albedo
from studio_core.brdfs.promises import seen_from
from studio_core.params import defaults
from studio_plugins.brdfs.ggx_dielectric import MODEL as SKIN
from studio_plugins.brdfs.plastic import MODEL, Params, inside


def values(**changed: object) -> dict[str, object]:
    return {k: np.asarray(v, np.float32) for k, v in {**defaults(Params), **changed}.items()}


def furnace(**changed: object) -> np.ndarray:
    given = values(**changed)
    angles = np.radians([0, 40, 70, 85])
    wo = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], -1)
    return quadrature_albedo(MODEL, MODEL.shape(given), wo, 1e-5) @ MODEL.coefficients(given).astype(
        np.float64
    )


@pytest.mark.parametrize("ior", [1.01, 1.5, 3.0])
@pytest.mark.parametrize("roughness", [0.05, 0.3, 1.0])
@pytest.mark.parametrize("depth", [0.0, 1.0])
def test_a_white_ground_returns_everything(ior: float, roughness: float, depth: float) -> None:
    made = furnace(base_color=(1.0, 1.0, 1.0), ior=ior, roughness=roughness, depth=depth)
    np.testing.assert_allclose(made, 1.0, atol=1e-3)


def test_inside_reflections_are_those_of_index_one_and_a_half() -> None:
    """0.596: Egan & Hilgeman 1979, table of internal diffuse reflectance."""
    np.testing.assert_allclose(inside(1.5), 0.596, atol=1e-3)
    np.testing.assert_array_equal(inside(np.full((2, 3), 1.5)), np.full((2, 3), inside(1.5)))


def test_depth_saturates_and_leaves_black_and_white_alone() -> None:
    colour = (0.0, 0.5, 1.0)
    picked = MODEL.coefficients(values(base_color=colour, depth=0.0))[1]
    deep = MODEL.coefficients(values(base_color=colour, depth=1.0))[1]
    np.testing.assert_allclose(picked, colour, rtol=1e-6)
    f = float(inside(1.5))
    np.testing.assert_allclose(deep, [0, 0.5 * (1 - f) / (1 - 0.5 * f), 1], atol=1e-6)


def test_without_a_ground_it_is_the_clear_skin() -> None:
    given = values(roughness=0.4)
    np.testing.assert_array_equal(MODEL.shape(given)[:19], SKIN.shape(given))


@pytest.mark.parametrize("index", [1.1, 1.5, 2.5])
def test_many_shapes_at_a_time_are_nearly_the_same(index: float) -> None:
    rows = [{**defaults(Params), "ior": index, "roughness": r} for r in (0.0, 0.03, 0.2, 0.45, 0.8, 1.0)]
    wo = seen_from(np.radians([0, 30, 60, 80, 88]))
    for values, made in zip(rows, MODEL.shapes(rows), strict=True):
        expected = MODEL.shape(values)
        np.testing.assert_array_equal(made[:20], expected[:20])
        found, truth = (quadrature_albedo(MODEL, shape, wo, 1e-5) for shape in (made, expected))
        np.testing.assert_allclose(found, truth, atol=4e-4)
