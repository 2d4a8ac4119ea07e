"""Light that came by way of other surfaces, by path tracing: without bias, and therefore the truth.

A path of m ≤ n surfaces leads from a light over x₁ … x_m to a point. What is asked for are the point's light
sums as `LayerRadiance` has them, of all lights with their gains. At the surfaces between textures are read as
they are, normals are interpolated, and normal maps are left out; light that would be negative in sum
(captured materials) is not cut off. As everywhere in bounces, what is see-through or catches shadows is
passed, and the inside of closed parts is black. Rays leave a point, or a surface, above both its shading
normal and its geometric one.

Kajiya 1986, "The rendering equation"; next-event estimation at every surface, multiple importance sampling of
the environment and of the point's BRDF terms (Veach & Guibas 1995), roulette from the fourth surface on.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.kernels.path_light import light_paths
from studio_core.kernels.path_rays import follow_paths
from studio_core.kernels.path_receivers import begin_paths, gather_paths
from studio_core.kernels.path_state import Paths
from studio_core.kernels.visibility import lifted
from studio_core.parallel import Workers
from studio_core.shading.artifacts import ChosenPoints, LayerRadiance, ShadingPoints, Shapes
from studio_core.shading.brute_force import blank_layer
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.path_world import PathWorld
from studio_core.shading.tilting import Facing, facings, gather_tilts

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

IN_FLIGHT = 1 << 16
"""Paths at once."""
CHUNK = 2048
ROULETTE = 4
"""Surfaces before paths may end by chance."""
CONVERGED = 32
"""Bounces that leave nothing to see: at albedo 0.8 the rest is a thousandth."""


@dataclass(frozen=True)
class PathSettings:
    """Surfaces a path may have, paths a point, and which random numbers they follow."""

    bounces: int = 3
    samples: int = 256
    seed: int = 0


def bounces_of(frame: Frame) -> int:
    """How many surfaces light goes by: `bounces` of the method's parameters; many where it is to settle."""
    params = None if frame.indirect is None else frame.indirect.params
    if getattr(params, "converged", False):
        return CONVERGED
    return int(getattr(params, "bounces", PathSettings.bounces))


@dataclass
class PathCounts:
    """What it took: paths begun, and segments followed."""

    paths: int = 0
    segments: int = 0


