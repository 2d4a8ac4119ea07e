"""A lens' ring near its edge, unrolled: rows of equal angle from the axis, columns of equal azimuth.

Azimuth is counted about the lens' axis, 0 to the right of the picture and 90° up. Rows go outwards.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import F32, F64, Mask, View
from studio_core.capturing.settings import Patch
from studio_core.imaging.resample import known_means


@dataclass(frozen=True, eq=False)
class Ring:
    """The grid: `theta` (rows,) and `azimuth` (columns,) in radians, of the pixels' centres."""

    theta: F64
    azimuth: F64

    @cached_property
    def directions(self) -> F64:
        """(rows, columns, 3) unit, in the lens' frame."""
        return directions(self.azimuth[None, :], self.theta[:, None])


def directions(azimuth: F64, theta: F64) -> F64:
    """(..., 3) unit directions of the lens' frame; both are broadcast."""
    sine, cosine = np.sin(theta), -np.cos(theta)
    x, y = sine * np.cos(azimuth), sine * np.sin(azimuth)
    return np.stack([x, y, np.broadcast_to(cosine, x.shape)], axis=-1)


def angles(way: F64) -> tuple[F64, F64]:
    """Azimuth 0 … 2π and angle from the axis of unit directions (..., 3)."""
    azimuth = np.mod(np.arctan2(way[..., 1], way[..., 0]), 2 * np.pi)
    return azimuth, np.arctan2(np.hypot(way[..., 0], way[..., 1]), -way[..., 2])


def covers(patch: Patch, azimuth: F64, theta: F64) -> Mask:
    """Which directions (radians) a rectangle holds."""
    along = np.mod(np.degrees(azimuth) - patch.azimuth, 360.0)
    away = np.degrees(theta)
    return np.asarray((along <= patch.width) & (away >= patch.inner) & (away <= patch.outer), np.bool_)


def coarser(view: View, radius: float) -> View:
    """The same with the circle's radius at `radius` pixels or a little more, by means over whole pixels.

    Light is averaged over what is usable; a pixel is usable where half of its area is.
    """
    factor = int(view.circle.radius / radius)
    if factor < 2:
        return view
    height, width = (size // factor for size in view.usable.shape)
    part = (slice(0, height * factor), slice(0, width * factor))
    light, share = known_means(view.light[part], view.usable[part], height, width)
    circle = view.circle.scaled(1 / factor)
    return replace(view, light=light, usable=share >= 0.5, circle=circle, clipped=None, dark=None)


def calmed(picture: npt.NDArray[Any], known: Mask, rows: float, columns: float) -> F32:
    """Gaussian mean of a ring's picture (R, C) or (R, C, 3) over what is known; the azimuth is closed.

    rows, columns: standard deviations in pixels.
    """
    from scipy import ndimage

    def mean(field: F32) -> F32:
        down = ndimage.gaussian_filter1d(field, rows, axis=0, mode="constant")
        return np.asarray(ndimage.gaussian_filter1d(down, columns, axis=1, mode="wrap"), np.float32)

    weight = known.astype(np.float32)
    total = mean(weight)
    if picture.ndim == 3:
        weight, total = weight[:, :, None], total[:, :, None]
    return np.asarray(mean(picture.astype(np.float32) * weight) / np.maximum(total, 1e-6), np.float32)


def runs(flags: Mask) -> list[tuple[int, int]]:
    """Start and length of the runs of set flags on a closed ring."""
    if flags.all():
        return [(0, len(flags))]
    if not flags.any():
        return []
    first = int(np.flatnonzero(~flags)[0])
    edges = np.diff(np.concatenate([[0], np.roll(flags, -first).astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return [(int(a + first) % len(flags), int(b - a)) for a, b in zip(starts, ends, strict=True)]
