"""What all texels lack in common: a table over the angle of the half vector and the cosine of light.

A smooth surface of tents, one a channel, fitted to what the parametric model leaves: a matte part that is not
Lambert's, a highlight's skirt. Where no sample was, it fades to nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_plugins.residual.samples import F32

NODES = _HALF, _COSINE = 14, 10
WIDEST = np.radians(75.0)
"""θ_h of the last node."""
_SMOOTH, _FADE = 3e-3, 3e-5


@dataclass(frozen=True, eq=False)
class Table:
    """`nodes` (θ_h, n·l, 3): θ_h 0 … 75°, denser where it is small; n·l 0 … 1."""

    nodes: F32

    def at(self, cosine_half: F32, cosine_light: F32) -> F32:
        """(..., 3) what is to be added; 0 where light comes from behind."""
        at, weight = _tents(np.ravel(cosine_half), np.ravel(cosine_light))
        flat = self.nodes.reshape(-1, 3)
        made = sum(weight[k][:, None] * flat[at[k]] for k in range(4))
        lit = np.ravel(cosine_light) > 0
        return np.asarray(made * lit[:, None], np.float32).reshape(*np.shape(cosine_half), 3)


def fit_table(cosine_half: F32, cosine_light: F32, lacking: F32, weights: F32) -> Table:
    """The table that lacks least of (m, 3) under weights (m,)."""
    from scipy.sparse import coo_matrix, vstack
    from scipy.sparse.linalg import lsmr

    at, weight = _tents(cosine_half, cosine_light)
    count = len(cosine_half)
    root = np.sqrt(weights / max(float(weights.sum()), 1e-12))
    rows = np.tile(np.arange(count), 4)
    data = np.concatenate([weight[k] * root for k in range(4)])
    size = _HALF * _COSINE
    design = coo_matrix((data, (rows, np.concatenate(list(at)))), shape=(count, size))
    whole = vstack([design.tocsr(), _regular(size)]).tocsr()
    nodes = np.zeros((size, 3))
    for c in range(3):
        wanted = np.concatenate([lacking[:, c] * root, np.zeros(whole.shape[0] - count)])
        nodes[:, c] = lsmr(whole, wanted, atol=1e-8, btol=1e-8, maxiter=400)[0]
    return Table(nodes.reshape(_HALF, _COSINE, 3).astype(np.float32))


def _tents(cosine_half: npt.NDArray[Any], cosine_light: npt.NDArray[Any]) -> tuple[Any, Any]:
    theta = np.arccos(np.clip(cosine_half, -1, 1))
    x = np.sqrt(np.clip(theta / WIDEST, 0, 1)) * (_HALF - 1)
    y = np.clip(cosine_light, 0, 1) * (_COSINE - 1)
    i, j = np.minimum(x.astype(np.intp), _HALF - 2), np.minimum(y.astype(np.intp), _COSINE - 2)
    u, v = x - i, y - j
    at = [(i + a) * _COSINE + j + b for a in (0, 1) for b in (0, 1)]
    weight = [(u if a else 1 - u) * (v if b else 1 - v) for a in (0, 1) for b in (0, 1)]
    return at, weight


def _regular(size: int) -> Any:
    """Second differences both ways are small, and so is all."""
    from scipy.sparse import csr_matrix, identity, kron, vstack

    def bend(count: int) -> Any:
        made = np.zeros((count - 2, count))
        for k in range(count - 2):
            made[k, k : k + 3] = 1, -2, 1
        return csr_matrix(made)

    across = kron(bend(_HALF), identity(_COSINE)) * np.sqrt(_SMOOTH / size)
    along = kron(identity(_HALF), bend(_COSINE)) * np.sqrt(_SMOOTH / size)
    return vstack([across, along, identity(size) * np.sqrt(_FADE / size)])
