"""Plain checks of triangle meshes: who shares an edge, what volume is enclosed."""

from __future__ import annotations

from collections import Counter

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def uses_of_edges(positions: Array, faces: npt.NDArray[np.int64]) -> set[int]:
    """How many faces meet at an edge, vertices at the same place being one; {2} for a closed surface."""
    _, point = np.unique(np.round(positions, 7), axis=0, return_inverse=True)
    corners = point.ravel()[faces]
    pairs = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    return set(Counter(map(tuple, pairs.tolist())).values())


def volume(positions: Array, faces: npt.NDArray[np.int64]) -> float:
    """Enclosed volume by the divergence theorem; positive where faces look outwards."""
    a, b, c = (positions[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
