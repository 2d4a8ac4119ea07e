"""Lamps and suns as traced layers: a node for every sample of a lamp that a vertex sees.

What a vertex sees of a lamp is traced again only when the vertex or the lamp has moved, or when something
that moved was or is between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.radiance import surface_frame
from studio_core.kernels.raycast import RayCaster
from studio_core.kernels.visibility import occlusion_rays
from studio_core.parallel import Workers
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Lamp
from studio_core.shading.job import Job
from studio_core.shading.lamps import lamp_light, lamp_targets
from studio_plugins.cuts.nodes import NodeBlock, NodeTable, starts
from studio_plugins.cuts.store import VisibilityStore

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

RAYS_A_BLOCK = 1 << 16
_NOTHING, _COARSE, _EXACT = 0, 1, 2


@dataclass(frozen=True)
class Source:
    """What gives light: targets (Q, 4) of shadow rays (see `occlusion_rays`), and either the lamp that
    they are on or the irradiance (Q, 3) that each gives to a surface facing it."""

    targets: F64
    lamp: Lamp | None = None
    irradiance: F32 | None = None

    def light(self, positions: F64) -> tuple[F32, F32, F32]:
        """Unit directions (P, Q, 3), weight (P, Q) and colour (Q, 3) at world positions (P, 3)."""
        if self.lamp is not None:
            towards, weight = lamp_light(self.lamp, self.targets, positions)
            return towards, weight, np.ones((len(self.targets), 3), np.float32)
        shape = (len(positions), len(self.targets))
        towards = np.broadcast_to(self.targets[:, :3].astype(np.float32), (*shape, 3))
        assert self.irradiance is not None
        return np.ascontiguousarray(towards), np.ones(shape, np.float32), self.irradiance

    @property
    def middle(self) -> tuple[F64, float, bool]:
        """Middle and radius of where rays go, and whether it is a place (else a direction)."""
        ends = self.targets[:, :3]
        middle = ends.mean(axis=0)
        return middle, float(np.linalg.norm(ends - middle, axis=1).max()), bool(self.targets[0, 3] > 0)


@kernel
def lamp_nodes(
    points: I64,
    normals: F32,
    tangents: F32,
    glossy: Bools,
    towards: F32,
    weight: F32,
    colour: F32,
    seen: Bools,
    irradiance: F32,
    out: F32,
    nodes: I64,
) -> int:
    """Nodes of the seen samples of each point, one for all where it is not glossy; their floats in `out`."""
    axes = np.empty((3, 3))
    samples = weight.shape[1]
    place = 0
    for row in range(len(points)):
        p = points[row]
        surface_frame(normals[p], tangents[p], axes)
        total = np.zeros(3)
        count = 0
        for q in range(samples):
            d = towards[row, q]
            z = axes[2, 0] * d[0] + axes[2, 1] * d[1] + axes[2, 2] * d[2]
            if seen[row, q] and z > 0.0 and weight[row, q] > 0.0:
                count += 1
                for c in range(3):
                    total[c] += weight[row, q] * z * colour[q, c]
        irradiance[p, 0], irradiance[p, 1], irradiance[p, 2] = total[0], total[1], total[2]
        if count > 0 and not glossy[p]:
            out[place], out[place + 1], out[place + 2] = 0.0, 0.0, 1.0
            out[place + 3], out[place + 4], out[place + 5] = total[0], total[1], total[2]
            count = 1
        elif count > 0:
            at = place
            for q in range(samples):
                d = towards[row, q]
                z = axes[2, 0] * d[0] + axes[2, 1] * d[1] + axes[2, 2] * d[2]
                if seen[row, q] and z > 0.0 and weight[row, q] > 0.0:
                    out[at] = axes[0, 0] * d[0] + axes[0, 1] * d[1] + axes[0, 2] * d[2]
                    out[at + count] = axes[1, 0] * d[0] + axes[1, 1] * d[1] + axes[1, 2] * d[2]
                    out[at + 2 * count] = z
                    for c in range(3):
                        out[at + (3 + c) * count] = weight[row, q] * z * colour[q, c]
                    at += 1
        nodes[row] = count
        place += 6 * count
    return place


class LampCache:
    """What vertices see of one lamp or of the suns; owned by the compute thread."""

    def __init__(self, workers: Workers) -> None:
        self.table = NodeTable(0)
        self._workers = workers
        self._generation = 0
        self._store: VisibilityStore | None = None
        self._source: Source | None = None
        self._state = np.zeros(0, np.int8)
        self._glossy = np.zeros(0, np.bool_)

    @property
    def settled(self) -> Bools:
        """(V,) vertices that were looked at as finely as asked for."""
        return np.asarray(self._state == _EXACT)

    def forget(self, points: Bools | slice = slice(None)) -> None:
        """These vertices have to be looked at again."""
        self._state[points] = _NOTHING

    def follow(self, source: Source, store: VisibilityStore) -> None:
        """Turn to this light and to the vertices of a store."""
        if store is not self._store or store.generation != self._generation:
            count = len(store.exact.start)
            state, glossy = self._state, self._glossy
            self._state, self._glossy = np.zeros(count, np.int8), np.zeros(count, np.bool_)
            if store is self._store and store.generation == self._generation + 1:
                kept = np.flatnonzero(store.gone_to >= 0)
                to = store.gone_to[kept]
                self._state[to], self._glossy[to] = state[kept], glossy[kept]
                self.table = self.table.renumbered(count, store.gone_to)
            else:
                self.table = self.table.resized(count)
            self._store, self._generation = store, store.generation
        if self._source is None or not _equal(self._source, source):
            self.forget()
        self._source = source

    def gather(
        self,
        mesh: WorldMesh,
        caster: RayCaster,
        points: I64,
        glossy: Bools,
        coarse: Source | None,
        job: Job,
    ) -> int:
        """Traces those of the points that need it, to the samples of `coarse` when given; how many."""
        assert self._source is not None
        source = coarse or self._source
        enough = _COARSE if coarse is not None else _EXACT
        fresh = (self._state[points] >= enough) & (self._glossy[points] | ~glossy[points])
        todo = points[~fresh]
        blocks = []
        step = max(1, RAYS_A_BLOCK // len(source.targets))
        for first in range(0, len(todo), step):
            job.checkpoint(first, len(todo))
            block = todo[first : first + step]
            positions = mesh.positions[block] + mesh.origin
            towards, weight, colour = source.light(positions)
            seen = occlusion_rays(
                caster,
                positions,
                mesh.normals[block],
                source.targets,
                self._workers,
                job,
                geometric_normals=mesh.geometric[block],
                inset=mesh.inset[block],
            )
            out = np.empty(6 * weight.size, np.float32)
            nodes = np.zeros(len(block), np.int64)
            length = lamp_nodes(
                block,
                mesh.normals,
                mesh.tangents,
                glossy,
                towards,
                weight,
                colour,
                seen,
                self.table.irradiance,
                out,
                nodes,
            )
            blocks.append(NodeBlock(block, starts(nodes), out[:length].copy()))
        if blocks:
            self.table.replace(blocks)
            self._state[todo] = enough
            self._glossy[todo] = glossy[todo]
        return len(todo)

    def shadowed_by(self, positions: F64, centre: F64, radius: float) -> Bools:
        """(P,) whether something within a sphere may stand between world positions (P, 3) and the light."""
        assert self._source is not None
        return shadowed(positions, self._source, centre, radius)


def shadowed(positions: F64, source: Source, centre: F64, radius: float) -> Bools:
    """(P,) whether a sphere may stand between positions (P, 3) and a light.

    All rays to the light lie in balls of radius t·spread about position + t·way, 0 ≤ t ≤ 1 (t ≥ 0 for a
    direction). One of them meets the sphere where |position + t·way − centre| ≤ radius + t·spread, squared:
    a·t² − 2b·t + c ≤ 0.
    """
    middle, spread, place = source.middle
    radius += 1e-6 * (1 + radius)
    way = middle - positions if place else np.broadcast_to(middle, positions.shape)
    off = centre - positions
    a = (way * way).sum(axis=1) - spread**2
    b = (off * way).sum(axis=1) + radius * spread
    c = (off * off).sum(axis=1) - radius**2
    lowest = np.maximum(b / np.where(a > 0, a, 1.0), 0.0)
    if place:
        ends = np.minimum(c, a - 2 * b + c)
        lowest = np.minimum(lowest, 1.0)
    else:
        ends = np.where(a > 0, c, -1.0)  # lights all around: anything may be in the way
    inside = a * lowest**2 - 2 * b * lowest + c
    return np.asarray(np.where(a > 0, np.minimum(inside, ends), ends) <= 0)


def lamp_source(lamp: Lamp, samples: int) -> Source:
    """A lamp of the scene, looked at in so many places."""
    return Source(lamp_targets(lamp, samples), lamp)


def sphere(mesh: WorldMesh, index: int) -> tuple[F64, float]:
    """Middle and radius in the world of an object's shading vertices."""
    own = mesh.positions[mesh.vertices_of(index)].astype(np.float64)
    if not len(own):
        return mesh.origin, 0.0
    middle = (own.min(axis=0) + own.max(axis=0)) / 2
    return middle + mesh.origin, float(np.linalg.norm(own - middle, axis=1).max())


def _equal(a: Source, b: Source) -> bool:
    if not np.array_equal(a.targets, b.targets) or not _equal_arrays(a.irradiance, b.irradiance):
        return False
    if a.lamp is None or b.lamp is None:
        return a.lamp is b.lamp
    cones = [(lamp.kind, lamp.cos_cone, lamp.cos_inner) for lamp in (a.lamp, b.lamp)]
    names = ("axis", "across", "up")
    return cones[0] == cones[1] and all(
        np.array_equal(getattr(a.lamp, name), getattr(b.lamp, name)) for name in names
    )


def _equal_arrays(a: F32 | None, b: F32 | None) -> bool:
    if a is None or b is None:
        return a is b
    return np.array_equal(a, b)
