"""Fisheye lenses: which direction a point of the picture shows, and back.

A lens looks along −z of its own frame, +x to the right and +y up in the picture (the house's convention of
cameras). A direction at the angle θ from the axis lies at the distance r(θ) = R · ρ(θ) / ρ(θ_max) from the
circle's centre, where R is the circle's radius in pixels and 2 θ_max the field of view.
"""

from __future__ import annotations

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


def project(lens: Lens, circle: Circle, directions: npt.NDArray[Any]) -> tuple[F64, npt.NDArray[np.bool_]]:
    """Points (..., 2) of directions (..., 3) of any length, and which of them the lens sees."""
    d = np.asarray(directions, np.float64)
    ring = np.hypot(d[..., 0], d[..., 1])
    theta = np.arctan2(ring, -d[..., 2])
    reach = circle.radius * lens.radius_of(theta)
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = np.where(ring > 0, reach / ring, 0.0)
    right, down = d[..., 0] * scale, -d[..., 1] * scale
    c, across, e = lens.affine
    points = np.stack([e * down + right + circle.x, c * down + across * right + circle.y], axis=-1)
    return points, theta <= lens.half


def unproject(lens: Lens, circle: Circle, points: npt.NDArray[Any]) -> tuple[F64, npt.NDArray[np.bool_]]:
    """Unit directions (..., 3) of points (..., 2), and which of them lie in the lens' field of view."""
    p = np.asarray(points, np.float64)
    x, y = p[..., 0] - circle.x, p[..., 1] - circle.y
    c, across, e = lens.affine
    determinant = c - across * e
    right, down = (c * x - e * y) / determinant, (y - across * x) / determinant
    reach = np.hypot(right, down)
    theta = lens.angle_of(reach / circle.radius)
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = np.where(reach > 0, np.sin(theta) / reach, 0.0)
    directions = np.stack([right * scale, -down * scale, -np.cos(theta)], axis=-1)
    return directions, theta <= lens.half


def pixel_points(height: int, width: int) -> F64:
    """(height, width, 2): the centres of all pixels."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([x, y], axis=-1)
