"""What a mesh is too coarse for of the paint on it: a reason to refine that vertices cannot see.

Paint is known at points that may lie closer than vertices: a painted spot within one face is in none of them.
Here every point is compared with what is interpolated at its place, in radiance, and what a face misses of
its points is given to its edges (`interpolation.EdgeErrors`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from studio_core.contract import Registry
from studio_core.scene.nodes import Scene
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Hits, Surfaces
from studio_core.shading.interpolation import EdgeErrors, seen_corners, seen_samples
from studio_core.shading.painting import Changes, Coat, coefficient_changes

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

NEAR = 8  # vertices among which a point looks for one that faces its way
EDGES = ((0, 1), (1, 2), (2, 0))


def with_paint(
    errors: EdgeErrors,
    scene: Scene,
    surfaces: Surfaces,
    coats: Mapping[int, Coat],
    painted: F32,
    terms: F32,
    hits: Hits,
    registry: Registry,
) -> EdgeErrors:
    """The errors, no edge's lower than what its faces miss of paint.

    coats by number of the object; painted (V, T·3) and terms (V, T, 3) at the vertices of `surfaces.mesh`.
    """
    mesh = surfaces.mesh
    samples = seen_samples(hits, len(mesh.faces))
    squares = errors.squares.copy()
    for number, coat in coats.items():
        start = mesh.faces_of(number).start
        faces = np.flatnonzero(samples[mesh.faces_of(number)]) + start
        if len(coat.paint.places) < 2 or not len(faces):
            continue
        corners = seen_corners(mesh, hits.view, faces)
        face, shares, point = _lying(mesh, number, corners, coat)
        made = _at_points(scene, surfaces, number, coat, point, terms.shape[1], registry)
        corner = corners[face]
        between = np.einsum("nk,nkt->nt", shares, painted[corner].astype(np.float64))
        light = np.einsum("nk,nktc->ntc", shares, terms[corner].astype(np.float64))
        missed = ((made.reshape(light.shape) - between.reshape(light.shape)) * light).sum(axis=1)
        total = np.bincount(face, (missed**2).mean(axis=1), len(faces))
        mean = total / np.maximum(np.bincount(face, minlength=len(faces)), 1)
        weight = mean * samples[faces] / len(EDGES)
        own = np.zeros(len(squares))
        for a, b in EDGES:
            edge = _edges_of(errors.ends, corners[:, [a, b]], len(mesh))
            known = edge >= 0
            np.add.at(own, edge[known], weight[known])
        squares = np.maximum(squares, own)
    relative = float(np.sqrt(squares.sum() / errors.scale))
    return dataclasses.replace(errors, squares=squares, relative_rmse=max(relative, errors.relative_rmse))


def _lying(mesh: WorldMesh, number: int, corners: I64, coat: Coat) -> tuple[I64, F64, I64]:
    """Of points next to seen faces: which of the faces, shares (N, 3) of its corners, and which points."""
    own = mesh.vertices_of(number)
    shape, paint = mesh.objects[number].mesh, coat.paint
    used, where = np.unique(corners - own.start, return_inverse=True)
    where = where.reshape(-1)
    near = min(NEAR, len(used))
    distance, found = cKDTree(shape.positions[used]).query(paint.places, k=near)
    distance, found = distance.reshape(-1, near), found.reshape(-1, near)
    vertex = used[found]
    alike = (shape.normals[vertex] * paint.normals[:, None]).sum(axis=2) > 0
    alike &= shape.slot[vertex] == paint.slots[:, None]
    rank = np.where(alike, distance, np.inf)
    best = np.argmin(rank, axis=1)
    rows = np.arange(len(best))
    point = np.flatnonzero(np.isfinite(rank[rows, best]))
    chosen = found[point, best[point]]
    # The faces around a vertex, as rows of one list.
    order = np.argsort(where, kind="stable")
    first = np.searchsorted(where[order], np.arange(len(used) + 1))
    places = paint.places[point].astype(np.float64)
    at = shape.positions.astype(np.float64)
    face = np.full(len(point), -1, np.int64)
    shares = np.zeros((len(point), 3))
    depth = np.full(len(point), -np.inf)
    for turn in range(int(np.diff(first)[chosen].max(initial=0))):
        some = np.flatnonzero(first[chosen] + turn < first[chosen + 1])
        around = order[first[chosen[some]] + turn] // 3
        a, b, c = (at[corners[around, k] - own.start] for k in range(3))
        made = _barycentric(places[some], a, b, c)
        least = made.min(axis=1)
        better = least > depth[some]
        rows = some[better]
        face[rows], depth[rows] = around[better], least[better]
        shares[rows] = made[better]
    shares = np.clip(shares, 0, None)
    shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1e-30)
    return face, shares, point


def _barycentric(p: F64, a: F64, b: F64, c: F64) -> F64:
    """(N, 3) of the foot of p on the plane of a triangle."""
    u, v, w = b - a, c - a, p - a
    uu, uv, vv = (np.einsum("nk,nk->n", x, y) for x, y in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("nk,nk->n", w, u), np.einsum("nk,nk->n", w, v)
    scale = np.maximum(uu * vv - uv * uv, 1e-30)
    second, third = (vv * wu - uv * wv) / scale, (uu * wv - uv * wu) / scale
    return np.stack([1 - second - third, second, third], axis=1)


def _at_points(
    scene: Scene, surfaces: Surfaces, number: int, coat: Coat, point: I64, width: int, registry: Registry
) -> F32:
    """(N, width · 3) what paint adds to coefficients at its points themselves."""
    table = np.array(surfaces.mesh.objects[number].materials)
    material = table[np.minimum(coat.paint.slots[point], len(table) - 1)]
    made = np.zeros((len(point), width, 3), np.float32)
    for one in np.unique(material).tolist():
        some = np.flatnonzero(material == one)
        changes: Changes = {
            name: coat.paint.change(name)[point[some]].squeeze(axis=1)
            if coat.paint.change(name).shape[1] == 1
            else coat.paint.change(name)[point[some]]
            for name in coat.paint.changes
        }
        added = coefficient_changes(scene.material(surfaces.materials[one]), registry, changes)
        made[some, : added.shape[1]] = added
    return made.reshape(len(point), -1)


def _edges_of(ends: I64, pairs: I64, span: int) -> I64:
    """Rows of the sorted edges (E, 2) that pairs (N, 2) are; −1 where none is."""
    keys = ends.min(axis=1) * span + ends.max(axis=1)
    wanted = pairs.min(axis=1) * span + pairs.max(axis=1)
    order = np.argsort(keys)
    found = np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)
    return np.where(keys[order][found] == wanted, order[found], -1)


__all__ = ["with_paint"]
