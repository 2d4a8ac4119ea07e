"""Masks of the brush, against distances that are measured one by one."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from studio_core.strokes.brush import Brush, lay, path_of

WIDTH, HEIGHT = 37, 23


def slow_mask(brush, path, width=WIDTH, height=HEIGHT):
    """The largest profile over all segments, of every pixel."""
    points = path_of(path) * (width, height, brush.size / 2 * height)
    points[:, 2] = np.maximum(points[:, 2], 0.75)
    y, x = np.mgrid[:height, :width] + 0.5
    made = np.zeros((height, width))
    for a, b in itertools.pairwise(points) if len(points) > 1 else [(points[0], points[0])]:
        way = b[:2] - a[:2]
        near = ((x - a[0]) * way[0] + (y - a[1]) * way[1]) / max(way @ way, 1e-300)
        for t in (near.clip(0, 1), 0 * x, 0 * x + 1):
            radius = a[2] + t * (b[2] - a[2])
            distance = np.hypot(x - a[0] - t * way[0], y - a[1] - t * way[1])
            inner, outer = brush.hardness * radius, radius
            thin = outer - inner < 1
            middle = (inner + outer) / 2
            inner, outer = np.where(thin, middle - 0.5, inner), np.where(thin, middle + 0.5, outer)
            fall = ((outer - distance) / (outer - inner)).clip(0, 1)
            made = np.maximum(made, fall * fall * (3 - 2 * fall))
    return made


brushes = st.builds(Brush, size=st.floats(1e-3, 1.5), hardness=st.floats(0, 1))
paths = st.integers(1, 5).flatmap(
    lambda count: hnp.arrays(np.float64, (count, 3), elements=st.floats(-1.5, 2.5))
)


@given(brushes, paths)
def test_mask_is_the_profile_of_the_distance_to_the_path(brush, path):
    mask = brush.mask(path, WIDTH, HEIGHT)
    assert mask.dtype == np.float32
    np.testing.assert_allclose(mask, slow_mask(brush, path), atol=2e-5)


@given(brushes, paths, st.integers(1, 4))
def test_a_path_in_parts_is_the_path(brush, path, cut):
    cut = min(cut, len(path)) - 1
    whole, parts = brush.mask(path, WIDTH, HEIGHT), np.zeros((HEIGHT, WIDTH), np.float32)
    for part in (path[: cut + 1], path[cut:]):
        before = parts.copy()
        top, bottom, left, right = brush.add(parts, part)
        outside = np.ones(parts.shape, bool)
        outside[top:bottom, left:right] = False
        assert np.array_equal(parts[outside], before[outside])
    np.testing.assert_array_equal(parts, whole)
    assert (whole >= 0).all()
    assert (whole <= 1).all()


def test_one_place_is_a_dab_and_a_small_one_still_touches():
    dab = Brush(size=0.5, hardness=1.0).mask([(0.5, 0.5)], WIDTH, HEIGHT)
    radius = 0.25 * HEIGHT
    assert dab.sum() == pytest.approx(np.pi * radius**2, rel=0.03)
    assert dab[HEIGHT // 2, WIDTH // 2] == 1
    for x in np.linspace(0, 1, 23):
        assert Brush(size=1e-3).mask([(x, 0.31)], WIDTH, HEIGHT).max() > 0


def test_outside_of_the_picture_nothing_is_painted():
    for path in ([(3.0, 3.0)], [(-4.0, 0.5), (-2.0, 0.5)], [(1e300, -1e300)]):
        mask = np.zeros((HEIGHT, WIDTH), np.float32)
        top, bottom, left, right = Brush().add(mask, path)
        assert not mask.any()
        assert (bottom - top) * (right - left) == 0
    assert Brush().mask([(-1e6, 0.5), (1e6, 0.5)], WIDTH, HEIGHT).any(axis=0).all()


def test_pressure_narrows_the_brush():
    mask = Brush(size=0.6).mask([(0.1, 0.5, 1.0), (0.9, 0.5, 0.1)], WIDTH, HEIGHT)
    high = (mask > 0).sum(axis=0)
    assert high[5] > 2 * high[32] > 0


@pytest.mark.parametrize("path", [[], [(0.1,)], [(np.nan, 0.0)], [(0.0, np.inf, 1.0)], 3.0])
def test_what_is_no_path_is_said(path):
    with pytest.raises(ValueError, match="a path is"):
        Brush().mask(path, 8, 8)


def test_only_the_rectangle_that_is_touched_is_walked_over():
    """A long thin line over a huge picture writes where it goes alone."""
    mask = np.zeros((2000, 3000), np.float32)
    lay(np.array([[10.0, 10.0, 3.0], [40.0, 12.0, 3.0]]), 0.5, mask)
    assert mask[:20, :50].sum() == mask.sum() > 100
