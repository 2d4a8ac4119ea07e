"""The shading meshes of a whole scene as one: what kernels and renderers walk over."""

from __future__ import annotations

import dataclasses
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import readonly
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import NodeId
from studio_core.scene.normals import Fan
from studio_core.scene.shading_mesh import CREASE_DEGREES, F32, NO_BACK, U32, ShadingMesh, prepare, shade_mesh
from studio_core.scene.transform import Transform, rotation_matrix

I32 = npt.NDArray[np.int32]
NO_MATERIAL = -1
_MOVED = ("positions", "normals", "tangents", "geometric", "inset", "area")


class MeshCache:
    """Shading meshes by geometry and edge, so that instances and versions of a scene share them.

    Keeps up to `capacity` bytes, least recently used first out. Used from one thread at a time.
    """

    def __init__(self, capacity: int = 512 << 20, crease_degrees: float = CREASE_DEGREES) -> None:
        self._capacity = capacity
        self._crease = crease_degrees
        self._held: OrderedDict[tuple[str, float], Fan | ShadingMesh] = OrderedDict()
        self._made: dict[tuple[str, float], tuple[str, float]] = {}  # what was asked for, and what is held

    def prepared(self, geometry: Geometry) -> Fan:
        """The repaired source; `choose_edge` takes this method."""
        key = (geometry.key, 0.0)
        found = self._held.get(key)
        if not isinstance(found, Fan):
            found = prepare(geometry, self._crease)
        self._keep(key, found)
        return found

    def mesh(self, geometry: Geometry, edge: float) -> ShadingMesh:
        """The shading mesh at a target edge in the geometry's own frame, four digits of it.

        Edges that come to the same, where nothing is split, give the same object.
        """
        asked = (geometry.key, float(f"{edge:.4g}"))
        key = self._made.get(asked, asked)
        found = self._held.get(key)
        if not isinstance(found, ShadingMesh):
            made = shade_mesh(geometry, asked[1], prepared=self.prepared(geometry))
            key = self._made[asked] = (geometry.key, made.edge)
            same = self._held.get(key)
            found = same if isinstance(same, ShadingMesh) else made
        self._keep(key, found)
        return found

    def _keep(self, key: tuple[str, float], value: Fan | ShadingMesh) -> None:
        self._held[key] = value
        self._held.move_to_end(key)
        while len(self._held) > 1 and sum(held.nbytes for held in self._held.values()) > self._capacity:
            self._held.popitem(last=False)


@dataclass(frozen=True)
class Placed:
    """One object of the world mesh. materials[slot] is the scene's number of the slot's material."""

    node: NodeId
    mesh: ShadingMesh
    transform: Transform
    materials: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class WorldMesh:
    """All objects' shading meshes in the world, relative to `origin` (3,) float64; read-only arrays.

    Per vertex, as in ShadingMesh: positions = world - origin (V, 3), normals, geometric, inset (V, 3),
    tangents (V, 4), area (V,) in m², uvs (V, 2) (zeros where a mesh has none), side (V,), object (V,) index
    into `objects`, material (V,) the scene's number or -1. faces and back_faces (F, 3) into the vertices
    (NO_BACK: none); face_material (F,) the front's. Object i has vertices vertex_offsets[i]:vertex_offsets[i
    + 1] and likewise faces. World = float64 first, then minus origin, then float32: recentre far scenes by
    `origin`.
    """

    objects: tuple[Placed, ...]
    origin: npt.NDArray[np.float64]
    positions: F32
    normals: F32
    tangents: F32
    geometric: F32
    inset: F32
    area: F32
    uvs: F32
    side: npt.NDArray[np.int8]
    object: I32
    material: I32
    faces: U32
    back_faces: U32
    face_material: I32
    vertex_offsets: npt.NDArray[np.int64]
    face_offsets: npt.NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.positions)

    def vertices_of(self, index: int) -> slice:
        """Where an object's vertices lie."""
        return slice(int(self.vertex_offsets[index]), int(self.vertex_offsets[index + 1]))

    def faces_of(self, index: int) -> slice:
        """Where an object's faces lie."""
        return slice(int(self.face_offsets[index]), int(self.face_offsets[index + 1]))

    def index_of(self, node: NodeId) -> int:
        """The object made from a node; KeyError when there is none."""
        for index, placed in enumerate(self.objects):
            if placed.node == node:
                return index
        raise KeyError(node)

    def moved(self, index: int, transform: Transform) -> WorldMesh:
        """With one object elsewhere; see `moved_many`."""
        return self.moved_many({index: transform})

    def moved_many(self, transforms: Mapping[int, Transform]) -> WorldMesh:
        """With objects, by index, elsewhere; itself when none of them moves.

        Meshes stay as finely split as they were; all else is shared.
        """
        objects = list(self.objects)
        moving = {i: t for i, t in transforms.items() if objects[i].transform != t}
        if not moving:
            return self
        arrays = [getattr(self, name).copy() for name in _MOVED]
        for index, transform in moving.items():
            objects[index] = dataclasses.replace(objects[index], transform=transform)
            for array, part in zip(arrays, _placed(objects[index], self.origin), strict=True):
                array[self.vertices_of(index)] = part
        fresh: dict[str, Any] = {n: readonly(a, np.float32) for n, a in zip(_MOVED, arrays, strict=True)}
        return dataclasses.replace(self, objects=tuple(objects), **fresh)

    def with_mesh(self, index: int, mesh: ShadingMesh) -> WorldMesh:
        """With another shading mesh (a refined one) for one object; see `with_meshes`."""
        return self.with_meshes({index: mesh})

    def with_meshes(self, meshes: Mapping[int, ShadingMesh]) -> WorldMesh:
        """With other shading meshes for objects, by index; later objects' numbers shift.

        The other objects are copied, not placed again.
        """
        objects = list(self.objects)
        for index, mesh in meshes.items():
            objects[index] = dataclasses.replace(objects[index], mesh=mesh)
        parts = []
        for index, placed in enumerate(objects):
            if index in meshes:
                parts.append(_placed(placed, self.origin))
            else:
                own = self.vertices_of(index)
                parts.append(tuple(getattr(self, name)[own] for name in _MOVED))
        return _joined(objects, self.origin, parts)


