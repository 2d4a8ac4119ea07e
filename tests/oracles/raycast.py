"""Every ray against every triangle in float64: Möller and Trumbore 1997, looped over triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]


class Nearest(NamedTuple):
    """First hits of N rays; object and face −1 and t inf where nothing is hit."""

    t: F64
    object: npt.NDArray[np.int64]
    face: npt.NDArray[np.int64]
    u: F64
    v: F64
    normal: F64
    margin: F64
    """How far in barycentrics the ray passes the nearest edge of any triangle it comes near."""


def nearest(
    objects: list[tuple[F64, npt.NDArray[np.integer], F64]],
    origins: F64,
    directions: F64,
    tnear: float = 0.0,
    tfar: float = np.inf,
) -> Nearest:
    """Objects are (positions, faces, 4×4 transform)."""
    n = len(origins)
    t = np.full(n, np.inf)
    which, face = np.full(n, -1), np.full(n, -1)
    us, vs, normals = np.zeros(n), np.zeros(n), np.zeros((n, 3))
    margin = np.full(n, np.inf)
    for number, (positions, faces, transform) in enumerate(objects):
        placed = np.asarray(positions, np.float64) @ transform[:3, :3].T + transform[:3, 3]
        turn = np.sign(np.linalg.det(transform[:3, :3]))
        for index, corners in enumerate(faces):
            a, b, c = placed[corners]
            e1, e2 = b - a, c - a
            normal = np.cross(e1, e2)
            size = np.linalg.norm(normal)
            if size == 0:
                continue
            p = np.cross(directions, e2)
            det = p @ e1
            with np.errstate(divide="ignore", invalid="ignore"):
                s = origins - a
                u = np.einsum("ij,ij->i", s, p) / det
                q = np.cross(s, e1)
                v = np.einsum("ij,ij->i", directions, q) / det
                distance = (q @ e2) / det
                edge = np.minimum(np.minimum(u, v), 1 - u - v)
                margin = np.fmin(margin, np.abs(edge))
                hit = (edge >= 0) & (distance >= tnear) & (distance <= tfar) & (distance < t) & (det != 0)
            t[hit], which[hit], face[hit] = distance[hit], number, index
            us[hit], vs[hit], normals[hit] = u[hit], v[hit], turn * normal / size
    return Nearest(t, which, face, us, vs, normals, margin)
