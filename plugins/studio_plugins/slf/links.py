"""The paper's visibility index h: what every element sees in each of its cells (section 6.1).

Rays are those of `studio_core.transport.operator`, one in each cell of `transport.cells` in the element's own
frame, at a random place of it: there is nothing to resample afterwards, and what the lobes' operators take is
what the rays bring. A hit names the linked element's cell of the direction back; open rays a row of the
environment.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.directions import leaf_of
from studio_core.kernels.radiance import surface_frame
from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.world_mesh import WorldMesh
from studio_core.transport.cells import (
    CELLS,
    PARTS,
    RINGS,
    cell_directions,
    cell_of,
    cell_projected_angles,
)
from studio_core.transport.hits import GONE, NOTHING
from studio_core.transport.operator import Transport
from studio_core.transport.patterns import Pattern
from studio_plugins.slf.elements import Elements
from studio_plugins.slf.skylight import DIRECTIONS, FINENESS, size_of_ring

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U32 = npt.NDArray[np.uint32]

VARIANTS = 64
CHUNK = 64


@functools.cache
def cell_pattern() -> Pattern:
    """Ray i lies in cell i, anywhere in it by projected angle; in VARIANTS ways."""
    rng = np.random.default_rng(8)
    ring, part = np.divmod(np.arange(CELLS), PARTS)
    u, v = rng.random((2, VARIANTS, CELLS))
    edges = np.cos(np.arange(RINGS + 1) * (math.pi / 2 / RINGS)) ** 2
    up = np.sqrt(edges[ring] + u * (edges[ring + 1] - edges[ring]))
    turn = (part + v) * (2 * math.pi / PARTS)
    away = np.sqrt(np.maximum(1 - up * up, 0))
    made = np.stack([away * np.cos(turn), away * np.sin(turn), up], axis=2)
    return Pattern.of(made, cell_projected_angles())


def frames_of(mesh: WorldMesh, vertices: I64) -> F32:
    """(N, 3, 3) of vertices: tangent, bitangent, normal, by row; in the world."""
    made = np.empty((len(vertices), 3, 3), np.float64)
    _frames(mesh.normals, mesh.tangents, vertices, made)
    return made.astype(np.float32)


def links(
    mesh: WorldMesh,
    elements: Elements,
    traced: Transport,
    frames: F32,
    black: int,
    workers: Workers,
    job: Checkpoints | None = None,
) -> U32:
    """(E, CELLS) the row of a `LightField` that each element sees in each cell; `traced` is up to date."""
    made = np.empty((len(elements), CELLS), np.uint32)
    rows = traced.row_of[elements.vertex].astype(np.int64)
    middles, sizes = cell_directions(), np.repeat(size_of_ring(), PARTS)
    pattern, table = traced.pattern.directions, traced.table

    def body(start: int, stop: int) -> None:
        link(
            start,
            stop,
            rows,
            traced.variant,
            table.vertex,
            elements.owner,
            frames,
            pattern,
            middles,
            sizes,
            black,
            made,
        )

    workers.run(len(elements), CHUNK, body, job)
    return made


@kernel
def _frames(normals: F32, tangents: F32, vertices: I64, out: F64) -> None:
    for i in range(len(vertices)):
        surface_frame(normals[vertices[i]], tangents[vertices[i]], out[i])


@kernel
def link(
    start: int,
    stop: int,
    rows: I64,
    variant: I32,
    hit_vertex: U32,
    owner: I32,
    frames: F32,
    pattern: F32,
    middles: F32,
    sizes: I64,
    black: int,
    out: U32,
) -> None:
    """See `links`; rows (E,) of the table, variant (R,), sizes (CELLS,) of the environment's averages."""
    count = len(rows)
    for e in range(start, stop):
        row = rows[e]
        own = variant[row]
        tx, ty, tz = frames[e, 0, 0], frames[e, 0, 1], frames[e, 0, 2]
        bx, by, bz = frames[e, 1, 0], frames[e, 1, 1], frames[e, 1, 2]
        nx, ny, nz = frames[e, 2, 0], frames[e, 2, 1], frames[e, 2, 2]
        for ray in range(hit_vertex.shape[1]):
            vertex = np.int64(hit_vertex[row, ray])
            if vertex == NOTHING:
                x, y, z = middles[ray, 0], middles[ray, 1], middles[ray, 2]
                leaf = leaf_of(
                    tx * x + bx * y + nx * z, ty * x + by * y + ny * z, tz * x + bz * y + nz * z, FINENESS
                )
                out[e, ray] = count * CELLS + sizes[ray] * DIRECTIONS + leaf
                continue
            other = np.int64(-1)
            if vertex < GONE:
                other = np.int64(owner[vertex])
            if other < 0:
                out[e, ray] = black
                continue
            x, y, z = pattern[own, ray, 0], pattern[own, ray, 1], pattern[own, ray, 2]
            wx, wy, wz = tx * x + bx * y + nx * z, ty * x + by * y + ny * z, tz * x + bz * y + nz * z
            u = frames[other, 0, 0] * wx + frames[other, 0, 1] * wy + frames[other, 0, 2] * wz
            v = frames[other, 1, 0] * wx + frames[other, 1, 1] * wy + frames[other, 1, 2] * wz
            w = frames[other, 2, 0] * wx + frames[other, 2, 1] * wy + frames[other, 2, 2] * wz
            out[e, ray] = other * CELLS + cell_of(-u, -v, -w)


__all__ = ["cell_pattern", "frames_of", "links"]
