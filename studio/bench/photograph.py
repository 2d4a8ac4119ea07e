"""`lucarne bench photograph`: furniture in a photograph: what it costs to show, and how true it is.

The sample room, as it is and with a floor that catches shadows, its environment far away and on the ground.
Compositions are repeated over the same radiance; errors are the meter's, brute force at random places.
"""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report, timed
from studio.headless import Headless
from studio_core.scene.nodes import FAR_AWAY, ON_THE_GROUND, Environment, MeshObject, Scene
from studio_core.scene.transform import Transform

if TYPE_CHECKING:
    from studio_core.shading.artifacts import Picture
    from studio_core.shading.job import Job

SIZE = (960, 540)
PLACES = 512
FLOOR = "Floor"


def cases(scene: Scene) -> dict[str, Scene]:
    """The room; its floor as part of the photograph; and that floor with nothing in the way of light."""
    floor = scene.named(FLOOR)
    assert isinstance(floor, MeshObject)
    catching = [dataclasses.replace(scene.material(m), catches=True) for m in floor.materials]
    sky = next(scene.of(Environment))
    made = {"plain": scene}
    for name, projection in (("far", FAR_AWAY), ("ground", ON_THE_GROUND)):
        seen = dataclasses.replace(sky, projection=projection, background=True, transform=Transform())
        made[name] = scene.with_materials(*catching).with_nodes(seen)
    others = [node for node in scene.of(MeshObject) if node.id != floor.id]
    hidden = [dataclasses.replace(node, hidden=True) for node in others]
    made["alone"] = made["ground"].with_nodes(*hidden)
    return made


def run(report: Report, program: Headless) -> None:
    """Rows CASE: milliseconds of compositions, errors, and how far `alone` is from the photograph."""
    from studio.samples import sample
    from studio_core.project.store import load

    for name, scene in cases(load(sample()).scene).items():
        with program.job(name) as job:
            _measure(report, program, name, scene, job)


def _measure(report: Report, program: Headless, name: str, scene: Scene, job: Job) -> None:
    from studio_core.raster import CoefficientTable, Compositor, PictureStage
    from studio_core.scene.diff import Changes
    from studio_core.shading.artifacts import Hits
    from studio_core.shading.error_meter import ErrorMeter
    from studio_core.shading.frame import Frame
    from studio_core.shading.offline import scene_view
    from studio_core.shading.pipeline import Pipeline

    services = program.services
    backend = services.registry.get("backend", "cuts")
    view = dataclasses.replace(scene_view(scene, None, *SIZE), antialias=2, fine_edges=True)
    pipeline = Pipeline([*backend.stages(services), PictureStage(services)])
    frame = Frame(scene, view, backend.Params(), 1)
    picture: Picture = pipeline.update(frame, Changes(), job)
    report.add(name, "caught_share", float(_shows(picture).mean()), "1")
    radiance, surfaces = picture.radiance, picture.radiance.surfaces
    table, compositor = CoefficientTable(services.registry)(scene, surfaces), Compositor(services.workers)
    hits = radiance.hits or pipeline.artifact(Hits)
    again = partial(compositor.picture, scene, radiance, hits, table, job)
    found = timed(again, 5 if report.quick else 25)
    report.add(name, "compose_ms", 1000 * found.median, "ms", 1000 * found.spread)
    error = ErrorMeter(services, PLACES)(pipeline, frame, job)
    if error is not None:
        report.add(name, "error", error.picture.relative_rmse, "1", error.picture.uncertainty)
    if name == "alone" and picture.colours is not None:
        caught = surfaces.catches[surfaces.mesh.material] & radiance.valid
        off = np.abs(picture.colours.record[caught, 3:6] - next(scene.of(Environment)).gain())
        report.add(name, "open_ratio_off", float(np.percentile(off, 99)), "1")


def _shows(picture: Picture) -> npt.NDArray[np.bool_]:
    """(H, W) pixels that show the photograph on a surface."""
    surfaces, mesh = picture.radiance.surfaces, picture.radiance.surfaces.mesh
    objects = np.unique(mesh.object[surfaces.catches[mesh.material]])
    return np.asarray(np.isin(picture.node, objects))
