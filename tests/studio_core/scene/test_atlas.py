"""Atlases show every spot of a surface once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.meshes import box

from studio_core.kernels.atlas import cover
from studio_core.scene.atlas import MARGIN, MOST, atlas_of, filled, is_atlas, packed, texels_of
from studio_core.scene.geometry import Geometry


def sheet(uvs):
    positions = np.array([[0, 0, 0], [2, 0, 0], [2, 0, 1], [0, 0, 1]], np.float32)
    faces = np.array([[0, 2, 1], [0, 3, 2]], np.uint32)
    return Geometry(positions, faces, None, np.asarray(uvs, np.float32))


WHOLE = [[0, 0], [1, 0], [1, 1], [0, 1]]


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(1, 12))
def test_faces_cover_what_they_have_inside(seed, size):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-2, size + 2, (3, 3, 2))
    face, often = np.full((size, size), -1, np.int32), np.zeros((size, size), np.int32)
    second, third = np.zeros((2, size, size), np.float32)
    cover(corners, face, second, third, often)
    middle = np.stack(np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5), axis=-1)
    shares = []
    for triangle in corners:
        sides = np.stack([triangle[1] - triangle[0], triangle[2] - triangle[0]], axis=1)
        b, c = np.moveaxis((middle - triangle[0]) @ np.linalg.inv(sides).T, -1, 0)
        shares.append(np.stack([1 - b - c, b, c]))
    least = np.array(shares).min(axis=1)
    expected = np.where((least >= 0).any(axis=0), 2 - np.argmax((least >= 0)[::-1], axis=0), -1)
    np.testing.assert_array_equal(face, expected)
    np.testing.assert_array_equal(often, (least > 1e-3).sum(axis=0))
    there = face >= 0
    chosen = np.array(shares)[face[there], :, *np.nonzero(there)]
    np.testing.assert_allclose(np.stack([second[there], third[there]], axis=1), chosen[:, 1:], atol=1e-5)


@pytest.mark.parametrize(
    ("uvs", "known"),
    [
        (WHOLE, True),
        (np.array(WHOLE) * 0.5 + 0.2, True),
        (np.array(WHOLE) * 2, False),
        (np.array(WHOLE) - 0.5, False),
        ([[0, 0], [1, 0], [0, 1], [1, 1]], False),
        (np.zeros((4, 2)), False),
    ],
)
def test_which_coordinates_are_an_atlas(uvs, known):
    assert is_atlas(sheet(uvs)) == known
    made = atlas_of(sheet(uvs), 0.05)
    assert made.made != known
    assert is_atlas(made.geometry)
    assert made.size % 4 == 0


def test_a_mesh_without_coordinates_gets_an_atlas_of_even_density():
    plain = box((1, 2, 0.5), (0, 0, 0))
    made = atlas_of(Geometry(plain.positions, plain.faces), 0.02)
    assert is_atlas(made.geometry)
    assert made.texel <= 0.0203
    texels = texels_of(made)
    area = len(texels.row) * made.texel**2
    assert area == pytest.approx(2 * (2 + 0.5 + 1), rel=0.03)
    np.testing.assert_array_equal(made.geometry.positions[made.geometry.faces], plain.positions[plain.faces])


def test_no_more_texels_than_allowed_make_them_longer():
    plain = box((1, 2, 0.5), (0, 0, 0))
    made = atlas_of(Geometry(plain.positions, plain.faces), 1e-5, 128)
    assert made.size <= 128 < MOST
    assert made.texel > 0.01
    assert len(texels_of(made).row) > 128 * 128 / 3


def test_pictures_show_the_surface_and_its_nearest_spot_beside_it():
    made = atlas_of(sheet(np.array(WHOLE) * 0.5), 0.05)
    texels = texels_of(made)
    places = texels.of(made.geometry, made.geometry.positions)
    picture = filled(texels, made.size, places)
    across = (np.arange(made.size) + 0.5) / made.size * 4
    np.testing.assert_allclose(picture[-1, :, 0], np.minimum(across, 2), atol=4 / made.size)
    np.testing.assert_allclose(picture[:, 0, 2], np.minimum(across[::-1] / 2, 1), atol=4 / made.size)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 30))
def test_charts_lie_side_by_side(seed, count):
    rng = np.random.default_rng(seed)
    chart = np.repeat(np.arange(count), 4)
    uvs = rng.uniform(-5, 5, (count, 1, 2)) + rng.uniform(0, 1, (count, 4, 2)) * rng.exponential(
        1, (count, 1, 1)
    )
    placed, side = packed(uvs.reshape(-1, 2), chart, 0.1)
    boxes = [(placed[chart == k].min(axis=0), placed[chart == k].max(axis=0)) for k in range(count)]
    assert placed.min() >= 0.05 - 1e-9
    assert placed.max() <= side - 0.05 + 1e-9
    for a, (low, high) in enumerate(boxes):
        np.testing.assert_allclose(high - low, np.ptp(uvs[a], axis=0), atol=1e-9)
        for other_low, other_high in boxes[:a]:
            assert (low > other_high + 0.09).any() or (other_low > high + 0.09).any()
    assert MARGIN >= 2
