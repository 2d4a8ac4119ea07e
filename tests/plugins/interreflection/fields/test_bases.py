"""Principal components and weights: they make what they learnt, with least squares, by area."""

from __future__ import annotations

import numpy as np
import oracles.fields as oracle
import pytest
from field_support import JOB, body, services
from hypothesis import given
from hypothesis import strategies as st
from scenes import cube, floor

from studio_core.transport.cells import CELLS, cell_directions
from studio_plugins.interreflection.fields.bases import principal_components
from studio_plugins.interreflection.fields.lattice import lattice_of
from studio_plugins.interreflection.fields.training import cells_of, columns, light_places, lit


@given(st.integers(3, 40), st.integers(1, 30), st.integers(1, 12), st.integers(0, 2**31))
def test_as_many_components_as_columns_make_all_of_them(vertices, count, rank, seed):
    rng = np.random.default_rng(seed)
    data = (rng.normal(size=(vertices, rank)) @ rng.normal(size=(rank, count))).astype(np.float32)
    area = rng.uniform(0.1, 2, vertices)
    basis = principal_components(data, area, rank)
    assert len(basis) <= rank
    np.testing.assert_allclose(basis.made(basis.weights(data)), data, atol=2e-3 * np.abs(data).max())


@given(st.integers(2, 12), st.integers(0, 2**31))
def test_weights_are_least_squares(count, seed):
    rng = np.random.default_rng(seed)
    area = rng.uniform(0.01, 2, 60)
    basis = principal_components(rng.normal(size=(60, 40)).astype(np.float32), area, count)
    values = rng.normal(size=(60, 2, 3))
    expected = oracle.least_squares(basis.functions.astype(float), area, values.reshape(60, 6))
    np.testing.assert_allclose(basis.weights(values).reshape(-1, 6), expected, atol=1e-5)


def test_no_other_functions_do_better(workers):
    """Error of the columns themselves, by area, against as many columns chosen at random."""
    own = body(cube(), 0.3)
    lattice = lattice_of(own.mesh, 4, 6)
    with own.caster() as caster:
        given = columns(own, *lit(own, caster, light_places(lattice, 64), services(workers), JOB))
    area = own.mesh.area.astype(float)

    def error(functions):
        weights = oracle.least_squares(functions, area, given.astype(float))
        return ((functions @ weights - given) ** 2 * area[:, None]).sum()

    made = principal_components(given, own.mesh.area, 8)
    rng = np.random.default_rng(0)
    for _ in range(20):
        chosen = given[:, rng.choice(given.shape[1], 8, replace=False)].astype(float)
        assert error(made.functions.astype(float)) < error(chosen)


def test_nothing_lit_has_no_functions():
    basis = principal_components(np.zeros((5, 3), np.float32), np.ones(5), 4)
    assert len(basis) == 0
    assert basis.weights(np.ones((5, 3))).shape == (0, 3)


def test_lights_give_what_a_point_light_gives(workers):
    own = body(floor(2.0), 0.5, lobes=2)
    lights = np.array([[0.3, 1.5, -0.2], [0.0, -1.0, 0.0]])
    with own.caster() as caster:
        irradiance, glossy = lit(own, caster, lights, services(workers), JOB)
    mesh = own.mesh
    for light, column in zip(lights, irradiance.T, strict=True):
        way = light - mesh.positions
        distance = np.linalg.norm(way, axis=1)
        cosine = (way * mesh.normals).sum(axis=1) / distance
        np.testing.assert_allclose(column, np.maximum(cosine, 0) / distance**2, rtol=1e-4, atol=1e-6)
    upper = irradiance[:, 0] > 0
    assert (glossy[upper, 0] > 0).all()
    first, second = glossy[upper, 0].T
    np.testing.assert_allclose(first**2, second * irradiance[upper, 0], rtol=1e-3)


def test_an_objects_own_shadow_is_learnt(workers):
    """Two plates, one over the other: the lower sees nothing of a light above."""
    from studio_core.scene.geometry import Geometry

    one = floor(1.0)
    both = Geometry(
        np.concatenate([one.positions, one.positions + np.array([0, 0.2, 0], np.float32)]),
        np.concatenate([one.faces, one.faces + np.uint32(len(one.positions))]),
        np.concatenate([one.normals, one.normals]),
    )
    own = body(both, 0.4)
    with own.caster() as caster:
        irradiance, _ = lit(own, caster, [[0.0, 5.0, 0.0]], services(workers), JOB)
    low = own.mesh.positions[:, 1] < 0.1
    middle = np.abs(own.mesh.positions[:, [0, 2]]).max(axis=1) < 0.4
    assert (irradiance[low & middle] == 0).all()
    assert irradiance[~low].max() == pytest.approx(1 / 4.8**2, rel=1e-3)


def test_cells_are_those_of_the_kernel():
    np.testing.assert_array_equal(cells_of(*cell_directions().astype(float).T), np.arange(CELLS))
