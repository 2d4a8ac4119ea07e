"""Rays of receivers that go on by path tracing: what comes along them, less what vertices tell."""

from __future__ import annotations

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
from studio_plugins.interreflection.gather.collecting import Rays

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

AT_ONCE = 1 << 17  # paths
CHUNK = 1 << 11


@dataclass(frozen=True, eq=False)
class Follower:
    """Follows rays on through one state of the scene."""

    mesh: WorldMesh
    world: PathWorld
    sources: Sources
    surface: Surface
    workers: Workers
    job: Job

    def __call__(self, rays: Rays, row: I64, ray: I64, turn: I64, seed: int) -> F32:
        """(K, 3): along rays (K,) `ray` of rows `row`, what a path finds less what vertices tell.

        A ray may be named several times: `turn` (K,) tells its paths apart.
        """
        mesh, found = self.mesh, np.zeros((len(row), 3), np.float32)
        used = np.unique(rays.rows[row])
        origins = np.zeros((len(mesh.positions), 3), np.float32)
        places = mesh.positions[used] + mesh.origin
        origins[used] = lifted(self.world.casters.primary, places, mesh.geometric[used], mesh.inset[used])
        for first in range(0, len(row), AT_ONCE):
            self.job.checkpoint(first, len(row))
            part = slice(first, min(first + AT_ONCE, len(row)))
            found[part] = self._along(rays, row[part], ray[part], turn[part], seed, origins)
        told = (rays.vertex[row, ray].astype(np.int64), rays.cell[row, ray].astype(np.int64))
        found -= sent_towards(self.sources.light, self.surface, *told, self.workers, self.job)
        return found

    def _along(self, rays: Rays, row: I64, ray: I64, turn: I64, seed: int, origins: F32) -> F32:
        workers, job, mesh, caster = self.workers, self.job, self.mesh, self.world.casters.primary
        paths = Paths.of(len(row))
        frames = (mesh.normals, mesh.tangents)
        drawn = (rays.rows, rays.variant, rays.pattern, rays.world, *frames)

        def begin(start: int, stop: int) -> None:
            begin_near(start, stop, seed, row, ray, turn, *drawn, origins, paths)

        workers.run(len(row), CHUNK, begin, job)
        active = np.arange(len(row))
        self._meet(active, False, paths)
        active = active[paths.material >= 0]
        self._light(active, paths)
        active = active[paths.material[active] >= 0]
        caster.count(len(row) + len(active))
        self._meet(active, True, paths)
        active = active[paths.material[active] >= 0]
        if self.sources.before is not None:
            cell = np.empty(len(active), np.int64)

            def look_back(start: int, stop: int) -> None:
                cells_back(start, stop, active, *frames, paths.vertex, paths.direction, cell)

            workers.run(len(active), CHUNK, look_back, job)
            met = paths.vertex[active].astype(np.int64)
            sent = sent_towards(self.sources.before, self.surface, met, cell, workers, job)
            paths.radiance[active] += paths.throughput[active] * sent
        return paths.radiance

    def _meet(self, active: I64, escapes: bool, paths: Paths) -> None:
        world = self.world

        def run(start: int, stop: int) -> None:
            follow_paths(start, stop, active, escapes, False, world.tracer, world.mesh, world.lights, paths)

        self.workers.run(len(active), CHUNK, run, self.job)

    def _light(self, active: I64, paths: Paths) -> None:
        world, shapes = self.world, self.world.shapes
        if shapes.row is not None:
            shapes = world.shapes_at(paths.material[active], paths.uv[active], paths.vertex[active])
            assert shapes.row is not None
            paths.row[active] = shapes.row
        lit: Any = (world.tracer, world.looks, world.models, shapes.offset, shapes.data, world.lights, paths)

        def run(start: int, stop: int) -> None:
            light_paths(start, stop, active, False, False, *lit)

        self.workers.run(len(active), CHUNK, run, self.job)


@kernel
def begin_near(
    start: int,
    stop: int,
    seed: int,
    row: I64,
    ray: I64,
    turn: I64,
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
        paths.random[n] = seeded(seed + turn[n], v, ray[n])
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
