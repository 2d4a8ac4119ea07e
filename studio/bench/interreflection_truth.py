"""What all light is, at some vertices: brute force for what comes straight, paths for what came by surfaces.

Paths come in two independent halves, so that their own noise drops out of errors (`harness.unbiased_rmse`).
Results are kept by content in the user's cache folder: a second run compares with the same truth.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio.bench.harness import unbiased_rmse
from studio_core.arrays import content_hash
from studio_core.contract import Services
from studio_core.folders import user_cache
from studio_core.scene.geometry import Geometry, Image, Table, Texture
from studio_core.scene.nodes import Light, Scene
from studio_core.shading.artifacts import Casters, ChosenPoints, LayerRadiance, Lighting, Shapes, Surfaces
from studio_core.shading.brute_force import VisibilityBits, all_points, environment_layer, lamp_layer
from studio_core.shading.cache import DiskCache
from studio_core.shading.job import Job
from studio_core.shading.path_tracing import PathSettings, chosen_points, indirect_halves
from studio_core.shading.path_world import PathWorlds
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.vertex_radiance import vertex_weights

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
METHOD = "all light at vertices, 1"
LEVEL, LAMP_SAMPLES = 15, 256


@dataclass(frozen=True)
class Light3:
    """At N vertices, towards the eye: radiance that came straight, and by way of others; irradiance likewise.

    All are (N, 3), with the lights' gains and the materials' colours in them.
    """

    direct: F32
    indirect: F32
    direct_irradiance: F32
    irradiance: F32

    @property
    def all(self) -> F32:
        """Radiance of all light; never negative, as shown."""
        return np.maximum(self.direct + self.indirect, 0)


@dataclass(frozen=True)
class Truth:
    """Two independent estimates of the same."""

    first: Light3
    second: Light3

    def error(self, made: Light3, what: str, most: float = 1.0) -> float:
        """Relative RMSE of one of the quantities (`direct`, `indirect`, `irradiance`, `all`), without noise.

        Of that share of the places that are least wrong. 0 where there is no such light.
        """
        ours, one, two = (np.asarray(getattr(light, what)) for light in (made, self.first, self.second))
        if not (one + two).any():
            return 0.0
        if most < 1:
            a, b, c = (values.astype(np.float64) for values in (ours, one, two))
            order = np.argsort(((a - b) * (a - c)).mean(axis=1))[: round(most * len(a))]
            ours, one, two = ours[order], one[order], two[order]
        return unbiased_rmse(ours, one, two)

    def mean(self, what: str) -> F64:
        """(N, 3) of both."""
        one, two = (np.asarray(getattr(light, what), np.float64) for light in (self.first, self.second))
        return np.asarray((one + two) / 2)


@dataclass(frozen=True)
class Places:
    """Vertices (N,) of the unrefined meshes, and what light sums are multiplied with there (N, T, 3)."""

    rows: I64
    weights: F32

    @classmethod
    def of(cls, scene: Scene, surfaces: Surfaces, rows: I64, services: Services) -> Places:
        """Some vertices of a scene."""
        from studio_core.shading.artifacts import TERMS

        weights = vertex_weights(scene, surfaces.unrefined, TERMS, services.registry)[rows]
        return cls(rows, weights)

    def radiance(self, terms: F32) -> F32:
        """(N, 3) of light sums (N, T, 3)."""
        return np.asarray(np.einsum("ntc,ntc->nc", terms, self.weights[:, : terms.shape[1]]), np.float32)


class TruthTracer:
    """Makes truths; kept in `cache` by the scene's content and the places."""

    def __init__(
        self, services: Services, samples: int, bounces: int, cache: DiskCache | None = None
    ) -> None:
        self._services, self._samples, self._bounces = services, samples, bounces
        self._cache = cache or DiskCache(user_cache() / "truths")
        self._worlds = PathWorlds(services.registry)

    def __call__(self, scene: Scene, eye: F64, pipeline: Pipeline, places: Places) -> Truth:
        """At places of what `pipeline` has just shaded, which must be `scene`."""
        surfaces, casters = pipeline.artifact(Surfaces), pipeline.artifact(Casters)
        lighting, shapes = pipeline.artifact(Lighting), pipeline.artifact(Shapes)
        assert surfaces is not None
        assert casters is not None
        assert lighting is not None
        assert shapes is not None
        points = chosen_points(surfaces.unrefined.mesh, places.rows)
        where = content_hash(points.positions, points.normals, points.inset)
        key = (scene_key(scene), where, tuple(np.round(eye, 9)), self._samples, self._bounces)
        kept = self._cache.get(METHOD, *key)
        if kept is None:
            own = shapes.of_points(places.rows)
            direct = self._direct(scene, points, own, lighting, casters, eye)
            world = self._worlds(scene, surfaces, casters, lighting)
            settings = PathSettings(self._bounces, 2 * self._samples)
            halves = indirect_halves(points, own, eye, world, settings, self._services.workers, Job("truth"))
            kept = {}
            for name, layer in zip(("direct", "first", "second"), (direct, *halves), strict=True):
                kept |= {name: layer.terms, f"{name}_irradiance": layer.irradiance}
            self._cache.put(kept, METHOD, *key)
        straight = places.radiance(kept["direct"])
        one, two = (
            Light3(
                straight,
                places.radiance(kept[name]),
                kept["direct_irradiance"],
                kept[f"{name}_irradiance"],
            )
            for name in ("first", "second")
        )
        return Truth(one, two)

    def _direct(
        self,
        scene: Scene,
        points: ChosenPoints,
        shapes: Shapes,
        lighting: Lighting,
        casters: Casters,
        eye: F64,
    ) -> LayerRadiance:
        """All lights together, with gains."""
        every, workers, job = all_points(points), self._services.workers, Job("truth")
        shapes = dataclasses.replace(shapes, tilt=None)
        gains = {light.id: np.asarray(light.gain(), np.float32) for light in scene.of(Light)}
        made = [
            (
                lamp.node,
                lamp_layer(points, shapes, casters.shadow, lamp, eye, every, LAMP_SAMPLES, workers, job),
            )
            for lamp in lighting.lamps
        ]
        if lighting.environment is not None:
            bits = VisibilityBits(points, casters.shadow, workers)
            sky = environment_layer(points, shapes, lighting, bits, eye, every, LEVEL, workers, job)
            made.append((lighting.environment.id, sky))
        terms = np.zeros((len(points.positions), shapes.width, 3), np.float32)
        irradiance = np.zeros((len(points.positions), 3), np.float32)
        for node, layer in made:
            if scene.shown(node):
                terms += layer.terms * gains[node]
                irradiance += layer.irradiance * gains[node]
        return LayerRadiance(terms, irradiance)


def scene_key(scene: Scene) -> str:
    """Hex digest of all that light depends on: nodes but cameras, materials, by content."""
    import hashlib

    digest = hashlib.blake2b(digest_size=16)
    for held in (*scene.nodes.values(), *scene.materials.values()):
        if type(held).__name__ == "Camera":
            continue
        for field in dataclasses.fields(held):
            digest.update(f"{field.name} {_told(getattr(held, field.name))}\n".encode())
    return digest.hexdigest()


def _told(value: object) -> str:
    if isinstance(value, Geometry | Image | Table):
        return value.key
    if isinstance(value, Texture):
        return f"{value.image.key} {value.scale} {value.offset} {value.rotation} {value.aspect}"
    if hasattr(value, "items"):
        return str(sorted((name, _told(held)) for name, held in value.items()))
    return repr(value)
