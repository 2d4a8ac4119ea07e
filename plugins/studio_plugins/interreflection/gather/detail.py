"""Sharing among neighbours where it takes noise away, and not where it takes detail.

E is what the rays found, S the same shared among neighbours (`smooth`). Two sets of independent rays tell how
large the noise is: their difference D, scaled to the noise of E, is nothing but noise. What sharing takes off
D, |D − S(D)|², it should take off E; where |E − S|² is more than that over a vertex and its neighbours, the
rest is detail, and E is kept in that share (as James & Stein 1961 shrink means).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.parallel import Workers
from studio_core.shading.job import Job

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

CHUNK = 1 << 11


def noise_of(first: F32, second: F32, rays: tuple[int, int]) -> F32:
    """(V, 3) as noisy as first + second, the sums over so many rays each; its mean is 0."""
    one, two = rays
    return np.asarray((first / one - second / two) * np.sqrt(one * two), np.float32)


def shared_noise(
    found: F32,
    noise: F32,
    wanted: Bools,
    neighbours: I32,
    share: Callable[[F32], F32],
    workers: Workers,
    job: Job | None = None,
) -> F32:
    """Light (V, 3) shared among neighbours by `share` where that takes noise away, of the wanted vertices."""
    out = share(found)
    taken = ((found - out) ** 2).sum(axis=1)
    expected = ((noise - share(noise)) ** 2).sum(axis=1)
    vertices = np.flatnonzero(wanted)

    def run(start: int, stop: int) -> None:
        give_back(start, stop, vertices, wanted, neighbours, found, taken, expected, out)

    workers.run(len(vertices), CHUNK, run, job)
    return out


@kernel
def give_back(
    start: int,
    stop: int,
    vertices: I64,
    wanted: Bools,
    neighbours: I32,
    found: F32,
    taken: F32,
    expected: F32,
    out: F32,
) -> None:
    """Mixes out (V, 3) with found (V, 3) at vertices[start:stop]: as much as of `taken` (V,), over each and
    its wanted neighbours, is more than `expected` (V,).
    """
    for n in range(start, stop):
        v = vertices[n]
        off, noise = float(taken[v]), float(expected[v])
        for k in range(neighbours.shape[1]):
            u = neighbours[v, k]
            if u < 0:
                break
            if wanted[u]:
                off += taken[u]
                noise += expected[u]
        if off > noise:
            kept = 1.0 - noise / off
            for c in range(3):
                out[v, c] += kept * (found[v, c] - out[v, c])
