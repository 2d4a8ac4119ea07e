"""Pixels from vertices against plain loops."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.radiance import bilinear_repeat, lat_long

from studio_core.kernels.background import FAR_AWAY, angle, background_hits
from studio_core.kernels.camera import sample_directions
from studio_core.kernels.compose import (
    AFFINE,
    CONSTANT,
    GENERAL,
    RECORD,
    add_caught,
    add_light,
    add_samples,
    average,
    face_texels,
    shade_hits,
    texel,
)
from studio_core.scene.transform import looking
from studio_core.session import View
from studio_core.shading.primary import pinhole

NO_COLOUR = np.zeros((0, 3), np.float32)


@given(st.integers(1, 5), st.integers(1, 5), st.floats(0, 1, width=32), st.floats(0, 1, width=32))
def test_texel_is_bilinear_and_repeats(height, width, u, v):
    rng = np.random.default_rng(height * 10 + width)
    map_ = rng.random((height, width, 9)).astype(np.float32)
    table = np.concatenate([np.zeros((3, 9), np.float32), map_.reshape(-1, 9)])
    out = np.empty(9, np.float32)
    texel(table, 3, height, width, np.float32(u), np.float32(v), out)
    np.testing.assert_allclose(out, bilinear_repeat(map_.astype(np.float64), u, v), atol=2e-5)


@given(st.floats(-1, 1, width=32), st.floats(-1, 1, width=32))
def test_angles_are_those_of_the_plane(y, x):
    away = abs(float(angle(np.float32(y), np.float32(x))) - np.arctan2(y, x))
    assert min(away, 2 * np.pi - away) < 4e-7 or max(abs(x), abs(y)) < 1e-20


@pytest.mark.parametrize("antialias", [1, 2])
@pytest.mark.parametrize("named", [False, True])
def test_background_equals_the_oracle(named, antialias):
    rng = np.random.default_rng(1)
    pixels = rng.random((8, 16, 3)).astype(np.float32)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    gain = np.array([1, 2, 3], np.float32)
    view = View(looking((0, 0, 0), (1, -2, 0.5)), fov=150, width=49, height=36, antialias=antialias)
    count = 49 * 36 * antialias**2
    samples = rng.permutation(count)[:700] if named else np.arange(count)
    directions = np.empty((len(samples), 3), np.float32)
    sample_directions(pinhole(view), samples, directions)
    face = np.where(np.arange(len(samples)) % 5 == 0, 3, -1).astype(np.int32)
    from_camera = (turn @ view.transform.matrix()[:3, :3]).astype(np.float32)
    given_samples = samples if named else np.zeros(0, np.int64)
    pieces = []
    for start in range(0, len(samples), 613):  # as threads do
        stop = min(start + 613, len(samples))
        out = np.full((stop - start, 3), -1, np.float32)
        background_hits(
            start, stop, pinhole(view), given_samples, face, from_camera, FAR_AWAY, pixels, gain, out
        )
        pieces.append(out)
    for d, f, made in zip(directions, face, np.concatenate(pieces), strict=True):
        expected = 0 if f >= 0 else lat_long(pixels, turn @ d) * gain
        np.testing.assert_allclose(made, expected, atol=5e-5)


def test_a_part_has_the_background_of_the_whole_there():
    rng = np.random.default_rng(3)
    pixels = rng.random((8, 16, 3)).astype(np.float32)
    whole = View(looking((0, 0, 0), (1, -2, 0.5)), fov=150, width=21, height=16, antialias=2)

    def behind(view, samples):
        turn = view.transform.matrix()[:3, :3].astype(np.float32)
        face, gain = np.full(len(samples), -1, np.int32), np.ones(3, np.float32)
        out = np.empty((len(samples), 3), np.float32)
        background_hits(0, len(out), pinhole(view), samples, face, turn, FAR_AWAY, pixels, gain, out)
        directions = np.empty((len(samples), 3), np.float32)
        sample_directions(pinhole(view), samples, directions)
        return out, directions

    every = behind(whole, np.arange(21 * 16 * 4))
    part = behind(whole.part(6, 5), np.arange(21 * 5 * 4))
    for made, expected in zip(part, every, strict=True):
        np.testing.assert_array_equal(made, expected[21 * 6 * 4 : 21 * 11 * 4])


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


def _one_triangle(kind):
    """Arguments of one triangle and its back with corners of its own, with three levels of a map."""
    rng = np.random.default_rng(2)
    uvs = np.array([[0, 0], [1, 0], [0, 1]])
    record, sums = rng.random((6, RECORD)).astype(np.float32), rng.random((6, 9)).astype(np.float32)
    record[:, 6:] = np.tile(uvs, (2, 1))
    texels, tables = rng.random((21, 3)).astype(np.float32), rng.random((21, 9)).astype(np.float32)
    first, size = np.array([[0, 16, 20]]), np.array([[[4, 4], [2, 2], [1, 1]]])
    looks = (np.array([kind]), record, sums, texels, tables, first, size, np.array([3]))
    return looks, np.array([[1, 0, 0, 0, 1, 0]], np.float32)


def _shade(kind, face=0, corners=(0, 1, 2), distance=1.0, beside=NO_COLOUR, added=NO_COLOUR):
    looks, uv_map = _one_triangle(kind)
    out = np.full((1, 3), -1, np.float32)
    shade_hits(
        0,
        1,
        np.array([face], np.int32),
        np.array([0.25], np.float32),
        np.array([0.5], np.float32),
        np.array([distance], np.float32),
        np.array([corners], np.uint32),
        np.array([-distance], np.float32),  # met head-on
        np.array([2.0], np.float32),
        np.zeros(1, np.int32),
        *looks,
        uv_map,
        0.01,
        beside,
        added,
        out,
    )
    return out[0]


@pytest.mark.parametrize("corners", [(0, 1, 2), (3, 4, 5)])
@pytest.mark.parametrize(("distance", "level"), [(1.0, 0), (60.0, 0), (80.0, 1), (1e6, 2), (1e30, 2)])
@pytest.mark.parametrize("kind", [CONSTANT, AFFINE, GENERAL])
def test_a_hit_is_its_corners_times_its_texel(kind, distance, level, corners):
    (_, record, sums, texels, tables, first, size, _), _ = _one_triangle(kind)
    mixed = np.array([0.25, 0.25, 0.5]) @ record[list(corners)].astype(np.float64)
    expected = mixed[:3]
    rows, (height, width) = slice(first[0, level], None), size[0, level]
    if kind == AFFINE:
        map_ = texels[rows][: height * width].reshape(height, width, 3).astype(np.float64)
        expected = mixed[:3] + mixed[3:6] * bilinear_repeat(map_, 0.25, 0.5)
    elif kind == GENERAL:
        map_ = tables[rows][: height * width].reshape(height, width, 9).astype(np.float64)
        terms = np.array([0.25, 0.25, 0.5]) @ sums[list(corners)]
        expected = mixed[:3] + (terms * bilinear_repeat(map_, 0.25, 0.5)).reshape(3, 3).sum(axis=0)
    np.testing.assert_allclose(_shade(kind, 0, corners, distance), expected, rtol=1e-5)


def test_sums_below_nothing_are_cut_off(monkeypatch):
    looks, uv_map = _one_triangle(GENERAL)
    assert (looks[2] > 0).all()
    darker = (*looks[:4], -looks[4], *looks[5:])
    monkeypatch.setitem(globals(), "_one_triangle", lambda _: (darker, uv_map))
    looks[1][:, :3] = 0
    assert (_shade(GENERAL) == 0).all()


@pytest.mark.parametrize("kind", [CONSTANT, AFFINE, GENERAL])
def test_light_that_vertices_do_not_have_is_added_before_sums_are_cut_off(kind):
    own = np.array([[0.5, 0.0, -100.0]], np.float32)
    made, alone = _shade(kind, added=own), _shade(kind)
    least = 0.0 if kind == GENERAL else -np.inf
    np.testing.assert_allclose(made, np.maximum(alone + own[0], least), rtol=1e-6)
    assert not _shade(kind, face=-1, added=own).any()


def test_what_is_not_hit_shows_what_lies_beside():
    assert not _shade(CONSTANT, face=-1).any()
    beside = np.array([[1, 2, 3]], np.float32)
    assert _shade(CONSTANT, face=-1, beside=beside).tolist() == [1, 2, 3]


@given(st.integers(0, 3), st.booleans())
def test_light_is_added_term_by_term_where_it_was_computed(seed, coated):
    rng = np.random.default_rng(seed)
    terms, gain = rng.random((2, 7, 9)).astype(np.float32), rng.random((2, 3)).astype(np.float32)
    valid, material = rng.random(7) < 0.7, rng.integers(0, 3, 7).astype(np.int32)
    kind = np.array([CONSTANT, AFFINE, GENERAL])
    plain, slope = rng.random((2, 3, 9)).astype(np.float32)
    painted = (rng.random((7, 9)) - 0.5).astype(np.float32) if coated else np.zeros((0, 0), np.float32)
    record, sums = np.zeros((7, RECORD), np.float32), np.zeros((7, 9), np.float32)
    for layer in range(2):
        for start, stop in ((0, 4), (4, 7)):
            light = (terms[layer], gain[layer], valid, material)
            add_light(start, stop, *light, kind, plain, slope, painted, record, sums)
    weighted = (terms.reshape(2, 7, 3, 3) * gain[:, None, None]).sum(axis=0) * valid[:, None, None]
    for v, m in enumerate(material):
        expected = (np.stack([plain[m], slope[m]]).reshape(2, 3, 3) * weighted[v]).sum(axis=1)
        expected[1] *= kind[m] == AFFINE
        expected *= kind[m] != GENERAL
        if coated:
            expected[0] += (painted[v].reshape(3, 3) * weighted[v]).sum(axis=0)
        made = record[v, :6].reshape(2, 3)
        np.testing.assert_allclose(made, expected, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(sums[v], weighted[v].ravel() * (kind[m] == GENERAL), rtol=1e-5)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("behind", [False, True])
def test_pixels_are_means_of_their_samples(weighted, behind):
    rng = np.random.default_rng(3)
    values, background = rng.random((5 * 4, 3)).astype(np.float32), rng.random((5, 3)).astype(np.float32)
    weight = rng.random(5 * 4).astype(np.float32)
    expected = (values * (weight[:, None] if weighted else 1)).reshape(5, 4, 3).mean(axis=1)
    expected = expected + (background if behind else 0)
    out = np.empty((5, 3), np.float32)
    average(4, values, weight if weighted else weight[:0], background if behind else NO_COLOUR, out)
    np.testing.assert_allclose(out, expected, rtol=1e-6)
    samples = np.array([3, 7, 0, 7])
    add_samples(samples, 4, weight[:4], values[:4], out)
    for n, sample in enumerate(samples):
        expected[sample // 4] += weight[n] * values[n] / 4
    np.testing.assert_allclose(out, expected, rtol=1e-6)


def test_texels_along_a_metre_are_those_of_the_finest_level():
    places = np.array([[0, 0, 0], [2, 0, 0], [0, 0.5, 0], [0, 0, 0]], np.float32)
    uvs = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 0, 1], [0, 1, 2], [0, 3, 2]], np.uint32)
    material = np.array([0, 0, 1, 0], np.int32)
    size, scale = (
        np.array([[[32, 8]], [[0, 0]]]),
        np.array([[2, 1, 0, 3, -1.5, 0], [1, 0, 0, 0, 1, 0]], np.float32),
    )
    out = np.empty(4, np.float32)
    for start, stop in ((0, 3), (3, 4)):
        face_texels(start, stop, places, uvs, faces, material, np.array([AFFINE, CONSTANT]), size, scale, out)
    # the whole map six times over on a rectangle of 2 × 0.5 m: 6 · 32 · 8 texels on one square metre
    np.testing.assert_allclose(out[[0, 2]], [np.sqrt(6 * 32 * 8), 1], rtol=1e-6)
    assert out[1] == 0
    assert out[3] == pytest.approx(1e10 * np.sqrt(0.5 * 6 * 32 * 8))  # a face without area


@given(st.lists(st.integers(0, 30), max_size=60), st.integers(1, 9), st.integers(0, 10**6))
@settings(max_examples=60)
def test_caught_light_is_added_alike_in_any_parts(pixels, step, seed):
    """As one hit after the other; no pixel is two parts' own."""
    rng, count = np.random.default_rng(seed), 4
    samples = np.sort(np.array(pixels, np.int64) * count + rng.integers(0, count, len(pixels)))
    rows = np.arange(len(samples))
    record = rng.random((6, 8)).astype(np.float32)
    shown = np.array([[0, 1, 2], [3, 4, 5]], np.uint32)
    u, v, weight = rng.random((3, len(rows))).astype(np.float32)
    photograph = rng.random((len(rows), 3)).astype(np.float32)
    hits = (rng.integers(0, 2, len(rows)).astype(np.int32), u, v, shown, record)
    expected = np.ones((31, 3))
    for n, sample in enumerate(samples):
        corners = record[shown[hits[0][n]], 3:6]
        light = np.array([1 - u[n] - v[n], u[n], v[n]]) @ corners * photograph[n]
        expected[sample // count] += weight[n] * light / count
    made, written = np.ones((31, 3), np.float32), []
    for start in range(0, len(rows), step):
        before = made.copy()
        add_caught(start, min(start + step, len(rows)), rows, samples, count, weight, *hits, photograph, made)
        written.append(set(np.flatnonzero((made != before).any(axis=1)).tolist()))
    np.testing.assert_allclose(made, expected, rtol=1e-5)
    assert sum(map(len, written)) == len(set().union(*written))
