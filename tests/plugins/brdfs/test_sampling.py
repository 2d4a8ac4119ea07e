"""What every model that draws directions must hold: bundled ones, and those of installed plugins."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
import pytest
from brdf_models import BUNDLED, MODELS
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.brdf import unit
from oracles.sampling import DENSITIES, visible_normal

from studio_core.brdfs.albedo import quadrature_albedo
from studio_core.brdfs.calls import density, evaluate, is_sampled, sample
from studio_core.brdfs.chi_square import chi_square
from studio_core.brdfs.promises import hard_directions, seen_from, weight_bound
from studio_core.brdfs.ranges import shaped, shapes, shaping
from studio_core.params import defaults

SAMPLED = {name: model for name, model in MODELS.items() if is_sampled(model)}
every_model = pytest.mark.parametrize("model", SAMPLED.values(), ids=SAMPLED.keys())
GGX = ("ggx", "ggx-conductor", "ggx-dielectric", "plastic")
FRACTIONS = (0.0, 0.35, 1.0)
ANGLES = np.radians([0.5, 50, 80, 89])
MOST = 16.0  # times what a perfect draw would weigh
EDGES = [(a, b) for a in (0, 1e-30, 1e-7, 0.5, 1 - 2**-24) for b in (0, 0.25, 0.5, 1 - 2**-24)]

component = st.one_of(
    st.sampled_from([0.0, 1e-45, 1e-38, 1e-20, 1e-7, 1e-4, 1.0]), st.floats(-1, 1, width=32)
)
fraction = st.one_of(st.sampled_from([0.0, 1e-38, 1e-7, 1.0]), st.floats(0, 1))
number = st.one_of(st.sampled_from([0.0, 1e-30, 0.5, 1 - 2**-24]), st.floats(0, 1 - 2**-24, width=32))


@st.composite
def any_direction(draw: Any) -> Any:
    """A unit vector, often grazing, sometimes below the surface."""
    v = np.array([draw(component) for _ in range(3)], np.float64)
    length = np.linalg.norm(v)
    return (v / length if length > 1e-3 else np.array([1, 0, 0])).astype(np.float32)


def lobes(model: Any, shape: Any) -> list[int]:
    """One term of each density."""
    wi = hard_directions(64)
    drawn = density(model, shape, seen_from(0.7, 0.3), wi)
    found: list[int] = []
    for k in range(model.terms):
        if not any(np.array_equal(drawn[:, k], drawn[:, j]) for j in found):
            found.append(k)
    return found


@pytest.mark.parametrize("name", BUNDLED)
def test_models_that_must_draw_do(name: str) -> None:
    assert name in SAMPLED


@every_model
def test_draws_as_often_as_it_says(model: Any) -> None:
    made = {}
    for values in shapes(model, FRACTIONS, mixed=2):
        shape = model.shape(values)
        for number_of, wo in enumerate(seen_from(ANGLES, 0.7)):
            for term in lobes(model, shape):
                seed = zlib.crc32(f"{model.id} {list(shape[:8])} {number_of} {term}".encode())
                found = chi_square(model, shape, wo, term, 20_000, seed)
                made[(term, round(float(np.degrees(ANGLES[number_of]))), tuple(shape[:4]))] = found
                assert 0 < found.expected < 1.005
                assert found.freedom >= 5
    worst = min(made, key=lambda at: made[at].p)
    print(f"{model.id}: least p of {len(made)} is {made[worst].p:.3g}, {worst}: {made[worst]}")
    assert made[worst].p * len(made) > 1e-3, (worst, made[worst])  # Bonferroni


@every_model
def test_weights_are_bounded(model: Any) -> None:
    rng = np.random.default_rng(3)
    u = np.concatenate([rng.random((1500, 2), np.float32), np.array(EDGES, np.float32)])
    for values in shapes(model, FRACTIONS, mixed=2):
        shape = model.shape(values)
        for wo in seen_from(np.radians([0, 45, 80, 89, 89.9]), 0.7):
            for term in range(model.terms):
                assert weight_bound(model, shape, wo, term, u, hard_directions(500)) < MOST, (
                    values,
                    wo,
                    term,
                )


@every_model
@settings(max_examples=60, deadline=None)
@given(data=st.data(), wo=any_direction(), u=st.lists(st.tuples(number, number), min_size=1))
def test_is_finite_and_of_length_one(model: Any, data: Any, wo: Any, u: Any) -> None:
    names = shaping(model)[0]
    shape = model.shape(shaped(model, *(data.draw(fraction, name) for name in names), 0.0))
    for term in range(model.terms):
        wi = sample(model, shape, wo, term, np.array(u, np.float32))
        assert np.isfinite(wi).all()
        up = wi[:, 2] > 0
        np.testing.assert_allclose(np.linalg.norm(wi[up].astype(np.float64), axis=1), 1, atol=3e-6)
        mirror = (wo * [-1, -1, 1])[None]
        drawn = density(model, shape, wo, np.concatenate([wi, wo[None], mirror, -wi]))
        assert np.isfinite(drawn).all()
        assert (drawn >= 0).all()
        below = np.concatenate([wi, wo[None], mirror, -wi])[:, 2] <= 0
        assert not drawn[below].any()
        if wo[2] <= 0:
            assert not up.any()
            assert not drawn.any()


@every_model
def test_drawn_directions_are_worth_drawing(model: Any) -> None:
    """The mean of term × cosine / density is the term's albedo by quadrature, which knows of no draws."""
    shape = model.shape(shaped(model, 0.9))
    wo = seen_from(0.8, 0.4)
    rng = np.random.default_rng(11)
    truth = quadrature_albedo(model, shape, wo, 1e-6)[0]
    for term in range(model.terms):
        wi = sample(model, shape, wo, term, rng.random((20_000, 2), np.float32))
        wi = np.where(wi[:, 2:] > 0, wi, np.array([0, 0, -1], np.float32))
        drawn = density(model, shape, wo, wi)[:, term].astype(np.float64)
        value = evaluate(model, shape, wo, wi)[:, term] * wi[:, 2]
        weight = np.divide(value, drawn, out=np.zeros_like(drawn), where=drawn > 0)
        off = 5 * weight.std() / np.sqrt(len(weight)) + 2e-3 * truth[term]
        assert abs(weight.mean() - truth[term]) <= off, term


