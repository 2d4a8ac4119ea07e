"""Irradiance where nothing is in the way."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.kernels.environment import EnvironmentMap, row_weights
from studio_core.kernels.light_tree import LightTree
from studio_core.shading.open_light import OpenLight


def directions(height, width):
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    theta, phi = np.pi * v, 2 * np.pi * (0.5 - u)
    return np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=2)


def summed(pixels, normal):
    """Pixel by pixel."""
    height, width = pixels.shape[:2]
    weight = row_weights(height)[:, None] * 2 * np.pi / width
    facing = np.maximum(directions(height, width) @ normal, 0) * weight
    return (pixels.astype(np.float64) * facing[..., None]).sum(axis=(0, 1))


def unit(v):
    return np.asarray(v, np.float64) / np.linalg.norm(v)


WAYS = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1).map(unit)


@given(WAYS, st.integers(0, 5))
@settings(max_examples=30)
def test_cells_are_as_good_as_pixels(normal, seed):
    pixels = np.random.default_rng(seed).random((240, 480, 3)).astype(np.float32) ** 4
    made = OpenLight(pixels).irradiance(normal)[0]
    np.testing.assert_allclose(made, summed(pixels, normal), rtol=4e-3)


@pytest.mark.parametrize("shape", [(1, 2), (3, 5), (97, 194), (200, 300)])
def test_an_even_sky_gives_pi_to_any_normal(shape):
    ways = np.random.default_rng(0).normal(size=(300, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    made = OpenLight(np.ones((*shape, 3), np.float32)).irradiance(ways)
    np.testing.assert_allclose(made, np.pi, rtol=2e-3)


def test_it_is_what_the_leaves_of_an_environment_give(workers):
    """A surface that catches shadows must not change where nothing casts any: backends sum over leaves."""
    towards = directions(128, 256)
    pixels = 0.2 + 3 * np.maximum(towards @ unit((1, 2, 1)), 0) ** 20
    pixels = np.repeat(pixels[..., None], 3, axis=2).astype(np.float32)
    leaves = EnvironmentMap.prepare(pixels, 15, workers).over_leaves(np.eye(3), workers)
    vector = LightTree.build(leaves, workers)
    from studio_core.kernels.directions import direction_set

    for normal in np.eye(3):
        facing = np.maximum(direction_set(15).directions @ normal, 0)
        expected = (vector.radiance * facing[:, None]).sum(axis=0) * vector.solid_angle
        np.testing.assert_allclose(OpenLight(pixels).irradiance(normal)[0], expected, rtol=2e-3)


def test_many_normals_are_as_each_by_itself():
    pixels = np.random.default_rng(3).random((32, 64, 3)).astype(np.float32)
    light = OpenLight(pixels)
    ways = np.random.default_rng(4).normal(size=(40, 3))
    ways = ways[np.random.default_rng(5).integers(0, 40, 200)]
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    each = np.concatenate([light.irradiance(way) for way in ways])
    np.testing.assert_allclose(light.irradiance(ways), each, rtol=2e-3)
    assert light.irradiance(np.zeros((0, 3))).shape == (0, 3)
