"""Environment maps: integrated over leaves without loss, whatever their size and rotation."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import light_tree as oracle

from studio_core.errors import Cancelled, InputError
from studio_core.kernels.directions import direction_set
from studio_core.kernels.environment import EnvironmentMap, integrate_environment, reduced_map
from studio_core.parallel import Workers


def turn(seed: int) -> npt.NDArray[np.float64]:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    return np.asarray(q)


def about_y(angle: float) -> npt.NDArray[np.float64]:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def power(leaves: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
    return np.asarray(leaves.sum(axis=0, dtype=np.float64) * 4 * math.pi / len(leaves))


@settings(max_examples=15, deadline=None)
@given(
    height=st.integers(1, 80),
    width=st.integers(2, 120),
    k=st.sampled_from([10, 11, 12]),
    value=st.sampled_from([0.0, 1e-4, 0.3, 1e6]),
    seed=st.integers(0, 9),
)
def test_a_constant_map_stays_constant(
    height: int, width: int, k: int, value: float, seed: int, workers: Workers
) -> None:
    pixels = np.full((height, width, 3), value, np.float32)
    leaves = integrate_environment(pixels, turn(seed), k, workers)
    np.testing.assert_allclose(leaves, value, rtol=2e-6)


@settings(max_examples=25, deadline=None)
@given(
    height=st.integers(40, 300),
    where=st.floats(0.0, 1.0),
    column=st.integers(0, 10_000),
    k=st.sampled_from([10, 11, 12]),
    seed=st.integers(0, 99),
)
def test_a_one_pixel_sun_keeps_its_power(
    height: int, where: float, column: int, k: int, seed: int, workers: Workers
) -> None:
    pixels = np.full((height, 2 * height, 3), 0.01)
    pixels[round(where * (height - 1)), column % (2 * height)] = [1e5, 3e4, 0.5]
    leaves = integrate_environment(pixels, turn(seed), k, workers)
    np.testing.assert_allclose(power(leaves), oracle.power(pixels), rtol=1e-4)


@settings(max_examples=25, deadline=None)
@given(
    height=st.integers(40, 300),
    where=st.floats(0.0, 1.0),
    k=st.sampled_from([10, 12]),
    seed=st.integers(0, 99),
)
def test_a_suns_power_lands_in_its_own_leaves(
    height: int, where: float, k: int, seed: int, workers: Workers
) -> None:
    """Scaling to the right power must not hide a sun that the sampling lost: the sky around stays."""
    pixels = np.full((height, 2 * height, 3), 1.0)
    pixels[round(where * (height - 1)), 7, 0] = 1e5
    leaves = integrate_environment(pixels, turn(seed), k, workers)
    np.testing.assert_allclose(leaves[:, 1], 1.0, rtol=1e-5)
    np.testing.assert_allclose(np.median(leaves[:, 0]), 1.0, rtol=5e-2)  # lost, it would be many times that


def test_power_is_the_pixels_sum_away_from_the_poles(workers: Workers) -> None:
    """What a user would expect of a sun: radiance times the pixel's solid angle."""
    height = 256
    pixels = np.zeros((height, 512, 3))
    pixels[90, 400] = 1e5
    ring = math.cos(math.pi * 90 / height) - math.cos(math.pi * 91 / height)
    expected = 1e5 * ring * 2 * math.pi / 512
    np.testing.assert_allclose(
        power(integrate_environment(pixels, turn(3), 12, workers)), expected, rtol=3e-3
    )


@pytest.mark.parametrize("shape", [(4096, 64), (700, 1500), (333, 128)])
def test_averaging_down_keeps_power(shape: tuple[int, int], workers: Workers) -> None:
    rng = np.random.default_rng(0)
    pixels = rng.lognormal(0, 2, (*shape, 3)).astype(np.float32)
    small = reduced_map(pixels, 10, workers)
    assert small.shape[0] <= 200
    edges = np.cos(np.pi * np.arange(shape[0] + 1) / shape[0])
    whole = np.einsum("hwc,h->c", pixels.astype(np.float64), edges[:-1] - edges[1:]) / shape[1]
    fewer = np.cos(np.pi * np.arange(small.shape[0] + 1) / small.shape[0])
    kept = np.einsum("hwc,h->c", small.astype(np.float64), fewer[:-1] - fewer[1:]) / small.shape[1]
    np.testing.assert_allclose(kept, whole, rtol=1e-5)


