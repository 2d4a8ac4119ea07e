"""What is close by, looked at point by point.

What a receiver meets is told by vertices. Where something is as close as vertices are to each other, that is
too coarse: light beside a table's leg, a reflection in the floor right under an edge. There rays are followed
on by the path tracer (`following`): light straight from lamps and sky at the very point that was met, one ray
more by the surface's own BRDF, and only at its end what vertices send.

    δ = L_followed − L_vertices

is summed over the rays like the light itself, and added. As it is a difference along the same ray, it has
little noise where vertices tell the truth; what is left of that is taken back where it is more than δ's own
mean (as James & Stein 1961 shrink means). How often which ray is followed: see `spending`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.transport.hits import BLACK, NOTHING
from studio_plugins.interreflection.gather.collecting import Rays
from studio_plugins.interreflection.gather.following import Follower
from studio_plugins.interreflection.gather.spending import Plan, informed, pilot

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U32 = npt.NDArray[np.uint32]

NEAR, NEAR_SHARP = 3.0, 10.0
"""Rays shorter than so many times the distance of vertices are followed on; to sharp lobes, longer ones."""
SHARP = 0.3  # error of separated lobes
SEED = 4000
FIRST, SECOND, TABLE = 0, 1 << 12, 1 << 16  # apart: seeds of the two turns, and of tables


@dataclass(frozen=True, eq=False)
class Near:
    """Rays (K,) of rows of a table that are followed on, and δ (K, 3) along them."""

    row: I64
    ray: I64
    change: F32

    def numbered(self, rays: Rays) -> U32:
        """(R, N) which of these a ray is; NOTHING: none."""
        made = np.full(rays.vertex.shape, NOTHING, np.uint32)
        made[self.row, self.ray] = np.arange(len(self.row), dtype=np.uint32)
        return made


def near_rays(rays: Rays, which: I64, area: F32, row: I32, error: F32) -> tuple[I64, I64]:
    """Which rows, and which of their rays, of rows `which` (C,), are to be followed on.

    area (V,) is what each vertex stands for, row (V,) that of its BRDF, and error (R,) how wrong that is as
    products.
    """
    sharp = np.append(error, np.float32(0))[row] > SHARP
    reach = np.where(sharp, np.float32(NEAR_SHARP), np.float32(NEAR)) * np.sqrt(2 * area)
    vertex = rays.vertex[which]
    met = vertex < BLACK
    limit = reach[np.where(met, vertex, 0)]
    found = met & (rays.distance[which].astype(np.float32) < limit)
    place, ray = np.nonzero(found)
    return which[place], ray.astype(np.int64)


def followed(
    tables: Sequence[tuple[Rays, I64, I64]], budget: int, follow: Follower
) -> tuple[list[Near], int]:
    """Rays of tables, as `near_rays` names them, followed on with about `budget` paths; how many it took."""
    rng = np.random.default_rng(SEED)
    upto = np.cumsum([0, *(len(row) for _, row, _ in tables)])
    vertex = np.concatenate([t.vertex[row, ray] for t, row, ray in tables]).astype(np.int64)

    def found(plan: Plan, seed: int) -> F32:
        made = [np.zeros((0, 3), np.float32)]
        edges = np.searchsorted(plan.ray, upto)
        for number, (rays, row, ray) in enumerate(tables):
            part = slice(edges[number], edges[number + 1])
            own, turn = plan.ray[part] - upto[number], plan.turn[part]
            made.append(follow(rays, row[own], ray[own], turn, SEED + seed + TABLE * number))
        return np.concatenate(made)

    first = pilot(len(vertex), budget, rng)
    one = found(first, FIRST)
    second = informed(vertex, first, one, budget, rng)
    two = found(second, SECOND)
    change = np.zeros((len(vertex), 3), np.float32)
    expected = np.maximum(first.expected + second.expected, 1e-30)
    for colour in range(3):
        for plan, light in ((first, one), (second, two)):
            sums = np.bincount(plan.ray, light[:, colour], len(vertex))
            change[:, colour] += (sums / expected).astype(np.float32)
    parts = zip(tables, upto[:-1], upto[1:], strict=True)
    made = [Near(row, ray, change[start:stop]) for (_, row, ray), start, stop in parts]
    return made, len(first.ray) + len(second.ray)


def trusted(found: Sequence[tuple[Rays, Near]], neighbours: I32) -> F32:
    """(V,) how much of each receiver's mean δ is more than its noise: 1 − Σ s² / Σ m², at least 0, over
    itself and the receivers among its neighbours (V, N); −1: none.
    """
    vertices = len(neighbours)
    count, total, squares = np.zeros(vertices), np.zeros(vertices), np.zeros(vertices)
    for rays, near in found:
        light = near.change.mean(axis=1, dtype=np.float64)
        receiver = rays.rows[near.row]
        count[rays.rows] += rays.vertex.shape[1]
        total += np.bincount(receiver, light, vertices)
        squares += np.bincount(receiver, light**2, vertices)
    count = np.maximum(count, 1)
    mean = total / count
    noise = np.maximum(squares / count - mean**2, 0) / count
    near_to = neighbours >= 0
    both = [x + (x[neighbours] * near_to).sum(axis=1) for x in (noise, mean**2)]
    share = 1 - np.divide(both[0], both[1], out=np.ones(vertices), where=both[1] > 0)
    return np.asarray(np.clip(share, 0, 1), np.float32)
