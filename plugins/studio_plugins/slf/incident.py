"""The light that reaches places: from 1024 directions of the nearest vertex, and from lamps and suns exactly.

The visibility index of section 6.1 is a kept table of hits (`studio_core.transport`): one row for each vertex
that a stroke has been near to, a ray in the middle of each of 32 × 32 cells of equal solid angle. What is met
sends what the light between surfaces says it does; where nothing is met there is the environment, averaged
over the cell. Lamps and suns are no part of that: every place looks at their samples itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.jit import kernel
from studio_core.kernels.directions import leaf_of
from studio_core.parallel import Checkpoints
from studio_core.scene.nodes import Light, Scene
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Lighting
from studio_core.strokes.solution import Lit
from studio_core.transport.bounces import sent_towards
from studio_core.transport.hits import NOTHING
from studio_core.transport.light_bits import LightBits, LitPoints
from studio_core.transport.light_kernels import arriving_from
from studio_core.transport.light_samples import LightSamples, joined, lamp_samples, sun_samples
from studio_core.transport.operator import Transport
from studio_core.transport.patterns import Pattern, grid_pattern
from studio_plugins.slf.places import Places

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
SIDE = 32
LAMP_SAMPLES = 64
MOST = 1024
"""Vertices whose light is kept while they are not asked for: 12 MB."""
OF_QUARTERS, OF_SIXTEENTHS = 13, 15
"""2^k means of the environment are as large as parts of cells are, of which there are 2^11 around."""


@dataclass(frozen=True, eq=False)
class Arriving:
    """Light at N places.

    row (N,) of what follows; light (R, 1024, 3) radiance from the pattern's cells, open (R, 1024) whether
    that is the sky, axes (R, 3, 3) rows t, b, n of the vertices; towards (N, C, 3) world, and strength
    (N, C, 3): irradiance of lamps and suns on what faces them. sky (2^k, 3) is radiance by leaf, the mean
    over a sixteenth of a cell.
    """

    row: I64
    light: F32
    open: Bools
    axes: F32
    towards: F32
    strength: F32
    sky: F32
    rays: int


@dataclass(frozen=True, eq=False)
class _Rows:
    """Of R vertices, in rising order, light and openness (R, 1024), as `Arriving` has them; sky (2^k, 3).

    What it was made from is `key`.
    """

    key: tuple[object, ...]
    vertex: I64
    light: F32
    open: Bools
    sky: F32


class Incident:
    """What vertices near strokes see, kept, and its light while that stays; owned by the compute thread."""

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self.pattern: Pattern = grid_pattern(SIDE)
        self.table = Transport(services.workers, self.pattern)
        self._rows: _Rows | None = None

    def at(self, scene: Scene, lit: Lit, places: Places, job: Checkpoints | None = None) -> Arriving:
        """Light at places, as it is now."""
        rows, rays = self._seen(scene, lit, np.unique(places.vertex), job)
        mesh, row = lit.surfaces.unrefined.mesh, np.searchsorted(rows.vertex, places.vertex)
        towards, strength, more = self._lamps(scene, lit, places, job)
        axes = _axes(mesh, rows.vertex)
        return Arriving(row, rows.light, rows.open, axes, towards, strength, rows.sky, rays + more)

    def _seen(self, scene: Scene, lit: Lit, vertices: I64, job: Checkpoints | None) -> tuple[_Rows, int]:
        """What is seen from vertices, and maybe from others, and how many rays that took."""
        environment, sent = lit.lighting.environment, lit.indirect.sent if lit.indirect else None
        node = scene.nodes.get(environment.id) if environment is not None else None
        shown = node if node is not None and scene.shown(node.id) else None
        key = (lit.surfaces.unrefined.mesh, lit.casters, lit.lighting, sent, shown)
        kept = self._rows
        if kept is not None and not all(one is other for one, other in zip(key, kept.key, strict=True)):
            kept = None
        new = vertices if kept is None else np.setdiff1d(vertices, kept.vertex, assume_unique=True)
        if kept is not None and not len(new):
            return kept, 0
        sky = kept.sky if kept is not None else self._sky(scene, lit.lighting)
        light, open_, rays = self._gathered(lit, new, sky, job)
        made = _Rows(key, new, light, open_, sky)
        if kept is not None:
            some = np.arange(len(kept.vertex))
            if len(some) + len(new) > MOST:
                some = np.flatnonzero(np.isin(kept.vertex, vertices))
            both = np.concatenate([kept.vertex[some], new])
            order = np.argsort(both)
            light = np.concatenate([kept.light[some], light])[order]
            open_ = np.concatenate([kept.open[some], open_])[order]
            made = _Rows(key, both[order], light, open_, sky)
        self._rows = made
        return made, rays

    def _gathered(self, lit: Lit, vertices: I64, sky: F32, job: Checkpoints | None) -> tuple[F32, Bools, int]:
        """Light (R, 1024, 3) and openness (R, 1024) of vertices."""
        surfaces = lit.surfaces.unrefined
        mesh = surfaces.mesh
        wanted = np.zeros(len(mesh), np.bool_)
        wanted[vertices] = True
        done = self.table.update(surfaces, lit.casters, wanted, job)
        where = self.table.row_of[vertices].astype(np.int64)
        met, cell = self.table.table.vertex[where], self.table.table.cell[where]
        light = np.zeros((*met.shape, 3), np.float32)
        known = met < len(mesh)
        if lit.indirect is not None and lit.indirect.sent is not None:
            sent, surface = lit.indirect.sent.light, lit.indirect.sent.surface
            hit, from_ = met[known].astype(np.int64), cell[known].astype(np.int64)
            light[known] = sent_towards(sent, surface, hit, from_, self._workers, None)
        open_ = met == NOTHING
        if len(sky):
            local, axes = self.pattern.directions[0], _axes(mesh, vertices)
            spread, coarse = _offsets(2), averaged(sky, OF_QUARTERS)

            def body(start: int, stop: int) -> None:
                sky_means(axes, local, spread, coarse, open_, light, start, stop)

            self._workers.run(len(axes), 16, body, None)
        return light, open_, done.rays

    def _sky(self, scene: Scene, lighting: Lighting) -> F32:
        tree, environment = lighting.tree, lighting.environment
        if tree is None or environment is None:
            return np.zeros((0, 3), np.float32)
        node = scene.nodes.get(environment.id)
        if not isinstance(node, Light) or not scene.shown(node.id):
            return np.zeros((0, 3), np.float32)
        return averaged(tree.radiance, OF_SIXTEENTHS) * np.asarray(node.gain(), np.float32)

    def _lamps(self, scene: Scene, lit: Lit, places: Places, job: Checkpoints | None) -> tuple[F32, F32, int]:
        lighting, mesh = lit.lighting, lit.surfaces.unrefined.mesh
        parts = [lamp_samples(lamp, LAMP_SAMPLES, 1, 1) for lamp in lighting.lamps]
        if lighting.environment is not None and lighting.sun is not None:
            parts.append(sun_samples(lighting.sun, LAMP_SAMPLES, 1, 1, lighting.environment.id, "sun"))
        samples: LightSamples = joined(parts, 1)
        count = len(samples)
        towards = np.zeros((len(places), count, 3), np.float32)
        strength = np.zeros((len(places), count, 3), np.float32)
        if not count or not len(places):
            return towards, strength, 0
        vertex = places.vertex
        points = LitPoints(
            mesh.origin,
            places.position.astype(np.float32),
            np.ascontiguousarray(places.axes[:, 2], np.float32),
            np.ascontiguousarray(mesh.geometric[vertex]),
            np.ascontiguousarray(mesh.inset[vertex]),
            np.ascontiguousarray(mesh.object[vertex]),
            np.zeros(len(places), np.int32),
        )
        bits = LightBits(self._workers)
        rays, _ = bits.update(points, lit.casters, samples, job)
        lights = {node.id: node for node in scene.of(Light) if scene.shown(node.id)}
        colour = samples.coloured(lights)[0]
        arriving(
            points.positions, samples.kind, samples.relative(mesh.origin)[0], samples.lamp, colour,
            bits.seen, towards, strength,
        )  # fmt: skip
        return towards, strength, rays


def _axes(mesh: WorldMesh, vertices: I64) -> F32:
    """(R, 3, 3) rows t, b, n."""
    normal, tangent = mesh.normals[vertices], mesh.tangents[vertices]
    across = tangent[:, 3:] * np.cross(normal, tangent[:, :3])
    return np.ascontiguousarray(np.stack([tangent[:, :3], across, normal], axis=1), np.float32)


def averaged(radiance: F32, k: int) -> F32:
    """(2^k, 3) means of the leaves of as many cells around; those that are no finer as they are."""
    if len(radiance) <= 1 << k:
        return radiance
    return np.asarray(radiance.reshape(1 << k, -1, 3).mean(axis=1), np.float32)


def _offsets(side: int) -> F32:
    """(side², 2) middles of equal parts of the unit square."""
    middle = (np.arange(side, dtype=np.float32) + 0.5) / side
    grid = np.stack(np.meshgrid(middle, middle, indexing="ij"), axis=-1)
    return np.asarray(grid.reshape(-1, 2), np.float32)


@kernel
def sky_means(
    axes: F32, local: F32, offsets: F32, sky: F32, open_: Bools, out: F32, start: int, stop: int
) -> None:
    """out (R, N, 3) of open cells: the mean of the sky at points about each cell's middle direction.

    Points lie at `offsets` (P, 2) of a square as large as the cell, turned about its middle.
    """
    k = 0
    while (1 << k) < len(sky):
        k += 1
    width = np.sqrt(2.0 * np.pi / len(local))
    share = np.float32(1.0 / len(offsets))
    for row in range(start, stop):
        for cell in range(len(local)):
            if not open_[row, cell]:
                continue
            x, y, z = float(local[cell, 0]), float(local[cell, 1]), float(local[cell, 2])
            # Two directions across the cell: away from the normal, and around it.
            level = max(np.sqrt(x * x + y * y), 1e-6)
            ux, uy, uz = x * z / level, y * z / level, -level
            vx, vy = -y / level, x / level
            red, green, blue = np.float32(0), np.float32(0), np.float32(0)
            for p in range(len(offsets)):
                a, b = (offsets[p, 0] - 0.5) * width, (offsets[p, 1] - 0.5) * width
                dx, dy, dz = x + a * ux + b * vx, y + a * uy + b * vy, z + a * uz
                scale = 1.0 / np.sqrt(dx * dx + dy * dy + dz * dz)
                dx, dy, dz = dx * scale, dy * scale, dz * scale
                wx = axes[row, 0, 0] * dx + axes[row, 1, 0] * dy + axes[row, 2, 0] * dz
                wy = axes[row, 0, 1] * dx + axes[row, 1, 1] * dy + axes[row, 2, 1] * dz
                wz = axes[row, 0, 2] * dx + axes[row, 1, 2] * dy + axes[row, 2, 2] * dz
                leaf = leaf_of(np.float32(wx), np.float32(wy), np.float32(wz), k)
                red += sky[leaf, 0]
                green += sky[leaf, 1]
                blue += sky[leaf, 2]
            out[row, cell, 0], out[row, cell, 1], out[row, cell, 2] = red * share, green * share, blue * share


@kernel
def arriving(
    positions: F32,
    kind: npt.NDArray[np.int8],
    place: F64,
    lamp: F64,
    colour: F32,
    seen: npt.NDArray[np.uint64],
    towards: F32,
    strength: F32,
) -> None:
    """towards and strength (N, C, 3) of light samples at points (N, 3); 0 where they are not seen."""
    one = np.uint64(1)
    for n in range(len(positions)):
        x, y, z = float(positions[n, 0]), float(positions[n, 1]), float(positions[n, 2])
        for c in range(len(kind)):
            dx, dy, dz, weight = arriving_from(
                kind[c], place[c, 0], place[c, 1], place[c, 2], lamp, c, x, y, z
            )
            towards[n, c, 0], towards[n, c, 1], towards[n, c, 2] = dx, dy, dz
            if seen[n, c >> 6] & (one << np.uint64(c & 63)):
                for channel in range(3):
                    strength[n, c, channel] = weight * colour[c, channel]


__all__ = ["OF_QUARTERS", "SIDE", "Arriving", "Incident", "averaged"]
