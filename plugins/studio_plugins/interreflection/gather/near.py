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

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.path_light import light_paths
from studio_core.kernels.path_rays import follow_paths
from studio_core.kernels.path_state import ENDED, Paths, seeded
from studio_core.kernels.radiance import surface_frame
from studio_core.kernels.visibility import lifted
from studio_core.parallel import Workers
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.job import Job
from studio_core.shading.path_world import PathWorld
from studio_core.transport.bounces import Light, Sources, Surface
from studio_core.transport.cells import cell_of
from studio_core.transport.hits import BLACK
from studio_core.transport.operator import Transport

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]

NEAR = 3.0  # rays shorter than so many times the distance of vertices are followed on
AT_ONCE = 1 << 17  # paths
CHUNK = 1 << 11
ZERO = np.float32(0.0)


@dataclass(frozen=True, eq=False)
class Near:
    """Rays (K,) of rows of a table that are followed on, and δ (K, 3) along them."""

    row: I64
    ray: I64
    change: F32


def near_rays(table: Transport, which: I64, spacing: F32) -> tuple[I64, I64]:
    """Rows and rays of rows `which` that end closer than `NEAR` times the spacing (V,) of what they meet."""
    vertex = table.table.vertex[which]
    met = vertex < BLACK
    limit = np.float32(NEAR) * spacing[np.where(met, vertex, 0)]
    found = met & (table.table.distance[which].astype(np.float32) < limit)
    place, ray = np.nonzero(found)
    return which[place], ray.astype(np.int64)


def followed(
    table: Transport,
    rows: I64,
    rays: I64,
    samples: int,
    seed: int,
    mesh: WorldMesh,
    world: PathWorld,
    sources: Sources,
    surface: Surface,
    workers: Workers,
    job: Job,
) -> Near:
    """The rays followed on, each `samples` times."""
    caster = world.casters.primary
    places = mesh.positions + mesh.origin
    own = table.rows[rows]
    used = np.unique(own)
    origin_of = np.zeros((len(mesh.positions), 3), np.float32)
    origin_of[used] = lifted(caster, places[used], mesh.geometric[used], mesh.inset[used])
    change = np.zeros((len(rows), 3), np.float32)
    dark = Light(np.zeros_like(sources.light.matte), np.zeros_like(sources.light.functions))
    beyond, known = sources.before or dark, surface.separated
    tables = (surface.slot, surface.row, known.base, known.count, known.outgoing)
    for sample in range(samples):
        for first in range(0, len(rows), AT_ONCE):
            job.checkpoint(first, len(rows))
            part = slice(first, min(first + AT_ONCE, len(rows)))
            count = part.stop - part.start
            paths = Paths.of(count)
            given = (table.rows, table.variant, table.pattern.directions, mesh.normals, mesh.tangents)

            def begin(start: int, stop: int, part: slice = part, paths: Paths = paths, s: int = sample) -> None:
                begin_near(start, stop, seed + s, rows[part], rays[part], *given, origin_of, paths)

            workers.run(count, CHUNK, begin, job)
            every = np.arange(count)
            _follow(every, False, world, paths, workers, job)
            active = np.flatnonzero(paths.material >= 0)
            _light(active, world, paths, workers, job)
            active = active[paths.material[active] >= 0]
            _follow(active, True, world, paths, workers, job)
            active = active[paths.material[active] >= 0]
            if sources.before is not None:

                def end(start: int, stop: int, active: I64 = active, paths: Paths = paths) -> None:
                    end_near(
                        start, stop, active, mesh.normals, mesh.tangents, beyond.matte, *tables, beyond.functions, paths
                    )

                workers.run(len(active), CHUNK, end, job)
            caster.count(count + len(active))
            change[part] += paths.radiance / np.float32(samples)
    hits = table.table

    def differ(start: int, stop: int) -> None:
        subtract_sent(
            start, stop, rows, rays, hits.vertex, hits.cell, sources.light.matte, *tables, sources.light.functions, change
        )

    workers.run(len(rows), CHUNK, differ, job)
    return Near(rows, rays, change)


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
    normals: F32,
    tangents: F32,
    origins: F32,
    paths: Paths,
) -> None:
    """Paths start … stop−1 along rays `ray` (K,) of rows `row` (K,) of a table; origins (V, 3)."""
    axes = np.empty((3, 3))
    for n in range(start, stop):
        v = rows[row[n]]
        surface_frame(normals[v], tangents[v], axes)
        a = variant[row[n]]
        x, y, z = pattern[a, ray[n], 0], pattern[a, ray[n], 1], pattern[a, ray[n], 2]
        for axis in range(3):
            paths.origin[n, axis] = origins[v, axis]
            paths.direction[n, axis] = axes[0, axis] * x + axes[1, axis] * y + axes[2, axis] * z
            paths.throughput[n, axis] = 1.0
            paths.radiance[n, axis] = 0.0
        paths.density[n] = 0.0
        paths.random[n] = seeded(seed, v, ray[n])
        paths.material[n] = 0


