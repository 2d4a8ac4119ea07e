"""Meshes under construction: float64, welded, with exact normals; frozen into `Geometry` at the end."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from studio_core.scene.geometry import Geometry
from studio_core.scene.transform import axis_angle, rotation_matrix

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Mesh:
    """Positions (P, 3) in metres, unit normals (P, 3), uvs (P, 2), faces (F, 3), slots (F,)."""

    positions: Array
    normals: Array
    faces: Indices
    uvs: Array
    slots: Indices

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
        """The mesh shifted."""
        return replace(self, positions=self.positions + np.array([x, y, z]))

    def turned(self, axis: Point, degrees: float, about: Point = (0.0, 0.0, 0.0)) -> Mesh:
        """The mesh rotated right-handedly about an axis through `about`."""
        matrix = rotation_matrix(axis_angle(axis, degrees))
        centre = np.array(about)
        return replace(
            self, positions=(self.positions - centre) @ matrix.T + centre, normals=self.normals @ matrix.T
        )

    def mirrored(self) -> Mesh:
        """The mesh reflected in the plane x = 0, still facing outwards."""
        flip = np.array([-1.0, 1.0, 1.0])
        return replace(
            self, positions=self.positions * flip, normals=self.normals * flip, faces=self.faces[:, ::-1]
        )

    def bent(self, bend: Callable[[Array], Array]) -> Mesh:
        """The mesh with its points moved by a smooth map (N, 3) → (N, 3) that keeps orientation.

        Normals follow by the cofactor matrix of the map's Jacobian (central differences of 10 µm).
        """
        step = 1e-5
        columns = []
        for axis in range(3):
            shift = np.zeros(3)
            shift[axis] = step
            columns.append((bend(self.positions + shift) - bend(self.positions - shift)) / (2 * step))
        x, y, z = columns
        n = self.normals
        bent = n[:, :1] * np.cross(y, z) + n[:, 1:2] * np.cross(z, x) + n[:, 2:] * np.cross(x, y)
        return replace(self, positions=bend(self.positions), normals=unit(bent))

    def slot(self, number: int) -> Mesh:
        """The mesh with all faces in one material slot."""
        return replace(self, slots=np.full(len(self.faces), number, np.int64))

    def mapped(self, across: int, up: int, width: float, height: float) -> Mesh:
        """The mesh with uvs by flat projection: axes `across` and `up`, metres a repeat."""
        uvs = self.positions[:, [across, up]] / np.array([width, height])
        return replace(self, uvs=uvs - uvs.min(axis=0))

    def geometry(self, textured: bool = False) -> Geometry:
        """The finished mesh."""
        return Geometry(
            positions=self.positions.astype(np.float32),
            faces=self.faces.astype(np.uint32),
            normals=unit(self.normals).astype(np.float32),
            uvs=self.uvs.astype(np.float32) if textured else None,
            slots=self.slots.astype(np.uint16),
        )


def unit(vectors: Array) -> Array:
    """Vectors (N, 3) divided by their lengths."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def face_normals(positions: Array, faces: Indices) -> Array:
    """(F, 3) normals with twice the face's area as length."""
    a, b, c = (positions[faces[:, k]] for k in range(3))
    return np.asarray(np.cross(b - a, c - a))


def facing(positions: Array, normals: Array, faces: Indices, uvs: Array | None = None) -> Mesh:
    """A mesh whose faces are wound the way its vertex normals point; faces without area are dropped."""
    flat = face_normals(positions, faces)
    solid = np.linalg.norm(flat, axis=1) > 1e-14
    faces, flat = faces[solid], flat[solid]
    wrong = np.einsum("ij,ij->i", flat, normals[faces].sum(axis=1)) < 0
    faces = np.where(wrong[:, None], faces[:, ::-1], faces)
    return Mesh(
        positions,
        unit(normals),
        faces,
        np.zeros((len(positions), 2)) if uvs is None else uvs,
        np.zeros(len(faces), np.int64),
    )


def smoothed(mesh: Mesh) -> Mesh:
    """The mesh with normals averaged over the faces at each vertex, weighted by angle; others stay."""
    total = np.zeros_like(mesh.positions)
    flat = unit(face_normals(mesh.positions, mesh.faces))
    for k in range(3):
        here = mesh.positions[mesh.faces[:, k]]
        one = unit(mesh.positions[mesh.faces[:, (k + 1) % 3]] - here)
        two = unit(mesh.positions[mesh.faces[:, (k + 2) % 3]] - here)
        angle = np.arccos(np.clip(np.einsum("ij,ij->i", one, two), -1, 1))
        np.add.at(total, mesh.faces[:, k], flat * angle[:, None])
    bare = ~total.any(axis=1)
    total[bare] = mesh.normals[bare]
    return replace(mesh, normals=unit(total))


def joined(*meshes: Mesh) -> Mesh:
    """Several meshes as one; their slots are kept."""
    starts = np.cumsum([0, *(len(m.positions) for m in meshes[:-1])])
    return Mesh(
        np.concatenate([m.positions for m in meshes]),
        np.concatenate([m.normals for m in meshes]),
        np.concatenate([m.faces + start for m, start in zip(meshes, starts, strict=True)]),
        np.concatenate([m.uvs for m in meshes]),
        np.concatenate([m.slots for m in meshes]),
    )


def grid_faces(rows: int, columns: int, wrap: bool = False, radial: bool = False) -> Indices:
    """Triangles of a grid of vertices, row by row; `wrap` joins the last column to the first.

    `radial` lets all diagonals point to the grid's middle.
    """
    across = columns if wrap else columns - 1
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(across), indexing="ij")
    a = (row * columns + column).ravel()
    b = (row * columns + (column + 1) % columns).ravel()
    c, d = a + columns, b + columns
    faces = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    if radial:
        off = ((2 * row - rows + 2) * (2 * column - columns + 2) < 0).ravel()
        other = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])
        faces = np.where(np.concatenate([off, off])[:, None], other, faces)
    return np.asarray(faces, dtype=np.int64)


def spline(points: npt.ArrayLike, count: int) -> Array:
    """`count` points, evenly spaced in length, on the centripetal Catmull–Rom curve through `points`."""
    knots = np.asarray(points, dtype=np.float64)
    padded = np.concatenate([[2 * knots[0] - knots[1]], knots, [2 * knots[-1] - knots[-2]]])
    dense = []
    for p0, p1, p2, p3 in zip(padded, padded[1:], padded[2:], padded[3:], strict=False):
        t0, t1, t2, t3 = np.cumsum(
            [0.0, *(math.sqrt(float(np.linalg.norm(b - a))) for a, b in ((p0, p1), (p1, p2), (p2, p3)))]
        )
        t = np.linspace(t1, t2, 33)[:-1, None]
        a1 = (t1 - t) / (t1 - t0) * p0 + (t - t0) / (t1 - t0) * p1
        a2 = (t2 - t) / (t2 - t1) * p1 + (t - t1) / (t2 - t1) * p2
        a3 = (t3 - t) / (t3 - t2) * p2 + (t - t2) / (t3 - t2) * p3
        b1 = (t2 - t) / (t2 - t0) * a1 + (t - t0) / (t2 - t0) * a2
        b2 = (t3 - t) / (t3 - t1) * a2 + (t - t1) / (t3 - t1) * a3
        dense.append((t2 - t) / (t2 - t1) * b1 + (t - t1) / (t2 - t1) * b2)
    curve = np.concatenate([*dense, knots[-1:]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    wanted = np.linspace(0.0, length[-1], count)
    return np.stack([np.interp(wanted, length, curve[:, k]) for k in range(knots.shape[1])], axis=1)
