"""How alike light along kept rays is then and now."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from studio_plugins.interreflection.gather.likeness import Likeness

RAYS = 64
EVERY = np.arange(5, dtype=np.int32)
LIGHT = hnp.arrays(np.float32, (5, RAYS), elements=st.floats(0, 1e4, width=32))


def kept(light: Any, places: Any = EVERY) -> Any:
    """Light (V, N) of vertices, packed by their places."""
    one = Likeness(light.shape[1], None, None, np.asarray(places, np.int32), len(light))
    one(np.arange(len(light)), light)
    return one.packed


def compared(then: Any, light: Any) -> Any:
    one = Likeness(light.shape[1], then, EVERY, None, len(light))
    one(np.arange(len(light)), light)
    return one.of


def expected(a: Any, b: Any) -> float:
    """The correlation, at least 0; 0 where either hardly varies."""
    a, b = a.astype(np.float64), b.astype(np.float64)
    if a.var() <= 1e-6 * a.mean() ** 2 or b.var() <= 1e-6 * b.mean() ** 2:
        return 0.0
    return float(np.clip(np.corrcoef(a, b)[0, 1], 0, 1))


def test_it_is_the_correlation_of_light_along_the_rays() -> None:
    rng = np.random.default_rng(2)
    then = (rng.random((5, RAYS)) ** 3).astype(np.float32)
    mix = np.array([1.0, 0.9, 0.5, 0.1, 0.0])[:, None]
    now = (7 * (mix * then + (1 - mix) * rng.random((5, RAYS)) ** 3)).astype(np.float32)
    now[4, 3:] = 0
    made = compared(kept(then), now)
    np.testing.assert_allclose(made, [*map(expected, then, now)], atol=5e-3)
    assert made[0] > 0.999


@given(LIGHT, st.floats(0.01, 100))
def test_dimmed_light_is_the_same_light(light: Any, gain: float) -> None:
    packed = kept(light)
    made = compared(packed, (light * np.float32(gain)).astype(np.float32))
    squares = packed.astype(np.float64) ** 2
    varied = (light.max(axis=1) > 1e-3) & (squares.std(axis=1) > 0.05 * squares.mean(axis=1))
    assert (made[varied] > 0.99).all()
    assert ((made >= 0) & (made <= 1)).all()


def test_what_cannot_be_compared_is_not_alike() -> None:
    rng = np.random.default_rng(3)
    light = rng.random((5, RAYS)).astype(np.float32)
    packed = kept(light)
    dark, even = np.zeros_like(light), np.ones_like(light)
    assert not compared(packed, dark).any()
    assert not compared(packed, even).any()
    assert not compared(kept(dark), light).any()
    assert not compared(None, light).any()
    assert not compared(packed[:, :32], light).any()
    missing = Likeness(RAYS, packed, np.array([0, -1, 2, 3, 4], np.int32), None, 5)
    missing(np.array([0, 1]), light[:2])
    assert missing.of[0] > 0.99
    assert missing.of[1] == 0
    assert (missing.of[2:] == -1).all()


def test_packed_light_is_roots_in_parts_of_the_brightest() -> None:
    light = np.array([[0, 1, 4, 16], [0, 0, 0, 0], [5, 5, 5, 5]], np.float32)
    packed = kept(light, [1, 0, -1])
    np.testing.assert_array_equal(packed, [[0, 0, 0, 0], [0, 64, 128, 255]])
