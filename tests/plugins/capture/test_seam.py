"""Where two lenses are joined, and that nobody sees it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.capturing.settings import FEATHER, GRADIENT, MULTIBAND
from studio_plugins.capture.seam import _membrane, closed_path, join

ASIDE = 0.02


def cheapest(cost: np.ndarray) -> float:
    """By trying all closed paths."""
    rows, columns = cost.shape
    best = np.inf
    for path in itertools.product(range(rows), repeat=columns):
        steps = [abs(path[i] - path[i - 1]) for i in range(columns)]
        if max(steps) <= 1:
            total = sum(cost[row, i] for i, row in enumerate(path)) + ASIDE * sum(steps)
            best = min(best, total)
    return best


@given(st.integers(1, 4), st.integers(3, 6), st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_the_closed_path_is_the_cheapest(rows: int, columns: int, seed: int) -> None:
    cost = np.random.default_rng(seed).random((rows, columns))
    path = closed_path(cost)
    steps = np.abs(path - np.roll(path, 1))
    assert steps.max() <= 1
    total = cost[path, np.arange(columns)].sum() + ASIDE * steps.sum()
    assert total == pytest.approx(cheapest(cost))


def looks(front_reach: float, back_reach: float, gain: float = 1.0, wall: bool = False):  # type: ignore[no-untyped-def]
    """Lenses that see up to these angles from their axes (degrees), and a near thing that they see apart."""

    def angle(directions: np.ndarray) -> np.ndarray:
        return np.degrees(np.arccos(np.clip(-directions[..., 2], -1, 1)))

    def light(directions: np.ndarray) -> np.ndarray:
        return (2 + np.stack([directions[..., 0], directions[..., 1], directions[..., 2]], -1)).astype(
            np.float32
        )

    def front(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return light(directions), angle(directions) < front_reach

    def back(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        made = light(directions) / np.float32(gain)
        if wall:
            azimuth = np.degrees(np.arctan2(directions[..., 1], directions[..., 0]))
            near = (np.abs(azimuth - 40) < 12) & (angle(directions) < 91)
            made = np.where(near[..., None], np.float32(0.05), made)
        return made, angle(directions) > 180 - back_reach

    return front, back


def test_the_seam_goes_round_what_the_lenses_see_apart() -> None:
    front, back = looks(96, 96, wall=True)
    joint = join(front, back, 512, MULTIBAND, np.radians(4))
    azimuth = np.degrees((np.arange(len(joint.path)) + 0.5) * 2 * np.pi / len(joint.path))
    theta = np.degrees(joint.path)
    assert theta.min() > 84
    assert theta.max() < 96
    assert (theta[np.abs(azimuth - 40) < 10] > 91).all()
    assert abs(np.median(theta[np.abs(azimuth - 200) < 60]) - 90) < 1.5
    assert joint.overlap == pytest.approx(12, abs=1)
    assert joint.cost < 0.1


@pytest.mark.parametrize("blend", [MULTIBAND, GRADIENT, FEATHER])
def test_a_difference_of_exposure_is_spread_not_left_at_the_seam(blend: str) -> None:
    front, back = looks(96, 96, gain=1.25)
    joint = join(front, back, 1024, blend, np.radians(4))
    theta = np.radians(np.linspace(70, 110, 400))[:, None]
    azimuth = np.radians(np.array([10.0, 77, 181, 359.9]))[None, :]
    theta, azimuth = np.broadcast_arrays(theta, azimuth)
    ring = np.sin(theta)
    way = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), -np.cos(theta)], axis=-1)
    share = joint.share(azimuth, theta)
    f, b = front(way)[0], back(way)[0]
    light = f * share[..., None] + b * (1 - share)[..., None]
    factor = joint.evened(azimuth, theta, share)
    if factor is not None:
        light = light * factor
    ratio = np.log(light / f)[..., 1]  # 0 on the front side, log(1 / 1.25) on the back side
    assert np.abs(ratio[0]).max() < 0.01
    np.testing.assert_allclose(ratio[-1], np.log(1 / 1.25), atol=0.01)
    assert np.abs(np.diff(ratio, axis=0)).max() < 0.012  # of 0.223, a tenth of a degree apart
    assert np.diff(ratio, axis=0).max() < 0.003  # one way, without waves


def test_a_lamp_that_one_lens_sees_elsewhere_does_not_shine_around_the_seam() -> None:
    front, plain = looks(96, 96)

    def back(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        light, seen = plain(directions)
        lamp = directions @ np.array([1.0, 0.0, 0.01]) > np.cos(np.radians(1.5))
        return np.where(lamp[..., None], np.float32(3000), light), seen

    joint = join(front, back, 1024, MULTIBAND, np.radians(4))
    theta, azimuth = np.meshgrid(np.radians(np.linspace(80, 100, 60)), np.radians(np.linspace(4, 20, 60)))
    share = joint.share(azimuth, theta)
    factor = joint.evened(azimuth, theta, share)
    assert factor is not None
    np.testing.assert_allclose(factor, 1, atol=0.03)


def test_lenses_that_do_not_overlap_are_parted_where_the_front_one_ends() -> None:
    front, back = looks(85, 85)
    joint = join(front, back, 256, MULTIBAND, np.radians(4))
    assert joint.overlap == 0
    np.testing.assert_allclose(np.degrees(joint.path), 85, atol=1.1)


def test_the_membrane_solves_its_equation() -> None:
    rng = np.random.default_rng(5)
    rows, columns = 11, 14
    ratio = rng.normal(0, 0.2, (rows, columns, 3)).astype(np.float32)
    hard = (np.arange(rows)[:, None] < 5 + np.arange(columns)[None, :] % 2).astype(np.float32)
    q, g = _membrane(ratio, np.ones((rows, columns), np.float32), hard)
    place = np.arange(rows * columns).reshape(rows, columns)
    matrix, right = scipy.sparse.lil_matrix((rows * columns, rows * columns)), np.zeros((rows * columns, 3))
    for i in range(rows):
        for j in range(columns):
            here = place[i, j]
            if i in (0, rows - 1):
                matrix[here, here], right[here] = 1, hard[i, j] * g[i, j]
                continue
            for k, m in ((i - 1, j), (i + 1, j), (i, (j - 1) % columns), (i, (j + 1) % columns)):
                matrix[here, place[k, m]] += 1
                matrix[here, here] -= 1
                right[here] += (hard[i, j] + hard[k, m]) / 2 * (g[k, m].astype(np.float64) - g[i, j])
    wanted = scipy.sparse.linalg.spsolve(matrix.tocsr(), right)
    np.testing.assert_allclose(q.reshape(-1, 3), wanted, atol=1e-6)
