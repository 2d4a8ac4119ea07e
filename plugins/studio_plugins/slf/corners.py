"""Columns at marks from the corners of the faces they lie on, as pictures have them.

A picture has the light of the environment, and that between surfaces, from the vertices of a face; so have
the columns: they are summed at each corner, in its frame and towards the eye, and brought to the marks that
lie between. What the nearest vertex alone sees is wrong wherever shadows end between vertices, and where
things lie in each other it may be the one that is hidden. Lamps and suns light every place by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.parallel import Checkpoints, Workers
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


@dataclass(frozen=True, eq=False)
class Corners:
    """Of N marks: C vertices as places, each seen from an eye; which of these (N, K) a mark lies between, and
    how near to each, weight (N, K) with sums of 1; K is 3 or 1.
    """

    places: Places
    which: I64
    weight: F64

    @classmethod
    def of(cls, lit: Lit, places: Places, eye: F64, workers: Workers) -> Corners:
        """Of the faces that are met at places from where they are seen, eyes (N, 3) in the mesh's frame, else
        of the vertices that stand for them. Corners that face away have no weight; where there would be more
        than places, each place has its heaviest one alone.
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
        eyes, seen_from = np.unique(eye, axis=0, return_inverse=True)
        names, which = np.unique(corner * len(eyes) + seen_from.reshape(-1, 1), return_inverse=True)
        if len(names) > len(places):
            most = weight.argmax(axis=1)[:, None]
            corner, weight = np.take_along_axis(corner, most, axis=1), np.ones((len(places), 1))
            names, which = np.unique(corner * len(eyes) + seen_from.reshape(-1, 1), return_inverse=True)
        seen = _seen(mesh, names // len(eyes), eyes[names % len(eyes)])
        return cls(seen, which.reshape(corner.shape), weight)

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


def lamp_sums(
    address: int,
    terms: int,
    shapes: F32,
    places: Places,
    towards: F32,
    strength: F32,
    workers: Workers,
    job: Checkpoints | None = None,
) -> F64:
    """(L, N, terms, 3) of a model's kernel with shapes (L, D): Σ strength · b_k · cosθ over samples of lamps.

    towards, strength (N, C, 3) are those of `incident.Arriving`.
    """
    out = np.zeros((len(shapes), len(places), terms, 3))
    if not strength.any():
        return out
    way = np.ascontiguousarray(np.einsum("nij,ncj->nic", places.axes, towards), np.float32)
    light = strength * np.maximum(way[:, 2, :, None], 0)
    given_shapes, wo = np.ascontiguousarray(shapes, np.float32), np.ascontiguousarray(places.wo, np.float32)

    def body(start: int, stop: int) -> None:
        add_lamps(address, terms, given_shapes, wo, way, light, out, start, stop)

    workers.run(len(places), 16, body, job)
    return out


@kernel
def add_lamps(
    address: int, terms: int, shapes: F32, wo: F32, way: F32, light: F32, out: F64, start: int, stop: int
) -> None:
    """See `lamp_sums`; way (N, 3, C) in the places' frames, light (N, C, 3) with its cosine."""
    count = light.shape[1]
    wi, values = np.empty(3 * count, np.float32), np.empty(terms * count, np.float32)
    for n in range(start, stop):
        for axis in range(3):
            wi[axis * count : (axis + 1) * count] = way[n, axis]
        for level in range(len(shapes)):
            call_address(address, shapes[level], wo[n], count, wi, values)
            for term in range(terms):
                for i in range(count):
                    value = values[term * count + i]
                    for channel in range(3):
                        out[level, n, term, channel] += value * light[n, i, channel]


__all__ = ["Corners", "lamp_sums"]
