"""How much light that a surface sends matters to a stroke by way of others: importance, carried backwards.

What row p of a stroke sees changes with a region's material at once, along its own rays (`influence`), and
by way of all that this region lights. For that the importance of what vertices send is carried from the
rows back over the kept rays, once for each bounce (the adjoint of `transport.gather.gather_bounce`): one
pass for all regions and all parameters. On this way shine counts as if it went everywhere alike. Importance
is carried for a few groups of rows; in a group, what comes from far differs little from row to row.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Shapes, Surfaces
from studio_core.shading.job import Job
from studio_core.transport.bounces import Surface
from studio_core.transport.cells import CELLS, cell_projected_angles
from studio_core.transport.exchange import Exchange
from studio_core.transport.hits import BLACK, gather_matte
from studio_core.transport.separable import Separated
from studio_plugins.slf.fixates import Rows, nearest_chosen
from studio_plugins.slf.influence import Columns, Sight

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]

GROUPS = 8
MOST_BOUNCES = 8
"""So often importance is carried where light goes on until it settles."""


def term_albedos(separated: Separated) -> F64:
    """(R, T) what each term with coefficient 1 sends back in all, of light from everywhere."""
    angles = cell_projected_angles().astype(np.float64)
    made = separated.matte.astype(np.float64) * np.pi
    for start in np.unique(separated.base[separated.count > 0]).tolist():
        rows = np.flatnonzero((separated.base == start) & (separated.count > 0))
        incoming, outgoing, term = separated.functions(int(rows[0]))
        each = (angles @ incoming.reshape(CELLS, -1)) * (angles @ outgoing.reshape(CELLS, -1)) / np.pi
        made[rows] += np.bincount(term, each, made.shape[1])
    return made


def groups_of(rows: Rows, mesh: WorldMesh) -> tuple[I64, F64]:
    """(P,) the group of each row, of one stroke and one side of a surface, all about as far across as others;
    and (P, K) how much each group counts for a row: those near it.
    """
    places = mesh.positions[rows.vertex].astype(np.float64)
    size = max(float(np.ptp(places, axis=0).max(initial=0.0)), 1e-6)
    apart = np.concatenate([mesh.normals[rows.vertex] * (2 * size), 10 * size * rows.stroke[:, None]], axis=1)
    points = np.concatenate([places, apart], axis=1)
    group = nearest_chosen(points, GROUPS + int(rows.stroke.max(initial=0)))
    group = np.unique(group, return_inverse=True)[1].reshape(-1)
    count = np.bincount(group)
    middle = np.stack([np.bincount(group, column) for column in points.T], axis=1) / count[:, None]
    away = ((points[:, None] - middle[None]) ** 2).sum(axis=2)
    share = 1 / (away + 1e-4 * size**2) ** 2
    return group, np.asarray(share / share.sum(axis=1, keepdims=True))


class Importance:
    """What vertices receive, times how much what they send of it matters to the means of K groups of rows.

    Beyond what the rows see themselves. With n bounces, light that takes m more of them on its way to a row
    had at most n − m before; `matter` (V, K, 3) is the sum over m.
    """

    def __init__(
        self, known: Exchange, surfaces: Surfaces, sights: Sequence[Sight], rows: Rows, job: Job | None
    ) -> None:
        group, self._share = groups_of(rows, surfaces.mesh)
        count, surface = len(known.surface.row), known.surface
        many = int(group.max(initial=-1)) + 1
        size = np.bincount(group, minlength=many)
        total = np.mean([sight.weight.sum(axis=1, dtype=np.float64) for sight in sights], axis=0)
        mean = np.stack([np.bincount(group, total[:, c], many) / size for c in range(3)], axis=1)
        self._ratio = total[:, None] / np.maximum(mean, 1e-30)  # (P, K, 3)
        self.albedos = term_albedos(surface.separated)
        reflects = self._reflects(surface)
        rays = np.zeros(count, np.float32)
        for table in known.tables:
            rays[table.rows] += table.table.rays
        bounces = MOST_BOUNCES if known.bounces is None else known.bounces
        irradiance = _irradiance(known, surfaces, reflects, rays, bounces, job)
        sent = np.zeros((count, many, 3), np.float32)
        share = (1 / (size * len(sights))).astype(np.float32)
        for sight in sights:
            spread_first(sight.met, sight.weight, group, share, sent)
        self.matter = np.zeros_like(sent)
        for step in range(1, bounces):
            before, sent = sent, np.zeros_like(sent)
            for table in known.tables:
                carry_back(table.rows, table.table.vertex, reflects, rays, before, sent)
            self.matter += sent * irradiance[bounces - 1 - step][:, None]

    def _reflects(self, surface: Surface) -> F32:
        """(V, 3) of irradiance, all terms together."""
        width = min(self.albedos.shape[1], surface.coefficients.shape[1])
        known = surface.row >= 0
        own = self.albedos[np.where(known, surface.row, 0), :width, None] * known[:, None, None]
        made = np.einsum("vtc,vtc->vc", own, surface.coefficients[:, :width])
        return np.asarray(made, np.float32)

    def of(self, region: I32, regions: int, surface: Surface, albedos: F64) -> Columns:
        """Columns of what comes by way of others; albedos (R, T) are of the rows of the surface."""
        count, width = self.matter.shape[1], surface.coefficients.shape[1]
        terms, whole = np.zeros((count, regions, width, 3)), np.zeros((count, regions, 3))
        sum_regions(region, surface.row, albedos / np.pi, surface.coefficients, self.matter, terms, whole)
        share = self._share[..., None] * self._ratio
        return Columns(np.einsum("pkc,kgtc->pgtc", share, terms), np.einsum("pkc,kgc->pgc", share, whole))


class _WithoutFunctions:
    """For sums of irradiance alone."""

    def __init__(self, shapes: Shapes) -> None:
        self.count = self.base = np.zeros(len(shapes.address), np.int64)
        self.incoming = np.zeros(0, np.float32)


def _irradiance(
    known: Exchange, surfaces: Surfaces, reflects: F32, rays: F32, bounces: int, job: Job | None
) -> list[F32]:
    """(V, 3) after 1 … `bounces` bounces, all matte."""
    straight = known.straight.sums(
        surfaces, known.shapes, _WithoutFunctions(known.shapes), known.lights, None, job
    ).irradiance
    made = [straight]
    for _ in range(bounces - 1):
        radiance = reflects * made[-1]
        more = np.zeros_like(straight)
        for table in known.tables:
            mean = np.zeros((len(table.rows), 3), np.float32)
            gather_matte(0, len(table.rows), np.arange(len(table.rows)), table.table.vertex, radiance, mean)
            more[table.rows] += mean * (table.table.rays / rays[table.rows])[:, None]
        made.append(straight + more)
    return made


@kernel
def spread_first(met: U32, weight: F32, group: I64, share: F32, out: F32) -> None:
    """Adds to out (V, K, 3) what light along rays (P, N) weighs in the means of the rows' groups (P,)."""
    for p in range(len(met)):
        g = group[p]
        for j in range(met.shape[1]):
            v = np.int64(met[p, j])
            if v < len(out):
                for c in range(3):
                    out[v, g, c] += share[g] * weight[p, j, c]