def world_mesh(
    items: Sequence[tuple[NodeId, Geometry, Transform, Sequence[int]]],
    edge: float,
    *,
    origin: npt.ArrayLike = (0.0, 0.0, 0.0),
    cache: MeshCache | None = None,
) -> WorldMesh:
    """The world mesh of (node, geometry, world transform, material number of each slot), edges ≤ `edge` m."""
    held = cache or MeshCache()
    return assemble(
        [
            Placed(node, held.mesh(geometry, edge / transform.scale), transform, tuple(materials))
            for node, geometry, transform, materials in items
        ],
        origin,
    )


def assemble(objects: Sequence[Placed], origin: npt.ArrayLike = (0.0, 0.0, 0.0)) -> WorldMesh:
    """Placed meshes concatenated."""
    centre = readonly(origin, np.float64, 3)
    return _joined(objects, centre, [_placed(placed, centre) for placed in objects])


def _joined(
    objects: Sequence[Placed], origin: npt.NDArray[np.float64], parts: Sequence[tuple[F32, ...]]
) -> WorldMesh:
    """Placed meshes, and what `_placed` says of them, one after the other."""
    meshes = [placed.mesh for placed in objects]
    vertex = np.concatenate([[0], np.cumsum([len(mesh) for mesh in meshes])]).astype(np.int64)
    face = np.concatenate([[0], np.cumsum([len(mesh.faces) for mesh in meshes])]).astype(np.int64)

    def joined(arrays: Sequence[npt.NDArray[np.generic]], *tail: int) -> npt.NDArray[np.generic]:
        return np.concatenate([*arrays]) if len(arrays) else np.zeros((0, *tail))

    def floats(column: int, *tail: int) -> F32:
        return readonly(joined([part[column] for part in parts], *tail), np.float32)

    def shifted(faces: U32, start: int) -> U32:
        return np.where(faces == NO_BACK, NO_BACK, faces + np.uint32(start)).astype(np.uint32)

    numbered = list(zip(meshes, vertex[:-1].tolist(), strict=True))
    uvs = [np.zeros((len(m), 2), np.float32) if m.uvs is None else m.uvs for m in meshes]
    return WorldMesh(
        objects=tuple(objects),
        origin=origin,
        positions=floats(0, 3),
        normals=floats(1, 3),
        tangents=floats(2, 4),
        geometric=floats(3, 3),
        inset=floats(4, 3),
        area=floats(5),
        uvs=readonly(joined(uvs, 2), np.float32),
        side=readonly(joined([mesh.side for mesh in meshes]), np.int8),
        object=readonly(np.repeat(np.arange(len(meshes)), np.diff(vertex)), np.int32),
        material=readonly(joined([_materials(o, o.mesh.slot) for o in objects]), np.int32),
        faces=readonly(joined([shifted(m.faces, start) for m, start in numbered], 3), np.uint32),
        back_faces=readonly(joined([shifted(m.back_faces, start) for m, start in numbered], 3), np.uint32),
        face_material=readonly(joined([_materials(o, o.mesh.slots) for o in objects]), np.int32),
        vertex_offsets=readonly(vertex, np.int64),
        face_offsets=readonly(face, np.int64),
    )


def _placed(placed: Placed, origin: npt.NDArray[np.float64]) -> tuple[F32, ...]:
    """What moves with one object, as in `_MOVED`, in the world."""
    mesh, transform = placed.mesh, placed.transform
    turn = rotation_matrix(transform.rotation).T
    shift = np.array(transform.translation) - origin
    scale = transform.scale

    def turned(vectors: F32, factor: float = 1.0) -> F32:
        return np.asarray(factor * (vectors.astype(np.float64) @ turn), np.float32)

    positions = scale * (mesh.positions.astype(np.float64) @ turn) + shift
    return (
        positions.astype(np.float32),
        turned(mesh.normals),
        np.concatenate([turned(mesh.tangents[:, :3]), mesh.tangents[:, 3:]], axis=1),
        turned(mesh.geometric),
        turned(mesh.inset, scale),
        np.asarray(mesh.area * scale**2, np.float32),
    )


def _materials(placed: Placed, slots: npt.NDArray[np.uint16]) -> I32:
    """Material number of each slot entry; slots past the last take the last, without materials -1."""
    table = np.array(placed.materials or (NO_MATERIAL,), np.int32)
    return np.asarray(table[np.minimum(slots, len(table) - 1)])
