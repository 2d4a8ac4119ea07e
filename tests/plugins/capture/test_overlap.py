"""Unrolled rims: places and directions there and back, what a strip shows, and guesses from strips alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.capturing.artifacts import F64, View
from studio_core.capturing.standing import HALF_TURN, rotation_from
from studio_core.imaging.projection import EQUISOLID, KANNALA_BRANDT, Circle, Lens, pixel_points, unproject
from studio_plugins.capture.guesses import by_features, by_rolling, by_sliding
from studio_plugins.capture.overlap import (
    Stand,
    Strip,
    across,
    flattened,
    places,
    rotation_of,
    stand_of,
    unroll,
    ways,
)
from studio_plugins.capture.refine import refined
from studio_plugins.capture.solve import solved

LENS = Lens(fov=200)


def seen_light(direction: F64) -> F64:
    """A world of soft waves of several lengths, the same for every channel."""
    x, y, z = np.moveaxis(direction, -1, 0)
    waves = np.sin(9 * x + 4 * y) + np.sin(11 * y - 7 * z + 1) + np.sin(8 * z + 5 * x * y + 2)
    fine = np.sin(31 * x + 23 * z) * np.cos(27 * y) + np.sin(40 * y * z + 17 * x)
    return np.asarray(np.exp(0.5 * waves + 0.35 * fine), np.float64)


def view_of(rotation: F64, lens: Lens = LENS, radius: float = 160.0) -> View:
    """What a lens shows whose frame is turned by `rotation` against the world's."""
    size = int(2 * radius + 12)
    circle = Circle(size / 2 + 1.5, size / 2 - 2.0, radius)
    direction, seen = unproject(lens, circle, pixel_points(size, size))
    light = np.where(seen, seen_light(direction @ rotation.T), 0.0)
    return View(np.repeat(light[..., None], 3, axis=2).astype(np.float32), seen, circle, lens)


def strips(rotation: F64) -> tuple[Strip, Strip]:
    return (
        unroll(view_of(np.eye(3)), False, math.radians(65), 2.0),
        unroll(view_of(rotation), True, math.radians(65), 2.0),
    )


def apart(a: F64, b: F64) -> float:
    return math.degrees(math.acos(min(1.0, max(-1.0, (np.trace(a.T @ b) - 1) / 2))))


angles = st.floats(-0.15, 0.15)
lenses = st.sampled_from([LENS, Lens(EQUISOLID, 195), Lens(KANNALA_BRANDT, 205, (-0.02, 0.002))])


@given(
    lenses,
    st.booleans(),
    st.floats(0.95, 1.05),
    st.tuples(*[st.floats(-0.02, 0.02)] * 4),
    st.floats(0, 6.28),
    st.floats(0.7, 0.92),
)
def test_places_and_directions_there_and_back(
    lens: Lens, turned: bool, wider: float, shifts: tuple[float, ...], a: float, share: float
) -> None:
    empty = np.zeros((1, 1), np.float32)
    strip = Strip(empty, empty, empty > 0, empty > 0, 0.0, 0.01, turned, lens, Circle(0, 0, 1))
    t = math.pi - share * lens.half if turned else share * lens.half
    stand = Stand(np.eye(3), lens.fov * wider, np.array(shifts[:2]), np.array(shifts[2:]))
    direction = ways(strip, np.array([a, t]), stand)
    assert np.linalg.norm(direction) == pytest.approx(1)
    back = places(strip, direction, stand)
    assert math.remainder(back[0] - a, 2 * math.pi) == pytest.approx(0, abs=1e-4)
    assert back[1] == pytest.approx(t, abs=1e-4)


def test_a_strip_shows_what_lies_there() -> None:
    strip, other = strips(HALF_TURN @ rotation_from(0, 0, 0))
    at = strip.grid()
    direction = np.stack(
        [
            np.sin(at[..., 1]) * np.cos(at[..., 0]),
            np.sin(at[..., 1]) * np.sin(at[..., 0]),
            -np.cos(at[..., 1]),
        ],
        -1,
    )
    wanted = np.log2(seen_light(direction))
    assert np.abs(strip.tone - wanted)[strip.usable].max() < 0.08
    assert np.median(np.abs(strip.tone - wanted)[strip.usable]) < 0.01
    assert strip.usable.mean() > 0.95
    assert other.turned


def test_strips_of_lenses_back_to_back_are_alike() -> None:
    front, back = strips(rotation_from(0, 0, 0))
    there = across(front, back, front.grid(), stand_of(rotation_from(0, 0, 0), LENS))
    off = np.mod(there - front.grid() + math.pi, 2 * math.pi) - math.pi
    assert np.abs(off).max() < 1e-9
    rows = front.shape[0]
    lag = round((back.first - front.first) / front.step)
    both = front.tone[lag:] - back.tone[: rows - lag]
    assert np.median(np.abs(both)) < 0.02


def test_what_changes_slowly_is_taken_out() -> None:
    rng = np.random.default_rng(1)
    fine = rng.normal(size=(60, 720)).astype(np.float32)
    slow = np.linspace(0, 2, 60, dtype=np.float32)[:, None] + np.cos(np.arange(720) / 720 * 2 * np.pi)
    usable = rng.random((60, 720)) > 0.1
    made = flattened(fine + slow.astype(np.float32), usable, 8.0)
    assert (made[~usable] == 0).all()
    inner = usable.copy()
    inner[:10] = inner[-10:] = False
    assert np.corrcoef(made[inner], fine[inner])[0, 1] > 0.98
    shifted = flattened(fine + np.float32(5), usable, 8.0)
    assert shifted == pytest.approx(flattened(fine, usable, 8.0), abs=1e-4)


@pytest.mark.parametrize("angles", [(3.0, -2.0, 0.0), (-4.0, 5.0, 130.0)])
def test_features_give_a_first_guess(angles: tuple[float, float, float]) -> None:
    rotation = rotation_from(*angles)
    guess = by_features(*strips(rotation), np.array([196.0, 200.0, 204.0]))
    assert guess is not None
    assert apart(rotation_of(guess.stand), rotation) < 0.5
    assert guess.stand.fov == pytest.approx(200, rel=0.01)


def test_rolling_and_sliding_give_one_without_features() -> None:
    rotation = rotation_from(2.0, -3.0, 47.0)
    front, back = strips(rotation)
    tried = by_rolling(front, back, 197.0)
    assert min(apart(rotation_of(one), rotation) for one in tried) < 6
    best = min(tried, key=lambda one: apart(rotation_of(one), rotation))
    slid = solved(front, back, by_sliding(front, back, best), best, True)
    assert apart(rotation_of(slid.stand), rotation) < 1.0
    fit = refined(front, back, slid.stand, True)
    assert apart(rotation_of(fit.stand), rotation) < 0.15
    assert fit.stand.fov == pytest.approx(200, rel=0.002)
    assert fit.spread < 0.15
    assert fit.share > 0.8
