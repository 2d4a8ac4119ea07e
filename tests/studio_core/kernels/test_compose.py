"""Pixels from vertices against plain loops."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles.radiance import bilinear_repeat, lat_long

from studio_core.kernels.camera import sample_directions
from studio_core.kernels.compose import background_samples, shade_samples, texel
from studio_core.scene.transform import looking
from studio_core.session import View
from studio_core.shading.primary import pinhole


@given(
    st.integers(1, 5), st.integers(1, 5), st.floats(-3, 3, allow_nan=False), st.floats(-3, 3, allow_nan=False)
)
def test_texel_is_bilinear_and_repeats(height, width, u, v):
    rng = np.random.default_rng(height * 10 + width)
    map_ = rng.random((height, width, 9)).astype(np.float32)
    table = np.concatenate([np.zeros((3, 9), np.float32), map_.reshape(-1, 9)])
    out = np.empty(9, np.float32)
    texel(table, 3, height, width, u, v, out)
    np.testing.assert_allclose(out, bilinear_repeat(map_.astype(np.float64), u, v), atol=2e-5)


@pytest.mark.parametrize("named", [False, True])
def test_background_equals_the_oracle(named):
    rng = np.random.default_rng(1)
    pixels = rng.random((8, 16, 3)).astype(np.float32)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0].astype(np.float32)
    gain = np.array([1, 2, 3], np.float32)
    lens = pinhole(View(looking((0, 0, 0), (1, -2, 0.5)), fov=150, width=9, height=6, antialias=2))
    samples = rng.permutation(9 * 6 * 4)[:50] if named else np.arange(9 * 6 * 4)
    directions = np.empty((len(samples), 3), np.float32)
    sample_directions(lens, samples, directions)
    face = np.where(np.arange(len(samples)) % 5 == 0, 3, -1).astype(np.int32)
    out = np.full((len(samples), 3), -1, np.float32)
    given = samples if named else np.zeros(0, np.int64)
    background_samples(0, len(samples), face, given, lens, turn, pixels, gain, out)
    for d, f, made in zip(directions, face, out, strict=True):
        expected = -1 if f >= 0 else lat_long(pixels, turn @ d) * gain
        np.testing.assert_allclose(made, expected, atol=2e-3)


def test_samples_are_ordered_by_pixel_and_lie_in_it():
    view = View(looking((0, 1, 2), (0.3, 0, 0)), fov=60, width=4, height=3, antialias=2)
    out = np.empty((4 * 3 * 4, 3), np.float32)
    sample_directions(pinhole(view), np.arange(len(out)), out)
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), 1, rtol=1e-6)
    own = out @ view.transform.matrix()[:3, :3]
    up = np.tan(np.radians(30))
    x = (own[:, 0] / -own[:, 2] / (up * 4 / 3) + 1) / 2 * 4
    y = (1 - own[:, 1] / -own[:, 2] / up) / 2 * 3
    pixel = np.arange(len(out)) // 4
    np.testing.assert_array_equal(np.floor(x), pixel % 4)
    np.testing.assert_array_equal(np.floor(y), pixel // 4)
    np.testing.assert_allclose(x.reshape(-1, 4).mean(axis=1) % 1, 0.5, atol=1e-4)


def _one_triangle():
    faces = np.array([[0, 1, 2]], np.uint32)
    back = np.array([[3, 4, 5]], np.uint32)
    places = np.tile(np.array([[0, 0, -1], [1, 0, -1], [0, 1, -1]], np.float32), (2, 1))
    uvs = np.tile(np.array([[0, 0], [1, 0], [0, 1]], np.float32), (2, 1))
    terms = np.arange(6 * 9, dtype=np.float32).reshape(6, 9)
    return faces, back, places, np.zeros(6, np.int32), uvs, terms


def _shade(direction, table, first, size, *, face=0):
    faces, back, places, material, uvs, terms = _one_triangle()
    out = np.full((1, 3), -1, np.float32)
    shade_samples(
        0,
        1,
        np.array([face], np.int32),
        np.array([0.25], np.float32),
        np.array([0.5], np.float32),
        np.array([1], np.float32),
        np.zeros(0, np.int64),
        pinhole(View(looking((0, 0, 0), direction), fov=1e-3, width=1, height=1, antialias=1)),
        faces,
        back,
        places,
        material,
        uvs,
        np.ones(1, np.float32),
        terms,
        table,
        first,
        size,
        np.array([[1, 1, 0, 0]], np.float32),
        0.01,
        out,
    )
    return out[0]


def test_each_side_has_its_own_vertices_and_terms_add_up():
    table = np.arange(9, dtype=np.float32)[None]
    first, size = np.zeros((1, 1), np.int64), np.ones((1, 1, 2), np.int64)
    weights = np.array([0.25, 0.25, 0.5])
    terms = _one_triangle()[-1]
    for direction, corners in (((0, 0, -1), terms[:3]), ((0, 0, 1), terms[3:])):
        expected = (table[0] * (weights @ corners)).reshape(3, 3).sum(axis=0)
        np.testing.assert_allclose(_shade(direction, table, first, size), expected, rtol=1e-6)


def test_nothing_is_written_where_nothing_is_hit():
    table = np.ones((1, 9), np.float32)
    first, size = np.zeros((1, 1), np.int64), np.ones((1, 1, 2), np.int64)
    assert (_shade((0, 0, -1), table, first, size, face=-1) == -1).all()


def test_texture_is_read_at_the_interpolated_uv():
    rng = np.random.default_rng(2)
    map_ = rng.random((4, 4, 9)).astype(np.float32)
    first, size = np.zeros((1, 1), np.int64), np.full((1, 1, 2), 4, np.int64)
    terms = np.array([0.25, 0.25, 0.5]) @ _one_triangle()[-1][:3]
    expected = (bilinear_repeat(map_.astype(np.float64), 0.25, 0.5) * terms).reshape(3, 3).sum(axis=0)
    np.testing.assert_allclose(_shade((0, 0, -1), map_.reshape(-1, 9), first, size), expected, rtol=1e-5)
