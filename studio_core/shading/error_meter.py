"""How wrong is what is on the screen: brute force at a random few places, compared with what is shown.

Two errors, both relative RMSE of linear radiance: of the *picture* (at random samples of it, where the
true surface point is lit by brute force: what vertices, interpolation and the backend do together) and of
the *vertices* (at random shown vertices: what the backend does alone).

Light between surfaces is path traced there, twice: noise that the two do not share is no error of what is
shown, and drops out of the mean of (shown − first) (shown − second).
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.raster import Coefficients, CoefficientTable, Compositor
from studio_core.scene.nodes import Light, NodeId
from studio_core.shading.artifacts import (
    Casters,
    Error,
    Hits,
    LayerRadiance,
    Lighting,
    MeasuredError,
    Radiance,
    ShadingPoints,
    Shapes,
)
from studio_core.shading.brute_force import VisibilityBits, all_points, environment_layer, lamp_layer
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.path_tracing import PathSettings, bounces_of, chosen_points, indirect_halves
from studio_core.shading.path_world import PathWorld, PathWorlds
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.surface_points import mapped_points, some_hits, surface_points, surface_uvs
from studio_core.shading.varying import ShapeTable

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
LEVEL = 15
LAMP_SAMPLES = 256
RESAMPLINGS = 200
PATHS = 1024
"""Paths a place, where light between surfaces is measured."""
SEEDS = 1_000_003
"""Where the numbers of these begin: far from those of path traced light that is shown."""


def compare(
    shown: npt.ArrayLike, true: npt.ArrayLike, seed: int = 0, again: npt.ArrayLike | None = None
) -> Error:
    """The error of (N, 3) radiance; its standard error by bootstrap over the places.

    All is relative to the mean of what is true. Where that is black and what is shown is not, it is relative
    to the mean of what is shown: at least 1, as if all of it were wrong. With `again`, `true` and it are two
    independent estimates of the truth whose noise does not count, but for the percentile.
    """
    a, b = np.asarray(shown, np.float64), np.asarray(true, np.float64)
    c = b if again is None else np.asarray(again, np.float64)
    truth = (b + c) / 2
    relative_to = truth if truth.any() else a
    if not relative_to.any():
        return Error(0.0, 0.0, len(b))
    squares, means = ((a - b) * (a - c)).mean(axis=1), relative_to.mean(axis=1)
    drawn = np.random.default_rng(seed).integers(0, len(b), (RESAMPLINGS, len(b)))
    redrawn = np.sqrt(np.maximum(squares[drawn].mean(axis=1), 0))
    redrawn /= np.maximum(means[drawn].mean(axis=1), 1e-30)
    worst = np.percentile(np.abs(a - truth).mean(axis=1), 99) / means.mean()
    found = float(np.sqrt(max(squares.mean(), 0)) / means.mean())
    return Error(found, float(redrawn.std()), len(b), float(worst))


class ErrorMeter:
    """Measures what a pipeline last made."""

    def __init__(self, services: Services, places: int = 256) -> None:
        self._workers = services.workers
        self._places = places  # where none are asked for
        self._coefficients = CoefficientTable(services.registry)
        self._shapes = ShapeTable(services.registry)
        self._compositor = Compositor(services.workers)
        self._worlds = PathWorlds(services.registry)

    def __call__(
        self, pipeline: Pipeline, frame: Frame, job: Job, places: int | None = None
    ) -> MeasuredError | None:
        """Errors of the pipeline's radiance for `frame`; None where nothing opaque is seen.

        Light between surfaces is compared with as many bounces as the frame asks for. Layers that brute force
        does not make are left out on both sides. With more `places` the errors are surer: their standard
        error says how sure.
        """
        radiance, shapes = pipeline.artifact(Radiance), pipeline.artifact(Shapes)
        lighting, casters = pipeline.artifact(Lighting), pipeline.artifact(Casters)
        if radiance is None or shapes is None or lighting is None or casters is None:
            return None
        hits = radiance.hits or pipeline.artifact(Hits)
        if hits is None:
            return None
        known = {node: layer for node, layer in radiance.layers.items() if node in lighting.layers}
        radiance = dataclasses.replace(radiance, layers=known)
        places = self._places if places is None else places
        rng = np.random.default_rng(frame.revision)
        surfaces, mesh = radiance.surfaces, radiance.surfaces.mesh
        hit = np.flatnonzero(hits.face >= 0)
        candidates = hit[surfaces.opacity[mesh.face_material[hits.face[hit]]] >= 1]
        if not len(candidates):
            return None
        chosen = np.sort(rng.choice(candidates, min(places, len(candidates)), replace=False))
        table = self._coefficients(frame.scene, surfaces)
        seen = some_hits(hits, chosen)
        eye = np.asarray(frame.view.transform.translation, np.float64)
        points, uvs = surface_points(surfaces, seen, eye), surface_uvs(surfaces, seen, eye)
        there = self._shapes.at(frame.scene, surfaces.materials, points.material, uvs)
        facing = mapped_points(frame.scene, surfaces, points, uvs)
        truth = self._brute(points, facing, there, lighting, casters, frame, job)
        looks, lights = self._compositor.coefficients(surfaces, seen, table), _lights(frame)
        caught, photograph = self._compositor.photograph(frame.scene, surfaces, seen, chosen)
        before = self._compositor.photographed_light(frame.scene, points.normals[caught])
        albedo = np.divide(photograph, before, out=np.zeros(before.shape), where=before > 0)
        shown_layers, true_layers = {}, {}
        for layer in radiance.layers:
            one = dataclasses.replace(radiance, layers={layer: radiance.layers[layer]}, indirect=None)
            shown_layers[layer] = self._compositor.radiance(frame.scene, one, seen, table, job, chosen)
            gain = np.asarray(lights[layer].gain() if layer in lights else (0, 0, 0), np.float32)
            true_layers[layer] = (truth[layer].terms * looks).sum(axis=1) * gain
            true_layers[layer][caught] = truth[layer].irradiance[caught] * gain * albedo
        by_layer = {k: compare(shown_layers[k], np.maximum(true_layers[k], 0)) for k in shown_layers}
        # What is below 0 is cut off once all light is summed.
        shown = self._compositor.radiance(frame.scene, radiance, seen, table, job, chosen)
        straight = sum(true_layers.values(), np.zeros((len(chosen), 3), np.float32))
        world, indirect = None, None
        true, again = straight, straight
        if radiance.indirect is not None:
            world = self._worlds(frame.scene, surfaces, casters, lighting)
            halves = []
            for half in self._bounced(points, facing, there, world, frame, job):
                halves.append((half.terms * looks).sum(axis=1))
                halves[-1][caught] = half.irradiance[caught] * albedo
            alone = dataclasses.replace(radiance, layers={}, pixel=None)
            light = self._compositor.radiance(frame.scene, alone, seen, table, job, chosen)
            indirect = compare(light, halves[0], again=halves[1])
            true, again = straight + halves[0], straight + halves[1]
        picture = compare(shown, np.maximum(true, 0), again=np.maximum(again, 0))
        vertices = self._vertices(radiance, shapes, lighting, casters, world, frame, table, rng, places, job)
        return MeasuredError(picture, vertices, by_layer, indirect)

    def _vertices(
        self,
        radiance: Radiance,
        shapes: Shapes,
        lighting: Lighting,
        casters: Casters,
        world: PathWorld | None,
        frame: Frame,
        table: Coefficients,
        rng: np.random.Generator,
        places: int,
        job: Job,
    ) -> Error:
        mesh = radiance.surfaces.mesh
        valid = np.flatnonzero(radiance.valid)
        some = np.sort(rng.choice(valid, min(places, len(valid)), replace=False))
        points, own = chosen_points(mesh, some), shapes.of_points(some)
        truth = self._brute(points, points, own, lighting, casters, frame, job)
        lights = _lights(frame)
        looks = table.typical[mesh.material[some]].reshape(-1, table.width, 3)
        shown = (radiance.combined(lights)[some] * looks).sum(axis=1)
        truth = {node: truth[node] for node in radiance.layers}
        every = np.ones(len(some), np.bool_)
        exact = dataclasses.replace(radiance, layers=truth, valid=every, indirect=None)
        straight = np.zeros((len(some), 3), np.float32)  # where light between surfaces is looked at alone
        if truth:
            straight = (exact.combined(lights) * looks).sum(axis=1)
        if world is None:
            return compare(shown, straight)
        halves = self._bounced(points, points, own, world, frame, job)
        one, other = (straight + (half.terms * looks).sum(axis=1) for half in halves)
        return compare(shown, one, again=other)

    def _bounced(
        self,
        points: ShadingPoints,
        facing: ShadingPoints,
        shapes: Shapes,
        world: PathWorld,
        frame: Frame,
        job: Job,
    ) -> tuple[LayerRadiance, LayerRadiance]:
        """Light that came by way of other surfaces, twice, on surfaces that face as `facing` does."""
        eye = np.asarray(frame.view.transform.translation, np.float64)
        settings = PathSettings(bounces_of(frame), PATHS, SEEDS + frame.revision)
        plain = dataclasses.replace(shapes, tilt=None)
        return indirect_halves(points, plain, eye, world, settings, self._workers, job, facing)

    def _brute(
        self,
        points: ShadingPoints,
        facing: ShadingPoints,
        shapes: Shapes,
        lighting: Lighting,
        casters: Casters,
        frame: Frame,
        job: Job,
    ) -> dict[NodeId, LayerRadiance]:
        """Light that is let through to the points, on surfaces that face as `facing` does."""
        shapes = dataclasses.replace(shapes, tilt=None)
        every, eye = all_points(points), np.asarray(frame.view.transform.translation, np.float64)
        made = {
            lamp.node: lamp_layer(
                facing, shapes, casters.shadow, lamp, eye, every, LAMP_SAMPLES, self._workers, job, points
            )
            for lamp in lighting.lamps
        }
        if lighting.environment is not None:
            bits = VisibilityBits(points, casters.shadow, self._workers)
            made[lighting.environment.id] = environment_layer(
                facing, shapes, lighting, bits, eye, every, LEVEL, self._workers, job
            )
        return made


def _lights(frame: Frame) -> dict[NodeId, Light]:
    return {light.id: light for light in frame.scene.of(Light) if frame.scene.shown(light.id)}
