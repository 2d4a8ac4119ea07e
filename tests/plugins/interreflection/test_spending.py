"""Paths go where they are needed, and what they find stays right in the mean."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_plugins.interreflection.gather.spending import AT_MOST, PILOT, informed, pilot


@given(rays=st.integers(1, 500), budget=st.integers(0, 4000), seed=st.integers(0, 99))
def test_plans_keep_to_their_budget(rays: int, budget: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    first = pilot(rays, budget, rng)
    assert abs(len(first.ray) - min(rays, int(budget * PILOT))) <= 1
    found = rng.normal(size=(len(first.ray), 3)).astype(np.float32)
    second = informed(rng.integers(0, 7, rays), first, found, budget, rng)
    assert len(first.ray) + len(second.ray) <= min(budget, AT_MOST * rays) + 2
    for plan in (first, second):
        count = np.bincount(plan.ray, minlength=rays)
        assert (np.abs(count - plan.expected) < 2).all()
        named = set(zip(plan.ray.tolist(), plan.turn.tolist(), strict=True))
        assert len(named) == len(plan.ray)
        assert (plan.turn < count[plan.ray]).all()


def test_nothing_to_follow_takes_no_paths() -> None:
    rng = np.random.default_rng(0)
    first = pilot(0, 100, rng)
    second = informed(np.zeros(0, np.int64), first, np.zeros((0, 3), np.float32), 100, rng)
    assert len(first.ray) == len(second.ray) == 0


def test_where_no_difference_is_found_no_more_is_looked_for() -> None:
    rng = np.random.default_rng(0)
    first = pilot(30, 30, rng)
    still = np.zeros((len(first.ray), 3), np.float32)
    assert len(informed(np.arange(30), first, still, 30, rng).ray) == 0


@pytest.mark.parametrize("rays", [400, 6000])
def test_the_mean_is_right_and_less_noisy_than_with_even_paths(rays: int) -> None:
    """One of twenty vertices is a hundred times as noisy as the others."""
    budget, truth = 1500, np.linspace(-1, 2, rays)
    vertex = np.arange(rays) % 20
    noise = np.where(vertex == 3, 100.0, 1.0)

    def light(plan: Any, rng: np.random.Generator) -> Any:
        one = truth[plan.ray] + noise[plan.ray] * rng.normal(size=len(plan.ray))
        return np.repeat(one[:, None], 3, axis=1).astype(np.float32)

    aimed, even = [], []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        first = pilot(rays, budget, rng)
        one = light(first, rng)
        second = informed(vertex, first, one, budget, rng)
        total = np.bincount(first.ray, one[:, 0], rays)
        total += np.bincount(second.ray, light(second, rng)[:, 0], rays)
        aimed.append((total / (first.expected + second.expected)).mean())
        spread = np.sort(rng.choice(rays, budget, replace=budget > rays))
        plain = type(first)(spread, spread, spread.astype(np.float64))
        even.append(light(plain, rng)[:, 0].mean())
    aimed_error = np.abs(np.array(aimed) - truth.mean())
    assert abs(np.mean(aimed) - truth.mean()) < 4 * np.std(aimed) / np.sqrt(200)
    assert np.sqrt((aimed_error**2).mean()) < 0.6 * np.std(even)
