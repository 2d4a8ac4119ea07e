"""The ball of previews: rings of points seen at equal angles, and where its pixels lie between them."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

_TILT = math.radians(14)  # the ball is seen a little from above
VIEW: F64 = np.array([0.0, math.sin(_TILT), math.cos(_TILT)])
"""Towards the eye, far away: it looks along -z, as cameras do."""
RIGHT: F64 = np.array([1.0, 0.0, 0.0])
UP: F64 = np.cross(VIEW, RIGHT)
"""With `RIGHT` the axes of the picture, in the world."""


@dataclass(frozen=True, eq=False)
class Sphere:
    """R rings of T points; ring i is seen at the angle whose cosine is `cosines` (R,).

    frames (R, T, 3, 3) have the axes of the shading frame as rows, in the world, the view in their xz plane;
    `grain` (R, T) is the angle from their x axis to the tangent along u.
    """

    cosines: F64
    frames: F32
    grain: F32


@dataclass(frozen=True, eq=False)
class Disc:
    """The ball's P pixels in a square picture.

    rows, columns (P,); coverage (P,) 0…1; uv (P, 2), v up; corners and shares (4, P): which points of a
    `Sphere`, numbered ring by ring with one more ring within the first and beyond the last, and how much.
    """

    rows: I64
    columns: I64
    coverage: F32
    uv: F32
    corners: I64
    shares: F32


@functools.lru_cache(maxsize=8)
def sphere(rings: int, turns: int) -> Sphere:
    """The points; `turns` is even."""
    angle = (np.arange(rings) + 0.5) / rings * np.pi / 2
    turn = 2 * np.pi * np.arange(turns) / turns
    cosine, sine = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    outward = np.cos(turn)[:, None] * RIGHT + np.sin(turn)[:, None] * UP
    normal = cosine * VIEW + sine * outward
    first = sine * VIEW - cosine * outward  # the view less its part along the normal
    second = np.cross(normal, first)
    frames = np.stack([first, second, normal], axis=2)
    tangent = along_u(normal)
    grain = np.arctan2((tangent * second).sum(axis=2), (tangent * first).sum(axis=2))
    return Sphere(np.cos(angle), frames.astype(np.float32), grain.astype(np.float32))


@functools.lru_cache(maxsize=16)
def disc(size: int, rings: int, turns: int) -> Disc:
    """The pixels of a ball that fills a picture of size × size pixels."""
    radius = size / 2 - 0.5
    grid = np.arange(size) + 0.5 - size / 2
    x, y = np.meshgrid(grid / radius, -grid / radius)
    distance = np.hypot(x, y)
    coverage = np.clip((1 - distance) * radius + 0.5, 0, 1)
    rows, columns = np.nonzero(coverage > 0)
    x, y, distance = x[rows, columns], y[rows, columns], distance[rows, columns]
    within = np.minimum(distance, 1.0)
    stretch = within / np.maximum(distance, 1e-12)
    x, y = x * stretch, y * stretch
    normal = x[:, None] * RIGHT + y[:, None] * UP + np.sqrt(1 - within**2)[:, None] * VIEW
    uv = np.stack(
        [np.arctan2(normal[:, 0], normal[:, 2]) / np.pi, np.arcsin(np.clip(normal[:, 1], -1, 1)) / np.pi], 1
    )  # a turn around is twice as long as the way from pole to pole
    ring = np.arcsin(within) / (np.pi / 2) * rings + 0.5
    ring = np.minimum(ring, rings + 1 - 1e-9)
    turn = np.arctan2(y, x) / (2 * np.pi) * turns % turns
    low, left = np.floor(ring).astype(np.int64), np.floor(turn).astype(np.int64) % turns
    up, right = (ring - low).astype(np.float32), (turn - np.floor(turn)).astype(np.float32)
    high, beside = low + 1, (left + 1) % turns
    corners = np.stack([low * turns + left, low * turns + beside, high * turns + left, high * turns + beside])
    shares = np.stack([(1 - up) * (1 - right), (1 - up) * right, up * (1 - right), up * right])
    covered = coverage[rows, columns].astype(np.float32)
    return Disc(rows, columns, covered, (uv + 0.5).astype(np.float32), corners, shares)


def over_disc(points: F32, at: Disc) -> F32:
    """(P, ...) between values at the points of a `Sphere` (R, T, ...), across its middle too."""
    turns = points.shape[1]
    inner, outer = np.roll(points[:1], turns // 2, axis=1), points[-1:]
    flat = np.concatenate([inner, points, outer]).reshape((len(points) + 2) * turns, -1)
    made = at.shares[0][:, None] * flat[at.corners[0]]
    for corner, share in zip(at.corners[1:], at.shares[1:], strict=True):
        made += share[:, None] * flat[corner]
    return np.asarray(made.reshape(-1, *points.shape[2:]))


def normals_of(at: Disc) -> F64:
    """(P, 3) unit normals of the pixels, in the world."""
    around = (at.uv[:, 0].astype(np.float64) - 0.5) * np.pi
    high = (at.uv[:, 1].astype(np.float64) - 0.5) * np.pi
    return np.stack([np.sin(around) * np.cos(high), np.sin(high), np.cos(around) * np.cos(high)], axis=1)


def along_u(normal: F64) -> F64:
    """Tangents in the direction of rising u: eastward. At the poles any."""
    east = np.stack([normal[..., 2], np.zeros(normal.shape[:-1]), -normal[..., 0]], axis=-1)
    length = np.linalg.norm(east, axis=-1, keepdims=True)
    return np.where(length > 1e-9, east / np.maximum(length, 1e-9), RIGHT)


__all__ = ["RIGHT", "UP", "VIEW", "Disc", "Sphere", "along_u", "disc", "normals_of", "over_disc", "sphere"]