@pytest.mark.parametrize("name", DENSITIES)
@settings(max_examples=40, deadline=None)
@given(at=st.floats(0, 1), seed=st.integers(0, 2**32 - 1))
def test_density_is_the_oracle(name: str, at: float, seed: int) -> None:
    model = MODELS[name]
    values = shaped(model, at)
    shape = model.shape(values)
    w = hard_directions(16, seed)
    steep = np.minimum(w[:16, 2], w[16:, 2]) > 0.2
    for wo in w[:16][steep]:
        u = np.random.default_rng(seed).random((8, 2), np.float32)
        drawn = np.concatenate([sample(model, shape, wo, k, u) for k in range(model.terms)])
        wi = np.concatenate([drawn[drawn[:, 2] > 0.05], w])
        truth = DENSITIES[name](values, unit(wo), unit(wi))
        made = density(model, shape, wo, wi)
        np.testing.assert_allclose(made, truth, rtol=2e-2, atol=1e-4)


@pytest.mark.parametrize("roughness", [0.001, 0.1, 0.4, 1.0])
@pytest.mark.parametrize("degrees", [0, 30, 85])
def test_ggx_draws_the_visible_normals_of_the_paper(roughness: float, degrees: float) -> None:
    model = MODELS["ggx"]
    values = {**defaults(model.Params), "roughness": roughness}
    shape = model.shape(values)
    wo = seen_from(np.radians(degrees), 0.3)
    u = np.random.default_rng(2).random((400, 2), np.float32)
    alpha = float(shape[0])
    h = visible_normal(wo.astype(np.float64), alpha, alpha, u.astype(np.float64))
    truth = 2 * (h @ wo)[:, None] * h - wo
    np.testing.assert_allclose(sample(model, shape, wo, 2, u), truth, atol=1e-5 * alpha**0.5 + 3e-7)
