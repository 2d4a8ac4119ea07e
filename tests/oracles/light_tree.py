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


def vector(pixels: F64, steps: int = 16) -> F64:
    """∫ L ω dω (3 channels, 3 axes) of the bilinear map, by the midpoints of a grid `steps` times as fine."""
    height, width = pixels.shape[:2]
    down, across = _between(height, steps, wrap=False), _between(width, steps, wrap=True)
    fine = np.einsum("ih,hwc,jw->ijc", down, pixels, across, optimize=True)
    theta = np.pi * (np.arange(height * steps) + 0.5) / (height * steps)
    phi = 2 * np.pi * (0.5 - (np.arange(width * steps) + 0.5) / (width * steps))
    cell = 2 * np.sin(theta) * math.sin(math.pi / (2 * height * steps)) * 2 * np.pi / (width * steps)
    sine, cosine = np.meshgrid(np.sin(theta), phi * 0 + 1, indexing="ij")[0], np.cos(theta)[:, None]
    towards = np.stack([sine * np.sin(phi), cosine + 0 * phi, sine * np.cos(phi)], axis=2)
    return np.einsum("ijc,i,ija->ca", fine, cell, towards)


def _between(count: int, steps: int, wrap: bool) -> F64:
    """(count · steps, count): how places along an axis are interpolated from its pixel centres."""
    made = np.zeros((count * steps, count))
    for i in range(count * steps):
        at = (i + 0.5) / steps - 0.5
        first = math.floor(at)
        for step, weight in ((0, 1 - (at - first)), (1, at - first)):
            pixel = (first + step) % count if wrap else min(max(first + step, 0), count - 1)
            made[i, pixel] += weight
    return made
