"""Sums over receivers' rays for one setting of mesh, BRDFs and eye; see `final`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from studio_core.parallel import Workers
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Shapes
from studio_core.shading.job import Job
from studio_core.shading.tilting import Facing
from studio_core.transport.bounces import Light, Surface
from studio_plugins.interreflection.gather.final import add_flat_terms, gather_final
from studio_plugins.interreflection.gather.lobe_rays import Drawn

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]
CHUNK = 1 << 9
NO_RAYS = np.zeros((0, 0, 3), np.float32)
UNTOLD = np.zeros((0, 0), np.float32)
Hear: TypeAlias = Callable[[I64, F32], object]
"""Is told of vertices (C,), and the light (C, N) along their rays, colours summed."""


class Rays(NamedTuple):
    """Rays of rows (R,) of receivers: what they met (R, N), and how far away; directions as in
    `final.gather_final`.
    """

    rows: I64
    row_of: I32
    variant: I32
    vertex: U32
    cell: U16
    distance: npt.NDArray[np.float16]
    pattern: F32
    world: F32


class Sending(NamedTuple):
    """What vertices send, and by which functions: as in `transport.gather`."""

    matte: F32
    slot: I64
    base: I64
    each: I64
    outgoing: F32
    functions: F32

    @classmethod
    def of(cls, light: Light, surface: Surface) -> Sending:
        """Of all vertices of a mesh."""
        known = surface.separated
        return cls(light.matte, surface.slot, known.base, known.count, known.outgoing, light.functions)

    @classmethod
    def along_rays(cls, light: F32) -> Sending:
        """Of light (K, 3) that comes along each of K rays, which are the vertices that they meet."""
        nothing, zero = np.zeros(0, np.float32), np.zeros(1, np.int64)
        return cls(light, np.full(len(light), -1, np.int64), zero, zero, nothing, nothing)


@dataclass(frozen=True, eq=False)
class Collector:
    """Mesh, BRDFs, eye (3,) relative to the mesh's origin; how many rays by the cosine there are in all."""

    mesh: WorldMesh
    shapes: Shapes
    flat: F32
    eye: F32
    lobes: Drawn
    cosine_rays: int
    workers: Workers
    job: Job

    @property
    def row(self) -> I32:
        """(V,) rows of BRDFs."""
        return self.shapes.rows(self.mesh)

    def add(
        self,
        rays: Rays,
        sending: Sending,
        needed: I64,
        way: Facing,
        terms: F32,
        irradiance: F32,
        hear: Hear | None = None,
    ) -> None:
        """Adds terms that are not flat (V, T, 3), and irradiance (V, 3), of the needed vertices.

        `hear` is told of the light along their rays, of some vertices at a time and from any thread.
        """
        which = rays.row_of[needed].astype(np.int64)
        which = which[which >= 0]
        mesh, shapes, row, lobes = self.mesh, self.shapes, self.row, self.lobes

        def run(start: int, stop: int) -> None:
            along = UNTOLD if hear is None else np.empty((stop - start, rays.vertex.shape[1]), np.float32)
            gather_final(
                start,
                stop,
                float(self.cosine_rays),
                lobes.count,
                which,
                rays.rows,
                rays.variant,
                rays.vertex,
                rays.cell,
                rays.pattern,
                rays.world,
                mesh.positions,
                mesh.normals,
                mesh.tangents,
                way.mesh.normals,
                way.mesh.tangents,
                row,
                self.eye,
                shapes.address,
                shapes.terms,
                shapes.offset,
                shapes.data,
                lobes.lobes.density,
                lobes.lobes.peaked,
                self.flat,
                *sending,
                terms,
                irradiance,
                along,
            )
            if hear is not None:
                hear(rays.rows[which[start:stop]], along)

        self.workers.run(len(which), CHUNK, run, self.job)

    def add_flat(self, needed: I64, terms: F32, irradiance: F32) -> None:
        """Adds the flat terms of the needed vertices, which are irradiance times their value."""
        row, flat = self.row, self.flat

        def run(start: int, stop: int) -> None:
            add_flat_terms(start, stop, needed, row, flat, irradiance, terms)

        self.workers.run(len(needed), CHUNK, run, self.job)
