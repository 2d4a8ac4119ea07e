"""Refined vertices while something moves: what they get from the vertices they lie between.

Where their irradiance is known it is theirs, so that shadows keep their edges while the eye moves; only how
much of it goes to the eye is taken from the neighbours. Elsewhere both are, and the picture is for so long
that of the unrefined mesh.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

_DARK = np.float32(1e-12)


def fill(between: I64, summed: Bools, wanted: Bools, settled: Bools, terms: F32, irradiance: F32) -> None:
    """Sets terms (V, T, 3) and, but for the settled, irradiance (V, 3) of wanted vertices.

    `between` (V, 2) are vertices of lower number, twice itself where refinement did not make the vertex: each
    is `summed`, and gives its own, or lies between others that are, wanted or not.
    """
    count = len(terms)
    share = np.empty((count, terms[0].size if count else 0), np.float32)
    level, needed = np.empty_like(irradiance), wanted.copy()
    flat = terms.reshape(count, -1)
    _fill(between, summed, wanted, settled & wanted, needed, flat, irradiance, share, level)


@kernel
def _fill(
    between: I64,
    summed: Bools,
    wanted: Bools,
    settled: Bools,
    needed: Bools,
    terms: F32,
    irradiance: F32,
    share: F32,
    level: F32,
) -> None:
    half = np.float32(0.5)
    for i in range(len(between) - 1, -1, -1):
        if needed[i] and not summed[i]:
            needed[between[i, 0]] = True
            needed[between[i, 1]] = True
    for i in range(len(between)):
        if summed[i]:
            for c in range(3):
                level[i, c] = irradiance[i, c]
            for c in range(terms.shape[1]):
                share[i, c] = terms[i, c] / max(irradiance[i, c % 3], _DARK)
        elif needed[i]:
            one, other = between[i, 0], between[i, 1]
            for c in range(3):
                level[i, c] = irradiance[i, c] if settled[i] else half * (level[one, c] + level[other, c])
            for c in range(terms.shape[1]):
                share[i, c] = half * (share[one, c] + share[other, c])
            if wanted[i]:  # what others only lie between keeps what it has
                for c in range(3):
                    irradiance[i, c] = level[i, c]
                for c in range(terms.shape[1]):
                    terms[i, c] = share[i, c] * level[i, c % 3]
