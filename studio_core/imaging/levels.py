"""Where a camera's numbers begin and end: the pedestal of no light, and the level at which light is clipped.

Both show as levels that do not follow the exposure: film scans begin at 14–17 of 255, JPEGs end anywhere
from 245 on. A level counts as such only where two different exposures agree on it, or near the ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
BINS = 512
_LOOKED_AT = 600_000  # pixels of a frame


@dataclass(frozen=True)
class Levels:
    """Usable numbers lie strictly between `black` and `white` (red, green, blue), in 0 … `top`."""

    black: tuple[float, float, float]
    white: tuple[float, float, float]
    top: float


def find_levels(frames: Sequence[npt.NDArray[Any]], evs: Sequence[float]) -> Levels:
    """Levels of frames (H, W, 3) of one camera, uint8, uint16 or float32 (linear), with their listed EV."""
    tops = {np.dtype(np.uint8): 255.0, np.dtype(np.uint16): 65535.0}
    top = tops.get(frames[0].dtype) or max(_largest(frame) for frame in frames)
    black, white = [], []
    # bytes fall into every second bin otherwise
    bins = 256 if frames[0].dtype == np.uint8 else BINS
    thin = [_thinned(frame) for frame in frames]
    # by what they show: what is listed may be wrong
    order = np.argsort([float(np.nan_to_num(frame, posinf=top).mean()) for frame in thin], kind="stable")
    thin = [thin[i] for i in order]
    sorted_evs = np.asarray(evs, np.float64)[order]
    for channel in range(3):
        counts = np.stack([_histogram(frame[..., channel], top, bins) for frame in thin])
        black.append(_pedestal(counts, sorted_evs) * top)
        white.append(_clipping(counts, sorted_evs) * top)
    return Levels((black[0], black[1], black[2]), (white[0], white[1], white[2]), top)


def _largest(frame: npt.NDArray[Any]) -> float:
    finite = frame[np.isfinite(frame)]
    return max(float(finite.max(initial=0.0)), 1e-12)


def _thinned(frame: npt.NDArray[Any]) -> npt.NDArray[Any]:
    step = max(1, int(np.sqrt(frame.shape[0] * frame.shape[1] / _LOOKED_AT)))
    return frame[::step, ::step]


def _histogram(numbers: npt.NDArray[Any], top: float, bins: int) -> F64:
    scaled = np.nan_to_num(numbers.astype(np.float32).ravel() * np.float32((bins - 1) / top), posinf=bins - 1)
    level = np.clip(np.rint(scaled), 0, bins - 1).astype(np.int64)
    return np.bincount(level, minlength=bins).astype(np.float64)


def _pedestal(counts: F64, evs: F64) -> float:
    """The level, in 0 … 1, on which the darkest pixels of two different exposures agree; else 0."""
    bins = int(counts.shape[1])
    floors = np.argmax(
        np.cumsum(counts, axis=1) >= np.maximum(20, 1e-3 * counts.sum(1, keepdims=True)), axis=1
    )
    darkest = 0
    apart = np.flatnonzero(np.abs(evs - evs[darkest]) >= 0.7)
    if not len(apart) or not 0.01 * bins <= floors[darkest] <= 0.2 * bins:
        return 0.0
    brighter = int(apart[0])
    # light would have raised it by half at the very least
    if floors[brighter] > 1.15 * floors[darkest] + 0.004 * bins:
        return 0.0
    first = int(floors[darkest])
    reach = counts[darkest, first : first + max(2, round(0.03 * bins))]
    return float((first + np.argmax(reach)) / (bins - 1))


def _clipping(counts: F64, evs: F64) -> float:
    """The level, in 0 … 1, from which on numbers tell nothing: where the pile of clipped pixels begins."""
    bins = int(counts.shape[1])
    above = np.cumsum(counts[:, ::-1], axis=1)[:, ::-1]
    enough = np.maximum(5, 1e-5 * counts.sum(1))
    tops = np.array(
        [int(np.flatnonzero(a >= e)[-1]) if a[0] >= e else 0 for a, e in zip(above, enough, strict=True)]
    )
    highest = int(tops.max())
    last = int(bins) - 1
    at_end = highest >= 0.9 * last
    reach = [i for i in range(len(evs)) if tops[i] >= highest - 0.015 * bins]
    edge = max(highest - round(0.02 * bins), 0)
    agree = (
        len(reach) > 1
        and abs(evs[reach[-1]] - evs[reach[0]]) >= 0.5
        and above[reach[-1], edge] > 1.2 * above[reach[0], edge]  # more light clips more
    )
    if not at_end and not agree:
        return 0.99  # nothing was clipped
    count = counts[reach].sum(0)
    start = max(highest - round(0.04 * bins), 0)
    usual = float(
        np.median(count[max(highest - round(0.2 * bins), 0) : max(highest - round(0.05 * bins), 1)])
    )
    peak = start + int(np.argmax(count[start : highest + 1]))
    if count[peak] < 4 * usual + 20:
        return highest / last if agree else min(0.99, highest / last)
    first = peak
    while first > start and count[first - 1] > 2 * usual + 5:
        first -= 1
    return min(0.99, (first - 0.5) / last)
