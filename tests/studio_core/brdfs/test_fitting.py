"""Models fitted to measurements: back to what made them, through noise, and honest where they cannot be."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from oracles.brdf import ORACLES

from studio_core.brdfs.calls import evaluate
from studio_core.brdfs.fitting import fit
from studio_core.brdfs.half_difference import filled, grid
from studio_core.brdfs.samples import Samples, difference, of_table, predicted
from studio_core.errors import Cancelled, InputError
from studio_core.kernels.pairs import evaluate_pairs
from studio_core.params import defaults, param
from studio_core.scene.geometry import Table
from studio_core.shading.job import Job
from studio_plugins.brdfs.blinn_phong import MODEL as BLINN_PHONG
from studio_plugins.brdfs.ggx import MODEL as GGX
from studio_plugins.brdfs.lambert import MODEL as LAMBERT
from studio_plugins.brdfs.phong import MODEL as PHONG

SHAPE = (90, 12, 10)
STARTS = 16
PLASTIC = {"base_color": (0.7, 0.3, 0.1), "metallic": 0.0, "roughness": math.sqrt(0.2), "specular": 0.6}
COPPER = {"base_color": (0.9, 0.6, 0.3), "metallic": 1.0, "roughness": math.sqrt(1e-3), "specular": 0.5}


def table(model: str, values: dict[str, Any], noise: float = 0.0) -> Table:
    """What the float64 oracle of a model gives in the middle of every cell."""
    wi, wo = grid(SHAPE)
    known = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    made = np.zeros((*SHAPE, 3))
    made[known] = ORACLES[model](values, wo[known], wi[known])
    made *= np.random.default_rng(0).lognormal(0, noise, made.shape) if noise else 1.0
    return Table(filled(made, known))


def alpha(values: Any) -> float:
    return float(values["roughness"]) ** 2


@pytest.mark.parametrize("values", [PLASTIC, COPPER], ids=["alpha 0.2", "alpha 1e-3"])
def test_ggx_is_found_again(values: dict[str, Any]) -> None:
    found = fit(GGX, of_table(table("ggx", values)), starts=STARTS)
    assert alpha(found.values) == pytest.approx(alpha(values), rel=0.01)
    np.testing.assert_allclose(found.values["base_color"], values["base_color"], rtol=0.01)
    assert found.values["metallic"] == pytest.approx(values["metallic"], abs=0.01)
    assert found.difference.rmse < 1e-3
    assert found.difference.metric < 1e-4


@pytest.mark.parametrize("model", [PHONG, BLINN_PHONG], ids=lambda m: m.id)
def test_two_lobes_are_found_again(model: Any) -> None:
    values = {"diffuse": (0.3, 0.2, 0.05), "specular": (0.1, 0.05, 0.02), "exponent": 2000.0}
    found = fit(model, of_table(table(model.id, values)), starts=STARTS).values
    assert found["exponent"] == pytest.approx(2000, rel=0.01)
    np.testing.assert_allclose(found["diffuse"], values["diffuse"], rtol=0.01)
    np.testing.assert_allclose(found["specular"], values["specular"], rtol=0.01)


def test_noise_is_averaged_out_and_told() -> None:
    noisy = of_table(table("ggx", PLASTIC, noise=0.2))
    found = fit(GGX, noisy, starts=STARTS)
    assert alpha(found.values) == pytest.approx(0.2, rel=0.05)
    np.testing.assert_allclose(found.values["base_color"], PLASTIC["base_color"], rtol=0.05)
    truth = difference(predicted(GGX, PLASTIC, noisy), noisy)
    assert found.difference.metric == pytest.approx(truth.metric, rel=0.02)
    assert found.difference.metric <= truth.metric


def test_a_model_that_cannot_says_so() -> None:
    samples = of_table(table("ggx", PLASTIC))
    matte, shiny = (fit(model, samples, starts=STARTS) for model in (LAMBERT, PHONG))
    own = difference(predicted(GGX, PLASTIC, samples), samples)
    assert own.metric < 1e-6 < shiny.difference.metric < matte.difference.metric
    assert matte.difference.rmse > 0.3
    assert matte.by_half["0–1"].bias < -0.5  # its highlight is missing
    assert matte.by_half["45–90"].bias > 0.5  # and is made up for where there is none
    assert sum(part.count for part in matte.by_view.values()) == len(samples)


def test_the_difference_is_what_it_says() -> None:
    samples = of_table(table("phong", defaults(PHONG.Params))).some(40)
    found = predicted(LAMBERT, defaults(LAMBERT.Params), samples)
    bent = off = size = tilt = whole = 0.0
    for wi, weight, truth, made in zip(samples.wi, samples.weight, samples.values, found, strict=True):
        for a, b in zip(made, truth, strict=True):
            bent += weight * (math.log(1 + wi[2] * a) - math.log(1 + wi[2] * b)) ** 2
            off, size = off + weight * (wi[2] * (a - b)) ** 2, size + weight * (wi[2] * b) ** 2
            tilt, whole = tilt + weight * wi[2] * (a - b), whole + weight * wi[2] * b
    told = difference(found, samples)
    assert told.metric == pytest.approx(math.sqrt(bent / (3 * samples.weight.sum())), rel=1e-6)
    assert told.rmse == pytest.approx(math.sqrt(off / size), rel=1e-6)
    assert told.bias == pytest.approx(tilt / whole, rel=1e-6)


def test_samples_are_cells_above_the_surface() -> None:
    values = np.random.default_rng(0).random((*SHAPE, 3)).astype(np.float32)
    samples = of_table(Table(values))
    assert len(samples) > 3000
    assert samples.wi[:, 2].min() > 0
    assert samples.wo[:, 2].min() > 0
    np.testing.assert_allclose(np.linalg.norm(samples.wi, axis=1), 1, atol=1e-6)
    assert samples.weight.mean() == pytest.approx(1)
    pool = {tuple(row) for row in values.reshape(-1, 3)}
    assert {tuple(row) for row in samples.values.astype(np.float32)} <= pool


def test_pairs_are_the_kernel_one_by_one() -> None:
    samples = of_table(table("ggx", PLASTIC)).some(20)
    shape = GGX.shape(PLASTIC)
    found = evaluate_pairs(GGX, shape, samples.wo, samples.wi)
    for wo, wi, row in zip(samples.wo, samples.wi, found, strict=True):
        np.testing.assert_allclose(evaluate(GGX, shape, wo, wi[None])[0], row, rtol=1e-6)
    assert evaluate_pairs(LAMBERT, LAMBERT.shape({}), samples.wo, samples.wi).shape == (20, 1)


@dataclass(frozen=True)
class _Params:
    base_color: Any = param((0.5, 0.5, 0.5), "Colour", low=0.0, high=1.0)
    dark: bool = param(False, "Dark")
    side: str = param("left", "Side", choices=("left", "right"))
    name: str = param("", "Name")


class _Flagged:
    """Lambert that a flag lets be bright."""

    id, label, Params, terms = "flagged", "Flagged", _Params, 1
    textures: tuple[str, ...] = ()
    address = property(lambda self: LAMBERT.address)

    def shape(self, values: Any) -> npt.NDArray[np.float32]:
        return np.array([1.0 if values["dark"] else 10.0, values["side"] == "right"], np.float32)

    def coefficients(self, values: Any) -> npt.NDArray[np.float32]:
        return LAMBERT.coefficients({"base_color": values["base_color"]})


def test_flags_and_lists_are_tried() -> None:
    asked = set()

    class Watched(_Flagged):
        def shape(self, values: Any) -> npt.NDArray[np.float32]:
            asked.add((values["dark"], values["side"], values["name"]))
            return super().shape(values)

    plain = {"diffuse": (0.4, 0.4, 0.4), "specular": (0.0, 0.0, 0.0), "exponent": 10.0}
    samples = of_table(table("phong", plain)).some(200)
    found = fit(Watched(), samples, fixed={"name": "mine"})
    assert asked == {(dark, side, "mine") for dark in (False, True) for side in ("left", "right")}
    assert found.values["base_color"] == pytest.approx((0.4, 0.4, 0.4), rel=1e-3)


def test_what_is_fixed_stays() -> None:
    samples = of_table(table("ggx", PLASTIC))
    found = fit(GGX, samples, fixed={"roughness": 0.8, "metallic": 0.25}, starts=4)
    assert (found.values["roughness"], found.values["metallic"]) == (0.8, 0.25)
    free = fit(GGX, samples, starts=STARTS)
    assert found.difference.metric > 10 * free.difference.metric


def test_the_report_is_plain_and_the_material_keeps_its_tables() -> None:
    measured = table("phong", {"diffuse": (0.4, 0.4, 0.4), "specular": (0.0, 0.0, 0.0), "exponent": 10.0})
    found = fit(LAMBERT, of_table(measured))
    report = json.loads(json.dumps(found.report(), allow_nan=False))
    assert report["model"] == "lambert"
    assert report["values"]["base_color"] == pytest.approx([0.4, 0.4, 0.4], rel=1e-3)
    assert report["metric"] < 1e-4
    made = found.material("Wall")
    assert (made.name, made.model, dict(made.values)) == ("Wall", "lambert", dict(found.values))


def test_nothing_to_fit_to_and_cancelling() -> None:
    dark = Samples(*(np.ones((20, 3), np.float32) for _ in range(2)), np.zeros((20, 3)), np.ones(20))
    with pytest.raises(InputError, match="nothing to fit"):
        fit(LAMBERT, dark)
    job = Job("fit")
    job.cancel()
    with pytest.raises(Cancelled):
        fit(GGX, of_table(table("ggx", PLASTIC)), job=job)
