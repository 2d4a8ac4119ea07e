"""Level surfaces below a point and along a ray: every triangle by its plane and its three edges."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]


def height_below(triangles: F64, point: F64) -> float:
    """Height of the highest surface at most as steep as 45.6° straight below a point; -inf without one."""
    return float(point[1] - first_level(triangles, point, np.array([0.0, -1.0, 0.0])))


def first_level(triangles: F64, start: F64, towards: F64) -> float:
    """Distance along a ray to the first surface at most as steep as 45.6°, inf without one."""
    best = np.inf
    for a, b, c in triangles:
        normal = np.cross(b - a, c - a)
        length = np.linalg.norm(normal)
        if length == 0 or abs(normal[1]) / length <= 0.7:
            continue
        slope = normal @ towards
        if slope == 0:
            continue
        distance = normal @ (a - start) / slope
        point = start + distance * towards
        turns = [np.cross(q - p, point - p) @ normal for p, q in ((a, b), (b, c), (c, a))]
        if distance >= 0 and min(turns) >= 0 and distance < best:
            best = distance
    return float(best)
