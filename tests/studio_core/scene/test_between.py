"""Shares of points between them: what the formula says, kept values, and looks that differ."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.scene.between import LEAST_FACING, LEAST_LIKE, LIKE, NEAREST, TOUCHING, Cloud, weigh


def cloud(rng, count, slots=1, looks=True):
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    look = rng.uniform(0, 1, (count, 3)).astype(np.float32) if looks else None
    return Cloud(rng.uniform(0, 1, (count, 3)), normals, rng.integers(0, slots, count), look)


def by_formula(points, places, values, near):
    made = np.zeros((len(places), values.shape[1]))
    for p in range(len(places)):
        own = np.flatnonzero(points.slots == places.slots[p])
        if not len(own):
            continue
        away = np.linalg.norm(points.places[own] - places.places[p], axis=1)
        order = np.argsort(away)[:near]
        own, away = own[order], away[order] / (away[order[-1]] * (1 + 1e-6))
        weight = (np.maximum(1 - away, 1e-6) / (away + TOUCHING)) ** 2
        weight = weight * np.maximum(points.normals[own] @ places.normals[p], LEAST_FACING) ** 2
        if points.looks is not None and places.looks is not None:
            square = ((points.looks[own] - places.looks[p]) ** 2).mean(axis=1)
            weight = weight * np.maximum(np.exp(-square / (2 * LIKE**2)), LEAST_LIKE)
        made[p] = weight @ values[own] / weight.sum()
    return made


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 40), st.booleans())
def test_shares_are_what_the_formula_says(seed, count, looks):
    rng = np.random.default_rng(seed)
    points, places = cloud(rng, count, 3, looks), cloud(rng, 25, 4, looks)
    values = rng.normal(size=(count, 2)).astype(np.float32)
    weights = weigh(points, places)
    expected = by_formula(points, places, values, weights.which.shape[1])
    np.testing.assert_allclose(weights(values), expected, rtol=1e-3, atol=1e-4)
    total = weights.share.sum(axis=1)
    np.testing.assert_allclose(total, np.isin(places.slots, points.slots), atol=1e-5)


def test_values_at_points_are_kept():
    rng = np.random.default_rng(0)
    points = cloud(rng, 300, looks=False)
    points = Cloud(points.places, np.broadcast_to([0.0, 0.0, 1.0], (300, 3)), points.slots)
    values = rng.normal(size=(300, 1)).astype(np.float32)
    made = weigh(points, points)(values)
    assert np.abs(made - values).max() < 0.005 * np.ptp(values)


def test_what_looks_otherwise_hardly_counts():
    x = np.linspace(0, 1, 41)
    places = np.stack([x, 0 * x, 0 * x], axis=1)
    normals = np.broadcast_to([0.0, 0.0, 1.0], places.shape)
    dark = (np.arange(41) // 4) % 2 == 0
    look = np.repeat(np.where(dark, 0.2, 0.8)[:, None], 3, axis=1).astype(np.float32)
    points = Cloud(places, normals, np.zeros(41, np.int64), look)
    values = np.where(dark, 1.0, 0.0).astype(np.float32)[:, None]
    moved = Cloud(places + np.array([0.0125 / 2, 0, 0]), normals, points.slots, look)
    followed = weigh(points, moved)(values)[:, 0]
    assert np.abs(followed - dark).max() < 0.01
    blind = weigh(Cloud(places, normals, points.slots), moved)(values)[:, 0]
    assert np.abs(blind - dark).max() > 0.05


def test_places_without_points_of_their_slot_have_nothing():
    rng = np.random.default_rng(1)
    points = cloud(rng, NEAREST - 3)
    places = Cloud(points.places, points.normals, points.slots + 1, points.looks)
    assert not weigh(points, places).share.any()
