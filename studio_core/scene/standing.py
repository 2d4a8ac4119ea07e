"""What things stand on: the surface seen along a ray, and the one straight below.

Triangles of whole meshes are tested at once with NumPy: first the flat boxes of all triangles as they look
along the rays, then the few that remain exactly (Möller and Trumbore 1997). What a direction needs is
prepared when a mesh is first in question, and kept: a drag asks hundreds of times.
"""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.edits import Move
from studio_core.scene.arranging import shifted
from studio_core.scene.bounds import exact_bounds, mesh_box, rows_in_world
from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_core.scene.transform import Transform

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
LEVEL = 0.7
"""Cosine of the steepest slope that something stands on."""
DOWN = np.array([0.0, -1.0, 0.0])
_NEAR = 1e-6  # metres: what lies this much above still counts as below
_INSET = 0.04  # of a footprint's width: points lie within its edge
_EDGE = 1e-7  # barycentric: rays along the edge between two triangles hit


@dataclass(frozen=True)
class Seat:
    """A point (3,) that something can stand on, and the mesh that it lies on."""

    at: F64
    node: NodeId


class _Mesh:
    """A mesh in the world, looked at along rays that all start at one point, or are all vertical."""

    def __init__(self, scene: Scene, node: MeshObject) -> None:
        self.id = node.id
        self.low, self.high = mesh_box(scene, node.id)
        self._scene, self._node = scene, node
        self._rows: F64 | None = None
        self._flat: F32 | None = None
        self._seen: tuple[bytes, F32] | None = None

    def rows(self) -> F64:
        """(3, P) x, y and z of all corners in the world."""
        if self._rows is None:
            self._rows = rows_in_world(self._node.geometry.positions, self._scene.world(self.id).matrix())
        return self._rows

    def triangles(self, which: npt.NDArray[np.bool_]) -> F64:
        """(N, 3, 3) corners in the world of some of the faces (F,)."""
        return np.moveaxis(self.rows()[:, self._node.geometry.faces[which]], 0, -1)

    def below(self, points: F64) -> F64:
        """(N,) height of the highest level surface at most as high as each point (N, 3); -inf without one."""
        if self._flat is None:
            x, _, z = self.rows().astype(np.float32)
            self._flat = _boxes(self._node.geometry.faces, x, z)
        least, greatest = points.min(axis=0), points.max(axis=0)
        x0, z0, x1, z1 = self._flat
        slack = 1e-5 * (1 + float(np.abs(points).max()))
        near = (x1 >= least[0] - slack) & (x0 <= greatest[0] + slack)
        near &= (z1 >= least[2] - slack) & (z0 <= greatest[2] + slack)
        distance, level = _hits(points, DOWN, self.triangles(near))
        distance = np.where(level[None], distance, np.inf)
        nearest: F64 = points[:, 1] - distance.min(axis=1, initial=np.inf)
        return nearest

    def along(self, start: F64, towards: F64) -> tuple[float, F64] | None:
        """Distance and point of the first level surface that a ray from `start` meets from above."""
        if not self._crossed(start, towards):
            return None
        u, v = _direction(towards)
        slack = 1e-5 * (1 + abs(u) + abs(v))
        u0, v0, u1, v1 = self._as_seen_from(start)
        near = (u1 >= u - slack) & (u0 <= u + slack) & (v1 >= v - slack) & (v0 <= v + slack)
        distance, level = _hits(start[None], towards, self.triangles(near))
        best = float(np.where(level, distance[0], np.inf).min(initial=np.inf))
        return (best, start + best * towards) if np.isfinite(best) else None

    def _crossed(self, start: F64, towards: F64) -> bool:
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (self.low - 1e-6 - start) / towards, (self.high + 1e-6 - start) / towards
        enter, leave = np.nanmax(np.minimum(a, b)), np.nanmin(np.maximum(a, b))
        return bool(enter <= leave and leave > 0)

    def _as_seen_from(self, start: F64) -> F32:
        """(4, F) boxes of the triangles, each projected to the plane below the start."""
        key = start.tobytes()
        if self._seen is None or self._seen[0] != key:
            x, y, z = self.rows()
            across, deep, along = x - start[0], start[1] - y, z - start[2]
            faces, above = self._node.geometry.faces, deep < 1e-6 * (1 + float(np.abs(deep).max()))
            with np.errstate(all="ignore"):
                boxes = _boxes(faces, (across / deep).astype(np.float32), (along / deep).astype(np.float32))
            if above.any():
                i, j, k = faces.T
                some, whole = above[i] | above[j] | above[k], above[i] & above[j] & above[k]
                boxes[:2, some], boxes[2:, some] = -np.inf, np.inf
                boxes[:, whole] = np.nan  # never met on the way down
            self._seen = key, boxes
        return self._seen[1]


