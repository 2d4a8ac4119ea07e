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
    Hits,
    LayerRadiance,
    Lighting,
    MeasuredError,
    Radiance,
    ShadingPoints,
    Shapes,
)
from studio_core.shading.brute_force import VisibilityBits, all_points, environment_layer, lamp_layer
from studio_core.shading.compared import Compared, Looked
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.path_tracing import PathSettings, bounces_of, chosen_points, indirect_halves
from studio_core.shading.path_world import PathWorld, PathWorlds
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.surface_points import (
    between_vertices,
    mapped_points,
    some_hits,
    surface_points,
    surface_uvs,
)
from studio_core.shading.varying import ShapeTable

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
LEVEL = 15
LAMP_SAMPLES = 256
PATHS = 1024
"""Paths a place, where light between surfaces is measured."""
SEEDS = 1_000_003
"""Where the numbers of these begin: far from those of path traced light that is shown."""


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

        With more `places` the errors are surer: their standard error says how sure.
        """
        looked = self.look(pipeline, frame, job, places)
        return None if looked is None else looked.error()

    def look(
        self, pipeline: Pipeline, frame: Frame, job: Job, places: int | None = None, number: int = 0
    ) -> Looked | None:
        """What is shown and what is true at random places; with another `number` at others.

        Light between surfaces is compared with as many bounces as the frame asks for. Layers that brute force
        does not make are left out on both sides.
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
        rng = np.random.default_rng((frame.revision, number))
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
        between = between_vertices(surfaces, seen, eye)
        there = self._shapes.at(frame.scene, surfaces.materials, points.material, uvs, between)
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
        by_layer = {k: Compared(shown_layers[k], np.maximum(true_layers[k], 0)) for k in shown_layers}
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
            indirect = Compared(light, halves[0], halves[1])
            true, again = straight + halves[0], straight + halves[1]
        picture = Compared(shown, np.maximum(true, 0), np.maximum(again, 0))
        vertices = self._vertices(radiance, shapes, lighting, casters, world, frame, table, rng, places, job)
        return Looked(picture, vertices, by_layer, indirect)

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
    ) -> Compared:
        mesh = radiance.surfaces.mesh
        valid = np.flatnonzero(radiance.valid)
        some = np.sort(rng.choice(valid, min(places, len(valid)), replace=False))
        points, own = chosen_points(mesh, some), shapes.of_points(some)
        truth = self._brute(points, points, own, lighting, casters, frame, job)
        lights = _lights(frame)
        looks = table.typical[mesh.material[some]]
        if len(table.painted):
            looks = looks + table.painted[some]
        looks = looks.reshape(-1, table.width, 3)
        shown = (radiance.combined(lights)[some] * looks).sum(axis=1)
        truth = {node: truth[node] for node in radiance.layers}
        every = np.ones(len(some), np.bool_)
        exact = dataclasses.replace(radiance, layers=truth, valid=every, indirect=None)
        straight = np.zeros((len(some), 3), np.float32)  # where light between surfaces is looked at alone
        if truth:
            straight = (exact.combined(lights) * looks).sum(axis=1)
        if world is None:
            return Compared(shown, straight)
        halves = self._bounced(points, points, own, world, frame, job)
        one, other = (straight + (half.terms * looks).sum(axis=1) for half in halves)
        return Compared(shown, one, other)

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


class SteadyMeter:
    """Looks at more places of the same picture each time it is asked, until the error is sure."""

    def __init__(self, meter: ErrorMeter) -> None:
        self._meter = meter
        self._of: Radiance | None = None
        self._looked: Looked | None = None
        self._number = 0

    def __call__(self, pipeline: Pipeline, frame: Frame, job: Job) -> MeasuredError | None:
        """The error by all places so far; None where nothing opaque is seen."""
        radiance = pipeline.artifact(Radiance)
        if radiance is not self._of:
            self._of, self._looked, self._number = radiance, None, 0
        more = self._meter.look(pipeline, frame, job, number=self._number)
        self._number += 1
        if more is not None:
            self._looked = more if self._looked is None else self._looked + more
        return None if self._looked is None else self._looked.error()


def _lights(frame: Frame) -> dict[NodeId, Light]:
    return {light.id: light for light in frame.scene.of(Light) if frame.scene.shown(light.id)}
