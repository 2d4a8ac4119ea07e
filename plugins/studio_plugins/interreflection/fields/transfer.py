"""Light from objects to the vertices of others: fields times weights, looked up, and received.

`combined` makes of an object's fields and weights (equation 5) what arrives at every place of its lattice, as
coefficients of harmonics in the world's frame. `arriving` looks that up at vertices of other objects, between
eight places. `receivers` are the vertices' own vectors: the cosine lobe and h_k times the cosine, turned to
the world, so that irradiance and the next bounce's L_k (equation 3) are inner products.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.jit import kernel
from studio_core.kernels.radiance import surface_frame
from studio_core.scene.transform import Transform, rotation_matrix
from studio_core.shading.artifacts import ShadingPoints
from studio_core.shading.job import Job
from studio_core.transport.cells import cell_directions, cell_projected_angles
from studio_plugins.interreflection.fields.harmonics import (
    cosine_lobe,
    harmonics,
    harmonics_of,
    probes,
    rotations,
)
from studio_plugins.interreflection.fields.lattice import NEIGHBOURS, Lattice, neighbours
from studio_plugins.interreflection.fields.precompute import Field

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

POINTS = 256


def combined(field: Field, weights: F64, transform: Transform) -> F32:
    """(P, bands², 3) grown light at the lattice's places, in the world's frame; weights (J, 3)."""
    count, size = field.values.shape[1:]
    flat = field.values.reshape(len(field.values), count * size)
    local = (weights.T.astype(np.float32) @ flat).reshape(3, count, size)
    turn = rotations(rotation_matrix(transform.rotation), field.bands)[0].astype(np.float32)
    return np.ascontiguousarray(np.moveaxis(local @ turn.T, 0, 2))


def into_lattice(lattice: Lattice, transform: Transform, origin: F64) -> F64:
    """(3, 4) from points relative to `origin`, in the world, into the lattice's frame."""
    turn = rotation_matrix(transform.rotation)
    linear = lattice.axes @ turn.T / transform.scale
    shift = linear @ (origin - np.array(transform.translation)) - lattice.axes @ lattice.centre
    return np.column_stack([linear, shift])


@kernel
def _look_up(
    start: int,
    stop: int,
    points: I64,
    positions: F32,
    owner: I32,
    source: int,
    way: F64,
    numbers: I64,
    lengths: F64,
    light: F32,
    out: F32,
) -> None:
    """Adds light (P, D) of one source at points[start:stop] that are not its own to out (len(points), D)."""
    index, weight = np.empty(NEIGHBOURS, np.int64), np.empty(NEIGHBOURS)
    for item in range(start, stop):
        vertex = points[item]
        if owner[vertex] == source:
            continue
        px, py, pz = positions[vertex, 0], positions[vertex, 1], positions[vertex, 2]
        x = way[0, 0] * px + way[0, 1] * py + way[0, 2] * pz + way[0, 3]
        y = way[1, 0] * px + way[1, 1] * py + way[1, 2] * pz + way[1, 3]
        z = way[2, 0] * px + way[2, 1] * py + way[2, 2] * pz + way[2, 3]
        neighbours(x, y, z, numbers, lengths, index, weight)
        for corner in range(NEIGHBOURS):
            share, place = np.float32(weight[corner]), index[corner]
            for j in range(light.shape[1]):
                out[item, j] += share * light[place, j]


class Sources:
    """What all objects send out at once: combined fields and where they are."""

    def __init__(self, owner: I32, positions: F32, origin: F64) -> None:
        self._owner, self._positions, self._origin = owner, positions, origin
        self._items: list[tuple[int, F64, Lattice, F32]] = []

    def add(self, index: int, lattice: Lattice, transform: Transform, light: F32) -> None:
        """Light (P, bands², 3) of an object, as `combined` has it."""
        way = into_lattice(lattice, transform, self._origin)
        self._items.append((index, way, lattice, light.reshape(len(light), -1)))

    def plus(self, others: Sources) -> Sources:
        """The same objects' light and that of others together, at the same places."""
        made = Sources(self._owner, self._positions, self._origin)
        theirs = {index: light for index, _, _, light in others._items}
        for index, way, lattice, light in self._items:
            made._items.append((index, way, lattice, light + theirs.get(index, np.float32(0))))
        known = {index for index, *_ in self._items}
        made._items += [item for item in others._items if item[0] not in known]
        return made

    def arriving(self, points: I64, bands: int, services: Services, job: Job) -> F32:
        """(len(points), bands², 3) light that arrives at some vertices from all other objects."""
        made = np.zeros((len(points), bands * bands * 3), np.float32)

        def run(start: int, stop: int) -> None:
            for index, way, lattice, light in self._items:
                given = (points, self._positions, self._owner, index, way, lattice.numbers, lattice.lengths)
                _look_up(start, stop, *given, light, made)

        services.workers.run(len(points), POINTS, run, job)
        return made.reshape(len(points), bands * bands, 3)


