"""Seamless cloning by definition (Pérez et al. 2003, equation 7): a sparse linear system, solved directly."""

from __future__ import annotations

import numpy as np
from scipy.sparse import lil_matrix
from scipy.sparse.linalg import spsolve


def clone(target, source, mask, wrap=False):
    """(H, W, C) float64. For each masked pixel p and its neighbours q in the picture:
    Σ (f_p − f_q) = Σ (g_p − g_q), f_q known where q is not masked."""
    height, width, channels = target.shape
    made = np.array(target, np.float64)
    source = np.asarray(source, np.float64)
    places = [tuple(place) for place in np.argwhere(mask)]
    number = {place: i for i, place in enumerate(places)}
    matrix, right = lil_matrix((len(places), len(places))), np.zeros((len(places), channels))
    for i, (y, x) in enumerate(places):
        for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):
            q = (y + dy, (x + dx) % width if wrap else x + dx)
            if not (0 <= q[0] < height and 0 <= q[1] < width):
                continue
            matrix[i, i] += 1
            right[i] += source[y, x] - source[q]
            if q in number:
                matrix[i, number[q]] -= 1
            else:
                right[i] += made[q]
    solved = spsolve(matrix.tocsc(), right)
    made[mask] = np.asarray(solved).reshape(len(places), channels)
    return made
