"""f_r: its terms against the oracle, and what the fit finds in samples whose model is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import residual as oracle

from studio.bench.lab import dome, row
from studio_plugins.residual.parametric import SHAPES, Parametric, best_parametric, fit_parametric, terms
from studio_plugins.residual.reflectance_map import slopes
from studio_plugins.residual.samples import Lights, Samples


def on_sphere(z: float, turn: float) -> np.ndarray:
    return np.array([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z])


cosines, turns = st.floats(0.02, 1), st.floats(0, 6.28)


@given(st.sampled_from(sorted(SHAPES)), cosines, turns, cosines, turns, st.floats(0, 1), st.floats(0, 1))
def test_terms_are_the_oracles(
    model: str, zv: float, tv: float, zl: float, tl: float, sharp: float, sharper: float
) -> None:
    low, high = (0.02, 1.0) if model.endswith("ggx") else (1.0, 2000.0)
    shapes = [low * (high / low) ** s for s in (sharp, sharper)][: SHAPES[model]]
    n, v, light = np.array([0.0, 0.0, 1.0]), on_sphere(zv, tv), on_sphere(zl, tl)
    made = terms(model, shapes, n.astype(np.float32)[None], v.astype(np.float32)[None], light)[:, 0]
    wanted = oracle.radiance(model, shapes, n, v, light)
    assert np.allclose(made, wanted, rtol=3e-3, atol=1e-4)


@given(st.sampled_from(sorted(SHAPES)), st.floats(-1, 1), turns, st.sampled_from([1e-3, 1e-2, 1.0]))
def test_terms_are_finite_at_all_ends(model: str, z: float, turn: float, small: float) -> None:
    shapes = [small if model.endswith("ggx") else 100 / small] * SHAPES[model]
    light = on_sphere(z, turn)
    n, v = np.float32([[0, 0, 1]]), np.float32([[np.sqrt(1 - 1e-10), 0, 1e-5]])
    for towards in (light, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-v[0, 0], 0.0, -v[0, 2] + 1e-3]):
        made = terms(model, shapes, n, v, np.asarray(towards) / np.linalg.norm(towards))
        assert np.isfinite(made).all()
        assert (made >= 0).all()


def samples_of(model: Parametric, lights: Lights, size: int = 40, noise: float = 0.0) -> Samples:
    n = slopes(size)
    v = np.broadcast_to(np.float32([0, 0, 1]), n.shape)
    values = np.stack([model.radiance(n, v, d) for d in lights.directions])
    values = values + np.random.default_rng(1).normal(size=values.shape) * noise
    return Samples(values.astype(np.float32), np.ones(values.shape[:3], np.bool_), n, v, lights)


@pytest.mark.parametrize(
    ("model", "shapes", "close"),
    [
        ("lambert", (), 0.0),
        ("rough-lambert", (), 0.0),
        ("paper", (35.0,), 0.02),
        ("phong", (80.0,), 0.02),
        ("blinn", (1.5,), 0.05),
        ("rough-blinn", (3000.0,), 0.02),
        ("two-blinn", (1500.0, 30.0), 0.05),
        ("ggx", (0.08,), 0.02),
        ("two-ggx", (0.05, 0.4), 0.1),
    ],
)
def test_a_known_model_is_found_again(model: str, shapes: tuple[float, ...], close: float) -> None:
    matte = [[0.4, 0.3, 0.2]] + [[0.1, 0.1, 0.1]] * model.startswith("rough-")
    truth = Parametric(
        model, shapes, np.array(matte + [[0.05, 0.04, 0.03], [0.06, 0.06, 0.06]][: len(shapes)])
    )
    found = fit_parametric(samples_of(truth, row(), noise=2e-3), model)
    assert np.allclose(found.shapes, shapes, rtol=close)
    assert np.allclose(found.colours[0], truth.colours[0], rtol=0.03)
    assert found.nmse < 5e-4
    assert not found.at_bound


def test_a_lobe_too_narrow_for_the_map_does_no_harm() -> None:
    truth = Parametric("blinn", (90_000.0,), np.array([[0.3] * 3, [0.02] * 3]))
    found = fit_parametric(samples_of(truth, dome()), "blinn")
    assert found.shapes[0] > 20_000
    assert found.nmse < 0.02


def test_the_plainest_model_that_fits_is_taken() -> None:
    truth = Parametric("lambert", (), np.array([[0.3, 0.2, 0.1]]))
    assert best_parametric(samples_of(truth, row(), noise=1e-3), list(SHAPES)).model == "lambert"


def test_nothing_usable_is_black() -> None:
    truth = Parametric("lambert", (), np.array([[0.3, 0.2, 0.1]]))
    samples = samples_of(truth, row())
    found = fit_parametric(samples, "two-ggx", np.zeros(samples.usable.shape, np.bool_))
    assert (found.colours == 0).all()
    with pytest.raises(ValueError, match="no model"):
        fit_parametric(samples, "velvet")
