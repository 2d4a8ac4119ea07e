"""Pictures of any size: shaded once, then seen and composed in bands of rows, so that memory is bounded.

A picture with more samples than a *guide* may have is shaded for a guide: the same view in fewer pixels.
Then hidden places are lit too (where the backend can), since the picture sees what lies between the guide's
samples. What is seen in each band goes through `PrimaryStage` and `Compositor` as everything else does: bands
put together are, to the bit, the picture in one piece with the same radiance.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.contract import Services, ShadingBackend
from studio_core.kernels.compose import RECORD
from studio_core.raster import CoefficientTable, Compositor
from studio_core.scene.diff import Aspect, Changes, diff, everything, view_changed
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import WHITE, Environment, Light, Node, NodeId, Scene, new_id
from studio_core.session import ALL, SHARE, View
from studio_core.shading.artifacts import (
    Casters,
    Hits,
    LayerRadiance,
    MeasuredError,
    Radiance,
    Surfaces,
)
from studio_core.shading.backdrop import BackdropPainter
from studio_core.shading.error_meter import ErrorMeter
from studio_core.shading.frame import Frame, IndirectChoice
from studio_core.shading.indirect import with_indirect
from studio_core.shading.job import Job
from studio_core.shading.job_parts import JobPart
from studio_core.shading.lamps import shown_environment
from studio_core.shading.open_light import OpenLight
from studio_core.shading.pipeline import Inputs, Pipeline
from studio_core.shading.refinement import LocatedPrimaryStage

F32 = npt.NDArray[np.float32]

GUIDE_SAMPLES = 1 << 23  # 1920 × 1080 with 2 × 2 samples
BAND_SAMPLES = 1 << 22
MARGIN = 2  # rows: whether something ends in a pixel is seen beside it; even, so that packets stay the same
COMPOSING = 0.05  # of the time that shading takes, for as many samples as a guide has
BETWEEN = "between surfaces"
"""Among a picture's lights, what came by way of other surfaces."""
WHITE_SKY = Image(np.ones((1, 2, 3), np.float32))


@dataclass(frozen=True)
class Parts:
    """What of a picture is asked for besides its colours.

    transparent: nothing behind the objects, and `alpha`, which is also where shadows are caught; lights: a
    picture for every light, which add up, and one, `BETWEEN`, of what came by way of other surfaces.
    """

    transparent: bool = False
    lights: bool = False


@dataclass(frozen=True, eq=False)
class Band:
    """Rows from `top` on, scene-linear: linear (h, W, 3); alpha (h, W), 1 where nothing is seen through.

    With alpha `linear` is premultiplied, as compositing wants it. `lights` has (h, W, 3) by light.
    """

    top: int
    linear: F32
    alpha: F32 | None = None
    lights: Mapping[NodeId, F32] = field(default_factory=frozen_map)


def guide(view: View, most: int) -> View:
    """The view itself, or in fewer pixels where it has more samples than `most`."""
    shrink = (most / (view.width * view.height * view.antialias**2)) ** 0.5
    return view if shrink >= 1 else view.sized(int(view.width * shrink), int(view.height * shrink))


def shading_share(view: View) -> float:
    """Which part of a picture's time is over when it is shaded, about."""
    return 1 / (1 + COMPOSING * max(1.0, _samples(view) / GUIDE_SAMPLES))


