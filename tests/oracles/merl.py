"""The MERL database's own way from directions to a place in its file, line by line in plain Python.

After the code that comes with the database (Matusik et al. 2003): spherical angles, two rotations, truncated
indices.
"""

from __future__ import annotations

import math

import numpy as np

Vector = tuple[float, float, float]


def rotated(v: Vector, axis: Vector, angle: float) -> Vector:
    """`v` turned about a unit axis (Rodrigues)."""
    turned = (
        np.multiply(v, math.cos(angle))
        + np.multiply(axis, np.dot(axis, v) * (1 - math.cos(angle)))
        + np.cross(axis, v) * math.sin(angle)
    )
    return float(turned[0]), float(turned[1]), float(turned[2])


def half_difference(wi: Vector, wo: Vector) -> tuple[float, float, float]:
    """θ_h, θ_d and φ_d (−π…π)."""
    h = np.add(wi, wo) / np.linalg.norm(np.add(wi, wo))
    theta_h, phi_h = math.acos(min(h[2], 1.0)), math.atan2(h[1], h[0])
    d = rotated(rotated(wi, (0, 0, 1), -phi_h), (0, 1, 0), -theta_h)
    return theta_h, math.acos(min(d[2], 1.0)), math.atan2(d[1], d[0])


def index(wi: Vector, wo: Vector) -> int:
    """Place of the pair's value in the block of one channel."""
    theta_h, theta_d, phi_d = half_difference(wi, wo)
    if phi_d < 0:
        phi_d += math.pi
    k = min(max(int(phi_d / math.pi * 180), 0), 179)
    j = min(max(int(theta_d / (math.pi * 0.5) * 90), 0), 89)
    i = 0 if theta_h <= 0 else min(max(int(math.sqrt(theta_h / (math.pi / 2) * 90 * 90)), 0), 89)
    return k + j * 180 + i * 180 * 90
