"""What receivers' rays met: the vertex, the way it is seen from, the distance; and sums over that."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
F16 = npt.NDArray[np.float16]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]

NOTHING = 0xFFFFFFFF
"""A ray that leaves the scene."""
BLACK = 0xFFFFFFFE
"""A ray that meets the inside of a closed part, which has no vertices."""
GONE = 0xFFFFFFFD
"""Between updates: a ray that met what is there no more."""
NO_OBJECT = 0xFFFF
_SMALLER, _LARGER = np.float32(2.0**-112), np.float32(2.0**112)
_INFINITE = 0x7C00


@dataclass(frozen=True, eq=False)
class HitTable:
    """First hits of N rays of each of R receivers.

    vertex (R, N) uint32: a shading vertex of the side that is seen, NOTHING or BLACK; cell (R, N) uint16: the
    cell (see `transport.cells`) of the direction back to the receiver in that vertex' own frame, of a BLACK
    ray the object that was met; distance (R, N) float16 metres, inf where nothing is met.

    The vertex is one of the three corners of the face that is hit, chosen by chance as often as its
    barycentric weight says: a mean over rays interpolates between vertices, without bias.
    """

    vertex: U32
    cell: U16
    distance: F16

    @staticmethod
    def empty(rows: int, rays: int) -> HitTable:
        """Of rays that meet nothing."""
        return HitTable(
            np.full((rows, rays), NOTHING, np.uint32),
            np.zeros((rows, rays), np.uint16),
            np.full((rows, rays), np.inf, np.float16),
        )

    def __len__(self) -> int:
        return len(self.vertex)

    def __getitem__(self, rows: slice | npt.NDArray[np.int64]) -> HitTable:
        return HitTable(self.vertex[rows], self.cell[rows], self.distance[rows])

    @property
    def arrays(self) -> tuple[npt.NDArray[Any], ...]:
        """All three."""
        return self.vertex, self.cell, self.distance

    @property
    def rays(self) -> int:
        """N."""
        return int(self.vertex.shape[1])

    @property
    def nbytes(self) -> int:
        """Bytes of the arrays."""
        return sum(int(array.nbytes) for array in self.arrays)


@kernel
def half_bits(value: np.float32, word: U32, number: F32) -> np.int64:
    """The float16 next to a number ≥ 0, as bits; `word` (1,) is scratch, and `number` the same as a float."""
    if not value < 65520.0:
        return np.int64(_INFINITE)
    number[0] = value * _SMALLER
    whole = np.int64(word[0])
    return np.int64((whole + 0xFFF + ((whole >> 13) & 1)) >> 13)


@kernel
def half_value(bits: int, word: U32, number: F32) -> np.float32:
    """The number ≥ 0 that float16 bits mean; scratch as in `half_bits`."""
    if bits >= _INFINITE:
        return np.float32(np.inf)
    word[0] = np.uint32(bits << 13)
    return np.float32(number[0] * _LARGER)


@kernel
def gather_matte(
    start: int, stop: int, rows: npt.NDArray[np.int64], vertex: U32, radiance: F32, out: F32
) -> None:
    """out[rows[start:stop]] (R, 3): the mean over each row's rays of radiance (V, 3); no light is 0.

    What rays of a cosine pattern see, so times π the irradiance.
    """
    rays = vertex.shape[1]
    limit = len(radiance)
    for item in range(start, stop):
        row = rows[item]
        red, green, blue = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for ray in range(rays):
            v = np.int64(vertex[row, ray])
            if v < limit:
                red += radiance[v, 0]
                green += radiance[v, 1]
                blue += radiance[v, 2]
        out[row, 0], out[row, 1], out[row, 2] = red / rays, green / rays, blue / rays


__all__ = ["BLACK", "GONE", "NOTHING", "NO_OBJECT", "HitTable", "gather_matte", "half_bits", "half_value"]
