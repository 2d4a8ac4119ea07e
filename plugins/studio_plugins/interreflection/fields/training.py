"""What an object looks like under point lights around it (section 5.2, figure 2): columns to learn from.

Compact objects are lit from places spread evenly over their bounding sphere, enlarged by `SPHERE`: where the
object touches the sphere itself a light would be as near as nothing, and its 1/d² all that is learnt. Plates
are lit from a grid over each side. A column is L_k (equation 3) of one light: V h_k(ω) cosθ / d² at every
vertex, shadows of the object on itself in it; all columns weigh the same.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.kernels.raycast import RayCaster
from studio_core.kernels.visibility import occlusion_rays
from studio_core.shading.job import Job
from studio_core.transport.cells import PARTS, RINGS
from studio_plugins.interreflection.fields.body import Body
from studio_plugins.interreflection.fields.lattice import Lattice

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

SPHERE = 1.6
HEIGHT = 0.35
"""Of lights over a plate, in halves of its length."""


def light_places(lattice: Lattice, count: int) -> F64:
    """(M, 3) lights about an object in its own frame; of a plate, shared by its sides."""
    if not lattice.flat:
        i = np.arange(count)
        z = 1 - (2 * i + 1) / count
        turn, flat = i * (math.pi * (3 - math.sqrt(5))), np.sqrt(1 - z * z)
        sphere = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
        return lattice.centre + SPHERE * lattice.radius * sphere
    across, along = lattice.lengths[3], lattice.lengths[4]
    each = count / lattice.sides
    first = max(round(math.sqrt(each * across / along)), 1)
    second = max(round(each / first), 1)
    s, t = (((np.arange(n) + 0.5) / n * 2 - 1) for n in (first, second))
    b, a = np.meshgrid(t * along, s * across, indexing="ij")
    height = HEIGHT * lattice.radius + lattice.lengths[5]
    places = np.stack([a.ravel(), b.ravel(), np.full(a.size, height)], axis=1)
    mirrored = places * np.array([1.0, 1.0, -1.0])
    every = np.concatenate([places, mirrored][: lattice.sides])
    return np.asarray(lattice.centre + every @ lattice.axes)


def lit(
    body: Body, caster: RayCaster, lights: npt.ArrayLike, services: Services, job: Job
) -> tuple[F32, F32]:
    """Irradiance (P, M) of the body's vertices under each light alone, and L_k (P, M, K) of its functions.

    lights (M, 3) in the object's frame, each of unit intensity.
    """
    mesh, places, own = body.mesh, np.asarray(lights, np.float64).reshape(-1, 3), body.vertices
    targets = np.column_stack([places, np.ones(len(places))])
    points = mesh.positions[own].astype(np.float64)
    seen = occlusion_rays(
        caster,
        points,
        mesh.normals[own],
        targets,
        services.workers,
        job,
        geometric_normals=mesh.geometric[own],
        inset=mesh.inset[own],
    )
    normals, along = mesh.normals[own].astype(np.float64), mesh.tangents[own, :3].astype(np.float64)
    across = np.cross(normals, along) * mesh.tangents[own, 3:]
    reflection, row = body.reflection, body.reflection.row[own]
    irradiance = np.zeros(seen.shape, np.float32)
    glossy = np.zeros((*seen.shape, reflection.incoming.shape[1]), np.float32)
    step = max(1, (1 << 18) // max(len(places), 1))
    for start in range(0, len(points), step):
        job.checkpoint(start, len(points))
        some = slice(start, start + step)
        way = places - points[some, None]
        distance = np.maximum(np.linalg.norm(way, axis=2), 1e-9)
        way /= distance[..., None]
        cosine = np.einsum("vmc,vc->vm", way, normals[some])
        given = np.where(seen[some], np.maximum(cosine, 0.0), 0.0) / distance**2
        irradiance[some] = given
        if glossy.shape[2]:
            x = np.einsum("vmc,vc->vm", way, along[some])
            y = np.einsum("vmc,vc->vm", way, across[some])
            found = reflection.incoming[row[some][:, None], :, cells_of(x, y, cosine)]
            glossy[some] = given[..., None] * found
    return irradiance, glossy


def cells_of(x: F64, y: F64, z: F64) -> I64:
    """`transport.cells.cell_of` of many directions."""
    ring = np.arccos(np.clip(z, 0.0, 1.0)) * (RINGS / (math.pi / 2))
    turn = np.arctan2(y, x) * (PARTS / (2 * math.pi))
    turn = np.where(turn < 0, turn + PARTS, turn)
    rings, parts = (np.minimum(v.astype(np.int64), n - 1) for v, n in ((ring, RINGS), (turn, PARTS)))
    return np.asarray(rings * PARTS + parts)


def columns(body: Body, irradiance: F32, glossy: F32) -> F32:
    """(P, C) all that is to be learnt, each column of the same mean square over the surface; dark ones go."""
    parts = [irradiance] if body.reflection.matte else []
    parts += [glossy[:, :, k] for k in range(glossy.shape[2])]
    every = np.concatenate(parts, axis=1) if parts else irradiance[:, :0]
    area = body.mesh.area[body.vertices].astype(np.float64)
    size = np.sqrt(area @ every.astype(np.float64) ** 2 / max(area.sum(), 1e-300))
    bright = size > 1e-9 * size.max(initial=0.0)
    return np.asarray(every[:, bright] / size[bright].astype(np.float32))


__all__ = ["cells_of", "columns", "light_places", "lit"]
