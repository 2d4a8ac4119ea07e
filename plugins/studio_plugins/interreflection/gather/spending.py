"""Where paths are spent: most of them where what they find is least certain.

A few surfaces make nearly all of the noise: those that one lamp or a patch of sky shines on through a gap.
So a first, even share of the paths learns how large differences are at each vertex that is met, and the
others are given out in proportion (Neyman 1934): a sum of independent estimates then has the least variance
for its paths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

PILOT = 1 / 3
"""Share of the paths that is spread evenly."""
AT_MOST = 4
"""Paths a ray on average: more tell nothing that the rays' own number would not hide."""
PRIOR = 2.0
"""Paths' worth of the mean over all vertices that a vertex starts from."""


@dataclass(frozen=True, eq=False)
class Plan:
    """Paths by the number of their ray (M,), and which of a ray's own each is; of each of K rays, how many it
    may expect: what its paths find is divided by that.
    """

    ray: I64
    turn: I64
    expected: F64


def pilot(rays: int, budget: int, rng: np.random.Generator) -> Plan:
    """At most one path a ray, evenly over all."""
    paths = min(rays, int(budget * PILOT))
    return _drawn(np.full(rays, paths / max(rays, 1)), rng)


def informed(vertex: I64, first: Plan, found: F32, budget: int, rng: np.random.Generator) -> Plan:
    """The others, for rays that meet `vertex` (K,), after the first have found differences (M, 3)."""
    rays = len(vertex)
    left = min(budget, AT_MOST * rays) - len(first.ray)
    if left <= 0 or not len(found):
        return _drawn(np.zeros(rays), rng)
    size = found.mean(axis=1, dtype=np.float64) ** 2
    met, each = np.unique(vertex, return_inverse=True)
    place = each[first.ray]
    known, total = (np.bincount(place, weights, len(met)) for weights in (None, size))
    wanted = np.sqrt((total + PRIOR * size.mean()) / (known + PRIOR))[each]
    if not wanted.sum() > 0:
        return _drawn(np.zeros(rays), rng)
    return _drawn(wanted * (left / wanted.sum()), rng)


def _drawn(expected: F64, rng: np.random.Generator) -> Plan:
    """Whole numbers of paths whose means are as expected, one in each unit of the running sum: neighbours
    share evenly, and rays that come round in turn do not fall into step with it.
    """
    upto = np.cumsum(expected)
    units = round(float(upto[-1])) if len(upto) else 0
    at = (np.arange(units) + rng.random(units)) * (upto[-1] / max(units, 1) if len(upto) else 0.0)
    ray = np.minimum(np.searchsorted(upto, at, side="right"), len(expected) - 1)
    count = np.bincount(ray, minlength=len(expected))
    turn = np.arange(len(ray)) - np.repeat(np.cumsum(count) - count, count)
    return Plan(ray, turn, expected)


__all__ = ["Plan", "informed", "pilot"]
