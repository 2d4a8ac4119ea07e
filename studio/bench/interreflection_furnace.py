"""The part of `lucarne bench interreflection` about closed rooms of one albedo: cases `furnace-ρ`.

Where every place of a closed room sends 1 of its own, all light together is 1/(1 − ρ) everywhere, whatever
the room's shape; after n bounces of it 1 + ρ + … + ρⁿ⁻¹. A box and a bent egg are looked at over kept rays,
a ball lit from its middle through the whole pipeline: there direct light is even too.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report
from studio.bench.interreflection_measure import Editor
from studio.bench.interreflection_meshes import inside_out, star
from studio.bench.interreflection_scenes import AS_MADE, FURNACES, furnace
from studio.headless import Headless
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import MeshObject, Scene
from studio_core.shading.artifacts import Casters, Indirect, Radiance, Shapes, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import scene_view
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.stages import SurfaceParams, common_stages
from studio_core.transport.bounces import Light, Surface, bounced
from studio_core.transport.operator import Transport
from studio_core.transport.patterns import cosine_pattern
from studio_core.transport.reflectance import VertexCoefficients
from studio_core.transport.separable import Separator

F64 = npt.NDArray[np.float64]
RAYS = 64
PARTIAL = (1, 2, 3, 5)


def run(report: Report, program: Headless, setup: Any) -> None:
    """`furnace_error` and the others, of every albedo that is wanted."""
    for albedo in FURNACES:
        name = f"furnace-{albedo}"
        if not report.wants(name):
            continue
        for suffix, curved in (("", False), ("_curved", True)):
            settled, partial = over_kept_rays(furnace(albedo, curved), program, albedo)
            report.add(name, f"furnace_error{suffix}", settled, "1")
            report.add(name, f"furnace_partial_error{suffix}", partial, "1")
        if "gather" in program.registry.names("indirect"):
            worst, mean = through_all(ball(albedo), program, albedo)
            report.add(name, "furnace_whole_error", worst, "1")
            report.add(name, "furnace_whole_mean_error", mean, "1")


def over_kept_rays(scene: Scene, program: Headless, albedo: float) -> tuple[float, float]:
    """The worst vertex' relative error when all has settled, and after some numbers of bounces."""
    services = program.services
    pipeline = Pipeline(common_stages(services))
    frame = Frame(scene, scene_view(scene, None, 96, 54), SurfaceParams(AS_MADE), 1)
    pipeline.update(frame, Changes(), Job("furnace"))
    surfaces, casters, shapes = (pipeline.artifact(kind) for kind in (Surfaces, Casters, Shapes))
    assert surfaces is not None
    assert casters is not None
    assert shapes is not None
    mesh = surfaces.unrefined.mesh
    count = len(mesh)
    table = Transport(services.workers, cosine_pattern(RAYS))
    table.update(surfaces, casters, np.ones(count, np.bool_), Job("furnace"))
    surface = Surface(
        shapes.rows(mesh),
        np.full(count, -1, np.int64),
        0,
        VertexCoefficients(services)(scene, surfaces),
        Separator()(shapes, 0.15, 36),
    )
    one = Light(np.ones((count, 3), np.float32), np.zeros(0, np.float32))
    within = inside(scene, mesh.positions + mesh.origin, mesh.normals)

    def wrong(bounces: int | None, expected: float) -> float:
        made = bounced(one, bounces, [table], surface, services.workers).light.matte[within]
        return float(np.abs(made / expected - 1).max())

    partial = max(wrong(n, sum(albedo**k for k in range(n))) for n in PARTIAL)
    return wrong(None, 1 / (1 - albedo)), partial


def inside(scene: Scene, positions: npt.ArrayLike, normals: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """(V,) which vertices of a room about its origin look inwards."""
    middle = next(scene.of(MeshObject)).geometry.bounds.mean(axis=0)
    away = np.asarray(positions, np.float64) - middle
    return np.asarray((away * np.asarray(normals)).sum(axis=1) < 0)


def ball(albedo: float) -> Scene:
    """A round room of radius 1, a bulb in its middle."""
    scene = furnace(albedo)
    walls = scene["walls"]
    assert isinstance(walls, MeshObject)
    mesh = inside_out(star(48, 72, lambda towards: np.ones(len(towards))))
    return scene.with_nodes(dataclasses.replace(walls, geometry=mesh))


def through_all(scene: Scene, program: Headless, albedo: float) -> tuple[float, float]:
    """(worst, mean) relative error of all light over what comes straight, at seen vertices, at rest, settled.

    Flat faces are nearer to the bulb than vertices: 0.2 % of it is the mesh's.
    """
    backend = program.registry.get("backend", "cuts")
    view = dataclasses.replace(scene_view(scene, None, 240, 135), antialias=1)
    values = {"vertices": AS_MADE, "refine": False}
    editor = Editor(backend, program.services, "gather", view, values, {"settle": True})
    editor.go(scene, False)
    rows, made = editor.seen(), editor.pipeline.artifact(Indirect)
    radiance = editor.pipeline.artifact(Radiance)
    assert made is not None
    assert radiance is not None
    lights = {light.id: light for light in scene.of(type(scene["bulb"]))}
    total = radiance.irradiance(lights)[rows].astype(np.float64)  # type: ignore[arg-type]
    straight = total - made.layer.irradiance[rows]
    off = total * (1 - albedo) / straight.mean() - 1
    return float(np.abs(off).max()), float(abs(off.mean()))
