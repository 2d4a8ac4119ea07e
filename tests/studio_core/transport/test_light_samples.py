"""Samples of lights: variants are strata, and together they are all of the light."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.suns import split_suns
from studio_core.scene.nodes import AreaLamp, PointLamp, Scene
from studio_core.scene.transform import Transform
from studio_core.shading.lamps import lamp_targets, lamps
from studio_core.transport.light_samples import joined, lamp_samples, shuffles, sun_samples
from studio_core.transport.sky_samples import Power, draw, probabilities
from studio_core.transport.zones import ZONES


def area():
    return lamps(Scene().with_nodes(AreaLamp(id="a", name="A", width=2.0, height=0.5)))[0]


@given(st.integers(1, 40), st.integers(1, 32), st.integers(0, 99))
def test_every_column_is_shuffled_by_itself(columns, variants, seed):
    found = shuffles(columns, variants, seed)
    np.testing.assert_array_equal(np.sort(found, axis=0), np.tile(np.arange(variants)[:, None], columns))


@pytest.mark.parametrize("samples", [1, 3, 8])
def test_variants_of_a_lamp_share_its_places(samples):
    made = lamp_samples(area(), samples, 16, 2)
    assert made.place.shape == (32, samples, 4)
    np.testing.assert_array_equal(made.place[:16], made.place[16:])
    own, targets = made.place[:16].reshape(-1, 4), lamp_targets(area(), 16 * samples)
    np.testing.assert_array_equal(own[np.lexsort(own.T)], targets[np.lexsort(targets.T)])
    np.testing.assert_allclose(made.light.sum(axis=1), 1.0, rtol=1e-6)  # of an area of 1 m²


def test_joined_lists_keep_their_order():
    point = lamps(Scene().with_nodes(PointLamp(id="p", name="P", transform=Transform((1, 2, 3)))))[0]
    made = joined([lamp_samples(point, 4, 2, 1), lamp_samples(area(), 3, 2, 1)], 2)
    assert made.owner == ("p", "a", "a", "a")
    assert [count for _, count in made.keys] == [1, 3]
    assert len(made) == 4
    np.testing.assert_array_equal(made.place[:, 0], [(1, 2, 3, 1)] * 2)
    light = made.coloured({"a": AreaLamp(id="a", name="A", intensity=2.0, tint=(1, 0.5, 0))})
    assert not light[:, 0].any()
    np.testing.assert_allclose(light[:, 1:].sum(axis=1), [(2, 1, 0)] * 2, rtol=1e-6)


def test_a_suns_variants_have_all_its_light():
    pixels = np.full((64, 128, 3), 0.2, np.float32)
    pixels[20, 30:33] = (3e3, 2e3, 1e3)
    pixels[40, 90] = 5e2
    _, sun = split_suns(pixels)
    assert sun is not None
    assert len(sun.parts) == 3
    made = sun_samples(sun, 4, 16, 3, "e", "key")
    assert made.place.shape[0] == 48
    np.testing.assert_allclose(made.light.sum(axis=1), [sun.irradiance.sum(axis=0)] * 48, rtol=0.02)
    towards = (made.light[:16, :, :1] * made.place[:16, :, :3]).sum(axis=(0, 1)) / 16
    expected = (sun.irradiance[:, :1] * sun.directions).sum(axis=0)
    np.testing.assert_allclose(towards, expected, rtol=0.01, atol=0.01 * np.linalg.norm(expected))


@settings(max_examples=6)
@given(st.integers(0, 1 << 30))
def test_drawn_directions_are_the_light(seed):
    """What a smooth function of direction gives is, over all variants, the integral of light times it."""
    rng = np.random.default_rng(seed)
    leaves = rng.gamma(1.0, 1.0, (1 << 12, 3)).astype(np.float32)
    leaves[rng.random(1 << 12) < 0.3] = 0
    tree = LightTree.build(leaves)
    power = Power.of(tree)
    worth = rng.random((ZONES, 1 << 10)) * (rng.random((ZONES, 1 << 10)) < 0.5)
    worth[0] = 0  # a zone that sees nothing draws by light alone
    chance = probabilities(power.cells, worth)
    np.testing.assert_allclose(chance.sum(axis=1), 1)
    directions, light = draw(tree, power, chance, 64, 16)
    axis = 0.3 * rng.normal(size=3)
    made = (light * (directions @ axis + 1)[..., None]).sum(axis=1).reshape(ZONES, 16, 3).mean(axis=1)
    expected = tree.prefix_power[-1] + tree.prefix_vector[-1] @ axis
    np.testing.assert_allclose(made[0], expected, rtol=0.2)
    np.testing.assert_allclose(made.mean(axis=0), expected, rtol=0.08)
    assert (light >= 0).all()
