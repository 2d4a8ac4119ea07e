"""Rows: what marks come to at vertices, and how they count."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from indirect_strokes import Painting, separate
from path_rooms import furnished

from studio_core.contract import Services
from studio_core.scene.nodes import AreaLamp, Camera
from studio_core.scene.transform import looking
from studio_core.shading.artifacts import Surfaces
from studio_plugins.slf.fixates import MOST, POOLS, nearest_chosen, rows_of

LAMP = AreaLamp(
    id="lamp", intensity=6.0, width=1.0, height=0.6, transform=looking((0.8, 2.4, 0.9), (-0.5, 0, -0.5))
)
CAMERA = Camera(id="camera", transform=looking((0, 2.2, 4.5), (0, 0.8, 0)))


@pytest.fixture(scope="module")
def painting(workers: Any, host: Any) -> Painting:
    return Painting(separate(furnished((LAMP, CAMERA))), Services(workers, host), 2000)


def test_marks_come_to_the_vertices_under_them(painting: Painting) -> None:
    surfaces = painting.room.handed()[Surfaces]
    some = painting.vertices("floor", (0, 0, 0.5), 90)
    shown = painting.radiance(painting.lit, some)
    rows = rows_of([painting.stroke(some, shown + 0.5), painting.fixate(some[:20])], surfaces)
    own = rows.some(np.flatnonzero(~rows.fixed))
    places = painting.mesh.positions
    assert np.abs(np.sort(places[own.vertex], axis=0) - np.sort(places[some], axis=0)).max() < 1e-5
    np.testing.assert_allclose(own.change, 0.5, rtol=1e-4)
    assert not rows.change[rows.fixed].any()
    assert (rows.importance * rows.change**2).sum() == pytest.approx(1)
    assert own.weight.sum() == pytest.approx(1)


def test_many_marks_are_thinned_and_pooled(painting: Painting) -> None:
    surfaces = painting.room.handed()[Surfaces]
    some = painting.vertices("floor", (0, 0, 0), 500)
    shown = painting.radiance(painting.lit, some)
    rows = rows_of([painting.stroke(some, shown * 2)], surfaces)
    assert len(rows) <= MOST
    pooled, share = rows.pooled(surfaces.mesh.positions)
    assert len(pooled) <= POOLS
    np.testing.assert_allclose(share.sum(axis=1), 1)
    np.testing.assert_allclose(pooled.weight.sum(), rows.weight.sum())
    np.testing.assert_allclose(pooled.weight @ pooled.change, rows.weight @ rows.change)


def test_a_flat_stroke_wants_its_mean_and_that_its_neighbours_stay(painting: Painting) -> None:
    surfaces = painting.room.handed()[Surfaces]
    some = painting.vertices("floor", (0, 0, 0), 60)
    shown = painting.radiance(painting.lit, some)
    wanted = shown + np.random.default_rng(0).random((60, 3))
    rows = rows_of([painting.stroke(some, wanted, flat=True)], surfaces)
    beside = ~rows.change.any(axis=1)
    assert beside.any()
    assert np.ptp(rows.change[~beside], axis=0).max() < 1e-9
    assert rows.weight[beside].max() < 0.2 * rows.weight[~beside].max()


def test_what_says_nothing_makes_no_rows(painting: Painting) -> None:
    surfaces = painting.room.handed()[Surfaces]
    some = painting.vertices("floor", (0, 0, 0), 30)
    stroke = painting.stroke(some, np.full((30, 3), np.nan))
    assert not len(rows_of([stroke], surfaces))
    assert not len(rows_of([dataclasses.replace(stroke, table=None)], surfaces))
    gone = dataclasses.replace(painting.stroke(some, np.ones((30, 3))), objects=("nobody",))
    assert not len(rows_of([gone], surfaces))
    every = np.arange(len(painting.mesh))
    assert not len(rows_of([painting.stroke(some, np.ones((30, 3)))], surfaces, every))


def test_a_later_solve_wants_what_is_left(painting: Painting) -> None:
    surfaces = painting.room.handed()[Surfaces]
    some = painting.vertices("floor", (0, 0, 0), 30)
    stroke = painting.stroke(some, np.full((30, 3), 2.0))
    rows = rows_of([stroke], surfaces, now={stroke.id: np.full((30, 3), 1.5)})
    np.testing.assert_allclose(rows.change, 0.5, rtol=1e-5)


@given(st.integers(1, 60), st.integers(1, 20), st.integers(0, 99))
def test_pools_are_as_many_as_asked_and_near(count: int, most: int, seed: int) -> None:
    points = np.random.default_rng(seed).random((count, 3))
    pool = nearest_chosen(points, most)
    assert len(np.unique(pool)) == min(count, most)
    if count <= most:
        assert len(np.unique(pool)) == count
