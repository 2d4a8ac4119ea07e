"""What pictures of a ball say about the lights that were told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studio.bench.lab import dome, row
from studio_plugins.residual.light_check import checked
from studio_plugins.residual.samples import Ball, Lights

BALL = Ball(60.4, 58.7, 50.3)
TURN = Rotation.from_rotvec(np.radians([1.0, -3.0, 1.5]))


def pictures(lights: Lights, distance: float, shine: float = 3.0) -> np.ndarray:
    """A matte ball with a spot where light is mirrored."""
    x, y = np.meshgrid(np.arange(121) + 0.5, np.arange(118) + 0.5)
    n, v, inside = replace(BALL, distance=distance).normals(x, y)
    mirrored = 2 * (n * v).sum(axis=-1, keepdims=True) * n - v
    made = [
        np.where(inside, 0.3 * np.maximum(n @ d, 0) + shine * np.exp(150 * (mirrored @ d - 1)), 0)
        for d in lights.directions
    ]
    return np.stack(made)[..., None].repeat(3, axis=-1).astype(np.float32)


def told_wrongly(lights: Lights, turn: bool, mirrored: bool, seed: int = 2) -> Lights:
    towards = TURN.inv().apply(lights.directions.copy()) if turn else lights.directions.copy()
    towards += np.random.default_rng(seed).normal(size=towards.shape) * np.radians(0.4)
    return replace(lights, directions=towards * ([-1, 1, 1] if mirrored else [1, 1, 1]))


def off(a: Lights, b: Lights) -> float:
    return float(np.degrees(np.arccos(np.clip((a.directions * b.directions).sum(axis=1), -1, 1))).mean())


@pytest.mark.parametrize("lights", [row(), dome((-35.0, 0.0, 35.0)).some(np.arange(0, 38, 2))])
@pytest.mark.parametrize("distance", [np.inf, 7.0, 20.0])
@pytest.mark.parametrize(("turn", "mirrored"), [(False, False), (True, False), (True, True)])
def test_camera_turn_and_side_are_found(lights: Lights, distance: float, turn: bool, mirrored: bool) -> None:
    seen = pictures(lights, distance)
    told = told_wrongly(lights, turn, mirrored)
    found = checked(seen, np.zeros(seen.shape[:3], np.bool_), BALL, told)
    assert 1 / found.ball.distance == pytest.approx(1 / distance, abs=0.012)
    assert off(found.lights, lights) < 0.75
    assert any("mirrored" in note for note in found.notes) == mirrored
    assert any("turned by" in note for note in found.notes) == turn
    assert any("radii" in note for note in found.notes) == np.isfinite(distance)


def test_a_distance_that_is_known_stays() -> None:
    seen = pictures(row(), 7.0)
    ball = replace(BALL, distance=7.0)
    found = checked(seen, np.zeros(seen.shape[:3], np.bool_), ball, told_wrongly(row(), True, False))
    assert found.ball == ball
    assert off(found.lights, row()) < 0.6


def test_a_matte_ball_tells_its_side_alone() -> None:
    seen = pictures(row(), 7.0, shine=0.0)
    told = told_wrongly(row(), True, True)
    found = checked(seen, np.zeros(seen.shape[:3], np.bool_), BALL, told)
    assert np.allclose(found.lights.directions, told.directions * [-1, 1, 1], atol=1e-12)
    assert found.ball == BALL


def test_lights_in_no_order_are_said() -> None:
    seen = pictures(row(), np.inf, shine=0.0)
    mixed = row().some(np.array([5, 0, 9, 3, 11, 1, 8, 4, 10, 2, 7, 6]))
    found = checked(seen, np.zeros(seen.shape[:3], np.bool_), BALL, mixed)
    assert np.array_equal(found.lights.directions, mixed.directions)
    assert any("hardly agree" in note for note in found.notes)


def test_clipped_spots_count() -> None:
    seen = pictures(row(), 7.0)
    clipped = seen.max(axis=-1) > 1.0
    found = checked(np.minimum(seen, np.float32(1.0)), clipped, BALL, told_wrongly(row(), False, False))
    assert found.ball.distance == pytest.approx(7.0, rel=0.1)