def indirect_layer(
    points: ShadingPoints,
    shapes: Shapes,
    eye: F64,
    world: PathWorld,
    settings: PathSettings,
    workers: Workers,
    job: Job,
    facing: ShadingPoints | None = None,
    counts: PathCounts | None = None,
) -> LayerRadiance:
    """The mean of `samples` paths for each of the points, towards an eye (3,), world.

    `shapes` are those of the points, whose materials count as in `world`. With `facing` the same points lie
    on surfaces that face otherwise (normal maps): light is let through by the normals of `points`. Points are
    independent of each other and of all else but their number and the seed. Raises Cancelled at checkpoints.
    """
    layer = blank_layer(points, shapes)
    if world.dark or not settings.bounces:
        return layer
    count, samples = len(points.positions), settings.samples
    step = max(1, IN_FLIGHT // samples)
    for first in range(0, count, step):
        job.checkpoint(first * samples, count * samples)
        some = np.arange(first, min(first + step, count))
        _Batch(points, facing or points, shapes, eye, world, settings, workers, job, some).run(layer, counts)
    return layer


def indirect_halves(
    points: ShadingPoints,
    shapes: Shapes,
    eye: F64,
    world: PathWorld,
    settings: PathSettings,
    workers: Workers,
    job: Job,
    facing: ShadingPoints | None = None,
    counts: PathCounts | None = None,
) -> tuple[LayerRadiance, LayerRadiance]:
    """Two independent estimates with half of the samples each: what they have in common is no noise."""
    made = []
    for half in (2 * settings.seed, 2 * settings.seed + 1):
        own = dataclasses.replace(settings, samples=max(settings.samples // 2, 1), seed=half)
        made.append(indirect_layer(points, shapes, eye, world, own, workers, job, facing, counts))
    return made[0], made[1]


def mean_layer(layers: list[tuple[LayerRadiance, float]]) -> LayerRadiance:
    """Several layers, each with its weight."""
    whole = sum(weight for _, weight in layers)
    terms = sum(layer.terms * np.float32(weight / whole) for layer, weight in layers)
    irradiance = sum(layer.irradiance * np.float32(weight / whole) for layer, weight in layers)
    tilts = None
    if layers[0][0].tilts is not None:
        tilts = sum(
            layer.tilts * np.float32(weight / whole) for layer, weight in layers if layer.tilts is not None
        )
    return LayerRadiance(
        np.asarray(terms), np.asarray(irradiance), None if tilts is None else np.asarray(tilts)
    )


def chosen_points(points: ShadingPoints, some: I64) -> ChosenPoints:
    """Some of the points alone."""
    return ChosenPoints(
        points.origin,
        points.positions[some],
        points.normals[some],
        points.tangents[some],
        points.geometric[some],
        points.inset[some],
        points.material[some],
    )


class _Batch:
    """The paths of some points (B), all at once."""

    def __init__(
        self,
        points: ShadingPoints,
        facing: ShadingPoints,
        shapes: Shapes,
        eye: F64,
        world: PathWorld,
        settings: PathSettings,
        workers: Workers,
        job: Job,
        some: I64,
    ) -> None:
        self._some, self._settings, self._world = some, settings, world
        self._workers, self._job = workers, job
        self._points = chosen_points(points, some)
        self._facing = chosen_points(facing, some)
        self._rows = np.ascontiguousarray(shapes.rows(points)[some])
        self._shapes = dataclasses.replace(shapes, row=self._rows)
        self._eye = (eye - points.origin).astype(np.float32)
        total = len(some) * settings.samples
        self._paths = Paths.of(total)
        self._towards, self._weight = np.zeros((total, 3), np.float32), np.zeros(total, np.float32)

    def run(self, layer: LayerRadiance, counts: PathCounts | None) -> None:
        """Fills in the points' part of a layer."""
        self._begin()
        segments = self._follow()
        self._gather(layer)
        self._world.casters.primary.count(segments)
        if counts is not None:
            counts.paths += len(self._weight)
            counts.segments += segments

    def _begin(self) -> None:
        points, facing, world, shapes = self._points, self._facing, self._world, self._shapes
        world_places = points.positions + points.origin
        origins = lifted(world.casters.primary, world_places, points.geometric, points.inset)

        def begin(start: int, stop: int) -> None:
            begin_paths(
                start,
                stop,
                self._settings.samples,
                self._settings.seed,
                self._some,
                points.positions,
                facing.normals,
                facing.tangents,
                points.normals,
                points.geometric,
                origins,
                points.material,
                self._rows,
                self._eye,
                world.models,
                shapes.offset,
                shapes.data,
                self._paths,
                self._towards,
                self._weight,
            )

        self._workers.run(len(self._some), max(1, CHUNK // self._settings.samples), begin, self._job)

    def _follow(self) -> int:
        """From surface to surface; the number of rays that were followed."""
        world, paths = self._world, self._paths
        bounces, segments = self._settings.bounces, 0
        for depth in range(1, bounces + 2):
            active = np.flatnonzero(paths.material >= 0)
            if not len(active):
                break
            segments += len(active)

            def follow(start: int, stop: int, active: I64 = active, depth: int = depth) -> None:
                escapes, last = depth > 1, depth > bounces
                follow_paths(
                    start, stop, active, escapes, last, world.tracer, world.mesh, world.lights, paths
                )

            self._workers.run(len(active), CHUNK, follow, self._job)
            active = active[paths.material[active] >= 0]
            if not len(active) or depth > bounces:
                break
            shapes = world.shapes
            if shapes.row is not None:
                shapes = world.shapes_at(paths.material[active], paths.uv[active], paths.vertex[active])
                assert shapes.row is not None
                paths.row[active] = shapes.row

            def light(
                start: int, stop: int, active: I64 = active, depth: int = depth, shapes: Shapes = shapes
            ) -> None:
                light_paths(
                    start,
                    stop,
                    active,
                    depth == bounces,
                    depth >= ROULETTE,
                    world.tracer,
                    world.looks,
                    world.models,
                    shapes.offset,
                    shapes.data,
                    world.lights,
                    paths,
                )

            self._workers.run(len(active), CHUNK, light, self._job)
        return segments

    def _gather(self, layer: LayerRadiance) -> None:
        some, shapes = self._some, self._shapes
        own = blank_layer(self._facing, shapes)
        ways = facings(self._facing, shapes, own)
        for way in ways:
            self._sum(way)
        if own.tilts is not None and layer.tilts is not None:
            gather_tilts(shapes, self._facing, ways, own.tilts)
            layer.tilts[some] = own.tilts
        layer.terms[some], layer.irradiance[some] = own.terms, own.irradiance

    def _sum(self, way: Facing) -> None:
        shapes, frames = self._shapes, way.mesh

        def gather(start: int, stop: int) -> None:
            gather_paths(
                start,
                stop,
                self._settings.samples,
                frames.positions,
                frames.normals,
                frames.tangents,
                self._rows,
                self._eye,
                shapes.address,
                shapes.terms,
                shapes.offset,
                shapes.data,
                self._towards,
                self._weight,
                self._paths.radiance,
                way.terms,
                way.irradiance,
            )

        self._workers.run(len(self._some), max(1, CHUNK // self._settings.samples), gather, self._job)


def growing(samples: int, first: int = 4, factor: int = 4) -> Iterator[int]:
    """How many samples more each time: `first` in all, then `factor` times as many, up to `samples`."""
    done = 0
    upto = min(first, samples)
    while done < samples:
        yield upto - done
        done, upto = upto, min(upto * factor, samples)


__all__ = [
    "CONVERGED",
    "PathCounts",
    "PathSettings",
    "bounces_of",
    "chosen_points",
    "growing",
    "indirect_halves",
    "indirect_layer",
    "mean_layer",
]
