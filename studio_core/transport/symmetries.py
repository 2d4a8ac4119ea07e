"""Which cells a kernel's symmetries make alike: what has to be evaluated, and blocks that come apart by sign.

A kernel that stays as it is when both directions are mirrored, or turned by half a turn, is known from some
cells of one direction, the representatives. In functions that are even or odd under each symmetry it falls
into blocks of as many rows as there are representatives.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.transport.cells import PARTS, RINGS

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

HALF = PARTS // 2


@dataclass(frozen=True, eq=False)
class Symmetry:
    """images (G, N): where each symmetry takes the representatives' cells; the first leaves them.

    signs[p, g] (G, G) is what symmetry g does to functions of kind p; those of kind 0 are even under all.
    """

    images: I64
    signs: F64

    @property
    def parts(self) -> range:
        """Of the representatives in each ring, from the first, which may be below 0."""
        count = self.images.shape[1] // RINGS
        first = int(self.images[0, 0])
        return range(
            first - PARTS if first > HALF else first, (first - PARTS if first > HALF else first) + count
        )


@functools.cache
def symmetry(across: bool, along: bool, turned: bool) -> Symmetry:
    """Of kernels that may be mirrored in x (`across`), in y (`along`), or `turned` by half a turn."""
    if across and along:
        parts = np.arange(PARTS // 4)
        moved = [parts, HALF - 1 - parts, PARTS - 1 - parts, parts + HALF]
        signs = [[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1], [1, -1, -1, 1]]
    elif across or along or turned:
        parts = np.arange(-PARTS // 4, PARTS // 4) if across else np.arange(HALF)
        moved = [parts, HALF - 1 - parts if across else PARTS - 1 - parts if along else parts + HALF]
        signs = [[1, 1], [1, -1]]
    else:
        moved, signs = [np.arange(PARTS)], [[1]]
    rings = np.arange(RINGS)[:, None] * PARTS
    images = np.stack([(rings + one % PARTS).ravel() for one in moved]).astype(np.int64)
    return Symmetry(images, np.array(signs, np.float64))


__all__ = ["Symmetry", "symmetry"]
