"""Light between surfaces by `gather` in small rooms, driven as `IndirectStage` drives it."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from path_rooms import stand

from studio_core.contract import Services
from studio_core.scene.diff import Aspect, Changes, diff, view_changed
from studio_core.scene.nodes import Scene
from studio_core.shading.artifacts import (
    Casters,
    DirectRadiance,
    Hits,
    Indirect,
    Lighting,
    Receivers,
    Shapes,
    Surfaces,
)
from studio_core.shading.frame import Frame, IndirectChoice
from studio_core.shading.job import Job
from studio_core.shading.path_tracing import PathSettings, chosen_points, indirect_halves
from studio_core.shading.path_world import PathWorlds
from studio_core.shading.pipeline import Pipeline
from studio_core.transport.reflectance import VertexCoefficients
from studio_plugins.interreflection.gather.method import METHOD, Params

HANDED = (Surfaces, Casters, Shapes, Lighting, Receivers, DirectRadiance)


class Room:
    """A scene, what the backend's first stages make of it, and the method's pipeline."""

    def __init__(self, scene: Scene, services: Services, vertices: int = 1500, **params: Any) -> None:
        self.services, self.params = services, Params(**params)
        self._stand = stand(scene, services, vertices)
        self._outer, self._frame = self._stand.pipeline, self._stand.frame
        self._choice = IndirectChoice("gather", self.params)
        self.inner = Pipeline(METHOD.stages(services), HANDED)
        self._marked: Frame | None = None
        self.scene = scene

    def light(self, scene: Scene | None = None, moving: bool = True, **params: Any) -> Indirect:
        """The layer, after one round while something moves, else after all rounds."""
        if params:
            self.params = dataclasses.replace(self.params, **params)
            self._choice = IndirectChoice("gather", self.params)
        changes = diff(self.scene, scene) if scene is not None else Changes()
        self.scene = scene or self.scene
        frame = dataclasses.replace(
            self._frame, scene=self.scene, indirect=self._choice, moving=moving, revision=1
        )
        if self._marked is not None and changes:
            self._outer.update(dataclasses.replace(frame, indirect=None), changes, Job("outer"))
        if self._marked is None or self._marked.moving != moving or params:
            changes |= view_changed(Aspect.VIEW | Aspect.QUALITY)
        self._marked = frame
        job, handed = Job("inner"), self.handed()
        made: Indirect = self.inner.start(frame, changes, job, handed)
        while not moving and self.inner.wants_more(frame, job):
            made = self.inner.refine(frame, job, handed)
        return made

    def complete(self) -> None:
        """What is done in idle time."""
        assert self._marked is not None
        self.inner.complete(self._marked, Job("idle"))

    def handed(self) -> dict[type, Any]:
        """What the method's stages get; everything is seen."""
        found: dict[type, Any] = {k: self._outer.artifact(k) for k in (Surfaces, Casters, Shapes, Lighting)}
        eye = np.asarray(self._frame.view.transform.translation, np.float64)
        if getattr(self, "_receivers", None) is None:
            self._receivers = Receivers(np.ones(len(found[Surfaces].mesh), np.bool_), eye)
        assert self._outer.artifact(Hits) is not None
        return {**found, Receivers: self._receivers, DirectRadiance: None}

    def radiance(self, terms: Any, some: Any) -> Any:
        """(N, 3) of light sums of some vertices."""
        surfaces = self._outer.artifact(Surfaces)
        assert surfaces is not None
        looks = VertexCoefficients(self.services)(self.scene, surfaces)[some]
        width = min(terms.shape[1], looks.shape[1])
        return np.maximum((terms[:, :width] * looks[:, :width]).sum(axis=1), 0)

    def truth(self, some: Any, samples: int = 512, bounces: int = 3) -> Any:
        """Two independent halves of path traced layers at some vertices."""
        found = self.handed()
        surfaces = found[Surfaces]
        world = PathWorlds(self.services.registry)(self.scene, surfaces, found[Casters], found[Lighting])
        points = chosen_points(surfaces.mesh, some)
        shapes = dataclasses.replace(found[Shapes].of_points(some), tilt=None)
        settings = PathSettings(bounces, samples, 1)
        return indirect_halves(
            points, shapes, found[Receivers].eye, world, settings, self.services.workers, Job("truth")
        )
