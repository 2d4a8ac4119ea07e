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
MEAN_K = 13
"""Leaves of the environment that a cell's mean is made from: about four to a cell."""


@dataclass(frozen=True, eq=False)
class Arriving:
    """Light at N places.

    row (N,) of what follows; light (R, 1024, 3) radiance from the pattern's cells, open (R, 1024) whether
    that is the sky, axes (R, 3, 3) rows t, b, n of the vertices; towards (N, C, 3) world, and strength
    (N, C, 3): irradiance of lamps and suns on what faces them. sky (2^k, 3) is radiance by leaf.
    """

    row: I64
    light: F32
    open: Bools
    axes: F32
    towards: F32
    strength: F32
    sky: F32
    rays: int


class Incident:
    """What vertices near strokes see, kept; owned by the compute thread."""

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self.pattern: Pattern = grid_pattern(SIDE)
        self.table = Transport(services.workers, self.pattern)

    def at(self, scene: Scene, lit: Lit, places: Places, job: Checkpoints | None = None) -> Arriving:
        """Light at places, as it is now."""
        surfaces = lit.surfaces.unrefined
        mesh = surfaces.mesh
        vertices, row = np.unique(places.vertex, return_inverse=True)
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
        normal, tangent = mesh.normals[vertices], mesh.tangents[vertices]
        across = tangent[:, 3:] * np.cross(normal, tangent[:, :3])
        axes = np.ascontiguousarray(np.stack([tangent[:, :3], across, normal], axis=1), np.float32)
        open_, sky = met == NOTHING, self._sky(scene, lit.lighting)
        if len(sky):
            local = self.pattern.directions[0]
            spread = _offsets(2)
            means = np.zeros_like(light)

            def body(start: int, stop: int) -> None:
                sky_means(axes, local, spread, sky, open_, means, start, stop)

            self._workers.run(len(axes), 16, body, None)
            light = np.where(open_[..., None], means, light)
        towards, strength, rays = self._lamps(scene, lit, places, job)
        return Arriving(row, light, open_, axes, towards, strength, sky, done.rays + rays)

    def _sky(self, scene: Scene, lighting: Lighting) -> F32:
        tree, environment = lighting.tree, lighting.environment
        if tree is None or environment is None:
            return np.zeros((0, 3), np.float32)
        node = scene.nodes.get(environment.id)
        if not isinstance(node, Light) or not scene.shown(node.id):
            return np.zeros((0, 3), np.float32)
        return np.asarray(tree.radiance * np.asarray(node.gain(), np.float32), np.float32)

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


__all__ = ["Arriving", "Incident"]
