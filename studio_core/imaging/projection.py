"""Fisheye lenses: which direction a point of the picture shows, and back.

A lens looks along −z of its own frame, +x to the right and +y up in the picture (the house's convention of
cameras). A direction at the angle θ from the axis lies at the distance r(θ) = R · ρ(θ) / ρ(θ_max) from the
circle's centre, where R is the circle's radius in pixels and 2 θ_max the field of view.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]

EQUIDISTANT, EQUISOLID, STEREOGRAPHIC = "equidistant", "equisolid", "stereographic"
ORTHOGRAPHIC, KANNALA_BRANDT, OCAM = "orthographic", "Kannala–Brandt", "OCamCalib"
MODELS = (EQUIDISTANT, EQUISOLID, STEREOGRAPHIC, ORTHOGRAPHIC, KANNALA_BRANDT, OCAM)
_TABLE = 4096
_BEHIND = -0.99  # cos 172°: nothing is projected that lies further behind
_FURTHEST = 4
_BLOCK = 1 << 15


@dataclass(frozen=True)
class Circle:
    """Where a lens' image lies: centre (x to the right, y down; pixel i covers i … i + 1), radius, pixels."""

    x: float
    y: float
    radius: float

    def scaled(self, factor: float) -> Circle:
        """In a picture `factor` times as wide."""
        return Circle(self.x * factor, self.y * factor, self.radius * factor)


@dataclass(frozen=True)
class Lens:
    """How angles become distances from the centre.

    `fov`: degrees across the circle. `coefficients`: k1 … k4 of θ + k1 θ³ + k2 θ⁵ + … (Kannala and Brandt
    2006, with f absorbed by the circle), or a0, a1, a2 … of OCamCalib's polynomial in units of the circle's
    radius (Scaramuzza 2006), which `fov` only cuts off. `affine`: OCamCalib's c, d, e:
    picture = [[c, d], [e, 1]] · ideal, about the centre, rows before columns. ValueError when no picture can
    come from it.
    """

    model: str = EQUIDISTANT
    fov: float = 190.0
    coefficients: tuple[float, ...] = ()
    affine: tuple[float, float, float] = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise ValueError(f"there is no lens model {self.model!r}")
        if not 10 <= self.fov <= 300:
            raise ValueError(f"a field of view of {self.fov:g}° is not a fisheye's")
        if self.model == ORTHOGRAPHIC and self.fov > 180:
            object.__setattr__(self, "fov", 180.0)  # it sees no further
        if self.model == OCAM and len(self.coefficients) < 2:
            raise ValueError("OCamCalib's polynomial has no coefficients")
        if not all(math.isfinite(k) for k in (*self.coefficients, *self.affine)):
            raise ValueError("a lens has finite coefficients")
        rho = self._rho(np.linspace(0, self.half, 257))
        if not (np.isfinite(rho).all() and (np.diff(rho) > 0).all()):
            raise ValueError("the lens' curve turns back inside its field of view")

    @property
    def half(self) -> float:
        """θ_max in radians."""
        return math.radians(self.fov) / 2

    def radius_of(self, theta: npt.ArrayLike) -> F64:
        """r / R of angles from the axis, radians; beyond the field of view too, where the model goes on."""
        theta = np.asarray(theta, np.float64)
        if self.model == OCAM:
            return self._ocam_radius(theta)
        made: F64 = self._rho(theta) / float(self._rho(np.array([self.half]))[0])
        return made

    def angle_of(self, radius: npt.ArrayLike) -> F64:
        """θ in radians of distances r / R; what lies outside the circle goes on linearly."""
        radius = np.asarray(radius, np.float64)
        if self.model == OCAM:
            return self._ocam_angle(radius)
        at = np.linspace(0, self.half, _TABLE)
        rho = self.radius_of(at)
        slope = (at[-1] - at[-2]) / (rho[-1] - rho[-2])
        inside = np.interp(radius, rho, at)
        made: F64 = np.where(radius > 1, self.half + (radius - 1) * slope, inside)
        return made

    def with_fov(self, fov: float) -> Lens:
        """The same curve, cut elsewhere."""
        return replace(self, fov=fov)

    def _rho(self, theta: F64) -> F64:
        match self.model:
            case "equidistant":
                return theta
            case "equisolid":
                return 2 * np.sin(np.clip(theta, 0, np.pi) / 2)
            case "stereographic":
                return 2 * np.tan(np.clip(theta, 0, 3.1) / 2)
            case "orthographic":
                return np.sin(np.clip(theta, 0, np.pi / 2))
            case "Kannala–Brandt":
                square, total = theta * theta, np.zeros_like(theta)
                for k in reversed(self.coefficients):
                    total = (total + k) * square
                return np.asarray(theta * (1 + total), np.float64)
            case _:
                return self._ocam_radius(theta)

    def _ocam_angle(self, radius: F64) -> F64:
        height = np.polynomial.polynomial.polyval(radius, self.coefficients)
        return np.asarray(np.arctan2(radius, -height), np.float64)

    def _ocam_radius(self, theta: F64) -> F64:
        radius = np.linspace(0, 1.5, 2 * _TABLE)
        angle = self._ocam_angle(radius)
        upward = np.maximum.accumulate(angle)
        return np.asarray(np.interp(theta, upward, radius), np.float64)


