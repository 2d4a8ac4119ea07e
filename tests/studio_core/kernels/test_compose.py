"""Pixels from vertices against plain loops."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from oracles.radiance import bilinear_repeat, lat_long

from studio_core.kernels.compose import background_samples, shade_samples, texel


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


def test_background_equals_the_oracle():
    rng = np.random.default_rng(1)
    pixels = rng.random((8, 16, 3)).astype(np.float32)
    directions = rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = np.concatenate([directions, [[0, 1, 0], [0, -1, 0], [0, 0, -1]]]).astype(np.float32)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0].astype(np.float32)
    gain = np.array([1, 2, 3], np.float32)
    out = np.zeros((len(directions), 3), np.float32)
    background_samples(0, len(directions), directions, turn, pixels, gain, out)
    for d, made in zip(directions, out, strict=True):
        np.testing.assert_allclose(made, lat_long(pixels, turn @ d) * gain, atol=2e-3)


def _one_triangle():
    faces = np.array([[0, 1, 2]], np.uint32)
    back = np.array([[3, 4, 5]], np.uint32)
    geometric = np.repeat(np.array([[0, 0, 1], [0, 0, -1]], np.float32), 3, axis=0)
    uvs = np.tile(np.array([[0, 0], [1, 0], [0, 1]], np.float32), (2, 1))
    terms = np.arange(6 * 9, dtype=np.float32).reshape(6, 9)
    return faces, back, geometric, np.zeros(6, np.int32), uvs, terms


def _shade(direction, table, first, size, *, face=0):
    faces, back, geometric, material, uvs, terms = _one_triangle()
    out = np.full((1, 3), -1, np.float32)
    shade_samples(
        0,
        1,
        np.array([face], np.int32),
        np.array([0.25], np.float32),
        np.array([0.5], np.float32),
        np.array([1], np.float32),
        np.array([direction], np.float32),
        faces,
        back,
        geometric,
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
