"""Per-texel coefficients of a basis: robust, rank-aware least squares, all texels at once (section 4.3).

Never through HᵀH: the weighted design of each texel is decomposed (SVD), and singular values under
`truncation` times the largest are left out, for lamps at one height say nothing about the direction
across. Tukey's weights leave out what does not fit (cast shadows, glints). What a texel's coefficients
are worth is asked of lights they have not seen: leave-one-out residuals, which the decomposition gives at
once, shrink them, down to nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_plugins.residual.samples import F32, F64

_BATCH = 8192  # texels at a time
_TUKEY = 4.685
_ROUNDS, _GENTLE = 8, 3
_SETTLED = 0.05  # change of a weight


@dataclass(frozen=True)
class Solver:
    """How to solve. truncation: relative to the largest singular value; tukey: leave out what does not fit;
    shrink: by leave-one-out; floor: standard deviation of values below which nothing is an outlier."""

    truncation: float = 0.03
    tukey: bool = True
    shrink: bool = True
    floor: float = 1e-4


@dataclass(frozen=True, eq=False)
class Solved:
    """Coefficients (t, k, 3), the rank of each texel's design (t,), what share of them was kept (t,), and the
    weights that were left to the samples (t, n)."""

    coefficients: F32
    rank: npt.NDArray[np.uint8]
    kept: F32
    weights: F32


def solve(design: F32, wanted: F32, weights: F32, how: Solver) -> Solved:
    """Least squares of design (t, n, k) · x = wanted (t, n, 3) under weights (t, n) ≥ 0; finite always.

    Texels without weights get zero, of rank 0.
    """
    count, lights, size = design.shape
    made = Solved(
        np.zeros((count, size, 3), np.float32),
        np.zeros(count, np.uint8),
        np.zeros(count, np.float32),
        np.zeros((count, lights), np.float32),
    )
    for first in range(0, count, _BATCH):
        part = slice(first, first + _BATCH)
        x, rank, kept, left = _batch(
            design[part].astype(np.float64),
            wanted[part].astype(np.float64),
            weights[part].astype(np.float64),
            how,
        )
        made.coefficients[part], made.rank[part], made.kept[part], made.weights[part] = x, rank, kept, left
    return made


def _batch(a: F64, b: F64, given: F64, how: Solver) -> tuple[F64, npt.NDArray[np.uint8], F64, F64]:
    weights = given
    x, u, keep = _truncated(a, b, weights, how.truncation)
    if how.tukey and a.shape[1] > a.shape[2] + 1:
        weights = weights.copy()
        active = np.arange(len(a))  # texels whose weights still change
        for step in range(_ROUNDS):
            part, some = a[active], given[active]
            off = np.sqrt(((b[active] - part @ x[active]) ** 2).mean(axis=2))
            scale = np.maximum(1.4826 * _weighted_median(off, some), how.floor)
            ratio = off / (_TUKEY * scale[:, None])
            # first gently, for the first fits lean on outliers
            trust = 1 / (1 + (4 * ratio) ** 2) if step < _GENTLE else np.maximum(1 - ratio**2, 0) ** 2
            change = np.abs(some * trust - weights[active]).max(axis=1)
            weights[active] = some * trust
            x[active], u[active], keep[active] = _truncated(part, b[active], weights[active], how.truncation)
            if step >= _GENTLE:
                active = active[change > _SETTLED]
                if not len(active):
                    break
    rank = keep.sum(axis=1).astype(np.uint8)
    kept = np.ones(len(a))
    if how.shrink:
        kept = _kept(a, b, x, u, keep, weights)
        x = x * kept[:, None, None]
    return x, rank, kept, weights


def _truncated(a: F64, b: F64, weights: F64, least: float) -> tuple[F64, F64, npt.NDArray[np.bool_]]:
    """Minimum-norm solutions (t, k, 3), left singular vectors (t, n, k), and which values count (t, k)."""
    root = np.sqrt(weights)[:, :, None]
    u, s, vt = np.linalg.svd(a * root, full_matrices=False)
    if s.shape[1] < a.shape[2]:  # fewer lights than columns
        pad = a.shape[2] - s.shape[1]
        u, s = np.pad(u, ((0, 0), (0, 0), (0, pad))), np.pad(s, ((0, 0), (0, pad)))
        vt = np.pad(vt, ((0, 0), (0, pad), (0, 0)))
    keep = (s > least * s[:, :1]) & (s > 1e-9)
    inverse = np.where(keep, 1 / np.where(keep, s, 1), 0)
    along = inverse[:, :, None] * (np.swapaxes(u, 1, 2) @ (b * root))
    return np.swapaxes(vt, 1, 2) @ along, u, keep


def _kept(a: F64, b: F64, x: F64, u: F64, keep: npt.NDArray[np.bool_], weights: F64) -> F64:
    """(t,) by how much the solution may be multiplied: the best factor 0 … 1 for predictions that left
    each light out in turn."""
    leverage = np.minimum((u**2 * keep[:, None, :]).sum(axis=2), 0.999)
    alone = (b - a @ x) / (1 - leverage)[:, :, None]
    guess = b - alone  # what the other lights say of this one
    top = (weights[:, :, None] * guess * b).sum(axis=(1, 2))
    bottom = (weights[:, :, None] * guess**2).sum(axis=(1, 2))
    return np.asarray(np.clip(top / np.maximum(bottom, 1e-30), 0, 1), np.float64)


def _weighted_median(values: F64, weights: F64) -> F64:
    """(t,) medians along the rows of those with a weight."""
    counted = np.where(weights > 0, values, np.nan)
    none = ~(weights > 0).any(axis=1)
    counted[none] = 0
    return np.asarray(np.nanmedian(counted, axis=1), np.float64)
