from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import pytest
from oracles.brdf import ORACLES
from oracles.brdf import albedo as oracle_albedo

from studio_core.brdfs import albedo as albedo_module
from studio_core.brdfs.albedo import albedo_table, mean_albedo, quadrature_albedo, term_albedo
from studio_core.brdfs.calls import evaluate
from studio_core.params import defaults


def model_of(name: str) -> Any:
    return importlib.import_module(f"studio_plugins.brdfs.{name}").MODEL


ANGLES = np.radians([0, 20, 45, 70, 85, 89])
CASES = [
    ("lambert", {}),
    ("phong", {"exponent": 1.0}),
    ("phong", {"exponent": 1e5}),
    ("blinn_phong", {"exponent": 1e5}),
    ("blinn_phong", {"exponent": 20.0}),
    ("ggx", {"roughness": 1e-3, "metallic": 1.0}),
    ("ggx", {"roughness": 0.3}),
    ("ggx", {"roughness": 1.0, "metallic": 0.5}),
]


@pytest.mark.parametrize(("name", "values"), CASES, ids=str)
def test_table_is_the_float64_oracle(name: str, values: dict[str, Any]) -> None:
    model = model_of(name)
    made = {**defaults(model.Params), **values}
    wo = np.stack([np.sin(ANGLES), 0 * ANGLES, np.cos(ANGLES)], 1)
    oracle = ORACLES[model.id]
    truth = oracle_albedo(lambda row, wi: oracle(made, wo[row], wi), wo, 2e-6)
    table = albedo_table(model, made, ANGLES)
    assert table.shape == (6, 3)
    np.testing.assert_allclose(table, truth, rtol=1e-3, atol=1e-4)


def test_a_change_of_colour_evaluates_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of("ggx")
    values = {**defaults(model.Params), "roughness": 0.4321}
    first = albedo_table(model, values, ANGLES)
    monkeypatch.setattr(albedo_module, "quadrature_albedo", None)
    again = albedo_table(model, {**values, "base_color": (0.2, 0.4, 0.8)}, ANGLES)
    assert again[0, 2] > again[0, 0]
    assert first[0, 0] > again[0, 0]


def test_mean_albedo_of_white_is_one() -> None:
    model = model_of("lambert")
    np.testing.assert_allclose(mean_albedo(model, {"base_color": (1.0, 0.5, 0.0)}), [1, 0.5, 0], atol=2e-3)


def test_what_is_kept_is_not_written_to() -> None:
    model = model_of("lambert")
    kept = term_albedo(model, np.zeros(0, np.float32), ANGLES)
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 2


def test_straight_along_the_surface_is_close_to_it() -> None:
    model = model_of("lambert")
    flat = np.zeros(0, np.float32)
    edge = term_albedo(model, flat, np.radians([89.9, 90.0]))
    assert edge[1] == edge[0]
    np.testing.assert_allclose(edge, np.pi, rtol=1e-3)


def test_quadrature_takes_any_azimuth() -> None:
    model = model_of("ggx")
    shape = model.shape({**defaults(model.Params), "roughness": 0.2})
    wo = np.array([[0.6, 0, 0.8], [-0.36, 0.48, 0.8]])
    made = quadrature_albedo(model, shape, wo, 1e-5)
    np.testing.assert_allclose(made[0], made[1], rtol=1e-3)


@pytest.mark.parametrize("wrong", [np.zeros(3), np.zeros((2, 2)), np.zeros((3, 4))])
def test_directions_of_another_form_are_refused(wrong: Any) -> None:
    model = model_of("lambert")
    with pytest.raises(ValueError, match="expected"):
        evaluate(model, np.zeros(0, np.float32), [0, 0, 1], wrong)
    with pytest.raises(ValueError, match="one direction"):
        evaluate(model, np.zeros(0, np.float32), [[0, 0, 1]], np.zeros((1, 3)))