def receiving_rows(incoming: F32, bands: int) -> F32:
    """(R, 1 + K, bands²) in a surface's own frame: the cosine lobe, then h_k times the cosine.

    incoming (R, K, CELLS).
    """
    shape = harmonics_of(cell_directions(), bands) * cell_projected_angles()[:, None]
    up = harmonics_of([(0.0, 0.0, 1.0)], bands)[0] * cosine_lobe(bands)
    made = np.empty((len(incoming), 1 + incoming.shape[1], bands * bands), np.float32)
    made[:, 0] = up
    made[:, 1:] = incoming @ shape.astype(np.float32)
    return made


@kernel
def _turned(
    start: int,
    stop: int,
    points: I64,
    normals: F32,
    tangents: F32,
    row: I32,
    parts: F64,
    probes: F64,
    bands: int,
    out: F32,
) -> None:
    """out (len(points), 1 + K, bands²) of points[start:stop], whose row has parts (1 + K, Q) of probes."""
    axes, world = np.empty((3, 3)), np.empty(bands * bands)
    sums = np.empty((out.shape[1], bands * bands))
    for item in range(start, stop):
        vertex = points[item]
        own = row[vertex]
        sums[:] = 0.0
        surface_frame(normals[vertex], tangents[vertex], axes)
        for q in range(len(probes)):
            x, y, z = probes[q, 0], probes[q, 1], probes[q, 2]
            harmonics(
                axes[0, 0] * x + axes[1, 0] * y + axes[2, 0] * z,
                axes[0, 1] * x + axes[1, 1] * y + axes[2, 1] * z,
                axes[0, 2] * x + axes[1, 2] * y + axes[2, 2] * z,
                bands,
                world,
            )
            for k in range(out.shape[1]):
                part = parts[own, k, q]
                for s in range(len(world)):
                    sums[k, s] += part * world[s]
        for k in range(out.shape[1]):
            for s in range(len(world)):
                out[item, k, s] = sums[k, s]


def receivers(
    points: ShadingPoints, some: I64, row: I32, rows: F32, bands: int, services: Services, job: Job
) -> F32:
    """(len(some), 1 + K, bands²) vectors of vertices in the world's frame; `rows` of `receiving_rows`.

    With L the vertex' arriving light, vector · L is its irradiance, then its L_k. row (V,) of each vertex.
    """
    directions, inverse = probes(bands)
    parts = rows.astype(np.float64) @ inverse
    made = np.empty((len(some), rows.shape[1], bands * bands), np.float32)

    def run(start: int, stop: int) -> None:
        _turned(start, stop, some, points.normals, points.tangents, row, parts, directions, bands, made)

    services.workers.run(len(some), POINTS, run, job)
    return made


@kernel
def received(start: int, stop: int, vectors: F32, light: F32, out: F32) -> None:
    """out (P, 1 + K, 3) = vectors (P, 1 + K, bands²) · light (P, bands², 3), for start … stop."""
    for item in range(start, stop):
        for k in range(vectors.shape[1]):
            red = green = blue = np.float32(0.0)
            for s in range(vectors.shape[2]):
                weight = vectors[item, k, s]
                red += weight * light[item, s, 0]
                green += weight * light[item, s, 1]
                blue += weight * light[item, s, 2]
            out[item, k, 0], out[item, k, 1], out[item, k, 2] = red, green, blue


def receive(vectors: F32, light: F32, services: Services, job: Job) -> F32:
    """(P, 1 + K, 3) irradiance, never below 0, and L_k."""
    made = np.empty((len(vectors), vectors.shape[1], 3), np.float32)
    services.workers.run(
        len(vectors), 4 * POINTS, lambda start, stop: received(start, stop, vectors, light, made), job
    )
    np.maximum(made[:, 0], 0.0, out=made[:, 0])
    return made


__all__ = ["Sources", "combined", "into_lattice", "receive", "receivers", "receiving_rows"]
