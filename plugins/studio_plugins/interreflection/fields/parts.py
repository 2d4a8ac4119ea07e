"""Hollow objects taken apart: a room in one mesh is walls that light each other.

An object's own light never comes back to it. For what mostly looks at itself, a room, a shelf, that would be
nearly all light: such an object is as many sources as it has smooth pieces of some size (a crease ends a
piece), and the rest of it is one more. A piece is an object of its own: the others light it, and do not stand
in the way of its light.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.kernels.packets import OPAQUE
from studio_core.kernels.visibility import lifted
from studio_core.scene.shading_mesh import NO_BACK, ShadingMesh
from studio_core.scene.topology import components
from studio_core.shading.job import Job
from studio_plugins.interreflection.fields.body import Body

I64 = npt.NDArray[np.int64]

HOLLOW = 0.3
"""Share of light that comes back to an object, from which on it is hollow."""
PIECE = 0.05
"""Of an object's surface, below which a piece belongs to the rest."""
VERTICES, RAYS = 256, 16


def own_share(body: Body, services: Services, job: Job) -> float:
    """How much of what a body's surface sends out meets that body again, about."""
    mesh = body.mesh
    area = mesh.area.astype(np.float64)
    if not area.sum() > 0:
        return 0.0
    places = (np.arange(VERTICES) + 0.5) / VERTICES * area.sum()
    chosen = np.minimum(np.searchsorted(np.cumsum(area), places), len(area) - 1)
    i = np.arange(RAYS)
    flat, turn = np.sqrt((i + 0.5) / RAYS), i * (math.pi * (3 - math.sqrt(5)))
    local = np.stack([flat * np.cos(turn), flat * np.sin(turn), np.sqrt(1 - flat**2)], axis=1)
    normals, along = mesh.geometric[chosen].astype(np.float64), mesh.tangents[chosen, :3].astype(np.float64)
    along -= (along * normals).sum(axis=1, keepdims=True) * normals
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    axes = np.stack([along, np.cross(normals, along), normals], axis=1)
    directions = np.einsum("rk,vkc->vrc", local, axes).reshape(-1, 3)
    with body.caster() as caster:
        given = mesh.positions[chosen], mesh.geometric[chosen], mesh.inset[chosen]
        starts = lifted(caster, *given).astype(np.float64) + caster.centre
        origins = np.repeat(starts, RAYS, axis=0)
        hits = caster.closest(origins, directions, 0.0, np.inf, services.workers, job, mask=OPAQUE)
    lit = (hits.face >= 0) & (hits.front | (mesh.back_faces[np.maximum(hits.face, 0), 0] != NO_BACK))
    return float(lit.mean())


def pieces(mesh: ShadingMesh) -> list[I64]:
    """Vertices of each smooth piece of some size, largest first, then those of all others."""
    front, back = mesh.faces.astype(np.int64), mesh.back_faces.astype(np.int64)
    both = front[back[:, 0] != NO_BACK], back[back[:, 0] != NO_BACK]
    first = np.concatenate([front[:, 0], front[:, 1], both[0][:, 0], both[1][:, 0], both[1][:, 1]])
    second = np.concatenate([front[:, 1], front[:, 2], both[1][:, 0], both[1][:, 1], both[1][:, 2]])
    label = np.unique(components(len(mesh), first, second), return_inverse=True)[1].reshape(-1)
    area = np.bincount(label, mesh.area.astype(np.float64))
    order = np.argsort(-area, kind="stable")
    large = order[area[order] >= PIECE * area.sum()]
    made = [np.flatnonzero(label == one) for one in large]
    rest = np.flatnonzero(~np.isin(label, large))
    return [*made, rest] if len(rest) else made


def parts(body: Body, services: Services, job: Job) -> list[I64 | None]:
    """Vertices of each source that a body is; None for all of them."""
    found = pieces(body.mesh)
    if len(found) < 2 or own_share(body, services, job) < HOLLOW:
        return [None]
    return [*found]


def piece_of(body: Body, some: I64) -> Body:
    """The body of some of the vertices of another, rising."""
    inside = np.zeros(len(body.mesh), np.bool_)
    inside[some] = True
    back = body.mesh.back_faces[:, 0]
    own = inside[body.mesh.faces[:, 0]] | inside[np.where(back == NO_BACK, body.mesh.faces[:, 0], back)]
    return dataclasses.replace(body, opaque=body.opaque & own, some=some)


__all__ = ["own_share", "parts", "piece_of", "pieces"]
