"""Where hits of the picture lie on the surface: the points that vertices stand for between them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import Scene
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.scene.tangents import arbitrary_tangents, perpendicular
from studio_core.shading.artifacts import ChosenPoints, Hits, Surfaces
from studio_core.shading.normal_maps import normal_texture, normals_at, strength
from studio_core.shading.tilting import turned_points
from studio_core.shading.varying import Between

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]


def surface_points(surfaces: Surfaces, hits: Hits, eye: F64) -> ChosenPoints:
    """The true surface points of hits seen from an eye (3,), world, with interpolated normals."""
    mesh = surfaces.mesh
    corners, weights, face_normal = _corners(surfaces, hits, eye)
    place = mesh.positions[corners].astype(np.float64)
    normals = _unit(np.einsum("nk,nkc->nc", weights, mesh.normals[corners].astype(np.float64)))
    return ChosenPoints(
        mesh.origin,
        np.einsum("nk,nkc->nc", weights, place).astype(np.float32),
        normals,
        _tangents(weights, mesh.tangents[corners], normals),
        _unit(face_normal),
        np.zeros((len(corners), 3), np.float32),
        mesh.material[corners[:, 0]],
    )


def mapped_points(scene: Scene, surfaces: Surfaces, points: ChosenPoints, uvs: F32) -> ChosenPoints:
    """The points with the normals that maps have at uvs (P, 2), where materials have such; not averaged."""
    normals = np.tile(np.array([0, 0, 1], np.float32), (len(uvs), 1))
    mapped = False
    for number, name in enumerate(surfaces.materials):
        material = scene.material(name)
        texture, own = normal_texture(material), np.flatnonzero(points.material == number)
        if texture is not None and len(own):
            normals[own], mapped = normals_at(texture, strength(material), uvs[own]), True
    return turned_points(points, normals) if mapped else points


def surface_uvs(surfaces: Surfaces, hits: Hits, eye: F64) -> F32:
    """(P, 2) texture coordinates of hits."""
    corners, weights, _ = _corners(surfaces, hits, eye)
    at: F64 = np.einsum("nk,nkc->nc", weights, surfaces.mesh.uvs[corners].astype(np.float64))
    return at.astype(np.float32)


def between_vertices(surfaces: Surfaces, hits: Hits, eye: F64) -> Between:
    """The corners that each hit lies between, of the side that is seen."""
    corners, weights, _ = _corners(surfaces, hits, eye)
    return Between(surfaces.mesh, corners.astype(np.int64), weights.astype(np.float32))


def _corners(surfaces: Surfaces, hits: Hits, eye: F64) -> tuple[npt.NDArray[np.integer[Any]], F64, F64]:
    """Vertices (P, 3) of the side that is seen, their weights (P, 3), and normals (P, 3) of the faces."""
    mesh = surfaces.mesh
    corners = mesh.faces[hits.face]
    place = mesh.positions[corners].astype(np.float64)
    face_normal = np.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0])
    behind = ((eye - mesh.origin - place[:, 0]) * face_normal).sum(axis=1) < 0
    back = mesh.back_faces[hits.face]
    turned = behind & (back[:, 0] != NO_BACK)
    corners = np.where(turned[:, None], back, corners)
    face_normal = np.where(turned[:, None], -face_normal, face_normal)
    weights = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1).astype(np.float64)
    return corners, weights, face_normal


def _unit(vectors: F64) -> F32:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    made: F32 = (vectors / np.maximum(length, 1e-30)).astype(np.float32)
    return made


def _tangents(weights: F64, tangents: F32, normals: F32) -> F32:
    """(P, 4) tangents (P, 3, 4) of corners, weighted (P, 3), to unit normals (P, 3)."""
    along = np.einsum("nk,nkc->nc", weights, tangents[:, :, :3].astype(np.float64))
    flat = perpendicular(along, normals.astype(np.float64))
    made = np.concatenate([flat.astype(np.float32), tangents[:, 0, 3:]], axis=1)
    lost = ~flat.any(axis=1)
    made[lost] = arbitrary_tangents(normals[lost])
    return made


def some_hits(hits: Hits, chosen: npt.NDArray[np.int64]) -> Hits:
    """Those alone, without what lies behind them."""
    uvt = (hits.u[chosen], hits.v[chosen], hits.distance[chosen])
    return Hits(hits.view, hits.samples, hits.face[chosen], *uvt)


__all__ = ["between_vertices", "mapped_points", "some_hits", "surface_points", "surface_uvs"]
