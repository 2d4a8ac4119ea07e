"""A filter within each object: irradiance that few rays found, shared among neighbours.

Indirect light changes over a surface about as fast as the surfaces around are near, so a neighbour counts by
its distance in parts of the harmonic mean of the rays' lengths (Ward, Rubinstein & Clear 1988), by how alike
the normals are, and only where its rays were about as long and met no insides: behind a cabinet that touches
the wall, vertices see the cabinet from within, and would darken the wall beside it.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.parallel import Workers
from studio_core.scene.shading_mesh import ShadingMesh
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.job import Job
from studio_core.transport.hits import HitTable

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
U16 = npt.NDArray[np.uint16]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

NEIGHBOURS = 24
REACH = 0.15  # of the harmonic mean length of a receiver's rays, with 64 of them
INSIDE = 0.2  # share of rays that meet insides, above which a receiver is no neighbour
ALIKE = 2.0  # largest ratio of two neighbours' harmonic means
UPRIGHT = 0.8  # cosine of normals below which vertices are no neighbours
CHUNK = 1 << 11


def nearest(mesh: ShadingMesh) -> I32:
    """(V, NEIGHBOURS) the nearest other vertices of the same side and material; −1 where there are fewer.

    Distances count normals too: vertices at one place on two sides of a crease are not neighbours.
    """
    from scipy.spatial import cKDTree

    count = len(mesh)
    size = float(np.linalg.norm(np.ptp(mesh.positions, axis=0))) if count else 0.0
    apart = [mesh.normals, mesh.slot[:, None].astype(np.float32)]
    places = np.concatenate([mesh.positions, *(size * other for other in apart)], axis=1)
    tree = cKDTree(places)
    wanted = min(NEIGHBOURS + 1, count)
    found = np.full((count, NEIGHBOURS), -1, np.int32)
    if wanted > 1:
        _, index = tree.query(places, k=wanted, workers=-1)
        other = index != np.arange(count)[:, None]
        other[other.all(axis=1), -1] = False  # more vertices at one place than neighbours
        found[:, : wanted - 1] = index[other].reshape(count, wanted - 1)
    return found


class Neighbours:
    """Nearest vertices within each object of a world mesh; by shading mesh, so instances share them."""

    def __init__(self) -> None:
        self._parts: tuple[ShadingMesh, ...] = ()
        self._starts: Mapping[int, int] = {}
        self._joined = np.zeros((0, NEIGHBOURS), np.int32)

    def __call__(self, mesh: WorldMesh) -> I32:
        """(V, NEIGHBOURS) vertices of the world mesh, −1: none."""
        parts = tuple(placed.mesh for placed in mesh.objects)
        if [*map(id, self._parts)] == [*map(id, parts)]:
            return self._joined
        made = np.empty((len(mesh), NEIGHBOURS), np.int32)
        starts: dict[int, int] = {}
        for part, start in zip(parts, mesh.vertex_offsets[:-1].tolist(), strict=True):
            if id(part) in starts:
                own = _shifted(made, starts[id(part)], start, len(part))
            elif id(part) in self._starts:
                own = _shifted(self._joined, self._starts[id(part)], start, len(part))
            else:
                own = nearest(part)
                own[own >= 0] += np.int32(start)
            made[start : start + len(part)] = own
            starts[id(part)] = start
        self._parts, self._starts, self._joined = parts, starts, made
        return made

    @property
    def nbytes(self) -> int:
        """Bytes of what is kept."""
        return self._joined.nbytes


def _shifted(table: I32, before: int, now: int, count: int) -> I32:
    """Rows of an object that starts elsewhere now."""
    own = table[before : before + count]
    return np.where(own >= 0, own + np.int32(now - before), np.int32(-1))


@kernel
def share_light(
    start: int,
    stop: int,
    reach: float,
    which: I64,
    rows: I64,
    position_of: I32,
    wanted: Bools,
    neighbours: I32,
    positions: F32,
    normals: F32,
    length: F32,
    inside: F32,
    irradiance: F32,
    out: F32,
) -> None:
    """out (V, 3) of receivers rows[which[start:stop]] from irradiance (V, 3), known where `wanted` (V,).

    position_of (V,) is where a vertex stands in rows, or −1: no receiver; length (R,) the harmonic means of
    rays' lengths; inside (R,) the shares that met insides. Neighbours count (1 − d / (reach · length)).
    """
    for n in range(start, stop):
        i = which[n]
        v = rows[i]
        red, green, blue = float(irradiance[v, 0]), float(irradiance[v, 1]), float(irradiance[v, 2])
        total = 1.0
        radius = reach * length[i]
        if inside[i] <= INSIDE and radius > 0.0:
            for k in range(neighbours.shape[1]):
                u = neighbours[v, k]
                if u < 0:
                    break
                j = position_of[u]
                if j < 0 or not wanted[u] or inside[j] > INSIDE:
                    continue
                if length[j] > ALIKE * length[i] or length[i] > ALIKE * length[j]:
                    continue
                alike = (
                    normals[u, 0] * normals[v, 0]
                    + normals[u, 1] * normals[v, 1]
                    + normals[u, 2] * normals[v, 2]
                )
                if alike <= UPRIGHT:
                    continue
                dx = float(positions[u, 0]) - float(positions[v, 0])
                dy = float(positions[u, 1]) - float(positions[v, 1])
                dz = float(positions[u, 2]) - float(positions[v, 2])
                near = 1.0 - np.sqrt(dx * dx + dy * dy + dz * dz) / radius
                if near <= 0.0:
                    continue
                weight = near * (alike - UPRIGHT) / (1.0 - UPRIGHT)
                red += weight * irradiance[u, 0]
                green += weight * irradiance[u, 1]
                blue += weight * irradiance[u, 2]
                total += weight
        out[v, 0], out[v, 1], out[v, 2] = red / total, green / total, blue / total


class KeptReceivers(Protocol):
    """Which vertices have kept rays: `rows` (R,), where each vertex stands in it, `row_of` (V,), or −1."""

    @property
    def rows(self) -> I64:
        """(R,)."""
        ...

    @property
    def row_of(self) -> I32:
        """(V,)."""
        ...

    @property
    def table(self) -> HitTable:
        """Hits."""
        ...

    @property
    def share_back(self) -> F32:
        """(R,) share of rays that met insides."""
        ...


@functools.cache
def _nearness() -> F32:
    """(2^16,) 1 / distance by the bits of float16; 0 of what is infinitely far."""
    with np.errstate(invalid="ignore"):
        length = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float64)
    known = length >= 0  # neither negative nor no number
    return np.where(known, 1 / np.maximum(np.where(known, length, 1), 1e-6), 0).astype(np.float32)


@kernel
def harmonic_means(start: int, stop: int, bits: U16, nearness: F32, out: F32) -> None:
    """out (R,) of rows start … stop−1: of the rays that met something, the harmonic mean length; else inf."""
    for i in range(start, stop):
        met, near = 0, np.float32(0.0)
        for j in range(bits.shape[1]):
            one = nearness[bits[i, j]]
            near += one
            met += 1 if one > 0 else 0
        out[i] = met / near if near > 0 else np.inf


@dataclass(frozen=True, eq=False)
class Spacing:
    """Of rows of receivers (R,): harmonic mean length of their rays, and the share that met insides."""

    length: F32
    inside: F32

    @classmethod
    def of(cls, kept: KeptReceivers, workers: Workers, job: Job | None = None) -> Spacing:
        """From kept hits."""
        bits, length = kept.table.distance.view(np.uint16), np.empty(len(kept.rows), np.float32)

        def run(start: int, stop: int) -> None:
            harmonic_means(start, stop, bits, _nearness(), length)

        workers.run(len(length), CHUNK, run, job)
        return cls(length, kept.share_back)


def smoothed(
    irradiance: F32,
    receivers: KeptReceivers,
    wanted: Bools,
    spacing: Spacing,
    mesh: WorldMesh,
    neighbours: I32,
    rays: int,
    workers: Workers,
    job: Job | None = None,
) -> F32:
    """Irradiance (V, 3) of the wanted vertices, filtered the less the more rays found it."""
    out = irradiance.copy()
    reach = REACH * (64 / max(rays, 1)) ** 0.25
    which = np.asarray(receivers.row_of[np.flatnonzero(wanted)], np.int64)

    def run(start: int, stop: int) -> None:
        share_light(
            start,
            stop,
            reach,
            which,
            receivers.rows,
            receivers.row_of,
            wanted,
            neighbours,
            mesh.positions,
            mesh.normals,
            spacing.length,
            spacing.inside,
            irradiance,
            out,
        )

    workers.run(len(which), CHUNK, run, job)
    return out
