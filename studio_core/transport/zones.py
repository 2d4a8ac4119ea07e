"""Zones of a scene: where vertices are and which way they face, for what differs between them.

The sky that a floor by the window sees is another than that of the wall across the room.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]

ACROSS = (2, 2, 2)
"""Parts of the scene along x, y and z."""
FACINGS = 6
"""Left, right, down, up, back, front."""
ZONES = FACINGS * ACROSS[0] * ACROSS[1] * ACROSS[2]
ANY = 0.01
"""What a point of any zone counts for each; one in the middle of a zone counts 1."""


@dataclass(frozen=True, eq=False)
class Zones:
    """Parts along each axis, in the world: where they meet, their middles, how far they reach."""

    bounds: tuple[F64, F64, F64]
    middle: tuple[F64, F64, F64]
    reach: tuple[F64, F64, F64]

    @staticmethod
    def about(points: F64) -> Zones:
        """Parts that hold equally many of the points (N, 3), with N > 0."""
        bounds, middle, reach = [], [], []
        for axis, parts in enumerate(ACROSS):
            edges = np.quantile(points[:, axis], np.arange(parts + 1) / parts)
            bounds.append(edges[1:-1])
            middle.append(np.quantile(points[:, axis], (np.arange(parts) + 0.5) / parts))
            reach.append(np.maximum(np.diff(edges) / 2, 1e-3 + 0.1 * (edges[-1] - edges[0])))
        return Zones(
            (bounds[0], bounds[1], bounds[2]),
            (middle[0], middle[1], middle[2]),
            (reach[0], reach[1], reach[2]),
        )

    def of(self, origin: F64, positions: F32, normals: F32) -> I32:
        """(V,) the zone of each point."""
        axis = np.abs(normals).argmax(axis=1)
        found = 2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] > 0)
        for axis, parts in enumerate(ACROSS):
            edges = (self.bounds[axis] - origin[axis]).astype(np.float32)
            found = found * parts + (positions[:, axis, None] > edges).sum(axis=1)
        return np.asarray(found, np.int32)

    def shares(self, positions: F64, normals: F32) -> F64:
        """(ZONES, N) how much each point, in the world, counts for each zone."""
        sides = np.stack([-normals, normals], axis=2).reshape(len(normals), FACINGS)
        made = np.maximum(sides, 0).astype(np.float64).T ** 2
        for axis in range(3):
            away = (positions[:, axis] - self.middle[axis][:, None]) / self.reach[axis][:, None]
            near = np.exp(-0.5 * away**2)
            made = (made[:, None] * near).reshape(-1, len(positions))
        return np.asarray(made + ANY)
