"""`lucarne bench reference`: how true the brute force is, how fast it traces, how fast the program starts.

Cases: `sample` (living room, its window light), `furniture-courtyard` and `furniture-interior` (sofa and
table of the shared test data under maps without and with a sun; left out where the data is absent),
`start`. Rows against Mitsuba 3 only where the extra `peers` is installed.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report, relative_rmse, timed
from studio.headless import Headless
from studio.samples import sample
from studio_core.errors import LucarneError
from studio_core.kernels.directions import direction_set
from studio_core.kernels.visibility import lifted, trace_visibility
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Light, Material, MeshObject, Scene
from studio_core.session import View
from studio_core.shading.artifacts import Casters, Radiance
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, picture, scene_view
from studio_core.shading.pipeline import Pipeline

F64 = npt.NDArray[np.float64]

DIRECTIONS = 1 << 15
NATIVE: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "diffuse": (
        "lambert",
        {"base_color": (0.5, 0.5, 0.5)},
        {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.5}},
    ),
    "roughconductor": (
        "ggx",
        {"base_color": (1.0, 1.0, 1.0), "metallic": 1.0, "roughness": 0.5, "keep_energy": False},
        {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": 0.25},
    ),
}


def run(report: Report, program: Headless) -> None:
    """All cases."""
    if importlib.util.find_spec("mitsuba") is None:
        report.notes.append("Mitsuba 3 is not installed: rows against it are left out.")
    from studio_core.project.store import load

    room = load(sample()).scene
    _truth(report, program, "sample", room)
    _speed(report, program, room)
    for name in ("courtyard", "interior"):
        scene = furniture(name, program)
        if scene is None:
            report.notes.append("The shared test data is absent: the furniture cases are left out.")
            break
        _truth(report, program, f"furniture-{name}", scene)
    _start(report)


def furniture(
    environment: str, program: Headless, room: str | None = None, windows: tuple[str, ...] = ()
) -> Scene | None:
    """Sofa and table on a floor of 6 m, or in a room, under a shared map; None where the data is absent.

    `room` and `windows` as on the command line.
    """
    from studio.build_scene import build

    root = Path(os.environ.get("LUCARNE_TEST_DATA") or Path(__file__).parents[3] / "shared" / "data")
    models = root / "cc0" / "furniture_blendswap_cc0"
    if not models.is_dir():
        return None
    options = argparse.Namespace(
        mesh=[
            f"{models / 'sofa2' / 'sofa2.obj'}@0,0,0,0,0.01",
            f"{models / 'oakTable' / 'oakTable.obj'}@1.5,0,0.4,0,0.01",
        ],
        unit="m",
        floor=None if room else 6.0,
        room=room,
        window=list(windows),
        door=[],
        passage=[],
        without=[],
        open_top=False,
        env=root / "cc0" / "hdri_polyhaven_cc0" / f"{environment}.exr",
        material=[],
        ground=None,
        shadow_floor=False,
        camera=["from=1.9,1.3,1.7:to=0.7,0.35,0:fov=70" if room else "from=1.9,1.3,3.2:to=0.7,0.35,0:fov=38"],
    )
    return build(options, program.registry)[0]


def _shaded(scene: Scene, program: Headless, view: View, directions: int) -> tuple[Radiance, Casters]:
    backend = program.registry.get("backend", "reference")
    params = backend_params(backend, {"directions": str(directions)})
    pipeline = Pipeline(backend.stages(program.services))
    made: Radiance = pipeline.update(Frame(scene, view, params), Changes(), Job("bench"))
    casters = pipeline.artifact(Casters)
    assert casters is not None
    return made, casters


def _truth(report: Report, program: Headless, case: str, scene: Scene) -> None:
    if importlib.util.find_spec("mitsuba") is None:
        return
    from studio_plugins.export.mitsuba_run import vertex_irradiance, vertex_radiance

    count, samples = (250, 16384) if report.quick else (1000, 65536)
    view = scene_view(scene, None, 480, 270)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program.registry.get("exporter", "mitsuba").save(scene, folder, program.registry)
        made, casters = _shaded(scene, program, view, DIRECTIONS)
        chosen, origins, normals = _points(made, casters, count)
        ours = made.irradiance(_lights(scene))[chosen]
        truth = vertex_irradiance(str(folder), origins, normals, samples, offset=0.0)
        error = relative_rmse(ours, truth.value)
        report.add(case, "irradiance_rel_rmse_vs_mitsuba", error, "1", truth.relative_error)
        worst = np.abs(ours - truth.value).mean(axis=1) / truth.value.mean()
        report.add(case, "irradiance_p99_error_vs_mitsuba", float(np.percentile(worst, 99)), "1")
        eye = np.asarray(view.transform.translation)
        pooled: list[tuple[F64, F64]] = []
        for native, (model, values, bsdf) in NATIVE.items():
            painted, casters = _shaded(_painted(scene, model, values), program, view, DIRECTIONS)
            coefficient = program.registry.brdf(model).coefficients(
                {k: np.asarray(v, np.float32) for k, v in values.items()} | _rest(program, model, values)
            )
            terms = painted.combined(_lights(scene))[chosen][:, : len(coefficient)]
            towards = eye - origins
            towards /= np.linalg.norm(towards, axis=1, keepdims=True)
            facing = (towards * normals).sum(axis=1) > 0.05
            shown = (terms * coefficient).sum(axis=1)[facing]
            truth = vertex_radiance(
                str(folder), origins[facing], normals[facing], towards[facing], bsdf, samples, offset=0.0
            )
            pooled.append((shown.astype(np.float64), truth.value))
            error = relative_rmse(shown, truth.value)
            report.add(case, f"radiance_{native}_rel_rmse_vs_mitsuba", error, "1", truth.relative_error)
        ours, reference = (np.concatenate(side) for side in zip(*pooled, strict=True))
        report.add(case, "radiance_rel_rmse_vs_mitsuba", relative_rmse(ours, reference), "1")
        if case != "sample":
            _pictures(report, program, case, scene, folder)


def _rest(program: Headless, model: str, values: dict[str, Any]) -> dict[str, Any]:
    from studio_core.params import defaults

    given = defaults(program.registry.brdf(model).Params)
    return {k: np.asarray(v, np.float32) for k, v in given.items() if k not in values}


def _painted(scene: Scene, model: str, values: dict[str, Any]) -> Scene:
    material = Material(id="bench", name="bench", model=model, values=values)
    nodes = [
        dataclasses.replace(node, materials=(material.id,) * len(node.materials))
        for node in scene.of(MeshObject)
    ]
    return scene.with_materials(material).with_nodes(*nodes)


def _lights(scene: Scene) -> dict[str, Light]:
    return {light.id: light for light in scene.of(Light) if scene.shown(light.id)}


def _points(made: Radiance, casters: Casters, count: int) -> tuple[npt.NDArray[np.int64], F64, F64]:
    """Random visible vertices with the tracer's own ray origins: other origins see another crease."""
    mesh = made.surfaces.mesh
    visible = np.flatnonzero(made.valid)
    chosen = np.random.default_rng(0).choice(visible, min(count, len(visible)), replace=False)
    world = mesh.positions[chosen] + mesh.origin
    starts = lifted(casters.shadow, world, mesh.geometric[chosen], mesh.inset[chosen])
    return chosen, starts + casters.shadow.centre, mesh.normals[chosen].astype(np.float64)


