"""Shading without a window: one call from a scene to radiance or a picture."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import IndirectMethod, Registry, Services, ShadingBackend, StrokeSolver
from studio_core.errors import EditError
from studio_core.kernels.visibility import lifted
from studio_core.params import build, param_infos, parse
from studio_core.raster import PictureStage
from studio_core.scene.bounds import scene_bounds
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Camera, Scene
from studio_core.session import ALL, Session, View, framing
from studio_core.shading.artifacts import Casters, MeasuredError, Picture, Radiance
from studio_core.shading.error_meter import ErrorMeter
from studio_core.shading.frame import Frame, IndirectChoice
from studio_core.shading.indirect import KIND, with_indirect
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Pipeline


def backend_params(
    backend: ShadingBackend | IndirectMethod | StrokeSolver, values: Mapping[str, object]
) -> Any:
    """Its parameters; texts (from the command line) are parsed, names and ranges checked."""
    infos = param_infos(backend.Params)
    parsed = {n: parse(n, infos[n], v) if isinstance(v, str) and n in infos else v for n, v in values.items()}
    return build(backend.Params, parsed)


def indirect_choice(registry: Registry, method: str, values: Mapping[str, object]) -> IndirectChoice:
    """A method of light between surfaces with its parameters, as `backend_params` has them."""
    return IndirectChoice(method, backend_params(registry.get(KIND, method), values))


def session_choice(session: Session, registry: Registry) -> IndirectChoice | None:
    """How light goes on between surfaces in a session; None where its method is not there, too."""
    if not session.bouncing or session.indirect not in registry.names(KIND):
        return None
    return indirect_choice(registry, session.indirect, session.indirect_params.get(session.indirect, {}))


def scene_view(scene: Scene, camera: str | None, width: int, height: int) -> View:
    """What the named camera sees; without a name the first camera, or a view that frames everything."""
    if camera is not None:
        for node in scene.of(Camera):
            if camera in (node.name, node.id):
                return View.of(node, scene, width, height)
        known = ", ".join(repr(node.name) for node in scene.of(Camera)) or "none"
        raise EditError(f"there is no camera {camera!r}; known: {known}")
    first = next(scene.of(Camera), None)
    if first is not None:
        return View.of(first, scene, width, height)
    low, high = scene_bounds(scene)
    return framing(low, high, View(width=width, height=height))


def shade(
    scene: Scene,
    view: View,
    backend: ShadingBackend,
    params: Any,
    services: Services,
    job: Job | None = None,
    *,
    indirect: IndirectChoice | None = None,
) -> Radiance:
    """Radiance at the shading vertices."""
    return shaded_pipeline(scene, view, backend, params, services, job, indirect=indirect)[0]


def shaded_pipeline(
    scene: Scene,
    view: View,
    backend: ShadingBackend,
    params: Any,
    services: Services,
    job: Job | None = None,
    *,
    indirect: IndirectChoice | None = None,
) -> tuple[Radiance, Pipeline]:
    """The same, with the pipeline that has made it and holds the other artifacts."""
    pipeline = Pipeline(with_indirect(backend.stages(services), services))
    frame = Frame(scene, view, params, 1, indirect=indirect)
    made: Radiance = pipeline.update(frame, Changes(), job or Job("Shading"))
    return made, pipeline


def ray_origins(pipeline: Pipeline, made: Radiance) -> npt.NDArray[np.float64]:
    """(V, 3) where the visibility rays of the shading vertices start, world.

    In creases a millionth of a metre decides what a vertex sees: a check by another tracer starts here.
    """
    mesh, casters = made.surfaces.mesh, pipeline.artifact(Casters)
    positions: npt.NDArray[np.float64] = mesh.positions + mesh.origin
    if casters is None:  # a backend that traces in its own way
        return positions
    starts = lifted(casters.shadow, positions, mesh.geometric, mesh.inset)
    return casters.shadow.centre + starts


def picture(
    scene: Scene,
    view: View,
    backend: ShadingBackend,
    params: Any,
    services: Services,
    job: Job | None = None,
    *,
    indirect: IndirectChoice | None = None,
    light: str = ALL,
) -> Picture:
    """The picture that `view` sees, scene-linear; `light` of `studio_core.session.LIGHTS`."""
    made = measured_picture(scene, view, backend, params, services, 0, job, indirect=indirect, light=light)
    return made[0]


def measured_picture(
    scene: Scene,
    view: View,
    backend: ShadingBackend,
    params: Any,
    services: Services,
    places: int,
    job: Job | None = None,
    *,
    indirect: IndirectChoice | None = None,
    light: str = ALL,
) -> tuple[Picture, MeasuredError | None]:
    """The same, with its error measured at so many random places; None for 0, or where nothing is seen."""
    pipeline = Pipeline([*with_indirect(backend.stages(services), services), PictureStage(services)])
    frame, job = Frame(scene, view, params, 1, indirect=indirect, light=light), job or Job("Rendering")
    made: Picture = pipeline.update(frame, Changes(), job)
    return made, ErrorMeter(services, places)(pipeline, frame, job) if places else None
