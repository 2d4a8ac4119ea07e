"""The arithmetic of `carrying`: ratios, how much of them goes over, and what is multiplied with them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

LEAST, MOST = 0.1, 2.0
"""Of q."""


def alike(one: F32, other: F32) -> F32:
    """The smaller of each two, neither negative, by the larger; 0 where both are 0."""
    made, larger = np.zeros_like(one), np.maximum(one, other)
    np.divide(np.minimum(one, other), larger, out=made, where=larger > 0)
    return made


def share_of(likeness: F32, level: F32) -> F32:
    """w (C,) of ρ and s (C,), ρ below 0 counting as 0; see `carrying`."""
    square = np.maximum(likeness, 0) ** 2
    made = square * level
    rest = level + (1 - square) * (1 - level)
    np.divide(made, rest, out=made, where=rest > 0)
    return made


@kernel
def multiply(vertices: I64, place: I32, share: F32, ratio: F32, sums: F32) -> None:
    """sums (V, T, 3) of vertices (C,) times 1 + share (ratio[place] − 1), of ratio (B, T, 3)."""
    for i in range(len(vertices)):
        if share[i] > 0:
            for t in range(sums.shape[1]):
                for c in range(3):
                    sums[vertices[i], t, c] *= np.float32(1) + share[i] * (
                        ratio[place[i], t, c] - np.float32(1)
                    )


def ratio_of(fine: F32, rough: F32) -> F32:
    """fine / rough, LEAST to MOST; 1 where the first tier found nothing."""
    made = np.ones_like(fine)
    with np.errstate(over="ignore"):
        np.divide(fine, rough, out=made, where=rough != 0)
    return np.clip(made, LEAST, MOST).astype(np.float32)
