"""Patterns of rays: distributed by the cosine, stratified, independent, alike in order."""

from __future__ import annotations

import numpy as np
import pytest

from studio_core.transport.patterns import cosine_pattern, grid_pattern, variants_of


@pytest.mark.parametrize("rays", [1, 16, 24, 64])
def test_rays_are_distributed_by_the_cosine(rays: int) -> None:
    pattern = cosine_pattern(rays, 200, seed=3)
    found = pattern.directions.astype(np.float64)
    np.testing.assert_allclose(np.linalg.norm(found, axis=2), 1, atol=1e-6)
    assert (found[:, :, 2] > 0).all()
    flat = found.reshape(-1, 3)
    # of the density cos / π: mean of z is 2/3, of z² a half, of x² and y² a quarter, of the rest 0
    expected = {(2,): 2 / 3, (2, 2): 1 / 2, (0, 0): 1 / 4, (1, 1): 1 / 4, (0,): 0, (1,): 0, (0, 1): 0}
    for axes, mean in expected.items():
        values = np.prod([flat[:, axis] for axis in axes], axis=0)
        assert abs(values.mean() - mean) < 4 * max(values.std() / np.sqrt(len(values)), 1e-9)
    assert pattern.projected.shape == (200, rays)
    assert pattern.projected.sum(dtype=np.float64) == pytest.approx(200 * np.pi, rel=1e-6)


def _square(directions: np.ndarray) -> np.ndarray:
    """Back from the disc to the square by the inverse of the concentric map."""
    x, y = directions[..., 0].astype(np.float64), directions[..., 1].astype(np.float64)
    wide = np.abs(x) > np.abs(y)
    radius = np.hypot(x, y) * np.where(wide, np.sign(x), np.sign(y))
    other = radius * 4 / np.pi * np.arctan(np.where(wide, y / x, x / y))
    return (np.stack([np.where(wide, radius, other), np.where(wide, other, radius)]) + 1) / 2


@pytest.mark.parametrize("rays", [16, 64, 256])
def test_every_stratum_has_one_ray_and_they_lie_in_order(rays: int) -> None:
    pattern = cosine_pattern(rays, 50)
    square = _square(pattern.directions)
    level = rays.bit_length() - 1
    for columns in range(level + 1):  # every elementary interval: a (0, m, 2)-net
        across, down = 1 << columns, 1 << (level - columns)
        cell = np.minimum((square[0] * across).astype(int), across - 1) * down
        cell += np.minimum((square[1] * down).astype(int), down - 1)
        clear = np.abs(square[0] * across % 1 - 0.5) < 0.4999
        clear &= np.abs(square[1] * down % 1 - 0.5) < 0.4999
        for variant in range(50):
            if clear[variant].all():
                assert len(np.unique(cell[variant])) == rays
    # ray i of all variants looks into one stratum
    spread = np.linalg.norm(square - square[:, :1], axis=0)
    assert spread.max() < 2 * np.sqrt(2 / rays) + 1e-6


def test_variants_seeds_and_sizes_are_independent() -> None:
    one, other = cosine_pattern(64, 128, seed=0), cosine_pattern(64, 128, seed=1)
    assert one.key != other.key
    assert one.key == cosine_pattern(64, 128).key

    # deviations of a function's mean do not go together
    def deviation(directions: np.ndarray) -> np.ndarray:
        return (np.abs(directions[..., 0] + 0.3 * directions[..., 1]) > 0.4).mean(axis=1)

    a, b = deviation(one.directions), deviation(other.directions)
    assert a.std() > 0
    assert abs(np.corrcoef(a, b)[0, 1]) < 0.35
    assert abs(np.corrcoef(a[:-1], a[1:])[0, 1]) < 0.35


def test_scrambled_rays_beat_random_ones() -> None:
    rng = np.random.default_rng(1)
    pattern = cosine_pattern(64, 256).directions.astype(np.float64)
    angle, radius = rng.uniform(0, 2 * np.pi, (256, 64)), np.sqrt(rng.random((256, 64)))
    plain = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - radius**2)], axis=2)
    smooth = np.array([0.3, -0.5, 0.81])
    errors = [np.std(np.maximum(rays @ smooth, 0).mean(axis=1)) for rays in (pattern, plain)]
    assert errors[0] < errors[1] / 5


def test_a_grid_has_equal_cells() -> None:
    grid = grid_pattern(32)
    assert grid.directions.shape == (1, 1024, 3)
    assert grid.projected.sum(dtype=np.float64) == pytest.approx(np.pi, rel=1e-3)
    z = grid.directions[0, :, 2].astype(np.float64)
    assert z.mean() == pytest.approx(1 / 2, rel=3e-3)  # equal solid angles: z is even
    assert (z**2).mean() == pytest.approx(1 / 3, rel=3e-3)
    with pytest.raises(ValueError, match="32, 64"):
        grid_pattern(24)
    with pytest.raises(ValueError, match="1 to"):
        cosine_pattern(0)


def test_vertices_spread_over_variants() -> None:
    found = variants_of(np.arange(100_000), 256)
    count = np.bincount(found, minlength=256)
    assert len(count) == 256
    assert abs(count - 390.6).max() < 6 * np.sqrt(390.6)
    assert np.mean(found[1:] == found[:-1]) < 0.02
