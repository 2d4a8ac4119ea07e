"""Fisheye lenses point by point, with the trigonometry that the models are defined by."""

from __future__ import annotations

import math


def radius(model: str, theta: float, half: float, k: tuple[float, ...] = ()) -> float:
    """r / R at the angle `theta` of a lens that sees `half` to each side."""

    def rho(angle: float) -> float:
        if model == "equidistant":
            return angle
        if model == "equisolid":
            return 2 * math.sin(angle / 2)
        if model == "stereographic":
            return 2 * math.tan(angle / 2)
        if model == "orthographic":
            return math.sin(angle)
        return angle + sum(term * angle ** (3 + 2 * i) for i, term in enumerate(k))

    return rho(theta) / rho(half)


def ocam_direction(
    row: float,
    column: float,
    polynomial: list[float],
    centre: tuple[float, float],
    affine: tuple[float, float, float],
) -> tuple[float, float, float]:
    """OCamCalib's `cam2world`, in the toolbox' own frame: x down, y right, z towards the photographer."""
    c, d, e = affine
    down, right = row - centre[0], column - centre[1]
    x = (down - d * right) / (c - d * e)
    y = (-e * down + c * right) / (c - d * e)
    rho = math.hypot(x, y)
    z = sum(a * rho**i for i, a in enumerate(polynomial))
    norm = math.sqrt(x * x + y * y + z * z)
    return x / norm, y / norm, z / norm


def ocam_pixel(
    direction: tuple[float, float, float],
    inverse: list[float],
    centre: tuple[float, float],
    affine: tuple[float, float, float],
) -> tuple[float, float]:
    """OCamCalib's `world2cam`: row and column by the file's polynomial for the way back."""
    c, d, e = affine
    x, y, z = direction
    norm = math.hypot(x, y)
    theta = math.atan2(z, norm)
    rho = sum(a * theta**i for i, a in enumerate(inverse))
    x, y = x / norm * rho, y / norm * rho
    return c * x + d * y + centre[0], e * x + y + centre[1]
