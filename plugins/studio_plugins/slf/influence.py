"""What rows of a stroke see of all other surfaces, and how much each term of these would change it.

The light that a row p reflects towards its eye is L_p = Σ_j w_pj X(v_j, cell_j): rays j by the cosine and,
where its material is peaked, by its lobes (balance heuristic), w its BRDF times cosine over the rays'
density, and X what the vertex that a ray met sends back along it. X = Σ_t c_t s_t is linear in the
coefficients c of the material's terms, with s_t = m_t E or Σ_k g_k h_k (`transport.gather`). So the
derivatives of L by the coefficients of all regions come from one pass over the rays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.jit import call_address, kernel
from studio_core.kernels.radiance import local_view, surface_frame
from studio_core.scene.nodes import Scene
from studio_core.shading.artifacts import Casters, Surfaces
from studio_core.shading.job import Job
from studio_core.transport.bounces import Light, Surface
from studio_core.transport.exchange import Exchange
from studio_core.transport.lobes import LobeTable, draw_lobes, spread_numbers
from studio_core.transport.operator import RayTransport, Transport
from studio_core.transport.patterns import cosine_pattern, variants_of
from studio_plugins.slf.fixates import Rows

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]
Bools = npt.NDArray[np.bool_]

RAYS, LOBE_RAYS = 2048, 256
SIDES = 2
"""Sets of rays that know nothing of each other: what both say is no noise."""
SEED, LOBE_SEED = 5000, 5100
VARIANTS = 64
CHUNK = 8
INV_PI = 1.0 / np.pi


@dataclass(frozen=True, eq=False)
class Sight:
    """Rays of P rows: met (P, N) vertices, or more than there are where nothing that sends is met; cell
    (P, N) of the way back; weight (P, N, 3) of what comes along.
    """

    met: U32
    cell: U16
    weight: F32
    traced: int

    def hit(self, count: int) -> Bools:
        """(V,) which of the vertices is met at all."""
        found = np.zeros(count, np.bool_)
        found[self.met[self.met < count]] = True
        return found


class Sights:
    """Keeps rays of the vertices that strokes were near to; owned by the compute thread."""

    def __init__(self, services: Services) -> None:
        lobes = LobeTable(services.registry)
        self._sides = [_Side(services, lobes, number) for number in range(SIDES)]

    @property
    def nbytes(self) -> int:
        """Bytes of all that is kept."""
        return sum(side.nbytes for side in self._sides)

    def of(
        self,
        scene: Scene,
        surfaces: Surfaces,
        casters: Casters,
        known: Exchange,
        rows: Rows,
        job: Job,
        sides: int = SIDES,
    ) -> tuple[Sight, ...]:
        """What the rows see now, by each of so many sets of rays; only what is not known is traced."""
        own = self._sides[:sides]
        return tuple(side.of(scene, surfaces, casters, known, rows, job) for side in own)


class _Side:
    """One set of rays."""

    def __init__(self, services: Services, lobes: LobeTable, number: int) -> None:
        self._workers = services.workers
        self._table = Transport(services.workers, cosine_pattern(RAYS, VARIANTS, SEED + number))
        self._lobes = lobes
        self._seed = LOBE_SEED + number
        self._drawn: list[RayTransport] = []

    @property
    def nbytes(self) -> int:
        """Bytes of what is kept."""
        return self._table.nbytes + sum(drawn.nbytes for drawn in self._drawn)

    def of(
        self, scene: Scene, surfaces: Surfaces, casters: Casters, known: Exchange, rows: Rows, job: Job
    ) -> Sight:
        """What the rows see now; only what is not known is traced."""
        mesh, shapes = surfaces.mesh, known.shapes
        wanted = np.zeros(len(mesh), np.bool_)
        wanted[rows.vertex] = True
        traced = self._table.update(surfaces, casters, wanted, job).rays
        where = self._table.row_of[rows.vertex].astype(np.int64)
        hits = self._table.table
        many = RAYS + LOBE_RAYS
        met, cell = np.full((len(rows), many), 0xFFFFFFFF, np.uint32), np.zeros((len(rows), many), np.uint16)
        met[:, :RAYS], cell[:, :RAYS] = hits.vertex[where], hits.cell[where]
        world = np.zeros((len(rows), LOBE_RAYS, 3), np.float32)
        lobes = self._lobes(scene, surfaces.materials, shapes)
        row = known.surface.row
        glossy = np.append(lobes.rows, False)[row[rows.vertex]]
        eyes, of_eye = np.unique(rows.eye, axis=0, return_inverse=True)
        for number in range(len(eyes)):
            own = np.flatnonzero(glossy & (of_eye.reshape(-1) == number))
            own = own[np.unique(rows.vertex[own], return_index=True)[1]]
            if not len(own):
                continue
            if number == len(self._drawn):
                self._drawn.append(RayTransport(self._workers, LOBE_RAYS))
            vertices = rows.vertex[own]
            directions = np.zeros((len(own), LOBE_RAYS, 3), np.float32)
            numbers = spread_numbers(VARIANTS, shapes.width, LOBE_RAYS, self._seed)
            draw_lobes(
                0, len(own), vertices, variants_of(vertices, VARIANTS), mesh.positions, mesh.normals,
                mesh.tangents, row, eyes[number].astype(np.float32), shapes.offset, shapes.data,
                lobes.sampler, lobes.peaked, numbers, directions,
            )  # fmt: skip
            drawn = self._drawn[number]
            traced += drawn.update(surfaces, casters, vertices, directions, job).rays
            every = np.flatnonzero(glossy & (of_eye.reshape(-1) == number))
            at = drawn.row_of[rows.vertex[every]]
            met[every, RAYS:], cell[every, RAYS:] = drawn.table.vertex[at], drawn.table.cell[at]
            world[every] = drawn.directions[at]
        weight = np.zeros((len(rows), many, 3), np.float32)
        variant, eye = self._table.variant[where], rows.eye.astype(np.float32)

        def run(start: int, stop: int) -> None:
            weigh_rays(
                start, stop, rows.vertex, eye, variant, self._table.pattern.directions, world,
                mesh.positions, mesh.normals, mesh.tangents, row, shapes.address, shapes.terms,
                shapes.offset, shapes.data, lobes.density, lobes.peaked, known.surface.coefficients, weight,
            )  # fmt: skip

        self._workers.run(len(rows), CHUNK, run, job)
        return Sight(met, cell, weight, traced)


@kernel
def weigh_rays(
    start: int,
    stop: int,
    vertex: I64,
    eye: F32,
    variant: I32,
    pattern: F32,
    world: F32,
    positions: F32,
    normals: F32,
    tangents: F32,
    row: I32,
    address: I64,
    terms: I64,
    offset: I64,
    data: F32,
    density: I64,
    peaked: Bools,
    coefficients: F32,
    out: F32,
) -> None:
    """out (P, N, 3): Σ_t c_t b_t cosθ / (N_c p_c + N_l p_l) of rows start … stop−1 towards eyes (P, 3).

    First the rays of a pattern's variant (P,), then those along `world` (P, N_l, 3), of which (0, 0, 0) is
    none; as in the gather, p_c = cosθ / π and p_l is what `draw_lobes` draws with.
    """
    cosine, lobes = pattern.shape[1], world.shape[1]
    axes, wo = np.empty((3, 3)), np.empty(3, np.float32)
    wi = np.empty(3 * (cosine + lobes), np.float32)
    values = np.empty(peaked.shape[1] * (cosine + lobes), np.float32)
    mixed = np.empty(cosine + lobes)
    for p in range(start, stop):
        v = vertex[p]
        r = row[v]
        out[p] = 0.0
        if r < 0:
            continue
        own = 0
        for t in range(terms[r]):
            own += 1 if peaked[r, t] else 0
        many = cosine + lobes if own > 0 else cosine
        surface_frame(normals[v], tangents[v], axes)
        local_view(positions[v], eye[p], axes, wo)
        for j in range(many):
            if j < cosine:
                for c in range(3):
                    wi[c * many + j] = pattern[variant[p], j, c]
            else:
                x, y, z = world[p, j - cosine, 0], world[p, j - cosine, 1], world[p, j - cosine, 2]
                for c in range(3):
                    wi[c * many + j] = axes[c, 0] * x + axes[c, 1] * y + axes[c, 2] * z
            mixed[j] = cosine * max(wi[2 * many + j], np.float32(0.0)) * INV_PI
        shape = data[offset[r] :]
        if own > 0:
            call_address(density[r], shape, wo, many, wi, values)
            turn = 0
            for t in range(terms[r]):
                if peaked[r, t]:
                    drawn = (lobes - turn + own - 1) // own
                    turn += 1
                    for j in range(many):
                        mixed[j] += drawn * values[t * many + j]
        call_address(address[r], shape, wo, many, wi, values)
        for t in range(terms[r]):
            for j in range(many):
                up = wi[2 * many + j]
                if up > 0.0 and mixed[j] > 0.0:
                    value = values[t * many + j] * up / mixed[j]
                    for c in range(3):
                        out[p, j, c] += value * coefficients[v, t, c]


@dataclass(frozen=True, eq=False)
class Columns:
    """Of P rows and G regions: by term (P, G, T, 3) what its coefficient 1 would add, and (P, G, 3) what the
    regions send with the coefficients that they have.
    """

    terms: F64
    whole: F64

    def plus(self, other: Columns) -> Columns:
        """Both."""
        return Columns(self.terms + other.terms, self.whole + other.whole)


def columns(
    sight: Sight, region: I32, regions: int, received: Light, surface: Surface, services: Services, job: Job
) -> Columns:
    """Sums over the rays of a sight, by region (V,) (−1: of no interest), from what vertices receive."""
    count, known = len(sight.met), surface.separated
    width = surface.coefficients.shape[1]
    terms = np.zeros((count, regions, width, 3))
    whole = np.zeros((count, regions, 3))

    def run(start: int, stop: int) -> None:
        add_columns(
            start, stop, sight.met, sight.cell, sight.weight, region, received.matte, received.functions,
            surface.coefficients, surface.slot, surface.row, known.matte, known.base, known.count,
            known.first, known.term, known.outgoing, terms, whole,
        )  # fmt: skip

    services.workers.run(count, CHUNK, run, job)
    return Columns(terms, whole)


@kernel
def add_columns(
    start: int,
    stop: int,
    met: U32,
    cell: U16,
    weight: F32,
    region: I32,
    irradiance: F32,
    received: F32,
    coefficients: F32,
    slot: I64,
    row: I32,
    matte: F32,
    base: I64,
    count: I64,
    first: I64,
    term: I32,
    outgoing: F32,
    terms: F64,
    whole: F64,
) -> None:
    """Adds to rows start … stop−1 of terms (P, G, T, 3) and whole (P, G, 3); see `columns`.

    irradiance (V, 3), received (S, 3) = Σ light · h_k; the rest as in `transport.gather`.
    """
    limit = len(region)
    width = min(matte.shape[1], coefficients.shape[1])
    sums = np.zeros((width, 3))
    for p in range(start, stop):
        for j in range(met.shape[1]):
            v = np.int64(met[p, j])
            if v >= limit:
                continue
            g = region[v]
            r = row[v]
            if g < 0 or r < 0 or (weight[p, j, 0] == 0 and weight[p, j, 1] == 0 and weight[p, j, 2] == 0):
                continue
            for t in range(width):
                for c in range(3):
                    sums[t, c] = matte[r, t] * irradiance[v, c]
            source = slot[v]
            if source >= 0:
                its = count[r]
                at = base[r] + np.int64(cell[p, j]) * its
                k = np.int64(0)
                while k < its:  # functions of a term lie together
                    t = term[first[r] + k]
                    red, green, blue = np.float32(0.0), np.float32(0.0), np.float32(0.0)
                    while k < its and term[first[r] + k] == t:
                        share = outgoing[at + k]
                        red += share * received[source + k, 0]
                        green += share * received[source + k, 1]
                        blue += share * received[source + k, 2]
                        k += 1
                    sums[t, 0] += red
                    sums[t, 1] += green
                    sums[t, 2] += blue
            for t in range(width):
                for c in range(3):
                    value = weight[p, j, c] * sums[t, c]
                    terms[p, g, t, c] += value
                    whole[p, g, c] += value * coefficients[v, t, c]


__all__ = ["Columns", "Sight", "Sights", "add_columns", "columns", "weigh_rays"]
