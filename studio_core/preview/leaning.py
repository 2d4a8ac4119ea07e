"""Normal maps on balls.

The eye and all light are far away: a pixel whose normal leans is lit as the one is whose own normal that is.
What has a grain has that of where it is taken from.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.preview.sphere import RIGHT, UP, VIEW, Disc, along_u, normals_of
from studio_core.scene.geometry import Texture
from studio_core.shading.normal_maps import turn

F32 = npt.NDArray[np.float32]

_RIM = 1.5  # pixels from the edge: further out nothing is known


def leaning(terms: F32, size: int, at: Disc, normals: F32, texture: Texture) -> F32:
    """(P, T, 3) terms of pixels whose normals lean as a picture says: normals (P, 3) in its frame.

    Normals that lean away from the eye are taken for those at the edge that are nearest to them.
    """
    own = normals_of(at)
    along = along_u(own)
    across = np.cross(own, along)
    p, q, r, s = turn(texture)
    x, y = p * normals[:, 0] + q * normals[:, 1], r * normals[:, 0] + s * normals[:, 1]
    leans = x[:, None] * along + y[:, None] * across + normals[:, 2:] * own
    flat = np.stack([leans @ RIGHT, leans @ UP], axis=1)
    distance, radius = np.linalg.norm(flat, axis=1), size / 2 - 0.5
    last = 1 - _RIM / radius
    wanted = np.where(leans @ VIEW > 0, np.minimum(distance, last), last)
    flat *= (wanted / np.maximum(distance, 1e-9))[:, None]
    grid = np.zeros((size, size, *terms.shape[1:]), np.float32)
    grid[at.rows, at.columns] = terms
    column, row = flat[:, 0] * radius + size / 2 - 0.5, size / 2 - 0.5 - flat[:, 1] * radius
    left, top = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    fx = (column - left).astype(np.float32)[:, None, None]
    fy = (row - top).astype(np.float32)[:, None, None]
    upper = grid[top, left] * (1 - fx) + grid[top, left + 1] * fx
    lower = grid[top + 1, left] * (1 - fx) + grid[top + 1, left + 1] * fx
    return np.asarray(upper * (1 - fy) + lower * fy, np.float32)


__all__ = ["leaning"]
