"""Lamps that no exposure resolved: which they are, and which of them likely lack most light.

A meter tells how much light all of them lack together, not which. A small strong lamp stands out of dark
surroundings as far as the exposures reach; a place that is just beyond them, a bright curtain, has a bright
rim. So what a lamp lacks is shared out as if its light went on rising inwards, over its own radius, as it
does at the rim.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import F64, Mask

_LEAST = 0.02
_LOOKED_AT = 200  # the largest; smaller ones share their middle weight
_WIDEST = 64  # pixels of a rim
_SATURATED = 16.0  # a contrast beyond that tells of the surroundings, not of the lamp

Labels = npt.NDArray[np.int32]


def places(mask: Mask) -> tuple[Labels, int]:
    """Connected places of an equirectangular mask, 1 … count, 0 elsewhere; its two edges are neighbours."""
    import cv2

    _, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    made = np.asarray(labels, np.int32)
    for left, right in zip(made[:, 0], made[:, -1], strict=True):
        if left and right and left != right:
            made[made == right] = left
    kept, numbered = np.unique(made, return_inverse=True)
    return numbered.reshape(made.shape).astype(np.int32), len(kept) - int(kept[0] == 0)


def lacking(luminance: npt.NDArray[np.floating], labels: Labels, count: int) -> F64:
    """(count + 1,) how many times its own light a place lacks, against the others; the most is 1."""
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    order = np.argsort(sizes)[::-1]
    made = np.full(count + 1, np.nan)
    for place in order[: min(_LOOKED_AT, count)]:
        radius = math.sqrt(float(sizes[place]) / math.pi)
        reach = min(max(2, round(radius)), _WIDEST)
        contrast = min(_contrast(luminance, labels, int(place), reach), _SATURATED)
        made[place] = max(contrast ** (radius / reach) - 1, _LEAST)
    known = made[np.isfinite(made)]
    made[~np.isfinite(made)] = float(np.median(known)) if len(known) else 1.0
    made[0] = 0
    return np.asarray(made / max(float(made.max()), _LEAST), np.float64)


def _contrast(luminance: npt.NDArray[np.floating], labels: Labels, place: int, reach: int) -> float:
    """A place's middle luminance over the mean of its rim, `reach` pixels wide."""
    import cv2

    height, width = labels.shape
    rows = np.flatnonzero((labels == place).any(axis=1))
    columns = np.flatnonzero((labels == place).any(axis=0))
    first, last = int(columns[0]), int(columns[-1])
    if last - first > width // 2:  # it lies at both edges
        first, last = int(columns[columns >= width // 2][0]), int(columns[columns < width // 2][-1]) + width
    at = np.mod(np.arange(first - reach, last + reach + 1), width)
    part = slice(max(int(rows[0]) - reach, 0), min(int(rows[-1]) + reach + 1, height))
    near, light = labels[part][:, at], luminance[part][:, at]
    own = near == place
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    rim = (cv2.dilate(own.astype(np.uint8), disc) > 0) & (near == 0)
    if not rim.any():
        return 1.0
    return float(np.median(light[own]) / max(float(light[rim].mean()), 1e-12))
