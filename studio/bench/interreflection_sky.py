"""The part of `lucarne bench interreflection` about where to look at the sky: cases `sky/SCENE`.

What counts is what the first bounce gathers: the mean of irradiance over the 64 vertices that rays by cosine
from a visible place meet, against 2^13 directions with the brightest in quarters. `plain` looks in the same
directions from everywhere, by radiance alone; `own` in 16 variants, by radiance alone; without a word: by
zones, where light gets to (`studio_core.transport.sky_samples`). Suns are left out. Each error is over
several mesh sizes, and so several draws.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report
from studio.bench.reference import furniture
from studio.headless import Headless
from studio.samples import sample
from studio_core.kernels.packets import OPAQUE
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Environment, Scene
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.shading.artifacts import Casters, Hits, Lighting, Shapes, Surfaces
from studio_core.shading.brute_force import VisibilityBits, environment_layer
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import scene_view
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.primary import visible_vertices
from studio_core.shading.stages import SurfaceParams, common_stages
from studio_core.transport.light_samples import LightSamples, SampleCounts, distant
from studio_core.transport.separable import Separator
from studio_core.transport.sky_samples import Power, SkyChooser, draw
from studio_core.transport.source_light import SourceLight
from studio_core.transport.zones import ZONES

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

BUDGETS = (8000, 9000, 10000)
RECEIVERS, RAYS = 400, 64
TRUTH = 13
WINDOW = "back:1.4x1.2@0.9"
COUNTS = (64, 256)


class Plain(SkyChooser):
    """Draws by radiance alone, the same for all zones."""

    def choose(
        self, mesh: Any, casters: Any, lighting: Lighting, counts: SampleCounts, seen: Any, job: Any = None
    ) -> LightSamples | None:
        """Samples of the environment."""
        assert lighting.tree is not None
        assert lighting.environment is not None
        power = Power.of(lighting.tree)
        chance = np.tile(power.cells / power.total, (ZONES, 1))
        drawn = draw(lighting.tree, power, chance, counts.environment, counts.variants)
        return distant(*drawn, lighting.environment.id, ("plain", counts))


def run(report: Report, program: Headless, setup: Any) -> None:
    """`gathered_error…` and `gathered_median…` of all scenes that are wanted."""
    from studio_core.project.store import load

    scenes: dict[str, Any] = {
        "sample": lambda: load(sample()).scene,
        "courtyard": lambda: furniture("courtyard", program),
        "interior": lambda: furniture("interior", program),
        "window": lambda: furniture("courtyard", program, room="5x4x2.6", windows=(WINDOW,)),
    }
    for name, make in scenes.items():
        if not report.wants(f"sky/{name}"):
            continue
        scene: Scene | None = make()
        if scene is None:
            report.notes.append(f"sky/{name}: the shared test data is absent.")
            continue
        rows: dict[str, list[tuple[float, float]]] = {}
        for budget in BUDGETS[:1] if report.quick else BUDGETS:
            for metric, error in errors(scene, budget, program).items():
                rows.setdefault(metric, []).append(error)
        for metric, found in rows.items():
            whole, middle = np.array(found).T
            report.add(f"sky/{name}", f"gathered_error{metric}", float(np.sqrt(np.mean(whole**2))), "1")
            report.add(f"sky/{name}", f"gathered_median{metric}", float(middle.mean()), "1")


def errors(scene: Scene, budget: int, program: Headless) -> dict[str, tuple[float, float]]:
    """Relative RMSE, and median of each place's own relative error, by how directions are chosen."""
    pipeline, job = Pipeline(common_stages(program.services)), Job("bench")
    frame = Frame(scene, scene_view(scene, None, 480, 270), SurfaceParams(budget), 1)
    pipeline.update(frame, Changes(), job)
    surfaces, casters, shapes, lighting, hits = (
        pipeline.artifact(kind) for kind in (Surfaces, Casters, Shapes, Lighting, Hits)
    )
    workers, mesh = program.services.workers, surfaces.mesh
    lighting = dataclasses.replace(lighting, lamps=(), sun=None)
    seen = visible_vertices(surfaces, hits)
    met = gathered_from(surfaces, casters, seen, program)
    bits = VisibilityBits(mesh, casters.primary, workers)
    used = np.unique(met[met >= 0])
    true = environment_layer(
        mesh, shapes, lighting, bits, np.zeros(3), used, TRUTH, workers, job
    ).irradiance.astype(np.float64)
    lights = {e.id: Environment(id=e.id, name=e.name, image=e.image) for e in scene.of(Environment)}
    functions, expected = Separator()(shapes, 0.15, 1), _means(true, met)
    found = {}
    for label, sky, variants in (("_plain", Plain, 1), ("_own", Plain, 16), ("", SkyChooser, 16)):
        for directions in COUNTS:
            light = SourceLight(workers, sky(workers))
            counts = SampleCounts(1, directions, variants)
            light.update(surfaces, casters, lighting, counts, job, seen)
            made = _means(light.sums(surfaces, shapes, functions, lights).irradiance, met)
            off = made - expected
            own = np.abs(off).mean(axis=1) / np.maximum(expected.mean(axis=1), 1e-9)
            whole = float(np.sqrt(np.mean(off**2)) / expected.mean())
            found[f"{label}_{directions}"] = whole, float(np.median(own))
    return found


def gathered_from(
    surfaces: Surfaces, casters: Casters, seen: npt.NDArray[np.bool_], program: Headless
) -> I64:
    """(RECEIVERS, RAYS) vertices that rays by cosine from random visible vertices meet; −1 for none."""
    mesh, caster, rng = surfaces.mesh, casters.primary, np.random.default_rng(9)
    starts = np.repeat(rng.choice(np.flatnonzero(seen), RECEIVERS), RAYS)
    normals = mesh.normals[starts].astype(np.float64)
    towards = rng.normal(size=normals.shape)
    towards = normals + towards / np.linalg.norm(towards, axis=1, keepdims=True)
    origins = mesh.positions[starts] + mesh.origin + caster.epsilon * mesh.geometric[starts]
    origins += mesh.inset[starts]
    hits = caster.closest(origins, towards, 0.0, np.inf, program.services.workers, mask=OPAQUE)
    face = np.where(hits.face >= 0, mesh.face_offsets[hits.object] + hits.face, 0)
    sides = np.where(hits.front[:, None], mesh.faces[face], mesh.back_faces[face])
    corner = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1).argmax(axis=1)
    met = np.take_along_axis(sides, corner[:, None], axis=1)[:, 0]
    return np.where((hits.face < 0) | (met == NO_BACK), -1, met.astype(np.int64)).reshape(-1, RAYS)


def _means(irradiance: npt.NDArray[np.floating], met: I64) -> F64:
    """(RECEIVERS, 3) mean over what rays meet, in float64; what leaves the scene counts 0."""
    values = np.where(met[..., None] >= 0, irradiance[np.maximum(met, 0)], 0.0)
    return np.asarray(values.mean(axis=1, dtype=np.float64))
