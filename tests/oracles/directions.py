"""The concentric map of Shirley and Chiu 1997 on a hemisphere, in float64, one direction at a time."""

from __future__ import annotations

import math


def direction(leaf: int, k: int, s: float = 0.5, t: float = 0.5) -> tuple[float, float, float]:
    """The point (s, t) of a leaf's cell: halve the square bit by bit, then map it."""
    lower = leaf >> (k - 1)
    left, right, bottom, top = 0.0, 1.0, 0.0, 1.0
    for step, bit in enumerate(reversed(range(k - 1))):
        upper = (leaf >> bit) & 1
        if step % 2 == 0:
            middle = (left + right) / 2
            left, right = (middle, right) if upper else (left, middle)
        else:
            middle = (bottom + top) / 2
            bottom, top = (middle, top) if upper else (bottom, middle)
    return on_hemisphere(lower, left + s * (right - left), bottom + t * (top - bottom))


def on_hemisphere(lower: int, s: float, t: float) -> tuple[float, float, float]:
    """The four triangles of the square, as the paper draws them, then y = 1 − r²."""
    a, b = 2 * s - 1, 2 * t - 1
    if a == 0 and b == 0:
        radius, angle = 0.0, 0.0
    elif a > -b and a > b:
        radius, angle = a, math.pi / 4 * (b / a)
    elif a > -b:
        radius, angle = b, math.pi / 4 * (2 - a / b)
    elif a < b:
        radius, angle = -a, math.pi / 4 * (4 + b / a)
    else:
        radius, angle = -b, math.pi / 4 * (6 - a / b)
    y = 1 - radius**2
    out = math.sqrt(max(0.0, 1 - y**2))
    return out * math.cos(angle), (-y if lower else y), out * math.sin(angle)
