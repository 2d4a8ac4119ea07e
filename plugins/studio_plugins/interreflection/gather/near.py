"""What is close by, looked at point by point.

What a receiver meets is told by vertices. Where something is as close as vertices are to each other, that is
too coarse: light beside a table's leg, a reflection in the floor right under an edge. There rays are followed
on by the path tracer (`studio_core.kernels.path_light`): light straight from lamps and sky at the very point
that was met, one ray more by the surface's own BRDF, and only at its end what vertices send.

    δ = L_followed − L_vertices

is summed over the rays like the light itself, and added. As it is a difference along the same ray, it has
little noise where vertices tell the truth; what is left of that is taken back where it is more than δ's own
mean (as James & Stein 1961 shrink means).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.path_light import light_paths
from studio_core.kernels.path_rays import follow_paths
from studio_core.kernels.path_state import Paths, seeded
from studio_core.kernels.radiance import surface_frame
from studio_core.kernels.visibility import lifted
from studio_core.parallel import Workers
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.job import Job
from studio_core.shading.path_world import PathWorld
from studio_core.transport.bounces import Sources, Surface, sent_towards
from studio_core.transport.cells import cell_of
from studio_core.transport.hits import BLACK, NOTHING
from studio_plugins.interreflection.gather.collecting import Rays

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]

NEAR, NEAR_SHARP = 3.0, 10.0
"""Rays shorter than so many times the distance of vertices are followed on; to sharp lobes, longer ones."""
SHARP = 0.3  # error of separated lobes
AT_ONCE = 1 << 17  # paths
CHUNK = 1 << 11


@dataclass(frozen=True, eq=False)
class Near:
    """Rays (K,) of rows of a table that are followed on, and δ (K, 3) along them."""

    row: I64
    ray: I64
    change: F32

    def numbered(self, rays: Rays) -> U32:
        """(R, N) which of these a ray is; NOTHING: none."""
        made = np.full(rays.vertex.shape, NOTHING, np.uint32)
        made[self.row, self.ray] = np.arange(len(self.row), dtype=np.uint32)
        return made


def near_rays(rays: Rays, which: I64, area: F32, row: I32, error: F32) -> tuple[I64, I64]:
    """Which rows, and which of their rays, of rows `which` (C,), are to be followed on.

    area (V,) is what each vertex stands for, row (V,) that of its BRDF, and error (R,) how wrong that is as
    products.
    """
    sharp = np.append(error, np.float32(0))[row] > SHARP
    reach = np.where(sharp, np.float32(NEAR_SHARP), np.float32(NEAR)) * np.sqrt(2 * area)
    vertex = rays.vertex[which]
    met = vertex < BLACK
    limit = reach[np.where(met, vertex, 0)]
    found = met & (rays.distance[which].astype(np.float32) < limit)
    place, ray = np.nonzero(found)
    return which[place], ray.astype(np.int64)


def followed(
    rays: Rays,
    row: I64,
    ray: I64,
    samples: int,
    seed: int,
    mesh: WorldMesh,
    world: PathWorld,
    sources: Sources,
    surface: Surface,
    workers: Workers,
    job: Job,
) -> Near:
    """Rays (K,) `ray` of rows `row` followed on, each `samples` times."""
    caster = world.casters.primary
    places = mesh.positions + mesh.origin
    used = np.unique(rays.rows[row])
    origin_of = np.zeros((len(mesh.positions), 3), np.float32)
    origin_of[used] = lifted(caster, places[used], mesh.geometric[used], mesh.inset[used])
    change = np.zeros((len(row), 3), np.float32)
    frames = (mesh.normals, mesh.tangents)
    drawn = (rays.rows, rays.variant, rays.pattern, rays.world, *frames)

    def along(part: slice, number: int) -> F32:
        paths = Paths.of(part.stop - part.start)

        def begin(start: int, stop: int) -> None:
            begin_near(start, stop, number, row[part], ray[part], *drawn, origin_of, paths)

        workers.run(len(paths.material), CHUNK, begin, job)
        active = np.arange(len(paths.material))
        _follow(active, False, world, paths, workers, job)
        active = active[paths.material >= 0]
        _light(active, world, paths, workers, job)
        active = active[paths.material[active] >= 0]
        caster.count(len(paths.material) + len(active))
        _follow(active, True, world, paths, workers, job)
        active = active[paths.material[active] >= 0]
        if sources.before is not None:
            cell = np.empty(len(active), np.int64)

            def look_back(start: int, stop: int) -> None:
                cells_back(start, stop, active, *frames, paths.vertex, paths.direction, cell)

            workers.run(len(active), CHUNK, look_back, job)
            met = paths.vertex[active].astype(np.int64)
            sent = sent_towards(sources.before, surface, met, cell, workers, job)
            paths.radiance[active] += paths.throughput[active] * sent
        return paths.radiance

    for first in range(0, len(row), AT_ONCE):
        part = slice(first, min(first + AT_ONCE, len(row)))
        for sample in range(samples):
            job.checkpoint(first * samples, len(row) * samples)
            change[part] += along(part, seed + sample) / np.float32(samples)
    told = (rays.vertex[row, ray].astype(np.int64), rays.cell[row, ray].astype(np.int64))
    change -= sent_towards(sources.light, surface, *told, workers, job)
    return Near(row, ray, change)


def _follow(active: I64, escapes: bool, world: PathWorld, paths: Paths, workers: Workers, job: Job) -> None:
    def run(start: int, stop: int) -> None:
        follow_paths(start, stop, active, escapes, False, world.tracer, world.mesh, world.lights, paths)

    workers.run(len(active), CHUNK, run, job)


def _light(active: I64, world: PathWorld, paths: Paths, workers: Workers, job: Job) -> None:
    shapes = world.shapes
    if shapes.row is not None:
        shapes = world.shapes_at(paths.material[active], paths.uv[active])
        assert shapes.row is not None
        paths.row[active] = shapes.row
    given: Any = (world.tracer, world.looks, world.models, shapes.offset, shapes.data, world.lights, paths)

    def run(start: int, stop: int) -> None:
        light_paths(start, stop, active, False, False, *given)

    workers.run(len(active), CHUNK, run, job)


@kernel
def begin_near(
    start: int,
    stop: int,
    seed: int,
    row: I64,
    ray: I64,
    rows: I64,
    variant: I32,
    pattern: F32,
    world: F32,
    normals: F32,
    tangents: F32,
    origins: F32,
    paths: Paths,
) -> None:
    """Paths start … stop−1 along rays `ray` (K,) of rows `row` (K,) of a table; origins (V, 3).

    Directions are those of the pattern or, where that is empty, of `world`; see `final.gather_final`.
    """
    axes = np.empty((3, 3))
    drawn = len(world) > 0
    for n in range(start, stop):
        v = rows[row[n]]
        if drawn:
            for axis in range(3):
                paths.direction[n, axis] = world[row[n], ray[n], axis]
        else:
            surface_frame(normals[v], tangents[v], axes)
            a = variant[row[n]]
            x, y, z = pattern[a, ray[n], 0], pattern[a, ray[n], 1], pattern[a, ray[n], 2]
            for axis in range(3):
                paths.direction[n, axis] = axes[0, axis] * x + axes[1, axis] * y + axes[2, axis] * z
        for axis in range(3):
            paths.origin[n, axis] = origins[v, axis]
            paths.throughput[n, axis] = 1.0
            paths.radiance[n, axis] = 0.0
        paths.density[n] = 0.0
        paths.random[n] = seeded(seed, v, ray[n])
        paths.material[n] = 0


@kernel
def cells_back(
    start: int, stop: int, active: I64, normals: F32, tangents: F32, vertex: I32, direction: F32, out: I64
) -> None:
    """out (A,): from which cell of the vertex that was met paths active[start:stop] came."""
    axes = np.empty((3, 3))
    for i in range(start, stop):
        n = active[i]
        v = np.int64(vertex[n])
        surface_frame(normals[v], tangents[v], axes)
        x, y, z = direction[n, 0], direction[n, 1], direction[n, 2]
        out[i] = cell_of(
            -(axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z),
            -(axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z),
            -(axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z),
        )


def trusted(found: Sequence[tuple[Rays, Near]], vertices: int) -> F32:
    """(V,) how much of each receiver's mean δ is more than its noise: 1 − s² / m², at least 0."""
    count, total, squares = np.zeros(vertices), np.zeros(vertices), np.zeros(vertices)
    for rays, near in found:
        light = near.change.mean(axis=1, dtype=np.float64)
        receiver = rays.rows[near.row]
        count[rays.rows] += rays.vertex.shape[1]
        total += np.bincount(receiver, light, vertices)
        squares += np.bincount(receiver, light**2, vertices)
    count = np.maximum(count, 1)
    mean = total / count
    noise = np.maximum(squares / count - mean**2, 0) / count
    with np.errstate(divide="ignore", invalid="ignore"):
        share = 1 - noise / mean**2
    return np.where(mean != 0, np.clip(share, 0, 1), 0).astype(np.float32)
