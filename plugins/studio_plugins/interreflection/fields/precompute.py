"""The fields of equation 5: what light every g_k(ω_o) Ψ_i(x) sends to every place of a lattice.

From each place rays go into the cone that holds the object, evenly spread; what they meet of the object
alone, seen from the side it is met at, gives the radiance they carry; the sum of radiance times harmonics
times the rays' solid angle is the place's vector. Insides of closed parts are black, and places that meet
little else are blind: they take over what lies outward of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.jit import kernel
from studio_core.kernels.packets import OPAQUE
from studio_core.kernels.radiance import surface_frame
from studio_core.kernels.raycast import RayCaster
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.shading.job import Job
from studio_core.transport.cells import cell_of
from studio_plugins.interreflection.fields.bases import Basis
from studio_plugins.interreflection.fields.body import Body
from studio_plugins.interreflection.fields.harmonics import harmonics
from studio_plugins.interreflection.fields.lattice import Lattice, fill_blind

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
U32 = npt.NDArray[np.uint32]

BLIND = 0.5
"""Share of a place's rays that meets the inside of a closed part, from which on it is blind."""
PLACES = 256  # traced at a time
_GOLDEN = math.pi * (3 - math.sqrt(5))


@dataclass(frozen=True, eq=False)
class Field:
    """Fields of one object: values (functions · N, P, bands²), of function k and component i number k·N + i.

    They are multiplied with `Lattice.grown`, and in the object's own frame.
    """

    lattice: Lattice
    basis: Basis
    values: F32
    bands: int

    @property
    def nbytes(self) -> int:
        """Bytes of what is kept."""
        return int(self.values.nbytes + self.basis.functions.nbytes)


def cones(lattice: Lattice) -> tuple[F64, F64]:
    """Axis (P, 3), in the object's frame, and cosine (P,) of a cone from each place that holds the object."""
    places = lattice.places()
    middle, reach = np.zeros(3), lattice.radius
    if lattice.flat:
        reach = float(np.linalg.norm(lattice.lengths[3:6] / np.array([1.2, 1.2, 1.0])))
    way = middle - places
    distance = np.maximum(np.linalg.norm(way, axis=1), 1e-30)
    outside = distance > reach * (1 + 1e-6)
    cosine = np.where(outside, np.sqrt(np.maximum(1 - (reach / distance) ** 2, 0.0)), -1.0)
    axis = way / distance[:, None]
    if lattice.flat:
        low = cosine < 0
        axis[low] = np.stack([0 * places[low, 2], 0 * places[low, 2], -np.sign(places[low, 2])], axis=1)
        cosine = np.maximum(cosine, 0.0)
    return axis @ lattice.axes, cosine


def precomputed(
    body: Body,
    caster: RayCaster,
    lattice: Lattice,
    basis: Basis,
    rays: int,
    bands: int,
    services: Services,
    job: Job,
) -> Field:
    """The fields of a body (its `caster` knows it alone), by so many rays from each place."""
    mesh, reflection = body.mesh, body.reflection
    points, count = lattice.points(), len(lattice)
    axis, cosine = cones(lattice)
    values = np.zeros((reflection.functions * len(basis), count, bands * bands), np.float32)
    black = np.zeros(count)
    for start in range(0, count, PLACES):
        stop = min(start + PLACES, count)
        directions = _spread(axis[start:stop], cosine[start:stop], rays, start)
        origins = np.repeat(points[start:stop], rays, axis=0)
        hits = caster.closest(origins, directions, 0.0, np.inf, services.workers, job, mask=OPAQUE)
        gather = partial(
            accumulate,
            place=start,
            rays=rays,
            bands=bands,
            directions=directions,
            solid=2 * math.pi * (1 - cosine[start:stop]) / rays,
            face=hits.face,
            u=hits.u,
            v=hits.v,
            front=hits.front,
            faces=mesh.faces,
            back_faces=mesh.back_faces,
            normals=mesh.normals,
            tangents=mesh.tangents,
            row=reflection.row,
            matte=reflection.matte,
            outgoing=reflection.outgoing,
            functions=basis.functions,
            out=values,
            black=black,
        )
        services.workers.run(stop - start, 16, gather, job)
    fill_blind(lattice, black > BLIND, values)
    values *= lattice.grown().astype(np.float32)[None, :, None]
    return Field(lattice, basis, values, bands)


def _spread(axis: F64, cosine: F64, rays: int, number: int) -> F32:
    """(P · rays, 3) directions evenly over cones, turned differently at each place."""
    i = np.arange(rays)
    z = 1 - (1 - cosine[:, None]) * ((i + 0.5) / rays)
    turn = i * _GOLDEN + (number + np.arange(len(axis)))[:, None] * 2.399963
    flat = np.sqrt(np.maximum(1 - z * z, 0.0))
    other = np.where(np.abs(axis[:, :1]) < 0.7, np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 1.0, 0.0]]))
    right = np.cross(axis, other)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    up = np.cross(axis, right)
    x, y = flat * np.cos(turn), flat * np.sin(turn)
    made = x[..., None] * right[:, None] + y[..., None] * up[:, None] + z[..., None] * axis[:, None]
    return np.asarray(made.reshape(-1, 3), np.float32)


@kernel
def accumulate(
    start: int,
    stop: int,
    place: int,
    rays: int,
    bands: int,
    directions: F32,
    solid: F64,
    face: npt.NDArray[np.int32],
    u: F32,
    v: F32,
    front: npt.NDArray[np.bool_],
    faces: U32,
    back_faces: U32,
    normals: F32,
    tangents: F32,
    row: I64,
    matte: bool,
    outgoing: F32,
    functions: F32,
    out: F32,
    black: F64,
) -> None:
    """Adds what rays of places start … stop meet to out (J, P, bands²); `place` is the first one's number."""
    components, size = functions.shape[1], bands * bands
    glossy = outgoing.shape[1]
    first = 1 if matte else 0
    total = (first + glossy) * components
    sent = np.empty(total, np.float32)
    shape = np.empty(size)
    sums = np.empty((size, total), np.float32)
    axes = np.empty((3, 3))
    for p in range(start, stop):
        sums[:] = 0.0
        lost = 0
        for ray in range(p * rays, (p + 1) * rays):
            hit = face[ray]
            if hit < 0:
                continue
            corners = faces[hit] if front[ray] else back_faces[hit]
            if corners[0] == NO_BACK:
                lost += 1
                continue
            x, y, z = directions[ray, 0], directions[ray, 1], directions[ray, 2]
            sent[:] = 0.0
            for c in range(3):
                vertex = corners[c]
                share = u[ray] if c == 1 else (v[ray] if c == 2 else np.float32(1.0) - u[ray] - v[ray])
                if matte:
                    for i in range(components):
                        sent[i] += share * functions[vertex, i]
                if glossy:
                    surface_frame(normals[vertex], tangents[vertex], axes)
                    cell = cell_of(
                        -(axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z),
                        -(axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z),
                        -(axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z),
                    )
                    for k in range(glossy):
                        g = share * outgoing[row[vertex], k, cell]
                        if g != 0.0:
                            at = (first + k) * components
                            for i in range(components):
                                sent[at + i] += g * functions[vertex, i]
            harmonics(x, y, z, bands, shape)
            for s in range(size):
                weight = np.float32(shape[s] * solid[p])
                for j in range(total):
                    sums[s, j] += weight * sent[j]
        for j in range(total):
            for s in range(size):
                out[j, place + p, s] = sums[s, j]
        black[place + p] = lost / rays


__all__ = ["Field", "accumulate", "cones", "precomputed"]
