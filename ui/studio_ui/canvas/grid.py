"""Lines on the ground, at y = 0: every decimetre, metre and ten metres, as long as they can be told apart."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.session import View
from studio_ui.canvas.projection import axes_of, extent, eye_of

F32 = npt.NDArray[np.float32]

STEPS = ((0.1, 0.28), (1.0, 0.55), (10.0, 1.0))
"""Metres between lines, and how strong these are."""
WIDE = 0.75
"""Pixels from a line's middle to where it ends."""
REACH = 16.0
"""Metres from the eye at which the last lines are gone."""
LIFT = 0.998
"""Share of the way to the ground within which nothing hides it: a floor at the same height does not."""


def grid_strength(view: View, distance: F32) -> F32:
    """(H, W) 0…1 how much of a pixel of the view is a line; `distance` (H, W) is how far one sees there."""
    height, width = distance.shape
    right, top = extent(view)
    axes, eye = axes_of(view).astype(np.float32), eye_of(view).astype(np.float32)
    x = ((2 * (np.arange(width) + 0.5) / width - 1) * right).astype(np.float32)[None]
    y = ((1 - 2 * (np.arange(height) + 0.5) / height) * top).astype(np.float32)[:, None]
    steps = (2 * right / width, 2 * top / height)
    made = np.zeros(distance.shape, np.float32)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # the ray (x, y, −1), without unit length, meets the ground at `reach`
        reach = -eye[1] / (x * axes[0, 1] + y * axes[1, 1] - axes[2, 1])
        away = reach * np.sqrt(x * x + y * y + 1)
        seen = (reach > 0) & (away < REACH) & (away * np.float32(LIFT) <= distance)
    rows, columns = np.nonzero(seen)
    reach, away, x, y = reach[seen], away[seen], x[0, columns], y[rows, 0]
    ray = [x * axes[0, k] + y * axes[1, k] - axes[2, k] for k in range(3)]
    place, span = [], []
    for k in (0, 2):  # and how far the ground moves from one pixel to the next
        place.append(eye[k] + reach * ray[k])
        slopes = [np.abs(reach * (axes[a, k] - ray[k] * axes[a, 1] / ray[1])) * steps[a] for a in (0, 1)]
        span.append(np.maximum(slopes[0] + slopes[1], np.float32(1e-9)))
    strength = np.zeros(len(reach), np.float32)
    for step, strong in STEPS:
        np.maximum(strength, strong * _lines(place, span, step), out=strength)
    made[seen] = strength * (1 - _smooth(0.35, 1.0, away / REACH))
    return made


def _lines(place: list[F32], span: list[F32], step: float) -> F32:
    near = []
    for at, wide in zip(place, span, strict=True):
        cells = at / step
        near.append(np.abs(cells - np.rint(cells)) * step / wide)
    fine = 1 - _smooth(0.15, 0.6, np.maximum(*span) / step)
    made: F32 = fine * np.clip(WIDE + 0.5 - np.minimum(*near), 0, 1)
    return made


def _smooth(low: float, high: float, x: F32) -> F32:
    t = np.clip((x - low) / (high - low), 0, 1)
    made: F32 = t * t * (3 - 2 * t)
    return made