class Ground:
    """The shown meshes of a scene but those at and under `without`, as they are now."""

    def __init__(self, scene: Scene, without: Container[NodeId] = ()) -> None:
        self._meshes = []
        for node in scene.of(MeshObject):
            above = {node.id, *(parent.id for parent in scene.ancestors(node.id))}
            if not len(node.geometry.faces) or not scene.shown(node.id):
                continue
            if not any(each in without for each in above):
                self._meshes.append(_Mesh(scene, node))

    def below(self, points: npt.ArrayLike) -> F64:
        """(N,) height of the first level surface at or straight below each point (N, 3); -inf without one."""
        asked = np.asarray(points, np.float64).reshape(-1, 3)
        found = np.full(len(asked), -np.inf)
        if not len(asked):
            return found
        low, high = asked.min(axis=0), asked.max(axis=0)
        for mesh in self._meshes:
            over = (mesh.low[[0, 2]] <= high[[0, 2]]).all() and (mesh.high[[0, 2]] >= low[[0, 2]]).all()
            if over and mesh.low[1] <= high[1] + 1e-9 and mesh.high[1] > found.min():
                found = np.maximum(found, mesh.below(asked))
        return found

    def support(self, low: npt.ArrayLike, high: npt.ArrayLike, top: float) -> float:
        """Height of what a box between two corners (3,) can stand on, at most `top`; -inf without anything.

        Looked for below nine points of the footprint: the highest of these carries.
        """
        low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
        inset = _INSET * (high - low)
        x = np.linspace(low[0] + inset[0], high[0] - inset[0], 3)
        z = np.linspace(low[2] + inset[2], high[2] - inset[2], 3)
        points = np.stack(np.broadcast_arrays(x[:, None], top, z[None]), axis=-1).reshape(-1, 3)
        return float(self.below(points).max())

    def along(self, start: npt.ArrayLike, towards: npt.ArrayLike) -> Seat | None:
        """Where a falling ray first meets something to stand on; None for one that does not fall."""
        start, towards = np.asarray(start, np.float64), np.asarray(towards, np.float64)
        if towards[1] > -1e-6:
            return None
        best, found = np.inf, None
        for mesh in self._meshes:
            hit = mesh.along(start, towards)
            if hit is not None and hit[0] < best:
                best, found = hit[0], Seat(hit[1], mesh.id)
        return found


def dropped(scene: Scene, nodes: Iterable[NodeId]) -> dict[NodeId, Transform]:
    """Local transforms that let each of `nodes` stand on what lies below it, else on the floor at y = 0.

    They stand on each other too, the lowest first. What is sunk into something by less than half of its
    height comes up.
    """
    found = {node: exact_bounds(scene, (node,)) for node in nodes}
    made: dict[NodeId, Transform] = {}
    for node, box in sorted(found.items(), key=lambda item: item[1][0][1] if item[1] is not None else 0.0):
        if box is None:
            continue
        low, high = box
        height = Ground(scene, {node}).support(low, high, float(low[1] + high[1]) / 2 + _NEAR)
        moved = shifted(scene, (node,), (0.0, (height if np.isfinite(height) else 0.0) - low[1], 0.0))
        scene = Move(moved)(scene)
        made |= moved
    return made


def _boxes(faces: npt.NDArray[np.uint32], x: F32, y: F32) -> F32:
    """(4, F) least x and y and greatest x and y of triangles whose corners lie at x and y (P,)."""
    made = np.empty((4, len(faces)), np.float32)
    for row, values in enumerate((x, y)):
        a, b, c = (values[corner] for corner in faces.T)
        np.minimum(np.minimum(a, b), c, out=made[row])
        np.maximum(np.maximum(a, b), c, out=made[row + 2])
    return made


def _direction(towards: F64) -> tuple[float, float]:
    """Where a falling ray goes, per metre of falling."""
    return float(towards[0] / -towards[1]), float(towards[2] / -towards[1])


def _hits(starts: F64, towards: F64, triangles: F64) -> tuple[F64, npt.NDArray[np.bool_]]:
    """(N, F) distances along a direction, inf for no hit (either side counts), and (F,) whether level."""
    a = triangles[:, 0]
    e1, e2 = triangles[:, 1] - a, triangles[:, 2] - a
    normal = np.cross(e1, e2)
    length = np.linalg.norm(normal, axis=1)
    level = np.abs(normal[:, 1]) > LEVEL * length
    p = np.cross(towards, e2)
    volume = np.einsum("fi,fi->f", e1, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / volume
        away = starts[:, None] - a[None]
        u = np.einsum("nfi,fi->nf", away, p) * inverse
        q = np.cross(away, e1[None])
        v = (q @ towards) * inverse
        distance = np.einsum("nfi,fi->nf", q, e2) * inverse
        hit = (u >= -_EDGE) & (v >= -_EDGE) & (u + v <= 1 + _EDGE) & (distance >= -1e-9)
    return np.where(hit, distance, np.inf), level
