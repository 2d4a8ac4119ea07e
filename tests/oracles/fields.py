"""Slow and obvious: light from vertex to vertex of two meshes that see all of each other; least squares."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]


def exchanged(mesh, sources, receivers, radiosity) -> F64:
    """Irradiance at receivers: Σ B cosθ cosθ' A / (π r²) over the sources, nothing in between.

    sources and receivers are slices of a world mesh, radiosity / π is the radiance of each source vertex.
    """
    place, normal = mesh.positions.astype(np.float64), mesh.normals.astype(np.float64)
    made = []
    for point, up in zip(place[receivers], normal[receivers], strict=True):
        way = place[sources] - point
        r2 = (way**2).sum(axis=1)
        cosine = np.maximum(way @ up, 0) * np.maximum(-(way * normal[sources]).sum(axis=1), 0)
        made.append((radiosity / np.pi * cosine / r2**2 * mesh.area[sources]).sum())
    return np.array(made)


def parallel_squares(side: float, gap: float) -> float:
    """Form factor of two equal squares that face each other (Howell's catalogue, C-11)."""
    x = side / gap
    s = 1 + x * x
    inner = np.log(np.sqrt(s * s / (1 + 2 * x * x))) + 2 * x * np.sqrt(s) * np.arctan(x / np.sqrt(s))
    return float(2 / (np.pi * x * x) * (inner - 2 * x * np.arctan(x)))


def least_squares(functions: F64, area: F64, values: F64) -> F64:
    """Weights of functions (V, N) for values (V, M), by area, by NumPy's own decomposition."""
    root = np.sqrt(area)[:, None]
    return np.linalg.lstsq(functions * root, values * root, rcond=None)[0]
