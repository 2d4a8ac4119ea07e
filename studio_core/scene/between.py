"""Between points of a surface: how much each of the nearest counts at other places of it.

Shepard's inverse distances in the form of Franke & Little (R. Franke, "Scattered data interpolation", Math.
Comp. 38, 1982, section 4.1): ((R − d) / (R d))², with R the distance of the farthest that is asked, so that
values at points are kept and nothing jumps where other points become the nearest. Times how alike they face,
squared, and, where looks are given, a bell of their difference: joint bilateral upsampling (slf-strokes.txt,
section 6.5). Slots share nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

NEAREST = 8
NEAREST_BY_LOOK = 16
"""Points that are asked; more where some of them look otherwise."""
LIKE = 0.1
"""Looks that are so far apart, per channel, count less by exp(−1/2); 0 is black and 1 is white."""
TOUCHING = 0.01  # of R: points nearer than this are where they are asked for
LEAST_FACING = 1e-3
LEAST_LIKE = 1e-4


@dataclass(frozen=True, eq=False)
class Cloud:
    """N places with unit normals (N, 3) and slots (N,); looks (N, K), about as uniform as lightness."""

    places: npt.NDArray[np.floating]
    normals: npt.NDArray[np.floating]
    slots: I64
    looks: F32 | None = None

    def __len__(self) -> int:
        return len(self.slots)


@dataclass(frozen=True, eq=False)
class Weights:
    """Of P places: the numbers of the nearest points (P, K), and their shares (P, K); all 0: none is."""

    which: I64
    share: F32

    def __call__(self, values: F32) -> F32:
        """(P, C) between values (N, C) of points."""
        made = np.zeros((len(self.which), values.shape[1]), np.float32)
        add_shares(self.which, self.share, np.ascontiguousarray(values, np.float32), made)
        return made

    def some(self, which: npt.NDArray[np.generic]) -> Weights:
        """At some of the places."""
        return Weights(self.which[which], self.share[which])


def weigh(points: Cloud, places: Cloud) -> Weights:
    """The shares of points at places; looks count where both have them."""
    by_look = points.looks is not None and places.looks is not None
    near = min(NEAREST_BY_LOOK if by_look else NEAREST, max(len(points), 1))
    which = np.zeros((len(places), near), np.int64)
    share = np.zeros((len(places), near), np.float32)
    nothing = np.zeros((max(len(points), len(places)), 0), np.float32)
    looks = [_rows(one.looks) if by_look else nothing for one in (points, places)]
    facing = _rows(points.normals), _rows(places.normals)
    for slot in np.unique(places.slots).tolist():
        own, there = np.flatnonzero(places.slots == slot), np.flatnonzero(points.slots == slot)
        if len(there) == 1:
            which[own, 0], share[own, 0] = there[0], 1.0
        if len(there) < 2:
            continue
        count = min(near, len(there))
        distance, index = cKDTree(points.places[there]).query(places.places[own], k=count)
        found = there[index]
        made = np.empty((len(own), count), np.float32)
        weigh_pairs(distance, found, own, facing[0], facing[1], looks[0], looks[1], made)
        which[own[:, None], np.arange(count)] = found
        share[own[:, None], np.arange(count)] = made
    return Weights(which, share)


def _rows(values: npt.NDArray[Any] | None) -> F32:
    return np.ascontiguousarray(values, np.float32)


@kernel
def weigh_pairs(
    distance: F64,
    found: I64,
    own: I64,
    normals: F32,
    facing: F32,
    looks: F32,
    looking: F32,
    out: F32,
) -> None:
    """out (P, K) = shares of points found (P, K) at distances (P, K), rising, of the places own (P,).

    normals and looks are those of points, facing and looking those of places; without channels looks tell
    nothing.
    """
    count, channels = found.shape[1], looks.shape[1]
    bell = 0.5 / (3.0 * LIKE * LIKE)
    for p in range(len(own)):
        v = own[p]
        reach = max(distance[p, count - 1], 1e-9) * (1 + 1e-6)
        total = 0.0
        for k in range(count):
            n = found[p, k]
            away = distance[p, k] / reach
            weight = max(1 - away, 1e-6) / (away + TOUCHING)
            cosine = (
                facing[v, 0] * normals[n, 0] + facing[v, 1] * normals[n, 1] + facing[v, 2] * normals[n, 2]
            )
            weight *= max(cosine, LEAST_FACING)
            weight *= weight
            if channels:
                square = 0.0
                for c in range(channels):
                    difference = looking[v, c] - looks[n, c]
                    square += difference * difference
                weight *= max(np.exp(-bell * square), LEAST_LIKE)
            out[p, k] = weight
            total += weight
        for k in range(count):
            out[p, k] /= total


@kernel
def add_shares(which: I64, share: F32, values: F32, out: F32) -> None:
    """out (P, C) += Σ_k share (P, k) · values (N, C) of the points which (P, k)."""
    for p in range(len(which)):
        for k in range(which.shape[1]):
            part, n = share[p, k], which[p, k]
            if part != 0:
                for c in range(values.shape[1]):
                    out[p, c] += part * values[n, c]


__all__ = ["NEAREST", "Cloud", "Weights", "weigh"]