@kernel
def sum_regions(
    region: I32, row: I32, albedos: F64, coefficients: F32, matter: F32, terms: F64, whole: F64
) -> None:
    """Adds to terms (K, G, T, 3) matter (V, K, 3) times albedos (R, T), by region (V,); to whole (K, G, 3)
    that times coefficients (V, T, 3).
    """
    width = min(albedos.shape[1], terms.shape[2])
    for v in range(len(region)):
        g, r = region[v], row[v]
        if g < 0 or r < 0:
            continue
        for t in range(width):
            for k in range(matter.shape[1]):
                for c in range(3):
                    value = matter[v, k, c] * albedos[r, t]
                    terms[k, g, t, c] += value
                    whole[k, g, c] += value * coefficients[v, t, c]


@kernel
def carry_back(rows: I64, hit_vertex: U32, reflects: F32, rays: F32, sent: F32, out: F32) -> None:
    """Adds to out (V, K, 3) the importance of what the hits of rows (R,) send: that of what the receivers
    send (V, K, 3), times what these reflect (V, 3), in equal parts of their `rays` (V,).
    """
    groups = sent.shape[1]
    each = np.empty((groups, 3), np.float32)
    for i in range(len(rows)):
        u = rows[i]
        total = np.float32(0.0)
        for k in range(groups):
            for c in range(3):
                each[k, c] = sent[u, k, c] * reflects[u, c] / rays[u]
                total += each[k, c]
        if total <= 0.0:
            continue
        for j in range(hit_vertex.shape[1]):
            v = np.int64(hit_vertex[i, j])
            if v >= BLACK:
                continue
            for k in range(groups):
                for c in range(3):
                    out[v, k, c] += each[k, c]


__all__ = ["GROUPS", "Importance", "carry_back", "groups_of", "spread_first", "sum_regions", "term_albedos"]
