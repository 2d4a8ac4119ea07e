"""The measured model draws where its table is bright."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles.brdf import ggx, unit

from studio_core.brdfs.calls import density, evaluate, sample
from studio_core.brdfs.chi_square import chi_square
from studio_core.brdfs.half_difference import grid
from studio_core.brdfs.promises import hard_directions, seen_from, weight_bound
from studio_core.kernels.half_angles import BINS, cumulative
from studio_core.params import defaults
from studio_core.scene.geometry import Table
from studio_plugins.brdfs.measured import MODEL, SLOT

DEFAULTS = defaults(MODEL.Params)


def glossy(roughness: float) -> Table:
    wi, wo = (unit(w) for w in grid((64, 12, 6)))
    values = {"base_color": (0.9, 0.5, 0.2), "metallic": 1.0, "roughness": roughness, "specular": 0.5}
    above = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    return Table((above[..., None] * ggx(values, wo, wi)).astype(np.float32))


@pytest.mark.parametrize("roughness", [0.12, 0.5])
@pytest.mark.parametrize("degrees", [3, 50, 85])
def test_draws_as_often_as_it_says(roughness: float, degrees: float) -> None:
    table = glossy(roughness)
    shape = MODEL.shape_of(DEFAULTS, {SLOT: table})
    found = chi_square(MODEL, shape, seen_from(np.radians(degrees), 0.7), 1, 40_000, int(degrees))
    print(found)
    assert found.p > 1e-3 / 6


@pytest.mark.parametrize("roughness", [0.12, 0.5])
def test_glossy_tables_are_drawn_well(roughness: float) -> None:
    table = glossy(roughness)
    shape = MODEL.shape_of(DEFAULTS, {SLOT: table})
    wo, rng = seen_from(0.6, 0.7), np.random.default_rng(1)
    wi = sample(MODEL, shape, wo, 0, rng.random((20_000, 2), np.float32))
    wi = wi[wi[:, 2] > 0]
    own = evaluate(MODEL, shape, wo, wi)[:, 0] * wi[:, 2] / density(MODEL, shape, wo, wi)[:, 0]
    plain = evaluate(MODEL, shape, wo, cosine(rng))[:, 0] * np.pi
    assert own.std() / own.mean() < 1.5
    assert own.std() / own.mean() < plain.std() / plain.mean() / (1.2 if roughness > 0.3 else 8)
    others = hard_directions(400)
    u = rng.random((500, 2), np.float32)
    for at in seen_from(np.radians([0, 45, 80]), 0.7):
        assert weight_bound(MODEL, shape, at, 0, u, others) < 16


def cosine(rng: np.random.Generator) -> Any:
    a, b = rng.random((2, 20_000))
    r, phi = np.sqrt(a), 2 * np.pi * b
    return np.stack([r * np.cos(phi), r * np.sin(phi), np.sqrt(1 - a)], -1)


@pytest.mark.parametrize("heights", [np.zeros(5), np.ones(1), np.r_[1e6, np.zeros(89)], np.ones(300)])
def test_every_bin_has_a_share(heights: Any) -> None:
    table = cumulative(heights)
    assert table[0] == 0
    assert table[-1] == 1
    assert (np.diff(table) > 0.09 / BINS).all()


def test_an_even_lobe_is_drawn_by_the_cosine() -> None:
    edges = np.sin(np.pi / 2 * (np.arange(BINS + 1) / BINS) ** 2) ** 2
    expected = 0.9 * edges + 0.1 * np.arange(BINS + 1) / BINS
    np.testing.assert_allclose(cumulative(np.ones(90)), expected, atol=1e-6)
