"""Fields: what one vertex sends is what a small source sends; insides are black."""

from __future__ import annotations

import numpy as np
import pytest
from field_support import body, even, field
from scenes import cube, floor

from studio_core.transport.cells import cell_of
from studio_plugins.interreflection.fields.bases import Basis
from studio_plugins.interreflection.fields.harmonics import harmonics_of
from studio_plugins.interreflection.fields.lattice import lattice_of
from studio_plugins.interreflection.fields.precompute import cones


def test_one_vertex_sends_what_a_small_source_sends(workers):
    """Its function falls off linearly over the adjacent faces: radiance times a third of their area."""
    own = body(floor(2.0), 0.25, lobes=1)
    mesh = own.mesh
    inner = np.abs(mesh.positions[:, [0, 2]]).max(axis=1) < 0.8
    vertex = int(np.flatnonzero(inner & (mesh.side == 1))[7])
    functions = np.zeros((len(mesh), 1), np.float32)
    functions[vertex] = 1
    lattice = lattice_of(mesh, 8, 8)
    made = field(own, lattice, Basis(functions, mesh.area.astype(float)), workers, rays=4096)
    values = made.values / lattice.grown().astype(np.float32)[None, :, None]
    way = mesh.positions[vertex] - lattice.points()
    distance = np.linalg.norm(way, axis=1)
    towards = way / distance[:, None]
    cosine = -towards @ mesh.normals[vertex]
    far = (distance > 1.0) & (cosine > 0.2)
    assert far.sum() > 100
    expected = harmonics_of(towards, 4) * (cosine * mesh.area[vertex] / distance**2)[:, None]
    size = np.linalg.norm(expected[far])
    assert np.linalg.norm(values[0][far] - expected[far]) < 0.05 * size
    cells = np.array([cell_of(0.0, np.sqrt(1 - c * c), c) for c in cosine[far]])
    glossy = expected[far] * own.reflection.outgoing[0, 0, cells][:, None]
    assert np.linalg.norm(values[1][far] - glossy) < 0.08 * np.linalg.norm(glossy)
    below = cosine < -0.1
    assert not values[:, below].any()


def test_inside_of_a_closed_object_is_what_is_outside_of_it(workers):
    own = body(cube(2.0), 0.5)
    lattice = lattice_of(own.mesh, 8, 8)
    made = field(own, lattice, even(own.mesh), workers, rays=64).values[0]
    bare = made / lattice.grown().astype(np.float32)[:, None]
    assert (bare[:, 0] > 0).all()
    inside = np.abs(lattice.points()).max(axis=1) < 0.9
    assert inside.any()
    size = lattice.layer_size
    np.testing.assert_allclose(bare[:size], bare[size : 2 * size], rtol=1e-5, atol=1e-6)


def test_cones_hold_the_object():
    for geometry in (cube(2.0), floor(2.0)):
        mesh = body(geometry, 0.5).mesh
        lattice = lattice_of(mesh, 8, 6)
        axis, cosine = cones(lattice)
        way = mesh.positions[None] - lattice.points()[:, None]
        way /= np.maximum(np.linalg.norm(way, axis=2, keepdims=True), 1e-12)
        along = (way * axis[:, None]).sum(axis=2)
        assert (along >= cosine[:, None] - 1e-4).all()
        np.testing.assert_allclose(np.linalg.norm(axis, axis=1), 1, atol=1e-9)


def test_even_light_about_an_open_plate_is_its_solid_angle(workers):
    own = body(floor(2.0), 0.5)
    lattice = lattice_of(own.mesh, 8, 9)
    made = field(own, lattice, even(own.mesh), workers, rays=1024).values[0]
    bare = made[:, 0] / lattice.grown()
    x, z, height = (lattice.places() / 1.0).T
    solid = np.zeros(len(bare))
    for sx in (1, -1):
        for sz in (1, -1):
            a, b, h = 1 - sx * x, 1 - sz * z, np.abs(height)
            solid += np.arctan2(a * b, h * np.sqrt(a * a + b * b + h * h))
    np.testing.assert_allclose(bare, solid / np.sqrt(4 * np.pi), atol=0.03)
    assert bare.max() == pytest.approx(2 * np.pi / np.sqrt(4 * np.pi), rel=0.05)
