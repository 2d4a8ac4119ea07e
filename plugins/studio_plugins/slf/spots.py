"""Places on surfaces with all that tells whether they are alike: where, which way they face, how they look.

A part is one slot of one object. Looks of different reflectance models say nothing of each other.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from studio_core.scene.nodes import NodeId
from studio_core.scene.transform import Transform, rotation_matrix
from studio_core.scene.world_mesh import WorldMesh
from studio_core.strokes.marks import Marks
from studio_plugins.slf.looks import Looks

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
SLOTS = 1 << 16
NEAR = 8  # vertices among which a place looks for its own


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

    def moved(self, which: I64, mesh: WorldMesh, index: int, places: F32, normals: F32) -> Spots:
        """These of them (N,), at places (N, 3) and with normals (N, 3) in the frame of an object."""
        turn, scale, shift = frame_of(mesh.objects[index].transform, mesh.origin)
        place = (scale * (places.astype(np.float64) @ turn) + shift).astype(np.float32)
        normal = (normals.astype(np.float64) @ turn).astype(np.float32)
        return dataclasses.replace(self.some(which), place=place, normal=normal)

    @staticmethod
    def of_mesh(mesh: WorldMesh, looks: Looks, first: int = 0) -> Spots:
        """All vertices, whose looks are given; `first` is the number of the first object."""
        slots = [placed.mesh.slot for placed in mesh.objects]
        slot = np.concatenate([*slots, np.zeros(0, np.uint16)]).astype(np.int64)
        part = (mesh.object.astype(np.int64) + first) * SLOTS + slot
        return Spots(mesh.positions, mesh.normals, looks.values, part, looks.model)

    @staticmethod
    def of_marks(marks: Marks, objects: tuple[NodeId, ...], mesh: WorldMesh, vertices: Spots) -> Spots:
        """Of a stroke's marks where their objects stand now, looking as the nearest vertices of the part that
        face alike. Marks on objects or slots that the mesh has not are left out.
        """
        number = {placed.node: index for index, placed in enumerate(mesh.objects)}
        parts = []
        for counted, node in enumerate(objects):
            if node in number:
                here = marks.some(marks.object == counted)
                index = number[node]
                own = vertices.some(np.arange(*mesh.vertex_offsets[index : index + 2]))
                parts.append(on_object(own, mesh, index, here.place, here.normal, here.slot))
        return joined(parts, vertices)


def joined(parts: Sequence[Spots], like: Spots) -> Spots:
    """One after the other; as wide as others where there are none."""
    every = [like.some(np.zeros(0, np.int64)), *parts]
    fields = [field.name for field in dataclasses.fields(Spots)]
    return Spots(*(np.concatenate([getattr(part, name) for part in every]) for name in fields))


def on_object(vertices: Spots, mesh: WorldMesh, index: int, places: F32, normals: F32, slots: I64) -> Spots:
    """Places (N, 3) in an object's own frame, that look as the nearest of its vertices do that face alike."""
    none = np.zeros(len(places), np.int64)
    there = vertices.moved(none, mesh, index, places, normals)
    parts = []
    for slot in np.unique(slots).tolist():
        own = vertices.some(vertices.part == index * SLOTS + slot)
        here = np.flatnonzero(slots == slot)
        if not len(own):
            continue
        near = min(NEAR, len(own))
        distance, found = cKDTree(own.place).query(there.place[here], k=near)
        distance, found = distance.reshape(len(here), near), found.reshape(len(here), near)
        away = (own.normal[found] * there.normal[here, None]).sum(axis=2) <= 0
        best = np.argmin(np.where(away, np.inf, distance), axis=1)
        as_there = own.some(found[np.arange(len(here)), best])
        parts.append(dataclasses.replace(as_there, place=there.place[here], normal=there.normal[here]))
    return joined(parts, vertices)


def frame_of(transform: Transform, origin: F64) -> tuple[F64, float, F64]:
    """A (3, 3), scale and shift (3,): a row p of the object's frame is at scale · p @ A + shift."""
    turn = rotation_matrix(transform.rotation).T
    return turn, transform.scale, np.asarray(transform.translation) - origin


__all__ = ["SLOTS", "Spots", "frame_of", "joined", "on_object"]
