"""Driving light between surfaces as the window does, and reading what it gave at chosen vertices."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio.bench.cuts_measure import changed, fitting, kept_bytes
from studio.bench.interreflection_truth import Light3, Places
from studio_core.contract import Services
from studio_core.params import build, param_infos
from studio_core.raster import PictureStage
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Light, Scene
from studio_core.session import View
from studio_core.shading.artifacts import (
    Casters,
    Hits,
    Indirect,
    Lighting,
    Picture,
    Radiance,
    Shapes,
    Surfaces,
)
from studio_core.shading.frame import Frame, IndirectChoice
from studio_core.shading.indirect import IndirectStage, unrefined_seen, with_indirect
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params
from studio_core.shading.pipeline import Pipeline
from studio_core.transport.operator import Transport
from studio_core.transport.patterns import cosine_pattern

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
PROBES = 32
OWNERS = ("studio_core", "studio_plugins")
BETWEEN = ("IndirectStage", "CombineStage")
"""Stages that are there for light between surfaces alone."""


@dataclass(frozen=True)
class Step:
    """One frame: seconds in all, of light between surfaces alone, and of that method's own stages."""

    seconds: float
    between: float
    stages: Mapping[str, float]
    counts: Mapping[str, int]
    facts: Mapping[str, float]
    rounds: int


class Editor:
    """One pipeline of a backend and a method; every `go` is a frame of the window."""

    def __init__(
        self,
        backend: Any,
        services: Services,
        method: str,
        view: View,
        values: Mapping[str, object],
        choices: Mapping[str, object] | None = None,
    ) -> None:
        self.services, self.view = services, view
        self.params = backend_params(backend, fitting(backend, values))
        maker = services.registry.get("indirect", method)
        known = param_infos(maker.Params)
        self.choice = IndirectChoice(
            method, build(maker.Params, {k: v for k, v in (choices or {}).items() if k in known})
        )
        self.pipeline = Pipeline([*with_indirect(backend.stages(services), services), PictureStage(services)])
        self.frame: Frame | None = None

    def go(self, scene: Scene, moving: bool) -> tuple[Step, Picture]:
        """Shade a scene after whatever came before."""
        before = self.frame
        revision = 1 if before is None else before.revision + 1
        self.frame = Frame(scene, self.view, self.params, revision, moving, self.choice)
        changes = Changes() if before is None else changed(before, self.frame)
        started = time.perf_counter()
        picture: Picture = self.pipeline.update(self.frame, changes, Job("bench"))
        seconds = time.perf_counter() - started
        between = sum(run.seconds for run in self.pipeline.report if run.name in BETWEEN)
        own: dict[str, float] = {}
        for run in self.stage.report:
            own[run.name] = own.get(run.name, 0.0) + run.seconds
        made = self.pipeline.artifact(Indirect)
        counts = {} if made is None else dict(made.counts)
        facts = {} if made is None else dict(made.facts)
        return Step(seconds, between, own, counts, facts, self.pipeline.rounds), picture

    @property
    def stage(self) -> IndirectStage:
        """That runs the method."""
        return next(stage for stage in self.pipeline.stages if isinstance(stage, IndirectStage))

    def seen(self) -> I64:
        """Vertices of the unrefined meshes that the last picture shows."""
        surfaces, hits = self.pipeline.artifact(Surfaces), self.pipeline.artifact(Hits)
        assert surfaces is not None
        assert hits is not None
        origins = None if surfaces.tree is None else surfaces.tree.origins
        return np.flatnonzero(unrefined_seen(surfaces, hits, origins))

    def free(self, rows: I64) -> I64:
        """Those of some vertices on which nothing stands: half of their rays, or more, meet no inside."""
        surfaces, casters = self.pipeline.artifact(Surfaces), self.pipeline.artifact(Casters)
        assert surfaces is not None
        assert casters is not None
        kept = Transport(self.services.workers, cosine_pattern(PROBES, seed=77))
        wanted = np.zeros(len(surfaces.unrefined.mesh), np.bool_)
        wanted[rows] = True
        kept.update(surfaces, casters, wanted, None)
        return rows[kept.share_back[kept.row_of[rows]] < 0.5]

    def light(self, places: Places) -> Light3:
        """What was made there for the last frame; for pipelines that refine nothing."""
        radiance = self.pipeline.artifact(Radiance)
        assert radiance is not None
        assert self.frame is not None
        assert radiance.indirect is not None
        scene, rows = self.frame.scene, places.rows
        lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
        indirect, between = radiance.indirect.terms[rows], radiance.indirect.irradiance[rows]
        straight = radiance.combined(lights)[rows]
        straight[:, : indirect.shape[1]] -= indirect
        return Light3(
            places.radiance(straight),
            places.radiance(indirect),
            radiance.irradiance(lights)[rows] - between,
            between.copy(),
        )

    def nbytes(self) -> int:
        """Bytes of arrays that only light between surfaces keeps."""
        seen: set[int] = set()
        kinds = (Surfaces, Casters, Shapes, Lighting, Hits, Radiance)
        for stage in self.pipeline.stages:
            if type(stage).__name__ not in BETWEEN:
                kept_bytes(stage, OWNERS, seen)
        others = [self.pipeline.artifact(kind) for kind in kinds]
        for artifact in others[:-1]:
            kept_bytes(artifact, OWNERS, seen)
        kept_bytes(self.services, OWNERS, seen)
        total = kept_bytes(self.pipeline.artifact(Indirect), OWNERS, seen)
        return total + kept_bytes(self.stage, OWNERS, seen)