@kernel
def end_near(
    start: int,
    stop: int,
    active: I64,
    normals: F32,
    tangents: F32,
    matte: F32,
    slot: I64,
    row: I32,
    base: I64,
    count: I64,
    outgoing: F32,
    functions: F32,
    paths: Paths,
) -> None:
    """Adds what vertices send to paths active[start:stop] where they ended, and ends them."""
    axes = np.empty((3, 3))
    for i in range(start, stop):
        n = active[i]
        v = np.int64(paths.vertex[n])
        r, g, b = matte[v, 0], matte[v, 1], matte[v, 2]
        source = slot[v]
        if source >= 0:
            surface_frame(normals[v], tangents[v], axes)
            x, y, z = paths.direction[n, 0], paths.direction[n, 1], paths.direction[n, 2]
            cell = cell_of(
                -(axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z),
                -(axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z),
                -(axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z),
            )
            its = count[row[v]]
            at = base[row[v]] + cell * its
            source *= 3
            for k in range(its):
                weight = outgoing[at + k]
                r += weight * functions[source + k]
                g += weight * functions[source + its + k]
                b += weight * functions[source + 2 * its + k]
            r, g, b = max(r, ZERO), max(g, ZERO), max(b, ZERO)
        paths.radiance[n, 0] += paths.throughput[n, 0] * r
        paths.radiance[n, 1] += paths.throughput[n, 1] * g
        paths.radiance[n, 2] += paths.throughput[n, 2] * b
        paths.material[n] = ENDED


@kernel
def subtract_sent(
    start: int,
    stop: int,
    rows: I64,
    rays: I64,
    hit_vertex: U32,
    hit_cell: U16,
    matte: F32,
    slot: I64,
    row: I32,
    base: I64,
    count: I64,
    outgoing: F32,
    functions: F32,
    out: F32,
) -> None:
    """Takes from out (K, 3) what vertices send along the rays start … stop−1."""
    for n in range(start, stop):
        v = np.int64(hit_vertex[rows[n], rays[n]])
        r, g, b = matte[v, 0], matte[v, 1], matte[v, 2]
        source = slot[v]
        if source >= 0:
            its = count[row[v]]
            at = base[row[v]] + np.int64(hit_cell[rows[n], rays[n]]) * its
            source *= 3
            for k in range(its):
                weight = outgoing[at + k]
                r += weight * functions[source + k]
                g += weight * functions[source + its + k]
                b += weight * functions[source + 2 * its + k]
            r, g, b = max(r, ZERO), max(g, ZERO), max(b, ZERO)
        out[n, 0] -= r
        out[n, 1] -= g
        out[n, 2] -= b


def trusted(near: Near, rows: int, rays: int) -> F32:
    """(R,) how much of each row's mean δ is more than its noise: 1 − s² / m², at least 0."""
    light = near.change.mean(axis=1).astype(np.float64)
    total = np.bincount(near.row, light, rows) / rays
    squares = np.bincount(near.row, light**2, rows) / rays
    noise = np.maximum(squares - total**2, 0) / rays
    with np.errstate(divide="ignore", invalid="ignore"):
        share = 1 - noise / total**2
    return np.where(total != 0, np.clip(share, 0, 1), 0).astype(np.float32)
