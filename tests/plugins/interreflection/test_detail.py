"""Sharing takes noise away and leaves detail."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from studio_core.parallel import Workers
from studio_plugins.interreflection.gather.detail import give_back, noise_of, shared_noise

SIDE = 4  # neighbours to each side


class Line:
    """Vertices in a row, each shared evenly with the next four on both sides."""

    def __init__(self, count: int, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        at = np.arange(count)[:, None] + np.r_[-SIDE:0, 1 : SIDE + 1]
        self.neighbours = np.where((at >= 0) & (at < count), at, -1).astype(np.int32)
        order = np.argsort(self.neighbours < 0, axis=1, kind="stable")
        self.neighbours = np.take_along_axis(self.neighbours, order, axis=1)
        self.wanted = np.ones(count, np.bool_)

    def share(self, light: Any) -> Any:
        near = self.neighbours >= 0
        total = light + (light[self.neighbours] * near[..., None]).sum(axis=1)
        return (total / (1 + near.sum(axis=1))[:, None]).astype(np.float32)

    def noise(self, size: float) -> Any:
        return (size * self.rng.normal(size=(len(self.wanted), 3))).astype(np.float32)

    def made(self, found: Any, noise: Any, workers: Workers) -> Any:
        return shared_noise(found, noise, self.wanted, self.neighbours, self.share, workers)


def error(made: Any, truth: Any) -> float:
    return float(np.sqrt(((made - truth) ** 2).mean()))


def test_even_light_is_shared_and_an_edge_is_kept(workers: Workers) -> None:
    line = Line(400, 1)
    even = np.full((400, 3), 5, np.float32)
    edge = even.copy()
    edge[200:] = 15.0
    for truth, most in ((even, 0.6), (edge, 1.05)):
        found = truth + line.noise(1.0)
        made = line.made(found, line.noise(1.0), workers)
        assert error(made, truth) < most * error(found, truth)
    beside = slice(196, 204)
    assert error(made[beside], edge[beside]) < 0.5 * error(line.share(found)[beside], edge[beside])


def test_without_noise_nothing_is_taken_and_without_light_nothing_is_given(workers: Workers) -> None:
    line = Line(50, 2)
    found = line.noise(1.0)
    np.testing.assert_allclose(line.made(found, np.zeros_like(found), workers), found, atol=1e-6)
    dark = np.zeros_like(found)
    assert not line.made(dark, line.noise(1.0), workers).any()


@given(one=st.integers(16, 512), two=st.integers(16, 512), seed=st.integers(0, 99))
def test_the_noise_of_two_parts_is_that_of_their_sum(one: int, two: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    first = (one * 3 + np.sqrt(one) * rng.normal(size=(3000, 3))).astype(np.float32)
    second = (two * 3 + np.sqrt(two) * rng.normal(size=(3000, 3))).astype(np.float32)
    noise = noise_of(first, second, (one, two))
    assert abs(noise.std() / (first + second).std() - 1) < 0.06
    assert abs(noise.mean()) < 0.06 * noise.std()


@given(seed=st.integers(0, 999))
def test_the_kernel_is_what_it_says(seed: int) -> None:
    line = Line(30, seed)
    wanted = line.rng.random(30) < 0.7
    found, shared = line.noise(1.0), line.noise(1.0)
    taken, expected = (line.rng.random(30).astype(np.float32) for _ in range(2))
    out = shared.copy()
    vertices = np.flatnonzero(wanted)
    give_back(0, len(vertices), vertices, wanted, line.neighbours, found, taken, expected, out)
    for v in range(30):
        near = [v, *(u for u in line.neighbours[v] if u >= 0 and wanted[u])]
        kept = max(0.0, 1 - expected[near].sum() / taken[near].sum()) if wanted[v] else 0.0
        np.testing.assert_allclose(out[v], shared[v] + kept * (found[v] - shared[v]), rtol=1e-4, atol=1e-5)