def test_leaves_are_means_over_their_cells(workers: Workers) -> None:
    rng = np.random.default_rng(1)
    pixels = rng.uniform(0, 1, (24, 48, 3))
    rotation = turn(5)
    leaves = integrate_environment(pixels, rotation, 10, workers)
    wide = reduced_map(pixels.astype(np.float32), 10, workers).astype(np.float64)
    np.testing.assert_array_equal(wide[6:18], pixels[6:18].astype(np.float32))
    for leaf in rng.integers(0, 1024, 12):
        expected = oracle.mean_over_leaf(wide, rotation, int(leaf), 10, 40)
        np.testing.assert_allclose(leaves[leaf], expected, rtol=2e-3, atol=3e-3)


def test_u_and_v_follow_openexr(workers: Workers) -> None:
    """The middle column looks at +z, a quarter from the left at +x, the first row up."""
    directions = direction_set(10).directions
    for row, column, axis in (
        (32, 64, [0, 0, 1]),
        (32, 32, [1, 0, 0]),
        (32, 0, [0, 0, -1]),
    ):
        pixels = np.zeros((64, 128, 3), np.float32)
        pixels[row - 1 : row + 1, [column - 1, column]] = 1.0
        leaves = integrate_environment(pixels, np.eye(3), 10, workers)
        centroid = leaves[:, 0] @ directions
        assert centroid @ np.array(axis) / np.linalg.norm(centroid) > 0.998
    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[:2] = 1.0
    above = direction_set(10).leaf_of([[0.0, 1.0, 0.0]])[0]
    assert integrate_environment(pixels, np.eye(3), 10, workers)[above, 0] > 0.3


def test_turning_the_map_equals_rolling_it(workers: Workers) -> None:
    rng = np.random.default_rng(2)
    pixels = rng.uniform(0, 1, (32, 64, 3)).astype(np.float32)
    turned = integrate_environment(pixels, about_y(math.pi / 2), 10, workers)
    rolled = integrate_environment(np.roll(pixels, -16, axis=1), np.eye(3), 10, workers)
    np.testing.assert_allclose(turned, rolled, rtol=1e-3, atol=1e-4)


def test_one_and_two_threads_give_the_same_bits(workers: Workers) -> None:
    pixels = np.random.default_rng(4).uniform(0, 1, (400, 500, 3))
    with Workers(1) as one:
        alone = integrate_environment(pixels, turn(1), 11, one)
    np.testing.assert_array_equal(alone, integrate_environment(pixels, turn(1), 11, workers))


def test_integration_can_be_cancelled(workers: Workers) -> None:
    class Impatient:
        calls = 0

        def checkpoint(self, done: int, total: int, /) -> None:
            self.calls += 1
            if self.calls == 4:
                raise Cancelled

    with pytest.raises(Cancelled):
        integrate_environment(np.ones((64, 128, 3)), np.eye(3), 12, workers, Impatient())


@pytest.mark.parametrize(
    ("pixels", "rotation", "cause"),
    [
        (np.full((4, 8, 3), np.nan), np.eye(3), "finite"),
        (np.full((4, 8, 3), np.inf), np.eye(3), "finite"),
        (np.where(np.arange(96).reshape(4, 8, 3) == 7, -1e-6, 1.0), np.eye(3), "negative"),
        (np.ones((4, 8)), np.eye(3), "three colours"),
        (np.ones((0, 8, 3)), np.eye(3), "three colours"),
        (np.ones((4, 8, 3)), np.eye(3) * 2, "rotation"),
        (np.ones((4, 8, 3)), np.full((3, 3), np.nan), "rotation"),
        (np.ones((4, 8, 3)), np.eye(4), "rotation"),
    ],
)
def test_what_is_no_radiance_is_refused(
    pixels: npt.NDArray[np.float64], rotation: npt.NDArray[np.float64], cause: str, workers: Workers
) -> None:
    with pytest.raises(InputError, match=cause):
        integrate_environment(pixels, rotation, 10, workers)


def test_a_map_made_ready_once_serves_every_rotation(workers: Workers) -> None:
    pixels = np.random.default_rng(5).uniform(0, 1, (40, 80, 3))
    ready = EnvironmentMap.prepare(pixels, 10, workers)
    for seed in (0, 1):
        fresh = integrate_environment(pixels, turn(seed), 10, workers)
        np.testing.assert_array_equal(ready.over_leaves(turn(seed), workers), fresh)
