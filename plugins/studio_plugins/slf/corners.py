"""Columns at marks from the corners of the faces they lie on, as pictures have them.

A picture has its light from the vertices of a face; so have the columns: they are summed at each corner, in
its frame and towards the eye, and brought to the marks that lie between. What the nearest vertex alone sees
is wrong wherever shadows end between vertices, and where things lie in each other it may be the one that is
hidden.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.parallel import Workers
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.scene.world_mesh import WorldMesh
from studio_core.strokes.solution import Lit
from studio_plugins.slf.links import frames_of
from studio_plugins.slf.places import LOWEST, Places

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
ABOVE = 1e-3
"""Metres above a mark from which its face is looked for."""
BENT = math.cos(math.radians(6))
"""Cosine between normals of a face's corners, below which a picture at rest has more vertices there."""
FEW = 200
"""So many corners are always summed, and else as many as there are places."""


@dataclass(frozen=True, eq=False)
class Corners:
    """Of N marks: C vertices as places, each seen from an eye; which of these (N, K) a mark lies between, and
    how near to each, weight (N, K) with sums of 1; K is 3 or 1. bent (B,) are marks whose faces stand for
    much of a curve, `own` their places with the light of the nearest corners.
    """

    places: Places
    which: I64
    weight: F64
    bent: I64
    own: Places

    @classmethod
    def of(cls, lit: Lit, places: Places, eye: F64, workers: Workers, few: int = FEW) -> Corners:
        """Of the faces that are met at places from where they are seen, eyes (N, 3) in the mesh's frame, else
        of the vertices that stand for them. Corners that face away have no weight; where there would be more
        than places and more than `few`, each place has its heaviest one alone.
        """
        mesh = lit.surfaces.unrefined.mesh
        towards = np.einsum("nji,nj->ni", places.axes, places.wo)
        start = places.position + mesh.origin + ABOVE * towards
        hits = lit.casters.primary.closest(start, -towards, 0.0, 2 * ABOVE, workers)
        met = hits.object == places.object
        face = np.where(met, hits.face + mesh.face_offsets[np.where(met, hits.object, 0)], 0)
        behind = ~hits.front & (mesh.back_faces[face, 0] != NO_BACK)
        corner = np.where(behind[:, None], mesh.back_faces[face], mesh.faces[face]).astype(np.int64)
        weight = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1).astype(np.float64)
        weight *= np.einsum("nkc,nc->nk", mesh.normals[corner], places.axes[:, 2]) > 0
        total = weight.sum(axis=1)
        alone = ~met | ~(total > 0)
        corner[alone], weight[alone], total[alone] = places.vertex[alone, None], (1, 0, 0), 1
        weight /= total[:, None]
        heaviest = np.take_along_axis(corner, weight.argmax(axis=1)[:, None], axis=1)
        normals = mesh.normals[corner]
        bent = np.flatnonzero(
            np.einsum("nkc,nkc->nk", normals, np.roll(normals, 1, axis=1)).min(axis=1) < BENT
        )
        own = dataclasses.replace(places.some(bent), vertex=heaviest[bent, 0])
        eyes, seen_from = np.unique(eye, axis=0, return_inverse=True)
        names, which = np.unique(corner * len(eyes) + seen_from.reshape(-1, 1), return_inverse=True)
        if len(names) > max(len(places), few):
            corner, weight = heaviest, np.ones((len(places), 1))
            names, which = np.unique(corner * len(eyes) + seen_from.reshape(-1, 1), return_inverse=True)
        seen = _seen(mesh, names // len(eyes), eyes[names % len(eyes)])
        return cls(seen, which.reshape(corner.shape), weight, bent, own)

    def between(self, sums: F64) -> F64:
        """(L, N, T, 3) at the marks, of sums (L, C, T, 3) at the corners."""
        return np.asarray(np.einsum("lnktc,nk->lntc", sums[:, self.which], self.weight, optimize=True))


def _seen(mesh: WorldMesh, vertex: I64, eye: F64) -> Places:
    """Vertices (C,) as places that are seen from eyes (C, 3)."""
    position = mesh.positions[vertex].astype(np.float64)
    axes = frames_of(mesh, vertex).astype(np.float64)
    wo = np.einsum("nij,nj->ni", axes, eye - position)
    wo /= np.maximum(np.linalg.norm(wo, axis=1, keepdims=True), 1e-30)
    wo[:, 2] = np.maximum(wo[:, 2], LOWEST)
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    none = np.zeros(len(vertex), np.int64)
    owner = mesh.object[vertex].astype(np.int64)
    return Places(position, axes, wo, vertex, owner, none, np.arange(len(vertex)))


__all__ = ["Corners"]