class PictureMaker:
    """Pictures of one scene after another; what the backend keeps serves the next. For one thread."""

    def __init__(
        self,
        backend: ShadingBackend,
        params: Any,
        services: Services,
        *,
        indirect: IndirectChoice | None = None,
        light: str = ALL,
    ) -> None:
        self._params, self._services = params, services
        self._indirect, self._light = indirect, light
        self._spacious = "everywhere" in {f.name for f in dataclasses.fields(params)}
        self._pipeline = Pipeline(with_indirect(backend.stages(services), services))
        self._coefficients = CoefficientTable(services.registry)
        self._compositor = Compositor(services.workers)
        self._backdrop = BackdropPainter(services.workers)
        self._frame: Frame | None = None
        self._view = View()

    @property
    def radiance(self) -> Radiance | None:
        """What was last shaded."""
        return self._pipeline.artifact(Radiance)

    def shade(self, scene: Scene, view: View, job: Job) -> Radiance:
        """Bring radiance up to date for a picture of this view."""
        before, seen, params = self._frame, view, self._params
        if self._spacious:
            seen = guide(view, GUIDE_SAMPLES)
            if seen is not view:
                params = dataclasses.replace(params, everywhere=True)
        revision = 1 if before is None else before.revision + 1
        frame = Frame(scene, seen, params, revision, indirect=self._indirect, light=self._light)
        changed = Changes()
        if before is not None:
            changed = diff(before.scene, scene) | view_changed(Aspect.VIEW | Aspect.QUALITY)
        self._frame, self._view = frame, view
        made: Radiance = self._pipeline.update(frame, changed, _Rounds(self._pipeline, job))
        return made

    def measure(self, places: int, job: Job) -> MeasuredError | None:
        """The error of what was last shaded, at so many random places of the guide; None: nothing is seen."""
        assert self._frame is not None
        return ErrorMeter(self._services, places)(self._pipeline, self._frame, job)

    def bands(self, job: Job, parts: Parts | None = None, most: int | None = None) -> Iterator[Band]:
        """The picture that was last shaded, from the top down."""
        radiance, frame = self.radiance, self._frame
        assert radiance is not None
        assert frame is not None
        parts = parts or Parts()
        view, casters = self._view, self._pipeline.artifact(Casters)
        whole = radiance.hits or self._pipeline.artifact(Hits)
        in_one = whole is not None and frame.view == view and _samples(view) <= GUIDE_SAMPLES
        if in_one or casters is None:
            assert whole is not None
            yield self._band(frame.scene, radiance, whole, 0, view.height, parts, job)
            return
        primary = LocatedPrimaryStage(self._services)
        given = {Surfaces: radiance.surfaces, Casters: casters}
        for top, height in rows_of(view, most or BAND_SAMPLES):
            job.checkpoint(top, view.height)
            above, below = min(MARGIN, top), min(MARGIN, view.height - top - height)
            part = view.part(top - above, above + height + below)
            quiet = JobPart(job, top / view.height, top / view.height)
            seen = dataclasses.replace(frame, view=part)
            hits = primary.run(seen, Inputs(given, everything(frame.scene)), quiet)
            yield self._band(frame.scene, radiance, hits, above, height, parts, quiet)
        job.checkpoint(view.height, view.height)

    def _band(
        self, scene: Scene, radiance: Radiance, hits: Hits, skip: int, height: int, parts: Parts, job: Job
    ) -> Band:
        """Rows skip … skip + height − 1 of what the hits see."""
        table = self._coefficients(scene, radiance.surfaces)

        make = self._compositor.share if self._light == SHARE else self._compositor.picture

        def made(of: Scene, light: Radiance) -> F32:
            picture = make(of, light, hits, table, job)
            return np.ascontiguousarray(picture.linear[skip : skip + height])

        sky, alpha, lights = shown_environment(scene), None, {}
        if parts.transparent:
            white, passed = self._white(scene, radiance, sky)
            alpha = np.clip(np.float32(1) - made(white, passed)[:, :, 1], 0, 1)
            if sky is not None:
                scene = scene.with_nodes(dataclasses.replace(sky, background=False))
        linear = made(scene, radiance)
        if parts.lights:
            # surfaces that catch shadows need the picture that they stand in, which counts once
            unlit = scene if sky is None else scene.with_nodes(_darkened(scene[sky.id]))
            for node in layers_of(scene, radiance):
                own = scene if sky is not None and node == sky.id else unlit
                lights[node] = made(own, _alone(radiance, node))
        return Band(hits.view.top + skip, linear, alpha, frozen_map(lights))

    def _white(self, scene: Scene, radiance: Radiance, sky: Environment | None) -> tuple[Scene, Radiance]:
        """White behind dark objects: what is seen of it is not covered. Caught shadows stay as they are."""
        plain = {"image": WHITE_SKY, "intensity": 1.0, "tint": WHITE, "temperature": 0.0, "background": True}
        white = dataclasses.replace(sky or Environment(id=new_id("white"), image=WHITE_SKY), **plain)  # type: ignore[arg-type]
        mesh, layers = radiance.surfaces.mesh, {}
        if sky is not None and radiance.surfaces.catches.any():
            record = np.zeros((len(radiance.valid), RECORD), np.float32)
            seen = scene.with_nodes(dataclasses.replace(sky, background=True))
            self._backdrop.light(seen, radiance, record)
            turn = sky.rotation().matrix()[:3, :3]
            even = OpenLight(np.ones((96, 192, 3), np.float32)).irradiance(mesh.normals @ turn)
            arrives = (record[:, 3:6] * even).astype(np.float32)
            layers[white.id] = LayerRadiance(np.zeros((len(arrives), radiance.width, 3), np.float32), arrives)
        return scene.with_nodes(white), dataclasses.replace(radiance, layers=layers, indirect=None)


class _Rounds(JobPart):
    """Stages one after another, then rounds of refinement, as one bar."""

    def __init__(self, pipeline: Pipeline, job: Job) -> None:
        super().__init__(job, 0.0, 1.0)
        self._pipeline = pipeline

    def at(self, share: float) -> None:
        """The first round is half of the work, each further one half of what is left."""
        pipeline = self._pipeline
        stage = (pipeline.current + share) / len(pipeline.stages) if not pipeline.rounds else share
        half = 0.5**pipeline.rounds
        super().at((1 - half) + 0.5 * half * stage)


def layers_of(scene: Scene, radiance: Radiance) -> tuple[NodeId, ...]:
    """The lights that a picture of the scene is made of; `BETWEEN` where that is among them."""
    lamps = tuple(n for n in radiance.layers if isinstance(scene.nodes.get(n), Light) and scene.shown(n))
    return lamps if radiance.indirect is None else (*lamps, BETWEEN)


def _alone(radiance: Radiance, node: NodeId) -> Radiance:
    """With one of `layers_of` alone."""
    if node == BETWEEN:
        return dataclasses.replace(radiance, layers={})
    return dataclasses.replace(radiance, layers={node: radiance.layers[node]}, indirect=None)


def rows_of(view: View, most: int) -> list[tuple[int, int]]:
    """(top, height) of bands with at most so many samples, each from an even row on."""
    height = most // (view.width * view.antialias**2) // 2 * 2
    height = max(2, height)
    return [(top, min(height, view.height - top)) for top in range(0, view.height, height)]


def _samples(view: View) -> int:
    return view.width * view.height * view.antialias**2


def _darkened(sky: Node) -> Node:
    assert isinstance(sky, Environment)
    return dataclasses.replace(sky, intensity=0.0)