def _pictures(report: Report, program: Headless, case: str, scene: Scene, folder: Path) -> None:
    from studio_plugins.export.mitsuba_run import render

    width, height, samples = (240, 135, 256) if report.quick else (480, 270, 2048)
    first, second = (render(folder, samples, (width, height), seed=seed) for seed in (1, 2))
    truth = (first + second) / 2
    backend = program.registry.get("backend", "reference")
    view = dataclasses.replace(scene_view(scene, None, width, height), antialias=4)
    directions = DIRECTIONS >> 3 if report.quick else DIRECTIONS
    for vertices in (30_000, 200_000):
        values = {"vertices": vertices, "directions": str(directions)}
        made = picture(scene, view, backend, backend_params(backend, values), program.services)
        solid = made.coverage >= 1
        noise = relative_rmse(first[solid], second[solid]) / 2
        metric = f"picture_{vertices}_rel_rmse_vs_mitsuba"
        report.add(case, metric, relative_rmse(made.linear, truth), "1")
        report.add(case, f"{metric}_on_objects", relative_rmse(made.linear[solid], truth[solid]), "1", noise)


def _speed(report: Report, program: Headless, scene: Scene) -> None:
    view = scene_view(scene, None, 960, 540)
    made, casters = _shaded(scene, program, view, 1 << 10)
    mesh, points = made.surfaces.mesh, np.flatnonzero(made.valid)
    points = points[:: 8 if report.quick else 1]
    workers = program.services.workers
    rays = 0

    def trace() -> None:
        nonlocal rays
        rays = trace_visibility(
            casters.shadow,
            mesh.positions[points] + mesh.origin,
            mesh.normals[points],
            direction_set(15),
            workers,
            geometric_normals=mesh.geometric[points],
            inset=mesh.inset[points],
        ).rays

    taken = timed(trace, 3 if report.quick else 5)
    rate = rays / taken.median / 1e6
    report.add("sample", "mrays_per_s", rate, "1e6/s", rate * taken.spread / taken.median)


def _start(report: Report) -> None:
    """Fresh processes, kernels compiled: until the window is up, and until its first picture."""
    environment = {**os.environ, "QT_QPA_PLATFORM": os.environ.get("QT_QPA_PLATFORM") or "offscreen"}
    found: dict[str, list[float]] = {"window_s": [], "first_picture_s": []}
    for _ in range(2 if report.quick else 5):
        tried = subprocess.run(
            [sys.executable, "-m", "studio.bench.start_probe"],
            capture_output=True,
            text=True,
            env=environment,
            timeout=300,
            check=False,
        )
        if tried.returncode:
            raise LucarneError(f"the window could not be measured: {tried.stderr.strip()[-300:]}")
        for name, seconds in json.loads(tried.stdout.splitlines()[-1]).items():
            found[name].append(seconds)
    for name, values in found.items():
        low, middle, high = np.percentile(values, [25, 50, 75])
        report.add("start", name, middle, "s", (high - low) / 2)
