"""What vertices would receive with other lobes: light as it is, weighed by functions of tried shapes.

A gather keeps of what arrives only sums over the functions of the materials that are there. What a region
would send were it duller or sharper needs the sums over other functions: of lamps and environment from kept
bits, of other surfaces from kept rays, for those vertices alone that somebody asks about.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.parallel import Workers
from studio_core.shading.artifacts import Shapes, Surfaces
from studio_core.shading.job import Job
from studio_core.transport.bounces import Light, Surface, ray_cells, sent_towards
from studio_core.transport.exchange import Exchange
from studio_core.transport.gather import MOST, uncover
from studio_core.transport.separable import Separated

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U16 = npt.NDArray[np.uint16]
Bools = npt.NDArray[np.bool_]
CHUNK = 1 << 9


@dataclass(frozen=True, eq=False)
class _Along:
    """Light (n, N, 3) along the kept rays of some vertices (n,); cells (n, N) of the rays at these."""

    vertices: I64
    cells: U16
    light: F32


class Arrivals:
    """Light that arrives at `some` (V,) vertices, and at those that stand in for covered ones among them."""

    def __init__(
        self, known: Exchange, surfaces: Surfaces, some: Bools, workers: Workers, job: Job | None = None
    ) -> None:
        self._known, self._surfaces = known, surfaces
        self._workers, self._job = workers, job
        covered, self.some = known.surface.covered, some.copy()
        if covered is not None:
            others = covered.others[some[covered.vertices]]
            self.some[others[others >= 0]] = True
        sent = known.sources.before or known.sources.light
        self._along: list[_Along] = []
        self._many = np.zeros(len(some), np.float32)
        for table in known.tables:
            own = np.flatnonzero(self.some[table.rows])
            vertices, hits = table.rows[own], table.table
            met, cell = hits.vertex[own], hits.cell[own]
            light = np.zeros((*met.shape, 3), np.float32)
            lit = met < len(some)
            light[lit] = sent_towards(
                sent, known.surface, met[lit].astype(np.int64), cell[lit].astype(np.int64), workers, job
            )
            self._along.append(_Along(vertices, ray_cells(table.pattern)[table.variant[own]], light))
            self._many[vertices] += hits.rays

    def weighed(
        self, shapes: Shapes, row: I32, separated: Separated, coefficients: F32
    ) -> tuple[Light, Surface]:
        """Irradiance and sums over the functions of row (V,) of `separated`, −1: none; and how it is sent on.

        Nothing is known of vertices that were not asked for.
        """
        row = np.where(self.some, row, -1).astype(np.int32)
        shaped = dataclasses.replace(shapes, row=row)
        irradiance, slot, functions = self._known.straight.sums(
            self._surfaces, shaped, separated, self._known.lights, self.some, self._job
        )
        scale = np.asarray(np.pi / np.maximum(self._many, 1), np.float32)
        for along in self._along:

            def run(start: int, stop: int, along: _Along = along) -> None:
                add_received(
                    start, stop, along.vertices, along.cells, along.light, scale, slot, row, separated.base,
                    separated.count, separated.incoming, irradiance, functions,
                )  # fmt: skip

            self._workers.run(len(along.vertices), CHUNK, run, self._job)
        covered = self._known.surface.covered
        if covered is not None:
            which = np.flatnonzero(self.some[covered.vertices])
            uncover(
                0, len(which), covered.vertices[which], covered.others[which], covered.weights[which],
                slot, row, separated.count, irradiance, functions,
            )  # fmt: skip
        made = Surface(row, slot, len(functions), coefficients, separated)
        return Light(irradiance, functions), made


@kernel
def add_received(
    start: int,
    stop: int,
    vertices: I64,
    cells: U16,
    light: F32,
    scale: F32,
    slot: I64,
    row: I32,
    base: I64,
    count: I64,
    incoming: F32,
    irradiance: F32,
    received: F32,
) -> None:
    """Adds to vertices[start:stop] irradiance (V, 3), and received (S, 3) = Σ light · h_k, of kept rays.

    light (n, N, 3) comes along rays from cells (n, N); each weighs scale (V,). As `transport.gather_bounce`.
    """
    sums = np.zeros((3, MOST), np.float32)
    for i in range(start, stop):
        v = vertices[i]
        first = slot[v]
        many, own = np.int64(0), np.int64(0)
        if first >= 0:
            many, own = np.int64(min(count[row[v]], MOST)), base[row[v]]
        for k in range(many):
            sums[0, k] = sums[1, k] = sums[2, k] = np.float32(0.0)
        red, green, blue = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for j in range(light.shape[1]):
            r, g, b = light[i, j, 0], light[i, j, 1], light[i, j, 2]
            red += r
            green += g
            blue += b
            at = own + np.int64(cells[i, j]) * many
            for k in range(many):
                weight = incoming[at + k]
                sums[0, k] += weight * r
                sums[1, k] += weight * g
                sums[2, k] += weight * b
        each = scale[v]
        irradiance[v, 0] += red * each
        irradiance[v, 1] += green * each
        irradiance[v, 2] += blue * each
        for k in range(many):
            received[first + k, 0] += sums[0, k] * each
            received[first + k, 1] += sums[1, k] * each
            received[first + k, 2] += sums[2, k] * each


__all__ = ["Arrivals", "add_received"]