@dataclass(frozen=True, eq=False)
class _Tables:
    """A lens' curve where neither arc tangents nor searching are needed to read it.

    `out`: r / (R sin θ) over cos θ from `_BEHIND` to 1. `sine` and `cosine`: R sin θ / r and cos θ over
    (r / R)² from 0 to `_FURTHEST`; both curves are smooth in these. Each has a node more than is read.
    """

    out: F64
    sine: F64
    cosine: F64
    edge: float  # cos θ_max
    square: float  # (r / R)² of it


@functools.lru_cache(maxsize=16)
def _tables(lens: Lens) -> _Tables:
    cosine = np.linspace(_BEHIND, 1, _TABLE + 1)
    theta = np.arccos(cosine)
    theta[-1] = 1e-6  # the limit on the axis
    out = lens.radius_of(theta) / np.sin(theta)
    radius = np.sqrt(np.linspace(0, _FURTHEST, _TABLE * _FURTHEST + 1))
    radius[0] = 1e-6
    angle = np.minimum(lens.angle_of(radius), np.pi)
    sine = np.sin(angle) / radius
    reach = float(lens.radius_of([lens.half])[0])
    made = _Tables(
        np.append(out, out[-1]),
        np.append(sine, sine[-1]),
        np.append(np.cos(angle), np.cos(angle[-1])),
        math.cos(lens.half),
        reach * reach,
    )
    for table in (made.out, made.sine, made.cosine):
        table.flags.writeable = False
    return made


def _read(table: F64, at: F64) -> F64:
    """Between the nodes of a table, `at` in its steps and inside it."""
    low = at.astype(np.intp)
    first = table[low]
    low += 1
    return np.asarray(first + (table[low] - first) * (at - low + 1), np.float64)


def project(lens: Lens, circle: Circle, directions: npt.NDArray[Any]) -> tuple[F64, npt.NDArray[np.bool_]]:
    """Points (..., 2) of directions (..., 3) of any length, and which of them the lens sees.

    A direction without length lies at the centre and is not seen. What lies further than 172° from the axis
    is drawn nearer than the model says; no lens sees it. From a table: within 1e-6 of the circle's radius.
    """
    d = np.asarray(directions, np.float64)
    flat = d.reshape(-1, 3)
    points = np.empty((len(flat), 2))
    seen = np.empty(len(flat), np.bool_)
    tables, (c, across, e) = _tables(lens), lens.affine
    for start in range(0, len(flat), _BLOCK):
        x, y, z = flat[start : start + _BLOCK].T
        with np.errstate(invalid="ignore", divide="ignore"):
            shrink = 1 / np.sqrt(x * x + y * y + z * z)
            cosine = z * -shrink
        some = np.isfinite(cosine)
        if not some.all():
            shrink, cosine = np.where(some, shrink, 0.0), np.where(some, cosine, -1.0)
        seen[start : start + _BLOCK] = cosine >= tables.edge - 1e-12
        np.clip(cosine, _BEHIND, 1, out=cosine)
        shrink *= _read(tables.out, (cosine - _BEHIND) * (_TABLE / (1 - _BEHIND)))
        shrink *= circle.radius
        right, down = x * shrink, y * -shrink
        points[start : start + _BLOCK, 0] = e * down + right + circle.x
        points[start : start + _BLOCK, 1] = c * down + across * right + circle.y
    return points.reshape(*d.shape[:-1], 2), seen.reshape(d.shape[:-1])


def unproject(lens: Lens, circle: Circle, points: npt.NDArray[Any]) -> tuple[F64, npt.NDArray[np.bool_]]:
    """Unit directions (..., 3) of points (..., 2), and which of them lie in the lens' field of view.

    Points further than twice the radius from the centre show what lies at twice the radius. From a table:
    within 1e-6, for orthographic lenses 1e-6 except in the outermost thousandth of the circle.
    """
    p = np.asarray(points, np.float64)
    flat = p.reshape(-1, 2)
    directions = np.empty((len(flat), 3))
    seen = np.empty(len(flat), np.bool_)
    tables, (c, across, e) = _tables(lens), lens.affine
    scale = 1 / ((c - across * e) * circle.radius)
    for start in range(0, len(flat), _BLOCK):
        x, y = flat[start : start + _BLOCK].T
        x, y = x - circle.x, y - circle.y
        right, up = (c * x - e * y) * scale, (across * x - y) * scale
        square = right * right + up * up
        seen[start : start + _BLOCK] = square <= tables.square + 1e-12
        far = square > _FURTHEST
        if far.any():
            with np.errstate(divide="ignore"):
                shrink = np.where(far, np.sqrt(_FURTHEST / square), 1.0)
            right, up, square = right * shrink, up * shrink, np.minimum(square, _FURTHEST)
        square *= _TABLE
        sine, part = _read(tables.sine, square), directions[start : start + _BLOCK]
        part[:, 0], part[:, 1] = right * sine, up * sine
        np.negative(_read(tables.cosine, square), out=part[:, 2])
    return directions.reshape(*p.shape[:-1], 3), seen.reshape(p.shape[:-1])


def pixel_points(height: int, width: int) -> F64:
    """(height, width, 2): the centres of all pixels."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([x, y], axis=-1)
