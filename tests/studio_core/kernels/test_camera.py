"""Tiles of the picture: every sample once, each along its own ray."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.kernels.camera import (
    TILE_HEIGHT,
    TILE_WIDTH,
    first_hits,
    pixels_of,
    sample_at,
    sample_directions,
    tiles_across,
    tiles_down,
    tiles_in,
)
from studio_core.kernels.raycast import CasterObject, RayCaster
from studio_core.scene.transform import looking
from studio_core.session import View
from studio_core.shading.primary import pinhole

SIZES = st.tuples(st.integers(1, 13), st.integers(1, 7), st.integers(1, 3))


def lens_of(size, eye=(0.3, 1.0, 4.0), at=(0.0, 0.0, 0.0)):
    width, height, n = size
    return pinhole(View(looking(eye, at), fov=50, width=width, height=height, antialias=n))


def place_of(sample, width, n):
    """Column and row in the grid of samples."""
    pixel, inner = divmod(sample, n * n)
    return (pixel % width) * n + inner % n, (pixel // width) * n + inner // n


@given(SIZES)
def test_the_grid_of_samples_holds_each_once(size):
    width, height, n = size
    for sample in range(width * height * n * n):
        x, y = place_of(sample, width, n)
        assert sample_at(x, y, width * n, n) == sample


@given(SIZES, st.lists(st.tuples(*[st.integers(-5, 30)] * 4), max_size=3))
def test_boxes_get_the_tiles_that_they_touch(size, boxes):
    lens = lens_of(size)
    across = tiles_across(lens)
    expected = []
    for tile in range(across * tiles_down(lens)):
        x, y = (tile % across) * TILE_WIDTH, (tile // across) * TILE_HEIGHT
        inside = [
            any(left <= i < right and top <= j < bottom for i in range(x, x + 4) for j in range(y, y + 2))
            for left, top, right, bottom in boxes
        ]
        expected += [tile] * any(inside)
    found = tiles_in(lens, np.array(boxes, np.int64).reshape(-1, 4))
    np.testing.assert_array_equal(found, expected)


@pytest.fixture(scope="module", params=["auto", "bvh"])
def caster(request):
    rng = np.random.default_rng(4)
    soup = rng.normal(size=(60, 3)).astype(np.float32)
    faces = np.arange(60, dtype=np.uint32).reshape(20, 3)
    turn = np.eye(4)
    turn[:3, 3] = (0.5, 0.2, -0.3)
    items = [
        CasterObject(soup, faces, "soup", np.eye(4), np.arange(20) % 3 > 0),
        CasterObject(soup[:30], faces[:10], "less", turn, None),
    ]
    with RayCaster(items, backend=request.param) as made:
        yield made


@given(SIZES, st.booleans())
@settings(max_examples=25)
def test_first_hits_are_those_of_each_sample_s_own_ray(caster, workers, size, some):
    width, height, n = size
    eye, lens = np.array([0.3, 1.0, 4.0]), lens_of(size)
    count = width * height * n * n
    face = np.full(count, -7, np.int32)
    u, v, distance = np.full((3, count), -7, np.float32)
    tiles = np.arange(tiles_across(lens) * tiles_down(lens))
    chosen = tiles[::2] if some else np.zeros(0, np.int64)
    handles, offsets = caster.handles(), np.array([0, 20, 30])
    first_hits(
        handles.intersect8, handles.scene, caster.local(eye), lens, handles.face_start, handles.face_ids,
        offsets, chosen, face, u, v, distance, False, 0, len(chosen) if some else len(tiles),
    )  # fmt: skip
    x, y = np.array([place_of(s, width, n) for s in range(count)]).T
    traced = np.isin((y // TILE_HEIGHT) * tiles_across(lens) + x // TILE_WIDTH, chosen) | (not some)
    assert (face[~traced] == -7).all()
    directions = np.empty((count, 3), np.float32)
    sample_directions(lens, np.arange(count), directions)
    found = caster.closest(np.tile(eye, (count, 1)), directions, 0.0, np.inf, workers)
    expected = np.where(found.object >= 0, offsets[found.object] + found.face, -1)
    same = face == expected
    assert (same | ~traced).mean() > 0.98  # a ray on an edge may go either way
    hit = same & traced & (face >= 0)
    np.testing.assert_allclose(distance[hit], found.t[hit], rtol=1e-5)
    np.testing.assert_allclose(u[hit], found.u[hit], atol=1e-4)
    np.testing.assert_allclose(v[hit], found.v[hit], atol=1e-4)
    assert np.isinf(distance[traced & (face < 0)]).all()


@given(SIZES, st.lists(st.integers(0, 60), unique=True))
def test_pixels_of_tiles_are_those_with_a_sample_in_one(size, tiles):
    width, height, n = size
    lens = lens_of(size)
    tiles = [tile for tile in tiles if tile < tiles_across(lens) * tiles_down(lens)]
    x, y = np.array([place_of(s, width, n) for s in range(width * height * n * n)]).T
    inside = np.isin((y // TILE_HEIGHT) * tiles_across(lens) + x // TILE_WIDTH, tiles)
    found = pixels_of(lens, np.array(tiles, np.int64))
    np.testing.assert_array_equal(found, np.flatnonzero(inside.reshape(-1, n * n).any(axis=1)))


@given(st.lists(st.integers(0, 34), unique=True, min_size=1))
def test_compact_hits_are_those_in_their_places(caster, pixels):
    eye, lens = np.array([0.3, 1.0, 4.0]), lens_of((7, 5, 4))
    handles, offsets = caster.handles(), np.array([0, 20, 30])

    def trace(tiles, count, compact):
        face, parts = np.full(count, -7, np.int32), np.full((3, count), -7, np.float32)
        first_hits(
            handles.intersect8, handles.scene, caster.local(eye), lens, handles.face_start,
            handles.face_ids, offsets, tiles, face, *parts, compact, 0, len(tiles),
        )  # fmt: skip
        return np.vstack([face, parts])

    whole = trace(np.arange(tiles_across(lens) * tiles_down(lens)), 35 * 16, False)
    tiles = np.array([(2 * (p // 7) + half) * 7 + p % 7 for p in pixels for half in (0, 1)])
    some = trace(tiles, 16 * len(pixels), True)
    np.testing.assert_array_equal(some.reshape(4, -1, 16), whole.reshape(4, -1, 16)[:, pixels])
