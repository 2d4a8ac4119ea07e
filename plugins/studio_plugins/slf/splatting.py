"""Radiance cache splatting: elements' pre-convolved light, brought to the vertices around them.

After Gautron et al. 2005 ("Radiance Cache Splatting"): an element gives what its lumitexel has for the
direction from a vertex to the eye to each vertex near it, weighted by distance and by how alike both face.
Lumitexels are used as they are made and not kept: pairs of vertex and element are in the elements' order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from studio_core.jit import kernel
from studio_core.scene.world_mesh import WorldMesh
from studio_core.transport.cells import PARTS, RINGS
from studio_plugins.slf.elements import ALIKE, Elements

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

NEAR = 4
"""Elements that give to a vertex."""
LOOKED_AT = 16
_PER_RADIAN = RINGS / (np.pi / 2)
_PER_TURN = PARTS / (2 * np.pi)


@dataclass(frozen=True, eq=False)
class Splats:
    """P pairs in the order of elements: vertex (P,) of a list, share (P,); start (E + 1,) of each element.

    Shares of a vertex sum to 1, or it has no pairs; elements nobody is near to have none either.
    """

    vertex: I64
    share: F64
    start: I64
    count: int

    @classmethod
    def of(
        cls,
        mesh: WorldMesh,
        elements: Elements,
        points: I64,
        rows: npt.NDArray[np.integer],
        inside: npt.NDArray[np.bool_],
    ) -> Splats:
        """For vertices `points` (N,) of the mesh whose elements these are; rows (V,) are their materials'.

        Only elements of the same object and row that face alike give, those `inside` (V,) closed parts to
        vertices that are so too; where there are none, the nearest of the object, if it is as much inside.
        """
        near = min(LOOKED_AT, len(elements))
        if not near or not len(points):
            return cls(np.zeros(0, np.int64), np.zeros(0), np.zeros(len(elements) + 1, np.int64), len(points))
        own = elements.vertex
        distance, found = cKDTree(mesh.positions[own]).query(mesh.positions[points], k=near)
        distance, found = distance.reshape(-1, near), found.reshape(-1, near)
        other = own[found]
        facing = np.einsum("nkc,nc->nk", mesh.normals[other], mesh.normals[points])
        may = (mesh.object[other] == mesh.object[points][:, None]) & (
            inside[other] == inside[points][:, None]
        )
        good = may & (facing > ALIKE) & (rows[other] == rows[points][:, None])
        lonely = ~good.any(axis=1)
        good[lonely] = may[lonely] & (np.cumsum(may[lonely], axis=1) == 1)
        order = np.argsort(np.where(good, distance, np.inf), axis=1, kind="stable")[:, : NEAR + 1]
        away, good, facing, found = (
            np.take_along_axis(one, order, axis=1) for one in (distance, good, facing, found)
        )
        reach = np.where(good, away, 0).max(axis=1, keepdims=True) * 1.001 + 1e-9
        weight = np.maximum(1 - away / reach, 1e-3) ** 2 * np.maximum(facing, 1e-2) ** 4
        share = np.where(good, weight, 0.0)
        share /= np.maximum(share.sum(axis=1, keepdims=True), 1e-300)
        vertex, slot = np.nonzero(share > 0)
        element = found[vertex, slot]
        by_element = np.argsort(element, kind="stable")
        start = np.searchsorted(element[by_element], np.arange(len(elements) + 1))
        return cls(vertex[by_element], share[vertex, slot][by_element], start.astype(np.int64), len(points))

    @property
    def used(self) -> npt.NDArray[np.bool_]:
        """(E,) elements that give to somebody."""
        return np.asarray(np.diff(self.start) > 0)

    def sums(self, values: F32) -> F32:
        """(N, …) weighted sums of values (P, …) over each vertex's pairs."""
        flat = values.reshape(len(values), -1)
        made = np.stack(
            [np.bincount(self.vertex, self.share * column, self.count) for column in flat.T], axis=1
        )
        return made.reshape(self.count, *values.shape[1:]).astype(np.float32)


def views(mesh: WorldMesh, points: I64, eye: F64) -> F32:
    """(N, 3) unit directions from vertices to the eye (3,), which is relative to the mesh's origin."""
    way = eye - mesh.positions[points]
    return np.asarray(way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-12), np.float32)


@kernel
def look_up(light: F32, frames: F32, element: I64, vertex: I64, views: F32, out: F32) -> None:
    """out (P, 3) of pairs of element and vertex: light (N, 3, RINGS, PARTS) of elements towards views (V, 3).

    Between the middles of cells, across the pole as well; frames (N, 3, 3).
    """
    for pair in range(len(element)):
        n, v = element[pair], vertex[pair]
        x, y, z = views[v, 0], views[v, 1], views[v, 2]
        a = frames[n, 0, 0] * x + frames[n, 0, 1] * y + frames[n, 0, 2] * z
        b = frames[n, 1, 0] * x + frames[n, 1, 1] * y + frames[n, 1, 2] * z
        c = frames[n, 2, 0] * x + frames[n, 2, 1] * y + frames[n, 2, 2] * z
        height = np.arctan2(np.sqrt(a * a + b * b), max(c, 0.0)) * _PER_RADIAN - 0.5
        turn = np.arctan2(b, a) * _PER_TURN - 0.5
        ring, part = int(np.floor(height)), int(np.floor(turn))
        up, along = height - ring, turn - part
        for colour in range(3):
            out[pair, colour] = 0.0
        for corner in range(4):
            i, j = ring + (corner >> 1), part + (corner & 1)
            weight = (up if corner >> 1 else 1.0 - up) * (along if corner & 1 else 1.0 - along)
            if i < 0:
                i, j = 0, j + PARTS // 2
            i, j = min(i, RINGS - 1), j % PARTS
            for colour in range(3):
                out[pair, colour] += weight * light[n, colour, i, j]


def blocks(used: npt.NDArray[np.bool_], size: int) -> Sequence[tuple[int, int]]:
    """Ranges of elements of at most `size`, without those in which nothing is used."""
    return [
        (start, min(start + size, len(used)))
        for start in range(0, len(used), size)
        if used[start : start + size].any()
    ]


__all__ = ["NEAR", "Splats", "blocks", "look_up", "views"]
