"""How wrong is what is on the screen: brute force at a random few places, compared with what is shown.

Two errors, both relative RMSE of linear radiance: of the *picture* (at random samples of it, where the
true surface point is lit by brute force: what vertices, interpolation and the backend do together) and of
the *vertices* (at random shown vertices: what the backend does alone).
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.raster import Coefficients, CoefficientTable, Compositor
from studio_core.scene.nodes import Light, NodeId, Scene
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.scene.tangents import arbitrary_tangents, perpendicular
from studio_core.shading.artifacts import (
    Casters,
    ChosenPoints,
    Error,
    Hits,
    LayerRadiance,
    Lighting,
    MeasuredError,
    Radiance,
    ShadingPoints,
    Shapes,
    Surfaces,
)
from studio_core.shading.brute_force import VisibilityBits, all_points, environment_layer, lamp_layer
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.normal_maps import normal_texture, normals_at, strength
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.tilting import turned_points
from studio_core.shading.varying import ShapeTable

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
LEVEL = 15
LAMP_SAMPLES = 256
RESAMPLINGS = 200


def compare(shown: npt.ArrayLike, true: npt.ArrayLike, seed: int = 0) -> Error:
    """The error of (N, 3) radiance; its standard error by bootstrap over the places.

    All is relative to the mean of what is true. Where that is black and what is shown is not, it is relative
    to the mean of what is shown: at least 1, as if all of it were wrong.
    """
    a, b = np.asarray(shown, np.float64), np.asarray(true, np.float64)
    relative_to = b if b.any() else a
    if not relative_to.any():
        return Error(0.0, 0.0, len(b))
    squares, means = ((a - b) ** 2).mean(axis=1), relative_to.mean(axis=1)
    drawn = np.random.default_rng(seed).integers(0, len(b), (RESAMPLINGS, len(b)))
    again = np.sqrt(squares[drawn].mean(axis=1)) / np.maximum(means[drawn].mean(axis=1), 1e-30)
    worst = np.percentile(np.abs(a - b).mean(axis=1), 99) / means.mean()
    found = float(np.sqrt(squares.mean()) / means.mean())
    return Error(found, float(again.std()), len(b), float(worst))


class ErrorMeter:
    """Measures what a pipeline last made."""

    def __init__(self, services: Services, places: int = 256) -> None:
        self._workers = services.workers
        self._places = places  # where none are asked for
        self._coefficients = CoefficientTable(services.registry)
        self._shapes = ShapeTable(services.registry)
        self._compositor = Compositor(services.workers)

    def __call__(
        self, pipeline: Pipeline, frame: Frame, job: Job, places: int | None = None
    ) -> MeasuredError | None:
        """Errors of the pipeline's radiance for `frame`; None where nothing opaque is seen.

        Layers that brute force does not make (light that came by way of other surfaces) are left out on
        both sides. With more `places` the errors are surer: their standard error says how sure.
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
        seen = _some(hits, chosen)
        points = surface_points(surfaces, seen, frame)
        uvs = surface_uvs(surfaces, seen, frame)
        there = self._shapes.at(frame.scene, surfaces.materials, points.material, uvs)
        facing = mapped_points(frame.scene, surfaces, points, uvs)
        truth = self._brute(points, facing, there, lighting, casters, frame, job)
        looks, lights = self._compositor.coefficients(surfaces, seen, table), _lights(frame)
        caught, photograph = self._compositor.photograph(frame.scene, surfaces, seen, chosen)
        before = self._compositor.photographed_light(frame.scene, points.normals[caught])
        albedo = np.divide(photograph, before, out=np.zeros(before.shape), where=before > 0)
        shown_layers, true_layers = {}, {}
        for layer in radiance.layers:
            one = dataclasses.replace(radiance, layers={layer: radiance.layers[layer]})
            shown_layers[layer] = self._compositor.radiance(frame.scene, one, seen, table, job, chosen)
            lit = dataclasses.replace(
                radiance, layers={layer: truth[layer]}, valid=np.ones(len(chosen), np.bool_)
            )
            true_layers[layer] = (lit.combined(lights) * looks).sum(axis=1)
            true_layers[layer][caught] = lit.irradiance(lights)[caught] * albedo
        # What is below 0 is cut off once all light is summed.
        shown = self._compositor.radiance(frame.scene, radiance, seen, table, job, chosen)
        true = np.maximum(sum(true_layers.values(), np.zeros((len(chosen), 3), np.float32)), 0)
        by_layer = {k: compare(shown_layers[k], np.maximum(true_layers[k], 0)) for k in shown_layers}
        vertices = self._vertices(radiance, shapes, lighting, casters, frame, table, rng, places, job)
        return MeasuredError(compare(shown, true), vertices, by_layer)

    def _vertices(
        self,
        radiance: Radiance,
        shapes: Shapes,
        lighting: Lighting,
        casters: Casters,
        frame: Frame,
        table: Coefficients,
        rng: np.random.Generator,
        places: int,
        job: Job,
    ) -> Error:
        mesh = radiance.surfaces.mesh
        valid = np.flatnonzero(radiance.valid)
        some = np.sort(rng.choice(valid, min(places, len(valid)), replace=False))
        points = ChosenPoints(
            mesh.origin,
            mesh.positions[some],
            mesh.normals[some],
            mesh.tangents[some],
            mesh.geometric[some],
            mesh.inset[some],
            mesh.material[some],
        )
        truth = self._brute(points, points, shapes.of_points(some), lighting, casters, frame, job)
        lights = _lights(frame)
        looks = table.typical[mesh.material[some]].reshape(-1, table.width, 3)
        shown = (radiance.combined(lights)[some] * looks).sum(axis=1)
        truth = {node: truth[node] for node in radiance.layers}
        exact = dataclasses.replace(radiance, layers=truth, valid=np.ones(len(some), np.bool_))
        return compare(shown, (exact.combined(lights) * looks).sum(axis=1))

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


