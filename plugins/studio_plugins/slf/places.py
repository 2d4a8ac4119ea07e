"""Where a stroke's marks are in the world now: points, frames, the vertices that stand for them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from studio_core.scene.nodes import NodeId, Scene
from studio_core.scene.tangents import perpendicular
from studio_core.scene.transform import rotation_matrix
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Surfaces
from studio_core.strokes.stroke import Stroke

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
NEAR = 8  # vertices among which the one that stands for a place is chosen
FACING = 0.3  # cosine of normals below which a vertex stands for nothing
LOWEST = 1e-3  # as pictures have it: normals between vertices may turn away at silhouettes


@dataclass(frozen=True, eq=False)
class Places:
    """N places, in the frame of a mesh's `origin`.

    position (N, 3), axes (N, 3, 3) rows t, b, n, wo (N, 3) towards the eye in these; vertex (N,) of the
    unrefined meshes, object (N,) in them, slot (N,); mark (N,) which of the stroke's marks each is.
    """

    position: F64
    axes: F64
    wo: F64
    vertex: I64
    object: I64
    slot: I64
    mark: I64

    def __len__(self) -> int:
        return len(self.vertex)

    def some(self, which: npt.NDArray[np.generic]) -> Places:
        """These of them."""
        return Places(*(getattr(self, field.name)[which] for field in dataclasses.fields(self)))


def places_of(scene: Scene, surfaces: Surfaces, stroke: Stroke) -> Places:
    """Of the marks on objects that are shown, where a vertex faces as the mark does."""
    marks, mesh = stroke.marks, surfaces.mesh
    found: list[Places] = []
    numbers = {node: number for number, node in enumerate(surfaces.nodes)}
    for index, node in enumerate(stroke.objects if marks is not None else ()):
        own = np.flatnonzero(marks.object == index) if marks is not None else np.zeros(0, np.int64)
        if marks is None or node not in numbers or not len(own):
            continue
        found.append(_on(scene, mesh, node, numbers[node], stroke, own))
    if not found:
        none = np.zeros(0, np.int64)
        return Places(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)), none, none, none, none)
    parts = [[getattr(one, field.name) for one in found] for field in dataclasses.fields(Places)]
    return Places(*(np.concatenate(part) for part in parts))


def _on(scene: Scene, mesh: WorldMesh, node: NodeId, number: int, stroke: Stroke, own: I64) -> Places:
    marks = stroke.marks
    assert marks is not None
    world = scene.world(node)
    turn = rotation_matrix(world.rotation)
    position = world.scale * (marks.place[own].astype(np.float64) @ turn.T) + world.translation - mesh.origin
    normal = _unit(marks.normal[own].astype(np.float64) @ turn.T)
    some = mesh.vertices_of(number)
    tree = cKDTree(mesh.positions[some])
    near = min(NEAR, some.stop - some.start)
    distance, index = tree.query(position, k=near)
    distance, index = distance.reshape(len(own), near), index.reshape(len(own), near) + some.start
    alike = np.einsum("nkc,nc->nk", mesh.normals[index], normal)
    rank = np.where(alike > FACING, distance, np.inf)
    best = np.argmin(rank, axis=1)
    rows = np.arange(len(own))
    good = np.isfinite(rank[rows, best])
    vertex = index[rows, best]
    along = perpendicular(mesh.tangents[vertex, :3].astype(np.float64), normal)
    lost = np.linalg.norm(along, axis=1) < 0.5
    along[lost] = _unit(np.cross(normal[lost], normal[lost][:, [1, 2, 0]] + [0.1, 0.2, 0.3]))
    sense = np.where(mesh.tangents[vertex, 3:] < 0, -1.0, 1.0)
    axes = np.stack([along, sense * np.cross(normal, along), normal], axis=1)
    towards = _unit(marks.eye[own].astype(np.float64) - mesh.origin - position)
    wo = np.einsum("nij,nj->ni", axes, towards)
    good &= np.isfinite(wo).all(axis=1) & (wo[:, 2] > 0)
    wo[:, 2] = np.maximum(wo[:, 2], LOWEST)
    count = np.full(len(own), number, np.int64)
    made = Places(position, axes, _unit(wo), vertex, count, marks.slot[own], own)
    return made.some(np.flatnonzero(good))


def _unit(vectors: F64) -> F64:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-30))
