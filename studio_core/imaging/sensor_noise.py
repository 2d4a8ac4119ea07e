"""A camera's noise from flat places of ordinary photographs (after Liu et al. 2008, section 3).

In every range of numbers the calmest places show noise alone; the parts of the model (rounding and
compression, reading, photons) are fitted to them without negative ones.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import numpy.typing as npt

from studio_core.imaging.tiles import Tiles

F64 = npt.NDArray[np.float64]
_RANGES = 24
_CALM = 0.25  # the quantile of variances that is noise alone
_FEWEST = 12  # places in a range


def fit_noise(
    tiles: Sequence[Tiles], exposure: Callable[..., F64], rounding: float
) -> tuple[float, float, float]:
    """The three parts of `Response.noise`.

    exposure(number 0 … 1, channel=…) → linear exposure. `rounding`: variance of rounding to whole numbers, of
    numbers 0 … 1; the least that the first part can be.
    """
    seen: list[tuple[float, float, float, float]] = []
    for part in tiles:
        for channel in range(3):
            fair = part.fair[..., channel]
            number, variance = part.number[..., channel][fair], part.variance[..., channel][fair]
            freedom = part.size**2 - 3
            seen.extend(_calm(number, variance, freedom, partial(exposure, channel=channel)))
    if not seen:
        return max(rounding, 1e-9), 0.0, 0.0
    number, variance, light, slope = np.array(seen).T
    square = slope**2
    parts = np.stack([np.ones_like(square), square, square * light], axis=1)
    made = _without_negative(parts, np.maximum(variance, 1e-12))
    return max(float(made[0]), rounding, 1e-12), float(made[1]), float(made[2])


def _calm(
    number: F64, variance: F64, freedom: int, exposure: Callable[[F64], F64]
) -> list[tuple[float, float, float, float]]:
    """(number, variance of noise, exposure, dn / dE) of each range of numbers."""
    made = []
    # a low quantile of a sample variance is under the variance itself: chi-squared, by Wilson and Hilferty
    shrink = (1 - 2 / (9 * freedom) - 0.6745 * np.sqrt(2 / (9 * freedom))) ** 3
    for low in range(_RANGES):
        here = (number >= low / _RANGES) & (number < (low + 1) / _RANGES)
        if np.count_nonzero(here) < _FEWEST:
            continue
        at = float(np.median(number[here]))
        step = 0.01
        around = exposure(np.array([max(at - step, 0.0), at, min(at + step, 1.0)]))
        rise = float(around[2] - around[0])
        if rise <= 0:
            continue
        slope = (min(at + step, 1.0) - max(at - step, 0.0)) / rise
        made.append((at, float(np.quantile(variance[here], _CALM)) / shrink, float(around[1]), slope))
    return made


def _without_negative(parts: F64, wanted: F64) -> F64:
    """Least squares of relative errors with three parts ≥ 0: the best of all subsets."""
    best, least = np.zeros(3), np.inf
    weight = 1 / wanted
    for count in (1, 2, 3):
        for chosen in itertools.combinations(range(3), count):
            some = parts[:, chosen] * weight[:, None]
            found = np.linalg.lstsq(some, np.ones(len(wanted)), rcond=None)[0]
            if (found < 0).any():
                continue
            # a model that is too small by half costs as much as one that is too large by twice
            ratio = np.maximum(parts[:, chosen] @ found, 1e-15) * weight
            cost = float(np.abs(np.log(ratio)).sum())
            if cost < least * 0.98:
                best, least = np.zeros(3), cost
                best[list(chosen)] = found
    return best
