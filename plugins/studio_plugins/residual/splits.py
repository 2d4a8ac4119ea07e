"""Which lights are held back: checkerboards, inner to outer, one row, a fraction."""

from __future__ import annotations

import numpy as np

from studio_core.errors import InputError
from studio_plugins.residual.samples import Flags, Lights


def checkerboard(lights: Lights) -> Flags:
    """(n,) True for those held back: every other one along each row, shifted from row to row."""
    angles = lights.angles()
    rows = np.round(angles[:, 1] / 5.0).astype(int)
    made = np.zeros(len(lights), np.bool_)
    for place, height in enumerate(np.unique(rows)):
        which = np.flatnonzero(rows == height)
        order = which[np.argsort(angles[which, 0])]
        made[order[(place + 1) % 2 :: 2]] = True
    return made


def inner_to_outer(lights: Lights) -> Flags:
    """(n,) True for the half that is further from the camera."""
    away = np.degrees(np.arccos(np.clip(lights.directions[:, 2], -1, 1)))
    return np.asarray(away > np.median(away) + 1e-6)


def one_row(lights: Lights) -> Flags:
    """(n,) True for all but the lights at the height that is nearest to the camera's."""
    height = lights.angles()[:, 1]
    middle = height[np.argmin(np.abs(height))]
    return np.asarray(np.abs(height - middle) > 2.5)


def fraction(lights: Lights, share: float, seed: int = 0) -> Flags:
    """(n,) True for a random share of them, at least one, and never all. InputError where that can't be."""
    if not 0 < share < 1 or len(lights) < 2:
        raise InputError(f"{share:g} of {len(lights)} lights cannot be held back")
    count = min(max(round(share * len(lights)), 1), len(lights) - 1)
    made = np.zeros(len(lights), np.bool_)
    made[np.random.default_rng(seed).permutation(len(lights))[:count]] = True
    return made


def folds(lights: Lights, count: int = 3) -> list[Flags]:
    """(n,) flags of each fold held back: every `count`-th light along rows, and last the outer half.

    Fewer where there are few lights; none with one light.
    """
    angles = lights.angles()
    order = np.lexsort((angles[:, 0], np.round(angles[:, 1] / 5.0)))
    place = np.empty(len(lights), int)
    place[order] = np.arange(len(lights))
    count = min(count, len(lights))
    made = [place % count == k for k in range(count)] if count > 1 else []
    outer = inner_to_outer(lights)
    if len(lights) >= 6 and outer.any() and not outer.all():
        made.append(outer)
    return made


SPLITS = {"checkerboard": checkerboard, "inner-outer": inner_to_outer, "one-row": one_row}
"""By name, as in reports."""
