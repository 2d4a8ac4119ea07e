"""Integrals over the hemisphere of what may be as sharp as a mirror: adaptive, polar around its direction.

A direction is θ = θ_h(φ) · expm1(g s) / expm1(g) away from the mirror direction of ω_o, in the azimuth φ;
θ_h is where that way meets the horizon, so s in 0…1 and φ in 0…2π are the hemisphere and nothing else. A
lobe is as smooth along s whether it is 1e-5 wide or 1, so that none is overlooked. φ = 0 leads to the normal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Tolerance = float | F64 | Callable[[F64], F64]
Integrand = Callable[[int, F32], npt.NDArray[np.floating]]
"""Values (N, K) at wi (N, 3) for the row of wo given first."""

GRADE = 14.0
FIRST = (4, 4)  # boxes of the hemisphere along s and φ; the horizon may bend sharply at φ = ±π/2
POINTS = 7
ROUNDS = 16
MOST = 1 << 17
"""Boxes at a time; where more do not settle, they stay as they are."""


@dataclass(frozen=True)
class MirrorFrame:
    """Frames (R) around the mirror directions of wo (R, 3), with z > 0."""

    mirror: F64
    up: F64
    aside: F64
    height: F64
    reach: F64

    @classmethod
    def of(cls, wo: npt.ArrayLike) -> MirrorFrame:
        """Of unit directions away from the surface."""
        o = np.atleast_2d(np.asarray(wo, np.float64))
        o = o / np.linalg.norm(o, axis=1, keepdims=True)
        reach, height = np.hypot(o[:, 0], o[:, 1]), o[:, 2]
        level = reach < 1e-12
        flat = np.where(level, 1.0, reach)
        c, s = np.where(level, 1.0, o[:, 0] / flat), np.where(level, 0.0, o[:, 1] / flat)
        mirror = np.stack([-reach * c, -reach * s, height], 1)
        up = np.stack([height * c, height * s, reach], 1)
        return cls(mirror, up, np.stack([-s, c, np.zeros_like(c)], 1), height, reach)

    def horizon(self, row: npt.NDArray[np.int64], phi: F64) -> F64:
        """θ_h (…) for rows and azimuths."""
        made: F64 = np.arctan2(self.height[row], -self.reach[row] * np.cos(phi))
        return made

    def directions(self, row: npt.NDArray[np.int64], s: F64, phi: F64) -> tuple[F32, F64]:
        """wi (…, 3), and the solid angle per s and φ (…), of arrays that are broadcast."""
        end = self.horizon(row, phi)
        theta = end * (np.expm1(GRADE * s) / np.expm1(GRADE))
        sine, cosine = np.sin(theta), np.cos(theta)
        up, aside = sine * np.cos(phi), sine * np.sin(phi)
        wi = np.empty((*theta.shape, 3), np.float32)
        for axis in range(3):
            made = cosine * self.mirror[row, axis]
            made += up * self.up[row, axis]
            made += aside * self.aside[row, axis]
            wi[..., axis] = made
        return wi, sine * (end * (GRADE * np.exp(GRADE * s) / np.expm1(GRADE)))

    def place(self, row: int, wi: npt.ArrayLike) -> tuple[F64, F64]:
        """s and φ in 0…2π of directions wi (N, 3): what `directions` leads to."""
        w = np.asarray(wi, np.float64)
        w = w / np.linalg.norm(w, axis=1, keepdims=True)
        away = w - self.mirror[row]
        theta = 2 * np.arcsin(np.minimum(np.linalg.norm(away, axis=1) / 2, 1.0))
        phi = np.arctan2(away @ self.aside[row], away @ self.up[row]) % (2 * np.pi)
        s = np.log1p(theta / self.horizon(np.full(len(w), row), phi) * np.expm1(GRADE)) / GRADE
        return np.clip(s, 0.0, 1.0), phi


def over_boxes(
    integrand: Integrand, wo: npt.ArrayLike, row: npt.ArrayLike, low: F64, size: F64, tolerance: Tolerance
) -> F64:
    """(B, K) ∫ f dω over the boxes low (B, 2), size (B, 2) in (s, φ) around the mirror of wo[row].

    Boxes are halved both ways until that changes them by less than `tolerance`: a number, (B, K), or what
    makes it of the first estimate (B, K).
    """
    frame = MirrorFrame.of(wo)
    box = np.arange(len(low))
    rows = np.asarray(row, np.int64)
    value = _integrate(integrand, frame, rows, low, size)
    limit = np.broadcast_to(tolerance(value) if callable(tolerance) else tolerance, value.shape)
    total = np.zeros(value.shape)
    corner = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    for _ in range(ROUNDS):
        halves = np.repeat(size / 2, 4, axis=0)
        low = np.repeat(low, 4, axis=0) + np.tile(corner, (len(low), 1)) * halves
        size, rows, box = halves, np.repeat(rows, 4), np.repeat(box, 4)
        parts = _integrate(integrand, frame, rows, low, size)
        better = parts.reshape(-1, 4, parts.shape[1]).sum(axis=1)
        done = (np.abs(better - value) <= limit[box[::4]]).all(axis=1)
        np.add.at(total, box[::4][done], better[done])
        keep = np.repeat(~done, 4)
        low, size, rows, box, value = low[keep], size[keep], rows[keep], box[keep], parts[keep]
        if not len(rows):
            return total
        if len(rows) > MOST:
            break
    np.add.at(total, box, value)
    return total


def over_hemisphere(
    integrand: Integrand, wo: npt.ArrayLike, tolerance: float, floor: float | None = None
) -> F64:
    """(R, K) ∫ f dω for the rows of wo (R, 3); `tolerance` is of one box of some dozens.

    With `floor` it is relative: to the row's integral of |f|, or to `floor` times the largest of all rows.
    """
    directions = np.atleast_2d(np.asarray(wo, np.float64))
    low, size = grid(*FIRST)
    count, rows = len(low), len(directions)
    row = np.repeat(np.arange(rows), count)

    def relative(first: F64) -> F64:
        whole = np.abs(first).reshape(rows, count, -1).sum(axis=1)  # what is odd sums to nothing
        limit = tolerance * np.maximum(whole, (floor or 0.0) * whole.max(axis=0))
        return np.asarray(np.repeat(limit, count, axis=0))

    low, size = np.tile(low, (rows, 1)), np.tile(size, (rows, 1))
    boxes = over_boxes(integrand, directions, row, low, size, tolerance if floor is None else relative)
    made: F64 = boxes.reshape(rows, count, -1).sum(axis=1)
    return made


def grid(along: int, around: int) -> tuple[F64, F64]:
    """low and size (along · around, 2) of equal boxes in (s, φ), φ running fastest."""
    s, phi = np.meshgrid(np.arange(along) / along, np.arange(around) / around, indexing="ij")
    low = np.stack([s.ravel(), 2 * np.pi * phi.ravel()], 1)
    return low, np.tile(np.array([1 / along, 2 * np.pi / around]), (along * around, 1))


_NODES, _WEIGHTS = (np.asarray(a, np.float64) for a in np.polynomial.legendre.leggauss(POINTS))
_NODES, _WEIGHTS = (_NODES + 1) / 2, _WEIGHTS / 2


def _integrate(
    integrand: Integrand, frame: MirrorFrame, row: npt.NDArray[np.int64], low: F64, size: F64
) -> F64:
    s = (low[:, :1] + size[:, :1] * _NODES)[:, :, None]
    phi = (low[:, 1:] + size[:, 1:] * _NODES)[:, None, :]
    wi, measure = frame.directions(row[:, None, None], s, phi)
    measure *= _WEIGHTS[:, None] * _WEIGHTS * (size[:, 0] * size[:, 1])[:, None, None]
    columns = wi.reshape(len(row), -1, 3)
    weight = measure.reshape(len(row), -1, 1)
    made: F64 | None = None
    for one in np.unique(row):
        mine = row == one
        values = integrand(int(one), columns[mine].reshape(-1, 3))
        if made is None:
            made = np.zeros((len(row), values.shape[1]))
        shaped = np.asarray(values, np.float64).reshape(int(mine.sum()), -1, values.shape[1])
        made[mine] = (shaped * weight[mine]).sum(axis=1)
    assert made is not None
    return made


__all__ = ["MirrorFrame", "grid", "over_boxes", "over_hemisphere"]
