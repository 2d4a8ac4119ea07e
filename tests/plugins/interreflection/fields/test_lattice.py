"""Where fields are sampled: places, and what is found between and beyond them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import cube, floor

from studio_core.scene.shading_mesh import shade_mesh
from studio_plugins.interreflection.fields.lattice import (
    FARTHEST,
    NEAREST,
    NEIGHBOURS,
    fill_blind,
    lattice_of,
    neighbours,
)

CUBE = lattice_of(shade_mesh(cube(2.0), 0.5), 8, 9)
PLATE = lattice_of(shade_mesh(floor(2.0), 0.5), 8, 9)


def looked_up(lattice, values, point):
    index, weight = np.empty(NEIGHBOURS, np.int64), np.empty(NEIGHBOURS)
    neighbours(*point, lattice.numbers, lattice.lengths, index, weight)
    assert index.min() >= 0
    assert index.max() < len(lattice)
    assert weight.min() >= 0
    return weight @ values[index]


def test_a_floor_has_layers_and_a_cube_spheres():
    assert PLATE.flat
    assert not CUBE.flat
    radii = np.linalg.norm(CUBE.places(), axis=1)
    assert radii.min() == pytest.approx(NEAREST * np.sqrt(3))
    assert radii.max() == pytest.approx(FARTHEST * np.sqrt(3))
    assert len(CUBE) == 8 * 81
    np.testing.assert_allclose(np.abs(PLATE.axes[2]), [0, 1, 0], atol=1e-6)
    assert (PLATE.places()[: len(PLATE) // 2, 2] > 0).all()
    assert (PLATE.places()[len(PLATE) // 2 :, 2] < 0).all()


@pytest.mark.parametrize("lattice", [CUBE, PLATE], ids=["cube", "plate"])
def test_places_find_themselves(lattice):
    values = lattice.places() @ (0.3, -0.5, 0.7)  # the same where places coincide
    for number, point in enumerate(lattice.places()):
        near = point * (1 - 1e-12)
        assert looked_up(lattice, values * lattice.grown(), near) == pytest.approx(values[number], abs=1e-6)


@given(st.floats(0.05, 100), st.integers(0, 2**31))
def test_what_falls_off_with_the_square_of_the_distance_is_found_far_away(distance, seed):
    towards = np.random.default_rng(seed).normal(size=3)
    towards /= np.linalg.norm(towards)
    values = CUBE.grown() * (CUBE.radius / np.linalg.norm(CUBE.places(), axis=1)) ** 2
    point = towards * distance * CUBE.radius
    found = looked_up(CUBE, values, point)
    true = 1 / np.clip(distance, NEAREST, None) ** 2
    assert found == pytest.approx(true, rel=0.15)
    if distance > FARTHEST:
        assert found == pytest.approx(true, rel=1e-6)


@given(st.integers(0, 2**31))
def test_any_point_is_looked_up_among_eight_places(seed):
    rng = np.random.default_rng(seed)
    point = rng.normal(size=3) * 10 ** rng.uniform(-3, 3)
    for lattice in (CUBE, PLATE):
        found = looked_up(lattice, lattice.grown(), point)
        assert 0 <= found <= 2


def test_even_light_is_even_within():
    rng = np.random.default_rng(1)
    for point in rng.uniform(-1, 1, (50, 3)):
        assert looked_up(CUBE, np.ones(len(CUBE)), point) == pytest.approx(
            1 / (1 + max(np.linalg.norm(point), NEAREST * CUBE.radius) ** 2 / CUBE.radius**2)
        )


def test_blind_places_take_what_lies_outward():
    values = np.arange(len(CUBE), dtype=np.float32)[None]
    blind = np.zeros(len(CUBE), bool)
    size = CUBE.layer_size
    blind[:size] = True
    blind[size + 4] = True
    fill_blind(CUBE, blind, values)
    expected = np.arange(size) + size
    expected[4] += size
    np.testing.assert_array_equal(values[0, :size], expected)
    assert values[0, -1] == len(CUBE) - 1
