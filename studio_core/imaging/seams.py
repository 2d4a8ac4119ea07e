"""Where one picture may pass into another unseen: minimum cuts through their difference.

Kwatra, Schödl, Essa, Turk, Bobick, "Graphcut Textures: Image and Video Synthesis Using Graph Cuts", 2003: two
pictures A and B lie above each other; every pixel takes the one or the other, and a seam between neighbours p
and q costs |A(p) − B(p)| + |A(q) − B(q)|. The cheapest seams are a minimum cut.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
Bools = npt.NDArray[np.bool_]
I32 = npt.NDArray[np.int32]

FINEST = 1000.0
"""Integer steps of the mean cost of a pair: capacities are whole numbers."""
_ENOUGH = 1 << 24


@dataclass
class Cutter:
    """Minimum cuts through squares of `side` pixels; the graph's edges are laid out once."""

    side: int
    _edges: tuple[I32, I32] = field(init=False)
    _pixels: I32 = field(init=False)

    def __post_init__(self) -> None:
        at = np.arange(self.side * self.side, dtype=np.int32).reshape(self.side, self.side)
        beside = np.stack([at[:, :-1].ravel(), at[:, 1:].ravel()])
        below = np.stack([at[:-1].ravel(), at[1:].ravel()])
        self._edges = tuple(np.concatenate([beside, below], axis=1))
        self._pixels = at.ravel()

    def __call__(self, difference: F32, kept: Bools, taken: Bools) -> Bools:
        """(S, S) true where the new picture is taken.

        difference (S, S) is how far the two are apart, kept and taken (S, S) where the old or the new one
        has to be. Where nothing must be kept, all is taken.
        """
        from scipy.sparse import csr_matrix
        from scipy.sparse.csgraph import breadth_first_order, maximum_flow

        if not kept.any():
            return np.ones_like(taken)
        if not taken.any():
            return np.zeros_like(taken)
        one, other = self._edges
        flat = difference.ravel().astype(np.float64)
        costs = flat[one] + flat[other]
        costs *= FINEST / max(float(costs.mean()), 1e-30)
        capacity = (np.minimum(costs, _ENOUGH / 8) + 1).astype(np.int32)
        count = self.side * self.side
        old, new = self._pixels[kept.ravel()], self._pixels[taken.ravel()]
        start = np.concatenate([one, other, np.full(len(old), count, np.int32), new])
        stop = np.concatenate([other, one, old, np.full(len(new), count + 1, np.int32)])
        ends = np.full(len(old) + len(new), _ENOUGH, np.int32)
        values = np.concatenate([capacity, capacity, ends])
        graph = csr_matrix((values, (start, stop)), shape=(count + 2, count + 2))
        left = graph - maximum_flow(graph, count, count + 1).flow
        left.eliminate_zeros()
        reached = breadth_first_order(left, count, return_predecessors=False)
        made = np.ones(count + 2, np.bool_)
        made[reached] = False
        return np.asarray(made[:count].reshape(self.side, self.side))


__all__ = ["Cutter"]
