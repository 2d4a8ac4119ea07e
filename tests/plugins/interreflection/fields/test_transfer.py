"""Light between two objects, against sums over pairs of vertices and the catalogue of form factors."""

from __future__ import annotations

import numpy as np
import oracles.fields as oracle
import pytest
from field_support import JOB, body, even, field, services
from scenes import cube, floor

from studio_core.scene.transform import Transform, axis_angle
from studio_core.scene.world_mesh import world_mesh
from studio_core.transport.cells import CELLS, cell_directions, cell_projected_angles
from studio_plugins.interreflection.fields.lattice import lattice_of
from studio_plugins.interreflection.fields.transfer import (
    Sources,
    combined,
    receive,
    receivers,
    receiving_rows,
)

FLIPPED = axis_angle((1, 0, 0), 180)


def sent(workers, geometry, here, there, target=None, bands=4, origin=(0, 0, 0)):
    """Irradiance of a target (else the like) by an object whose radiance is 1, and the oracle's."""
    target = target or floor(2.0)
    mesh = world_mesh([("a", geometry, here, (0,)), ("b", target, there, (0,))], 0.25, origin=origin)
    own = body(geometry, mesh.objects[0].mesh.edge)
    assert len(own.mesh) == mesh.vertex_offsets[1]
    lattice = lattice_of(own.mesh, 16, 20)
    made = field(own, lattice, even(own.mesh), workers, bands=bands)
    sources = Sources(mesh.object, mesh.positions, mesh.origin)
    sources.add(0, lattice, here, combined(made, np.ones((1, 3)), here))
    points = np.arange(mesh.vertex_offsets[1], mesh.vertex_offsets[2])
    light = sources.arriving(points, bands, services(workers), JOB)
    rows = receiving_rows(np.zeros((1, 0, CELLS), np.float32), bands)
    row = np.zeros(len(mesh), np.int32)
    vectors = receivers(mesh, points, row, rows, bands, services(workers), JOB)
    made_here = receive(vectors, light, services(workers), JOB)[:, 0, 0]
    truth = oracle.exchanged(mesh, mesh.vertices_of(0), points, np.pi)
    return made_here, truth, mesh.area[points], sources


def test_two_plates_exchange_their_form_factor(workers):
    made, _, area, _ = sent(workers, floor(2.0), Transform(), Transform((0, 1, 0), FLIPPED))
    expected = np.pi * oracle.parallel_squares(2.0, 1.0)
    facing = made > 0.1
    assert np.average(made[facing], weights=area[facing]) == pytest.approx(expected, rel=0.04)


@pytest.mark.parametrize(
    ("geometry", "here", "there"),
    [
        (floor(2.0), Transform(), Transform((0, 1, 0), FLIPPED)),
        (floor(2.0), Transform((3, 1, 2), axis_angle((1, 1, 0), 40), 1.5), Transform((3, 3.5, 2), FLIPPED)),
        (cube(1.0), Transform((0, 1, 0)), Transform()),
        (cube(1.0), Transform((1, 1, 0), axis_angle((1, 1, 0), 40), 0.5), Transform()),
        (cube(1.0), Transform((4, 12, -2), axis_angle((0, 1, 1), 70)), Transform()),
    ],
    ids=["plates", "turned", "cube", "small", "far"],
)
def test_light_is_that_of_pairs_of_vertices(workers, geometry, here, there):
    """Within 8 % in the mean square: what four bands of harmonics and eight places leave."""
    made, truth, _, _ = sent(workers, geometry, here, there)
    assert np.sqrt(((made - truth) ** 2).mean()) < 0.08 * truth.mean()
    assert made.min() >= 0


def test_it_is_the_same_far_from_the_origin(workers):
    near = sent(workers, cube(1.0), Transform((0, 1, 0)), Transform())[0]
    far = sent(workers, cube(1.0), Transform((1e4, 1, 0)), Transform((1e4, 0, 0)), origin=(1e4, 0, 0))[0]
    np.testing.assert_allclose(far, near, rtol=1e-3, atol=1e-4)


def test_an_object_gets_nothing_of_its_own_light(workers):
    sources = sent(workers, cube(1.0), Transform((0, 1, 0)), Transform())[3]
    own = np.flatnonzero(sources._owner == 0)
    assert not sources.arriving(own, 4, services(workers), JOB).any()


def test_sums_of_sources_are_their_light_together(workers):
    _, _, _, one = sent(workers, cube(1.0), Transform((0, 1, 0)), Transform())
    points = np.flatnonzero(one._owner == 1)
    both, alone = (s.arriving(points, 4, services(workers), JOB) for s in (one.plus(one), one))
    np.testing.assert_allclose(both, 2 * alone, rtol=1e-5, atol=1e-6)


def test_receivers_see_light_in_their_own_frame(workers):
    """Irradiance and L_k of light made of harmonics, against sums over the cells of each hemisphere."""
    rng = np.random.default_rng(3)
    mesh = world_mesh([("a", cube(), Transform((0, 0, 0), axis_angle((1, 2, 3), 77)), (0,))], 0.5)
    incoming = rng.uniform(0, 1, (1, 2, CELLS)).astype(np.float32)
    bands = 5
    rows = receiving_rows(incoming, bands)
    points = np.arange(len(mesh))
    row = np.zeros(len(mesh), np.int32)
    vectors = receivers(mesh, points, row, rows, bands, services(workers), JOB)
    light = rng.normal(size=bands * bands)
    light[0] = 20.0
    spread = np.repeat(np.tile(light.astype(np.float32), (len(mesh), 1))[..., None], 3, axis=2)
    made = receive(vectors, spread, services(workers), JOB)
    from studio_plugins.interreflection.fields.harmonics import harmonics_of

    normals, along = mesh.normals.astype(float), mesh.tangents[:, :3].astype(float)
    across = np.cross(normals, along) * mesh.tangents[:, 3:]
    cells = cell_directions().astype(float)
    for vertex in range(0, len(mesh), 7):
        axes = np.stack([along[vertex], across[vertex], normals[vertex]])
        seen = harmonics_of(cells @ axes, bands) @ light
        expected = (seen * cell_projected_angles() * incoming[0]).sum(axis=1)
        np.testing.assert_allclose(made[vertex, 1:, 0], expected, rtol=2e-3, atol=2e-3)
        assert made[vertex, 0, 0] == pytest.approx((seen * cell_projected_angles()).sum(), rel=0.01)
