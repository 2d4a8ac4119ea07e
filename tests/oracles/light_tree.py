"""The bilinear equirectangular environment in float64, looped: lookups and exact power."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from oracles import directions

F64 = npt.NDArray[np.float64]


def radiance(pixels: F64, direction: F64) -> F64:
    """Bilinear, wrapping in u, clamped in v, u = 0.5 − atan2(x, z)/2π, v = acos(y)/π."""
    height, width = pixels.shape[:2]
    x, y, z = direction / np.linalg.norm(direction)
    u = (0.5 - math.atan2(x, z) / (2 * math.pi)) * width - 0.5
    v = math.acos(max(-1.0, min(1.0, y))) / math.pi * height - 0.5
    column, row = math.floor(u), math.floor(v)
    total = np.zeros(3)
    for dx, wx in ((0, 1 - (u - column)), (1, u - column)):
        for dy, wy in ((0, 1 - (v - row)), (1, v - row)):
            total += wx * wy * pixels[min(max(row + dy, 0), height - 1), (column + dx) % width]
    return total


def mean_over_leaf(pixels: F64, rotation: F64, leaf: int, k: int, points: int) -> F64:
    """Mean over points × points equal-area places of a leaf's cell."""
    total = np.zeros(3)
    for i in range(points):
        for j in range(points):
            at = directions.direction(leaf, k, (i + 0.5) / points, (j + 0.5) / points)
            total += radiance(pixels, rotation.T @ np.array(at))
    return total / points**2


def power(pixels: F64) -> F64:
    """∫ L dω of the bilinear map: each row's tent in v integrated against sin θ by fine quadrature."""
    height, width = pixels.shape[:2]
    steps = 64
    weights = np.zeros(height)
    for i in range(height * steps):
        v = (i + 0.5) / steps - 0.5
        row = math.floor(v)
        ring = math.cos(math.pi * i / (height * steps)) - math.cos(math.pi * (i + 1) / (height * steps))
        weights[min(max(row, 0), height - 1)] += (1 - (v - row)) * ring
        weights[min(max(row + 1, 0), height - 1)] += (v - row) * ring
    return np.einsum("hwc,h->c", pixels, weights) * 2 * math.pi / width
