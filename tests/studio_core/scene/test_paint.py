"""Paint on points: what lies between them, and what must never happen."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.scene.between import NEAREST
from studio_core.scene.paint import Paint


def plane(rng, count):
    places = np.concatenate([rng.uniform(0, 1, (count, 2)), np.zeros((count, 1))], axis=1)
    return places, np.broadcast_to([0.0, 0.0, 1.0], (count, 3))


def test_what_is_alike_everywhere_is_alike_between():
    rng = np.random.default_rng(0)
    places, normals = plane(rng, 50)
    paint = Paint.of(places, normals, np.zeros(50), {"roughness": np.full(50, 0.3)})
    where, facing = plane(rng, 20)
    made = paint.weights(where, facing, np.zeros(20, int))(paint.change("roughness"))
    np.testing.assert_allclose(made, 0.3, rtol=1e-5)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 30))
def test_nothing_leaves_the_range_of_the_nearest_points(seed, count):
    rng = np.random.default_rng(seed)
    places, normals = plane(rng, count)
    values = rng.normal(size=(count, 3))
    paint = Paint.of(places, normals, np.zeros(count), {"base_color": values})
    where, facing = plane(rng, 10)
    weights = paint.weights(where, facing, np.zeros(10, int))
    made = weights(paint.change("base_color"))
    assert (weights.share >= 0).all()
    np.testing.assert_allclose(weights.share.sum(axis=1), 1, rtol=1e-5)
    gaps = np.linalg.norm(where[:, None] - places, axis=2)
    near = np.argsort(gaps, axis=1)[:, : min(NEAREST, count)]
    assert (made >= values[near].min(axis=1) - 1e-5).all()
    assert (made <= values[near].max(axis=1) + 1e-5).all()


def test_at_a_point_it_is_mostly_what_the_point_has():
    rng = np.random.default_rng(1)
    places, normals = plane(rng, 200)
    values = np.where(places[:, :1] < 0.5, 1.0, 0.0)
    paint = Paint.of(places, normals, np.zeros(200), {"roughness": values})
    made = paint.weights(places, normals, np.zeros(200, int))(paint.change("roughness"))
    far = np.abs(places[:, 0] - 0.5) > 0.15
    np.testing.assert_allclose(made[far, 0], values[far, 0], atol=1e-6)
    assert np.abs(made - values).mean() < 0.05


def test_the_other_side_and_other_slots_do_not_count():
    places = np.array([[0, 0, 0], [0, 0, 0.01], [0, 0, 0.005]], float)
    normals = np.array([[0, 0, -1], [0, 0, 1], [0, 0, 1]], float)
    paint = Paint.of(places, normals, [0, 0, 1], {"roughness": [1.0, 0.0, 5.0]})
    sides = paint.weights(places[:2], normals[:2], [0, 0])(paint.change("roughness"))
    np.testing.assert_allclose(sides[:, 0], [1, 0], atol=1e-3)
    other = paint.weights(places, normals, [1, 1, 2])(paint.change("roughness"))
    np.testing.assert_allclose(other[:, 0], [5, 5, 0])


def test_what_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="do not fit"):
        Paint.of(np.zeros((3, 3)), np.ones((3, 3)), np.zeros(3), {"roughness": np.zeros(2)})
    with pytest.raises(ValueError, match="do not fit"):
        Paint.of(np.zeros((3, 3)), np.ones((3, 3)), np.zeros(3), {"roughness": np.zeros((3, 2))})
    with pytest.raises(ValueError, match="looks do not fit"):
        Paint.of(np.zeros((3, 3)), np.ones((3, 3)), np.zeros(3), {}, np.zeros((2, 3)))
    with pytest.raises(ValueError, match="finite"):
        Paint.of(np.full((3, 3), np.nan), np.ones((3, 3)), np.zeros(3), {})


def test_equal_paint_has_one_key():
    def made(value):
        return Paint.of(np.zeros((2, 3)), np.ones((2, 3)), np.zeros(2), {"roughness": [value, 0.0]})

    assert made(0.5).key == made(0.5).key != made(0.6).key


def test_some_changes_alone_leave_out_slots_that_they_do_not_touch():
    places, up = np.arange(9.0).reshape(3, 3), np.tile([0.0, 1.0, 0.0], (3, 1))
    one, other = np.array([[0.1], [0.0], [0.0]]), np.array([[0.0], [0.0], [0.5]])
    looks = np.full((3, 3), 0.5)
    paint = Paint.of(places, up, [0, 0, 1], {"1/a": one, "2/a": other, "2/b": 0 * one}, looks)
    first, second = paint.only({"a": "1/a"}), paint.only({"a": "2/a", "b": "2/b"})
    np.testing.assert_array_equal(first.places, places[:2])
    np.testing.assert_allclose(first.change("a")[:, 0], [0.1, 0.0])
    np.testing.assert_array_equal(second.slots, [1])
    assert set(second.changes) == {"a"}
    assert first.looks is not None
    assert paint.only({"b": "2/b"}) is None
