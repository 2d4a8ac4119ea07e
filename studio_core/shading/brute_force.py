"""Equation (2) of Iwasaki et al. by brute force: every direction, traced visibility, every vertex.

The truth that backends are measured against. What was traced is kept as bits (S/8 bytes a vertex) while
the geometry stands still, so that light, material and view cost no rays.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.kernels.directions import DirectionSet, direction_set
from studio_core.kernels.radiance import BATCH, environment_terms, lamp_terms
from studio_core.kernels.visibility import occlusion_rays, trace_visibility
from studio_core.parallel import Workers
from studio_core.shading.artifacts import (
    TERMS,
    Casters,
    Lamp,
    LayerRadiance,
    Lighting,
    Shapes,
    Surfaces,
)
from studio_core.shading.job import Job
from studio_core.shading.lamps import lamp_light, lamp_targets

F32 = npt.NDArray[np.float32]
Points = npt.NDArray[np.int64]

POINTS = 512  # vertices a chunk: a checkpoint every few milliseconds at 2^10 directions
BITS_LIMIT = 1 << 30


class VisibilityBits:
    """Visibility of shading vertices over direction sets, traced when first asked for.

    bits[p, w] bit b: direction 64·w + b leaves vertex p unoccluded and above its shading horizon.
    """

    def __init__(self, surfaces: Surfaces, casters: Casters, workers: Workers) -> None:
        self._surfaces, self._casters, self._workers = surfaces, casters, workers
        self._bits: dict[int, npt.NDArray[np.uint64]] = {}
        self._done: dict[int, npt.NDArray[np.bool_]] = {}
        self.rays = 0

    def of(self, points: Points, directions: DirectionSet, job: Job) -> npt.NDArray[np.uint64]:
        """(len(points), S/64) words; kept unless all vertices would need over 1 GiB."""
        count, words = len(self._surfaces.mesh.positions), len(directions.directions) // 64
        level = directions.k
        if count * words * 8 > BITS_LIMIT:
            return self._trace(points, directions, job)
        if level not in self._bits:
            self._bits[level] = np.zeros((count, words), np.uint64)
            self._done[level] = np.zeros(count, np.bool_)
        missing = points[~self._done[level][points]]
        if len(missing):
            self._bits[level][missing] = self._trace(missing, directions, job)
            self._done[level][missing] = True
        kept: npt.NDArray[np.uint64] = self._bits[level][points]
        return kept

    def _trace(self, points: Points, directions: DirectionSet, job: Job) -> npt.NDArray[np.uint64]:
        mesh = self._surfaces.mesh
        found = trace_visibility(
            self._casters.shadow,
            mesh.positions[points] + mesh.origin,
            mesh.normals[points],
            directions,
            self._workers,
            job,
            geometric_normals=mesh.geometric[points],
            inset=mesh.inset[points],
        )
        self.rays += found.rays
        return found.words


def blank_layer(surfaces: Surfaces) -> LayerRadiance:
    """A layer without light."""
    count = len(surfaces.mesh.positions)
    return LayerRadiance(np.zeros((count, TERMS, 3), np.float32), np.zeros((count, 3), np.float32))


def environment_layer(
    surfaces: Surfaces,
    shapes: Shapes,
    lighting: Lighting,
    visibility: VisibilityBits,
    eye: npt.NDArray[np.float64],
    points: Points,
    level: int,
    workers: Workers,
    job: Job,
    onto: LayerRadiance | None = None,
) -> LayerRadiance:
    """The environment's layer at unit gain for `points`, over 2^level directions."""
    layer = onto or blank_layer(surfaces)
    if lighting.tree is None or not len(points):
        return layer
    mesh, directions = surfaces.mesh, direction_set(level)
    leaves = lighting.tree.coarsened(level).radiance
    local_eye = (eye - mesh.origin).astype(np.float32)
    step = max(POINTS, min(len(points), (64 << 20) // (len(directions.directions) // 8)))
    for first in range(0, len(points), step):
        block = points[first : first + step]
        bits = visibility.of(block, directions, job)

        def run(start: int, stop: int, block: Points = block, bits: npt.NDArray[np.uint64] = bits) -> None:
            environment_terms(
                start,
                stop,
                block,
                mesh.positions,
                mesh.normals,
                mesh.material,
                local_eye,
                bits,
                directions.directions,
                leaves,
                directions.solid_angle,
                shapes.address,
                shapes.terms,
                shapes.offset,
                shapes.data,
                layer.terms,
                layer.irradiance,
            )

        workers.run(len(block), POINTS, run, job)
    return layer


def lamp_layer(
    surfaces: Surfaces,
    shapes: Shapes,
    casters: Casters,
    lamp: Lamp,
    eye: npt.NDArray[np.float64],
    points: Points,
    samples: int,
    workers: Workers,
    job: Job,
) -> LayerRadiance:
    """One lamp's layer at unit gain for `points`, by traced shadow rays to `samples` places of the lamp."""
    layer, mesh = blank_layer(surfaces), surfaces.mesh
    targets = lamp_targets(lamp, min(samples, BATCH))
    local_eye = (eye - mesh.origin).astype(np.float32)
    step = max(1, (1 << 20) // len(targets))
    for first in range(0, len(points), step):
        job.checkpoint(first, len(points))
        block = points[first : first + step]
        positions = mesh.positions[block] + mesh.origin
        towards, weight = lamp_light(lamp, targets, positions)
        seen = occlusion_rays(
            casters.shadow,
            positions,
            mesh.normals[block],
            targets,
            workers,
            job,
            geometric_normals=mesh.geometric[block],
            inset=mesh.inset[block],
        )
        lamp_terms(
            block,
            mesh.positions,
            mesh.normals,
            mesh.material,
            local_eye,
            towards,
            weight,
            seen,
            shapes.address,
            shapes.terms,
            shapes.offset,
            shapes.data,
            layer.terms,
            layer.irradiance,
        )
    return layer


def all_points(surfaces: Surfaces, mask: npt.NDArray[np.bool_] | None = None) -> Points:
    """Indices of the vertices of `mask`, or of all."""
    count = len(surfaces.mesh.positions)
    return np.flatnonzero(mask).astype(np.int64) if mask is not None else np.arange(count, dtype=np.int64)
