"""A half-difference table from samples at any directions.

Highlights stay where they are over half and difference angles, so that interpolation between few angles of
incidence doubles no highlight, as it does over the angles themselves. Every cell is the value at its place
of a plane through the logarithms of its nearest samples (weighted local linear regression with a little
ridge), kept within what these samples have.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.half_difference import centres, to_angles
from studio_core.brdfs.samples import Samples
from studio_core.scene.geometry import Table

F64 = npt.NDArray[np.float64]

SHAPE = (90, 30, 24)
NEIGHBOURS = 16
RIDGE = 1e-3
AROUND = 0.3
_CHUNK = 20_000


def table_of(samples: Samples, name: str = "", shape: tuple[int, int, int] = SHAPE) -> Table:
    """(*shape, 3) of samples (N ≥ 2); where there are none near, the nearest ones are taken."""
    from scipy.spatial import cKDTree

    angles = to_angles(samples.wi.astype(np.float64), samples.wo.astype(np.float64))
    places = _places(*angles)
    floor = 1e-3 * float(np.median(samples.values.mean(axis=1))) + 1e-9
    logs = np.log(samples.values + floor)
    theta_h, theta_d, phi_d = np.meshgrid(*centres(shape), indexing="ij")
    cells = _places(theta_h.ravel(), theta_d.ravel(), phi_d.ravel())
    count = min(NEIGHBOURS, len(places))
    tree = cKDTree(places)
    made = np.empty((len(cells), 3), np.float32)
    for start in range(0, len(cells), _CHUNK):
        some = cells[start : start + _CHUNK]
        distance, index = tree.query(some, count)
        found = _planes(some, places[index], logs[index], distance)
        made[start : start + _CHUNK] = np.maximum(np.exp(found) - floor, 0)
    return Table(made.reshape(*shape, 3), name)


def _places(theta_h: F64, theta_d: F64, phi_d: F64) -> F64:
    """(N, 4) √θ_h, θ_d, and φ_d on a circle that is a point where it says nothing."""
    half, difference = np.sqrt(theta_h / (np.pi / 2)), theta_d / (np.pi / 2)
    radius = AROUND * half * np.sin(theta_d)
    return np.stack([half, difference, radius * np.cos(2 * phi_d), radius * np.sin(2 * phi_d)], axis=-1)


def _planes(at: F64, places: F64, logs: F64, distance: F64) -> F64:
    """(M, 3) logarithms at (M, 4) from K neighbours each."""
    reach = distance[:, -1:] * 1.001 + 1e-12
    weight = (1 - (distance / reach) ** 2) ** 2 / (distance**2 + (0.05 * reach) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    offsets = (places - at[:, None]) / reach[:, :, None]
    rows = np.concatenate([np.ones((*offsets.shape[:2], 1)), offsets], axis=2)
    weighted = rows * weight[:, :, None]
    normal = np.einsum("mki,mkj->mij", weighted, rows)
    normal[:, range(1, 5), range(1, 5)] += RIDGE
    right = np.einsum("mki,mkc->mic", weighted, logs)
    found = np.linalg.solve(normal, right)[:, 0]
    return np.asarray(np.clip(found, logs.min(axis=1), logs.max(axis=1)))
