"""An order of points in which rays go alike: who faces the same way, neighbours after each other."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.scene.tessellate import morton_codes

F32 = npt.NDArray[np.float32]


def coherent(positions: F32, normals: F32) -> npt.NDArray[np.int64]:
    """(P,) an order of points (P, 3) with normals (P, 3)."""
    if not len(positions):
        return np.zeros(0, np.int64)
    axis = np.abs(normals).argmax(axis=1)
    facing = 2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] < 0)
    return np.lexsort((morton_codes(positions.astype(np.float64)), facing))
