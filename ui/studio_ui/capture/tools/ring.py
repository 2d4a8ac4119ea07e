"""Rectangles of the ring: where they lie in a lens' picture, and what a hand makes of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from studio_core.capturing.settings import Patch
from studio_core.imaging.projection import Circle, Lens, project, unproject

LEAST = 1.0  # degrees of a side
F64 = npt.NDArray[np.float64]


def ring_points(lens: Lens, circle: Circle, azimuth: npt.ArrayLike, theta: npt.ArrayLike) -> F64:
    """(..., 2) points of the picture of azimuth and angle from the axis, degrees (broadcast)."""
    a, t = np.broadcast_arrays(np.radians(azimuth), np.radians(theta))
    directions = np.stack([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), -np.cos(t)], axis=-1)
    return project(lens, circle, directions)[0]


def at_ring(lens: Lens, circle: Circle, x: float, y: float) -> tuple[float, float]:
    """Azimuth 0 … 360 and angle from the axis, degrees, of a point of the picture."""
    d, _ = unproject(lens, circle, np.array([x, y]))
    theta = math.degrees(math.atan2(math.hypot(d[0], d[1]), -d[2]))
    return math.degrees(math.atan2(d[1], d[0])) % 360, theta


def outline(lens: Lens, circle: Circle, patch: Patch, step: float = 1.0) -> F64:
    """(N, 2): the rectangle's border in the picture, closed by joining the ends."""
    count = max(2, math.ceil(patch.width / step) + 1)
    across = np.linspace(patch.azimuth, patch.azimuth + patch.width, count)
    outer = ring_points(lens, circle, across, patch.outer)
    inner = ring_points(lens, circle, across[::-1], patch.inner)
    return np.concatenate([outer, inner])


def inside(patch: Patch, azimuth: float, theta: float, margin: float = 0.0) -> bool:
    """Whether a place of the ring lies in the rectangle, or up to `margin` degrees beside it."""
    past = (azimuth - patch.azimuth + margin) % 360
    within = past <= patch.width + 2 * margin
    return within and patch.inner - margin <= theta <= patch.outer + margin


def grip_at(patch: Patch, azimuth: float, theta: float, reach_azimuth: float, reach_theta: float) -> str:
    """Which side is within reach (degrees): start, end, inner, outer; body inside; else nothing."""
    past = (azimuth - patch.azimuth + 180) % 360 - 180
    to_end = (azimuth - patch.azimuth - patch.width + 180) % 360 - 180
    high = patch.inner - reach_theta <= theta <= patch.outer + reach_theta
    wide = (azimuth - patch.azimuth + reach_azimuth) % 360 <= patch.width + 2 * reach_azimuth
    if high and abs(past) <= reach_azimuth:
        return "start"
    if high and abs(to_end) <= reach_azimuth:
        return "end"
    if wide and abs(theta - patch.inner) <= reach_theta:
        return "inner"
    if wide and abs(theta - patch.outer) <= reach_theta:
        return "outer"
    return "body" if inside(patch, azimuth, theta) else ""


def dragged(patch: Patch, grip: str, azimuth: float, theta: float, widest: float) -> Patch:
    """The rectangle after its grip was moved by degrees; `widest` is the lens' largest angle."""
    match grip:
        case "start":
            by = min(max(azimuth, patch.width - 360), patch.width - LEAST)
            return replace(patch, azimuth=(patch.azimuth + by) % 360, width=patch.width - by)
        case "end":
            return replace(patch, width=min(max(patch.width + azimuth, LEAST), 360.0))
        case "inner":
            return replace(patch, inner=min(max(patch.inner + theta, 0.0), patch.outer - LEAST))
        case "outer":
            return replace(patch, outer=min(max(patch.outer + theta, patch.inner + LEAST), widest))
        case "body":
            by = min(max(theta, -patch.inner), widest - patch.outer)
            moved = replace(patch, azimuth=(patch.azimuth + azimuth) % 360)
            return replace(moved, inner=patch.inner + by, outer=patch.outer + by)
        case _:
            return patch


def drawn(side: str, start: tuple[float, float], end: tuple[float, float], widest: float) -> Patch:
    """The rectangle between two places of the ring, the short way round."""
    turn = (end[0] - start[0] + 180) % 360 - 180
    azimuth = start[0] if turn >= 0 else end[0]
    inner, outer = sorted((min(start[1], widest), min(end[1], widest)))
    inner = min(inner, widest - LEAST)
    return Patch(side, azimuth % 360, max(abs(turn), LEAST), inner, max(outer, inner + LEAST))
