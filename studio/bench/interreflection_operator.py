"""The part of `lucarne bench interreflection` about what all methods stand on: cases `operator/…`.

`operator/rays-N/SCENE`: rays of every vertex, N each: traced anew, after a step of a drag, kept. `operator/
light/SCENE`: light straight from all lights at every vertex, traced anew, after a step of a drag, and summed
again after a light was dimmed. `operator/phong-n`: how many products a lobe of exponent n comes apart into.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from studio.bench.harness import Report, Timing
from studio.bench.interreflection_edits import dims, drags
from studio.bench.interreflection_scenes import Setting, setting
from studio.headless import Headless
from studio_core.arrays import frozen_map
from studio_core.scene.diff import Changes, diff
from studio_core.scene.nodes import Light, Material, Scene
from studio_core.shading.artifacts import Casters, Hits, Lighting, Shapes, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import scene_view
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.primary import visible_vertices
from studio_core.shading.stages import SurfaceParams, common_stages
from studio_core.shading.varying import ShapeTable
from studio_core.transport.light_samples import SampleCounts
from studio_core.transport.operator import Transport
from studio_core.transport.patterns import cosine_pattern
from studio_core.transport.separable import Separator
from studio_core.transport.source_light import SourceLight

SCENES = ("room", "sample")
RAYS = (16, 64)
SAMPLES = SampleCounts(lamp=1, environment=64)
EXPONENTS = (5, 10, 16, 64, 256)
TOLERANCES = (5, 15, 30)
MOST = 64
STEPS = 7


@dataclass
class Stand:
    """A scene's artifacts, brought along from scene to scene."""

    pipeline: Pipeline
    one: Setting
    scene: Scene
    revision: int = 0

    @classmethod
    def of(cls, one: Setting, program: Headless) -> Stand:
        """Of a setting as it is."""
        made = cls(Pipeline(common_stages(program.services)), one, one.scene)
        made.go(one.scene)
        return made

    def go(self, scene: Scene) -> None:
        """To another scene."""
        view = replace(scene_view(scene, None, 960, 540), antialias=1)
        changes = diff(self.scene, scene) if self.revision else Changes()
        self.revision += 1
        frame = Frame(scene, view, SurfaceParams(self.one.budget), self.revision, True)
        self.pipeline.update(frame, changes, Job("bench"))
        self.scene = scene

    def get(self, kind: type) -> Any:
        """What there is of a kind."""
        return self.pipeline.artifact(kind)


def run(report: Report, program: Headless, setup: Any) -> None:
    """All cases that are wanted."""
    for scene in SCENES:
        names = [*(f"operator/rays-{rays}/{scene}" for rays in RAYS), f"operator/light/{scene}"]
        if not any(report.wants(name) for name in names):
            continue
        one = setting(scene, program)
        assert one is not None
        for rays, name in zip(RAYS, names, strict=False):
            if report.wants(name):
                kept_rays(report, name, Stand.of(one, program), program, rays)
        if report.wants(names[-1]):
            source_light(report, names[-1], Stand.of(one, program), program)
    for exponent in EXPONENTS:
        name = f"operator/phong-{exponent}"
        if report.wants(name):
            products(report, name, program, float(exponent))


def kept_rays(report: Report, name: str, stand: Stand, program: Headless, rays: int) -> None:
    """`mrays_per_s`, `ms_trace`, `ms_move`, `share_redone`, `share_tested`, `bytes`."""
    pattern, workers = cosine_pattern(rays), program.services.workers
    everything = np.ones(len(stand.get(Surfaces).mesh), np.bool_)

    def update(made: Transport) -> tuple[float, Any]:
        started = time.perf_counter()
        counts = made.update(stand.get(Surfaces), stand.get(Casters), everything, Job("bench"))
        return time.perf_counter() - started, counts

    taken = []
    for _ in range(4):
        made = Transport(workers, pattern)
        taken.append(update(made))
    whole = Timing.of(seconds for seconds, _ in taken[1:])
    rate = taken[-1][1].rays / min(seconds for seconds, _ in taken[1:]) / 1e6
    report.add(name, "mrays_per_s", rate, "1e6/s")
    report.add(name, "ms_trace", 1000 * whole.median, "ms", 1000 * whole.spread)
    moves = []
    for scene in [*drags(stand.one, STEPS), stand.one.scene]:
        stand.go(scene)
        moves.append(update(made))
    moved = Timing.of(seconds for seconds, _ in moves[1:])
    report.add(name, "ms_move", 1000 * moved.median, "ms", 1000 * moved.spread)
    total = len(everything) * rays
    report.add(name, "share_redone", float(np.median([counts.rays for _, counts in moves])) / total, "1")
    report.add(name, "share_tested", float(np.median([counts.tested for _, counts in moves])) / total, "1")
    report.add(name, "bytes", made.nbytes, "B")


def source_light(report: Report, name: str, stand: Stand, program: Headless) -> None:
    """`ms_trace`, `ms_move`, `ms_sums`, `samples`, `bytes`."""
    workers, separated = program.services.workers, Separator()
    hits: Hits = stand.get(Hits)
    seen = visible_vertices(stand.get(Surfaces), hits)

    def update(made: SourceLight) -> float:
        started = time.perf_counter()
        made.update(stand.get(Surfaces), stand.get(Casters), stand.get(Lighting), SAMPLES, Job("bench"), seen)
        return time.perf_counter() - started

    def summed(made: SourceLight) -> float:
        shapes: Shapes = stand.get(Shapes)
        functions = separated(shapes, 0.15, 36)
        lights = {light.id: light for light in stand.scene.of(Light) if stand.scene.shown(light.id)}
        started = time.perf_counter()
        made.sums(stand.get(Surfaces), shapes, functions, lights, None, Job("bench"))
        return time.perf_counter() - started

    traced = []
    for _ in range(3):
        made = SourceLight(workers)
        traced.append(update(made))
    sums = [summed(made)]
    for scene in dims(stand.one, STEPS):
        stand.go(scene)
        sums.append(summed(made))
    moves = []
    for scene in [*drags(stand.one, STEPS), stand.one.scene]:
        stand.go(scene)
        moves.append(update(made))
    for metric, taken in (("ms_trace", traced[1:]), ("ms_sums", sums[1:]), ("ms_move", moves[1:])):
        timing = Timing.of(taken)
        report.add(name, metric, 1000 * timing.median, "ms", 1000 * timing.spread)
    report.add(name, "bytes", made.nbytes, "B")


def products(report: Report, name: str, program: Headless, exponent: float) -> None:
    """`products_T` and `error_T` by tolerance in per cent, `ms` of taking the lobe apart."""
    values = {"diffuse": (0.0, 0.0, 0.0), "specular": (1.0, 1.0, 1.0), "exponent": exponent}
    material = Material(id="lobe", name="Lobe", model="phong", values=frozen_map(values))
    scene = Scene().with_materials(material)
    nothing = np.zeros(0, np.int32), np.zeros((0, 2), np.float32)
    shapes = ShapeTable(program.registry).at(scene, (material.id,), *nothing)
    taken = []
    for tolerance in TOLERANCES:
        Separator()(shapes, tolerance / 100, MOST)
        started = time.perf_counter()
        found = Separator()(shapes, tolerance / 100, MOST)
        taken.append(time.perf_counter() - started)
        report.add(name, f"products_{tolerance}", int(found.count[0]), "1")
        report.add(name, f"error_{tolerance}", float(found.error[0]), "1")
    report.add(name, "ms", 1000 * max(taken), "ms")
