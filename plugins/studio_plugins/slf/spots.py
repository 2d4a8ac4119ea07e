"""Places on surfaces with all that tells whether they are alike: where, which way they face, how they look.

A part is one slot of one object. Looks of different reflectance models say nothing of each other.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from studio_core.scene.nodes import NodeId
from studio_core.scene.transform import rotation_matrix
from studio_core.scene.world_mesh import WorldMesh
from studio_core.strokes.marks import Marks
from studio_plugins.slf.looks import Looks

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
SLOTS = 1 << 16
NEAR = 8  # vertices among which a mark looks for its own


@dataclass(frozen=True, eq=False)
class Spots:
    """N places: place (N, 3) in the world less the mesh's origin, normal (N, 3) unit, look (N, K) as in
    `looks`; part (N,) = object · SLOTS + slot, and model (N,), −1 for what has no material.
    """

    place: F32
    normal: F32
    look: F32
    part: I64
    model: I32

    def __len__(self) -> int:
        return len(self.part)

    def some(self, which: npt.NDArray[np.generic]) -> Spots:
        """These of them."""
        return Spots(*(getattr(self, field.name)[which] for field in dataclasses.fields(self)))

    @staticmethod
    def of_mesh(mesh: WorldMesh, looks: Looks) -> Spots:
        """All vertices, whose looks are given."""
        slots = [placed.mesh.slot for placed in mesh.objects]
        slot = np.concatenate([*slots, np.zeros(0, np.uint16)]).astype(np.int64)
        part = mesh.object.astype(np.int64) * SLOTS + slot
        return Spots(mesh.positions, mesh.normals, looks.values, part, looks.model)

    @staticmethod
    def of_marks(marks: Marks, objects: tuple[NodeId, ...], mesh: WorldMesh, vertices: Spots) -> Spots:
        """Of a stroke's marks where their objects stand now, looking as the nearest vertices of the part that
        face alike. Marks on objects or slots that the mesh has not are left out.
        """
        number = {placed.node: index for index, placed in enumerate(mesh.objects)}
        parts: list[Spots] = []
        for counted, node in enumerate(objects):
            if node not in number:
                continue
            index = number[node]
            placed = mesh.objects[index].transform
            turn = rotation_matrix(placed.rotation).T
            shift = np.array(placed.translation) - mesh.origin
            own = vertices.some(np.arange(mesh.vertex_offsets[index], mesh.vertex_offsets[index + 1]))
            for slot in np.unique(marks.slot[marks.object == counted]).tolist():
                here = marks.some((marks.object == counted) & (marks.slot == slot))
                place = placed.scale * (here.place.astype(np.float64) @ turn) + shift
                normal = here.normal.astype(np.float64) @ turn
                part = own.some(own.part == index * SLOTS + slot)
                if len(part):
                    parts.append(_looking_as(part, place, normal))
        if not parts:
            return vertices.some(np.zeros(0, np.int64))
        rows = [[getattr(part, field.name) for part in parts] for field in dataclasses.fields(Spots)]
        return Spots(*(np.concatenate(row) for row in rows))


def _looking_as(part: Spots, place: npt.NDArray[np.float64], normal: npt.NDArray[np.float64]) -> Spots:
    """At places (N, 3), what the nearest of a part that faces alike is."""
    near = min(NEAR, len(part))
    distance, found = (one.reshape(len(place), near) for one in cKDTree(part.place).query(place, k=near))
    away = (part.normal[found] * normal[:, None]).sum(axis=2) <= 0
    best = np.argmin(np.where(away, np.inf, distance), axis=1)
    own = found[np.arange(len(place)), best]
    as_there = part.some(own)
    return dataclasses.replace(as_there, place=place.astype(np.float32), normal=normal.astype(np.float32))


__all__ = ["SLOTS", "Spots"]
