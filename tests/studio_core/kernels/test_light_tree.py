"""Light on the tree of directions: turned without drift, summed exactly."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from studio_core.colour import LUMINANCE
from studio_core.errors import InputError
from studio_core.kernels.directions import direction_set
from studio_core.kernels.environment import integrate_environment
from studio_core.kernels.light_tree import LightTree, rotate_radiance
from studio_core.parallel import Workers


def turn(seed: int) -> npt.NDArray[np.float64]:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    return np.asarray(q)


def power(leaves: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
    return np.asarray(leaves.sum(axis=0, dtype=np.float64) * 4 * math.pi / len(leaves))


def test_fast_turning_follows_the_exact_one(workers: Workers) -> None:
    rng = np.random.default_rng(3)
    sky = np.clip(np.cos(np.linspace(0, np.pi, 48)), 0, 1)[:, None, None] * np.ones((48, 96, 3))
    pixels = sky + rng.uniform(0, 0.05, (48, 96, 3))
    pixels[10:14, 20:25] += [5.0, 4.0, 3.0]
    rotation = turn(8)
    still = integrate_environment(pixels, np.eye(3), 14, workers)
    exact = integrate_environment(pixels, rotation, 12, workers)
    fast = rotate_radiance(still, rotation, 12, workers)
    np.testing.assert_allclose(power(fast), power(exact), rtol=1e-3)
    error = np.sqrt(((fast.astype(np.float64) - exact) ** 2).mean()) / exact.mean()
    assert error < 0.05
    np.testing.assert_array_equal(rotate_radiance(np.zeros_like(still), rotation, 10, workers), 0.0)


@pytest.mark.parametrize("k", [10, 13])
def test_the_tree_holds_sums_of_its_leaves(k: int) -> None:
    rng = np.random.default_rng(k)
    size = 1 << k
    radiance = rng.lognormal(-2, 3, (size, 3)).astype(np.float32)
    tree = LightTree.build(radiance)
    wide, along = radiance.astype(np.float64), direction_set(k).directions.astype(np.float64)
    lum = wide @ np.array(LUMINANCE)
    for node in [1, 2, 3, *rng.integers(4, 2 * size, 60)]:
        first, last = int(node), int(node) + 1
        while first < size:
            first, last = 2 * first, 2 * last
        chosen = slice(first - size, last - size)
        np.testing.assert_allclose(tree.node_sum[node], wide[chosen].sum(axis=0), rtol=1e-6)
        moment = lum[chosen] @ along[chosen]
        np.testing.assert_allclose(tree.node_moment[node], moment, rtol=1e-5, atol=1e-6 * lum[chosen].sum())
    for _ in range(40):
        a, b = np.sort(rng.integers(0, size + 1, 2))
        np.testing.assert_allclose(
            tree.prefix_power[b] - tree.prefix_power[a],
            wide[a:b].sum(axis=0) * tree.solid_angle,
            rtol=1e-9,
            atol=1e-9,
        )
        expected = np.einsum("lc,la->ca", wide[a:b], along[a:b]) * tree.solid_angle
        np.testing.assert_allclose(
            tree.prefix_vector[b] - tree.prefix_vector[a], expected, rtol=1e-8, atol=1e-9
        )


def test_coarser_trees_keep_light_and_are_the_finer_ones_nodes() -> None:
    rng = np.random.default_rng(6)
    fine = LightTree.build(rng.lognormal(0, 2, (1 << 13, 3)))
    coarse = fine.coarsened(10)
    assert fine.coarsened(13) is fine
    assert fine.coarsened(10) is coarse
    np.testing.assert_allclose(coarse.prefix_power[-1], fine.prefix_power[-1], rtol=1e-6)
    np.testing.assert_allclose(coarse.node_sum[1 << 10 :], fine.node_sum[1 << 10 : 2 << 10] / 8, rtol=1e-6)
    with pytest.raises(ValueError, match="cannot be made"):
        coarse.coarsened(12)


def test_a_uniform_sky_gives_pi_times_its_radiance() -> None:
    tree = LightTree.build(np.full((1 << 15, 3), 2.0))
    upper = tree.prefix_vector[1 << 14] - tree.prefix_vector[0]
    np.testing.assert_allclose(upper[:, 1], 2.0 * math.pi, rtol=2e-4)
    np.testing.assert_allclose(upper[:, [0, 2]], 0.0, atol=1e-4)


@pytest.mark.parametrize(
    ("radiance", "cause"),
    [
        (np.ones((1000, 3)), "2\\^k rows"),
        (np.ones((1024, 4)), "2\\^k rows"),
        (np.full((1024, 3), np.inf), "finite"),
        (np.full((1024, 3), -1.0), "negative"),
    ],
)
def test_leaves_that_are_no_light_are_refused(radiance: npt.NDArray[np.float64], cause: str) -> None:
    with pytest.raises(InputError, match=cause):
        LightTree.build(radiance)


@pytest.mark.parametrize("k", [10, 15])
def test_trees_are_the_same_bits_with_any_threads(k: int, workers: Workers) -> None:
    radiance = np.random.default_rng(k).lognormal(0, 2, (1 << k, 3))
    alone = LightTree.build(radiance)
    with Workers(3) as three:
        for some in (workers, three):
            made = LightTree.build(radiance, some)
            for name in ("radiance", "node_sum", "node_moment", "prefix_power", "prefix_vector"):
                np.testing.assert_array_equal(getattr(made, name), getattr(alone, name))


@pytest.mark.parametrize("k", [10, 15])
def test_turns_are_the_same_bits_with_any_threads(k: int, workers: Workers) -> None:
    leaves = np.random.default_rng(k).lognormal(0, 2, (1 << 13, 3)).astype(np.float32)
    with Workers(1) as one:
        alone = rotate_radiance(leaves, turn(2), k, one)
    np.testing.assert_array_equal(alone, rotate_radiance(leaves, turn(2), k, workers))


def test_turning_there_and_back_moves_light_by_little(workers: Workers) -> None:
    """A spot of light stays where the rotation takes its middle."""
    directions = direction_set(13).directions.astype(np.float64)
    axis = np.array([0.6, 0.48, 0.64])
    leaves = np.repeat(np.exp(40 * (directions @ axis - 1))[:, None], 3, axis=1).astype(np.float32)
    for seed in range(6):
        rotation = turn(seed)
        centroid = rotate_radiance(leaves, rotation, 13, workers)[:, 0].astype(np.float64) @ directions
        centroid /= np.linalg.norm(centroid)
        assert np.degrees(np.arccos(min(1.0, centroid @ (rotation @ axis)))) < 0.05
