"""Zones of a scene."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from studio_core.transport.zones import ACROSS, ANY, FACINGS, ZONES, Zones


def points(seed, count=400):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    return rng.normal(size=(count, 3)) * (4, 1, 2) + 7, (
        normals / np.linalg.norm(normals, axis=1, keepdims=True)
    ).astype(np.float32)


@given(st.integers(0, 1 << 30))
def test_every_part_holds_its_share(seed):
    places, normals = points(seed)
    zone = Zones.about(places).of(np.zeros(3), places.astype(np.float32), normals)
    assert zone.min() >= 0
    assert zone.max() < ZONES
    parts = zone % (ZONES // FACINGS)
    of_axis = np.unravel_index(parts, ACROSS)
    for axis, found in enumerate(of_axis):
        assert np.abs(np.bincount(found, minlength=ACROSS[axis]) - 400 / ACROSS[axis]).max() <= 4


def test_facing_is_the_nearest_axis():
    normals = np.concatenate([-np.eye(3), np.eye(3)]).astype(np.float32)
    places = np.zeros((6, 3))
    zone = Zones.about(places).of(np.zeros(3), places.astype(np.float32), normals)
    np.testing.assert_array_equal(zone // (ZONES // FACINGS), [0, 2, 4, 1, 3, 5])


def test_zones_do_not_depend_on_the_origin():
    places, normals = points(3)
    zones = Zones.about(places + 1e4)
    near = zones.of(np.full(3, 1e4), places.astype(np.float32), normals)
    other = zones.of(np.array((1e4 + 7, 1e4 + 1, 1e4 - 2)), (places - (7, 1, -2)).astype(np.float32), normals)
    np.testing.assert_array_equal(near, other)


def test_a_point_counts_most_for_its_own_zone():
    """Where it stands in the middle of its part and faces along an axis."""
    places, _ = points(5)
    zones = Zones.about(places)
    corners = np.stack(np.meshgrid(*zones.middle, indexing="ij"), axis=-1).reshape(-1, 3)
    for facing in range(FACINGS):
        normals = np.zeros((len(corners), 3), np.float32)
        normals[:, facing // 2] = 1 if facing % 2 else -1
        share = zones.shares(corners, normals)
        own = zones.of(np.zeros(3), corners.astype(np.float32), normals)
        np.testing.assert_array_equal(share.argmax(axis=0), own)
        np.testing.assert_allclose(share.max(axis=0), 1 + ANY, rtol=1e-6)
