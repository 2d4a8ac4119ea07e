"""Whether a model draws directions as often as it says: Pearson's χ² over boxes of the hemisphere.

The boxes follow the mirror direction on a logarithmic scale, so that the inside of a lobe 1e-4 wide is looked
at as closely as a matte one; how many directions are expected in each is the density's integral. What
gave no direction is a box of its own, so the density's whole is checked too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.calls import density, sample
from studio_core.brdfs.quadrature import MirrorFrame, grid, over_boxes
from studio_core.contract import SampledBrdf

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

ALONG, AROUND = 24, 16
LEAST_EXPECTED = 10.0
PRECISE = 0.03  # directions a box; layers along the horizon may be as thin as 1e-4


@dataclass(frozen=True)
class ChiSquare:
    """p: how likely so large a statistic is when all is right; `found` and `expected` are shares drawn."""

    p: float
    statistic: float
    freedom: int
    found: float
    expected: float


def chi_square(
    brdf: SampledBrdf, shape: F32, wo: npt.ArrayLike, term: int, count: int = 40_000, seed: int = 0
) -> ChiSquare:
    """The test of one term and one direction wo (3,) with `count` draws."""
    direction = np.asarray(wo, np.float32)
    low, size = grid(ALONG, AROUND)
    u = np.random.default_rng(seed).random((count, 2), np.float32)
    wi = sample(brdf, shape, direction, term, u)
    wi = wi[wi[:, 2] > 0]

    def integrand(_: int, at: F32) -> F32:
        return density(brdf, shape, direction, at)[:, term : term + 1]

    rows = np.zeros(len(low), np.int64)
    inside = over_boxes(integrand, direction, rows, low, size, PRECISE / count)[:, 0]
    s, phi = MirrorFrame.of(direction).place(0, wi)
    box = np.minimum(s * ALONG, ALONG - 1).astype(np.int64) * AROUND
    box += np.minimum(phi / (2 * np.pi) * AROUND, AROUND - 1).astype(np.int64)
    seen = np.append(np.bincount(box, minlength=len(low)), count - len(wi)).astype(np.float64)
    expected = np.append(inside, max(1 - inside.sum(), 0.0)) * count
    statistic, freedom = pearson(seen, expected)
    return ChiSquare(tail(statistic, freedom), statistic, freedom, len(wi) / count, float(inside.sum()))


def pearson(seen: F64, expected: F64) -> tuple[float, int]:
    """χ² and degrees of freedom; boxes in which little is expected are pooled, the least first."""
    order = np.argsort(expected, kind="stable")
    filled = np.cumsum(expected[order])
    pools = int(np.searchsorted(expected[order], LEAST_EXPECTED))  # those before are too small alone
    group = np.arange(len(order)) + 1
    group[:pools] = np.minimum(filled[:pools] // LEAST_EXPECTED, pools)
    _, group = np.unique(group, return_inverse=True)
    a, b = np.bincount(group, seen[order]), np.bincount(group, expected[order])
    if len(b) > 1 and b[0] < LEAST_EXPECTED:
        a, b = np.append(a[0] + a[1], a[2:]), np.append(b[0] + b[1], b[2:])
    statistic = float(((a - b) ** 2 / np.maximum(b, 1e-300)).sum())
    return statistic, max(len(b) - 1, 1)


def tail(statistic: float, freedom: int) -> float:
    """The probability that χ² of so many degrees of freedom is larger."""
    from scipy.special import gammaincc

    return float(gammaincc(freedom / 2, statistic / 2))


__all__ = ["ChiSquare", "chi_square", "pearson", "tail"]