def surface_points(surfaces: Surfaces, hits: Hits, frame: Frame) -> ChosenPoints:
    """The true surface points of hits, with interpolated normals."""
    mesh = surfaces.mesh
    corners, weights, face_normal = _corners(surfaces, hits, frame)
    place = mesh.positions[corners].astype(np.float64)
    normals = _unit(np.einsum("nk,nkc->nc", weights, mesh.normals[corners].astype(np.float64)))
    return ChosenPoints(
        mesh.origin,
        np.einsum("nk,nkc->nc", weights, place).astype(np.float32),
        normals,
        _tangents(weights, mesh.tangents[corners], normals),
        _unit(face_normal),
        np.zeros((len(corners), 3), np.float32),
        mesh.material[corners[:, 0]],
    )


def mapped_points(scene: Scene, surfaces: Surfaces, points: ChosenPoints, uvs: F32) -> ChosenPoints:
    """The points with the normals that maps have at uvs (P, 2), where materials have such; not averaged."""
    normals = np.tile(np.array([0, 0, 1], np.float32), (len(uvs), 1))
    mapped = False
    for number, name in enumerate(surfaces.materials):
        material = scene.material(name)
        texture, own = normal_texture(material), np.flatnonzero(points.material == number)
        if texture is not None and len(own):
            normals[own], mapped = normals_at(texture, strength(material), uvs[own]), True
    return turned_points(points, normals) if mapped else points


def surface_uvs(surfaces: Surfaces, hits: Hits, frame: Frame) -> F32:
    """(P, 2) texture coordinates of hits."""
    corners, weights, _ = _corners(surfaces, hits, frame)
    at: F64 = np.einsum("nk,nkc->nc", weights, surfaces.mesh.uvs[corners].astype(np.float64))
    return at.astype(np.float32)


def _corners(surfaces: Surfaces, hits: Hits, frame: Frame) -> tuple[npt.NDArray[np.integer[Any]], F64, F64]:
    """Vertices (P, 3) of the side that is seen, their weights (P, 3), and normals (P, 3) of the faces."""
    mesh = surfaces.mesh
    corners = mesh.faces[hits.face]
    place = mesh.positions[corners].astype(np.float64)
    face_normal = np.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0])
    eye = np.asarray(frame.view.transform.translation, np.float64) - mesh.origin
    behind = ((eye - place[:, 0]) * face_normal).sum(axis=1) < 0
    back = mesh.back_faces[hits.face]
    turned = behind & (back[:, 0] != NO_BACK)
    corners = np.where(turned[:, None], back, corners)
    face_normal = np.where(turned[:, None], -face_normal, face_normal)
    weights = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1).astype(np.float64)
    return corners, weights, face_normal


def _unit(vectors: F64) -> F32:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    made: F32 = (vectors / np.maximum(length, 1e-30)).astype(np.float32)
    return made


def _tangents(weights: F64, tangents: F32, normals: F32) -> F32:
    """(P, 4) tangents (P, 3, 4) of corners, weighted (P, 3), to unit normals (P, 3)."""
    along = np.einsum("nk,nkc->nc", weights, tangents[:, :, :3].astype(np.float64))
    flat = perpendicular(along, normals.astype(np.float64))
    made = np.concatenate([flat.astype(np.float32), tangents[:, 0, 3:]], axis=1)
    lost = ~flat.any(axis=1)
    made[lost] = arbitrary_tangents(normals[lost])
    return made


def _some(hits: Hits, chosen: npt.NDArray[np.int64]) -> Hits:
    uvt = (hits.u[chosen], hits.v[chosen], hits.distance[chosen])
    return Hits(hits.view, hits.samples, hits.face[chosen], *uvt)


def _lights(frame: Frame) -> dict[NodeId, Light]:
    return {light.id: light for light in frame.scene.of(Light) if frame.scene.shown(light.id)}
