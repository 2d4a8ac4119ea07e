"""Light fields in half precision: there and back, whatever the range; the environment over discs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from studio_core.kernels.directions import direction_set
from studio_core.kernels.light_tree import LightTree
from studio_core.parallel import Workers
from studio_core.transport.cells import CELLS, PARTS, RINGS
from studio_plugins.slf.lumitexels import LightField
from studio_plugins.slf.skylight import DIRECTIONS, FINENESS, SIZES, SKY, averages, size_of_ring


def test_what_is_kept_is_read_again_whatever_its_range():
    rng = np.random.default_rng(0)
    scale = 10.0 ** rng.uniform(-6, 6, (7, 1, 1, 1))
    light = (scale * rng.uniform(0, 1, (7, 3, RINGS, PARTS)) ** 4).astype(np.float32)
    field = LightField(9)
    field.keep(1, light)
    read = field.of(1, 8)
    most = light.max(axis=(1, 2, 3), keepdims=True)
    assert (np.abs(read - light) <= 5e-4 * light + 1e-9 * most).all()
    assert not field.of(0, 1).any()
    assert not field.of(8, 9).any()


def test_what_sends_the_same_everywhere_is_read_in_every_cell():
    rng = np.random.default_rng(3)
    even = (10.0 ** rng.uniform(-6, 6, (4, 1)) * rng.uniform(0, 1, (4, 3))).astype(np.float32)
    field, plain = LightField(6), LightField(6)
    field.keep(0, rng.uniform(0, 1, (6, 3, RINGS, PARTS)).astype(np.float32))
    field.keep_even(1, even)
    plain.keep(1, np.broadcast_to(even[..., None, None], (4, 3, RINGS, PARTS)))
    np.testing.assert_array_equal(field.of(1, 5), plain.of(1, 5))
    assert np.ptp(field.of(0, 1)) > 0
    field.keep(1, np.zeros((1, 3, RINGS, PARTS), np.float32))
    assert not field.of(1, 2).any()


def test_light_below_zero_is_none():
    field = LightField(1)
    field.keep(0, np.full((1, 3, RINGS, PARTS), -1, np.float32))
    assert not field.of(0, 1).any()


def test_rows_may_come_from_anywhere():
    rng = np.random.default_rng(1)
    field = LightField(2)
    light, sky = rng.uniform(0, 1, (2, 3, RINGS, PARTS)), rng.uniform(0, 90, (SKY, 3))
    field.keep(0, light.astype(np.float32))
    field.keep_sky(sky.astype(np.float32))
    every = np.concatenate([light.reshape(2, 3, CELLS).swapaxes(1, 2).reshape(-1, 3), sky, np.zeros((1, 3))])
    rows = rng.integers(0, LightField.rows_of(2), (3, CELLS)).astype(np.uint32)
    rows[0, 0] = LightField.rows_of(2) - 1
    read = np.empty((3, 3, RINGS, PARTS), np.float32)
    field.read(rows, read)
    assert np.allclose(read.reshape(3, 3, CELLS).swapaxes(1, 2), every[rows], rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("k", [13, 15, 17])
def test_averages_of_an_even_sky_are_it_and_of_a_window_lose_no_light(k):
    even = LightTree.build(np.full((1 << k, 3), 2.5, np.float32))
    assert np.allclose(averages(even, Workers(2)), 2.5, rtol=1e-5)
    light = np.zeros((1 << k, 3), np.float32)
    light[direction_set(k).directions @ [0.6, 0.64, 0.48] > math.cos(0.05)] = 9
    made = averages(LightTree.build(light), Workers(1)).reshape(SIZES, DIRECTIONS, 3)
    assert np.allclose(made.mean(axis=1), light.mean(axis=0), rtol=0.03)
    assert made[0].max() > 2 * made[-1].max() * 0.9 or made[-1].max() < 9


def test_larger_cells_look_into_larger_discs():
    sizes = size_of_ring()
    assert (np.diff(sizes) >= 0).all()
    assert sizes[0] == 0
    assert sizes[-1] == SIZES - 1
    assert FINENESS == 15
