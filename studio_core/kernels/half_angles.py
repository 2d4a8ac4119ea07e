"""Draws of half vectors by a table over their angle θ_h with the normal: for measured reflectance.

The table is a cumulative distribution over BINS bins, bounded by θ_h = π/2 (i / BINS)² as the rows of
half-difference tables are, so that sharp highlights have many; within a bin, half vectors lie evenly.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.brdf import TWO

F = np.float32
BINS = 64
EDGES = BINS + 1
"""Numbers of a table."""
EVEN = 0.1  # share of all draws that goes to bins alike, so that none is left out
_FINE = 4
_BINS = np.float32(BINS)
_QUARTER_TURN = np.float32(np.pi / 4)
_TO_BIN = np.float32(2 / np.pi)
_TURN = np.float32(2 * np.pi)


def cumulative(heights: npt.ArrayLike) -> npt.NDArray[np.float32]:
    """(EDGES,) for a lobe whose value is heights (H,) in the middle of H rows, bounded as the bins are.

    Bins are drawn by their share of ∫ value · cos θ_h dω_h.
    """
    rows = np.asarray(heights, np.float64)
    place = (np.arange(BINS * _FINE) + 0.5) / (BINS * _FINE)
    edges = np.pi / 2 * (np.arange(BINS * _FINE + 1) / (BINS * _FINE)) ** 2
    value = np.interp(place * len(rows) - 0.5, np.arange(len(rows)), np.maximum(rows, 0.0))
    share = (value * np.diff(np.sin(edges) ** 2)).reshape(BINS, _FINE).sum(axis=1)
    share = share / share.sum() if share.sum() > 0 else np.full(BINS, 1 / BINS)
    made = np.concatenate([[0.0], np.cumsum((1 - EVEN) * share + EVEN / BINS)])
    return np.asarray(made / made[-1], np.float32)


@kernel
def _edge(i: int) -> F:
    """1 − cos θ_h where bin i begins."""
    part = np.float32(i) / _BINS
    sine = np.sin(_QUARTER_TURN * part * part)
    made: F = TWO * sine * sine
    return made


@kernel
def drawn_height(table: Any, u: F) -> F:
    """1 − cos θ_h of a half vector drawn with u in [0, 1)."""
    low, high = 0, BINS
    while high - low > 1:
        middle = (low + high) // 2
        if table[middle] <= u:
            low = middle
        else:
            high = middle
    part = (u - table[low]) / (table[low + 1] - table[low])
    first = _edge(low)
    made: F = first + part * (_edge(low + 1) - first)
    return made


@kernel
def height_density(table: Any, flat: F, up: F) -> F:
    """Density per steradian of a half vector with tan θ_h = flat / up."""
    i = min(max(int(np.sqrt(np.arctan2(flat, up) * _TO_BIN) * _BINS), 0), BINS - 1)
    made: F = (table[i + 1] - table[i]) / (_TURN * (_edge(i + 1) - _edge(i)))
    return made


__all__ = ["BINS", "EDGES", "cumulative", "drawn_height", "height_density"]
