"""The directions of previews: they sum lobes of every sharpness up."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.brdfs.calls import evaluate
from studio_core.preview.fan import DIRECTIONS, fan
from studio_plugins.brdfs.blinn_phong import MODEL as BLINN
from studio_plugins.brdfs.ggx import MODEL as GGX

cosines = st.floats(0.02, 1.0)


@given(cosines)
def test_weights_make_up_the_hemisphere(cosine: float) -> None:
    made = fan(cosine)
    assert made.wi.shape == (DIRECTIONS, 3)
    assert made.solid.shape == (DIRECTIONS,)
    assert (made.solid >= 0).all()
    assert (made.wi[:, 2] > 0).all()
    np.testing.assert_allclose(np.linalg.norm(made.wi, axis=1), 1, atol=1e-5)
    z, solid = made.wi[:, 2].astype(float), made.solid.astype(float)
    assert solid @ z == pytest.approx(np.pi, rel=0.01)
    assert solid @ (z * z) == pytest.approx(2 * np.pi / 3, rel=0.01)
    assert abs(solid @ (z * made.wi[:, 1])) < 0.01


@given(st.floats(1e-3, 1.0), st.floats(0.1, 1.0))
def test_an_unnormalised_ggx_distribution_sums_to_one(roughness: float, cosine: float) -> None:
    """∫ D(h) (n·h) dω_h = 1, through ω_i: dω_h = dω_i / (4 ω_o·h)."""
    alpha = max(roughness**2, 1e-4)
    made = fan(cosine)
    half = made.wi.astype(float) + made.wo
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    sine2 = half[:, 0] ** 2 + half[:, 1] ** 2
    d = (alpha / (alpha**2 * (1 - sine2) + sine2)) ** 2 / np.pi
    total = (d * half[:, 2] / (4 * (half @ made.wo.astype(float))) * made.solid).sum()
    # what is mirrored below the horizon is left out, and is little where lobes are sharp
    assert total < 1.02
    if alpha < 0.05 * cosine:
        assert total > 0.97


def _dense(model: object, shape: np.ndarray, angle: float) -> np.ndarray:
    """The same integral over half a million half vectors."""
    edges = np.concatenate([[1e-9], np.geomspace(1e-6, np.pi / 2, 700)])
    turn = 2 * np.pi * (np.arange(720) + 0.5) / 720
    wo = np.array([np.sin(angle), 0, np.cos(angle)])
    made = np.zeros(model.terms)  # type: ignore[attr-defined]
    for inner, outer in itertools.pairwise(edges):
        middle = np.sqrt(inner * outer)
        area = 4 * np.pi * (np.sin(outer / 2) ** 2 - np.sin(inner / 2) ** 2) / len(turn)
        ring = np.sin(middle) * np.stack([np.cos(turn), np.sin(turn)], 1)
        half = np.column_stack([ring, np.full(len(turn), np.cos(middle))])
        toward = half @ wo
        wi = 2 * toward[:, None] * half - wo
        seen = (toward > 0) & (wi[:, 2] > 0)
        weight = (wi[:, 2] * 4 * toward * area)[seen, None]
        made += (evaluate(model, shape, wo, wi[seen]) * weight).sum(axis=0)  # type: ignore[arg-type]
    return made


@pytest.mark.parametrize("degrees", [5, 45, 75])
@pytest.mark.parametrize(
    ("model", "values"),
    [(GGX, {"roughness": 0.05}), (GGX, {"roughness": 0.4}), (BLINN, {"exponent": 3000.0})],
    ids=["smooth", "rough", "blinn"],
)
def test_albedo_is_that_of_a_dense_sum(model: object, values: dict[str, float], degrees: float) -> None:
    angle = np.radians(degrees)
    shape = model.shape(values)  # type: ignore[attr-defined]
    made = fan(float(np.cos(angle)))
    values_ = evaluate(model, shape, made.wo, made.wi)  # type: ignore[arg-type]
    found = (values_ * (made.wi[:, 2] * made.solid)[:, None]).sum(axis=0)
    true = _dense(model, shape, angle)
    np.testing.assert_allclose(found, true, rtol=0.02, atol=2e-3)
