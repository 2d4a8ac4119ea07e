"""Recovery on pictures by Mitsuba 3: trials of `strokes_recovery` whose light another renderer has made.

Cases are mitsuba/joint/LIGHT/shape/0.02/PARAMETER. Which pixel shows what is still ours; what is shown there,
before the change and after it, is direct light by Mitsuba's `direct` integrator in the exported scene.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report
from studio.bench.strokes_recovery import Tally, case_name, take
from studio.bench.strokes_trials import HEIGHT, LIGHTS, PARAMETERS, WIDTH, Trial, dressed, trials
from studio.headless import Headless
from studio_core.edits import Remove
from studio_core.params import Value
from studio_core.scene.nodes import Camera, Scene
from studio_core.session import View
from studio_core.shading.artifacts import Picture
from studio_core.strokes.session import KIND

F32 = npt.NDArray[np.float32]

TRIALS, QUICK_TRIALS = 8, 1
SAMPLES = 1024
"""Paths a pixel; Mitsuba's sampler wants a square."""
SOLVER, STROKE, NOISE = "joint", "shape", 0.02


def run(report: Report, program: Headless) -> None:
    """All cases, where Mitsuba is."""
    if importlib.util.find_spec("mitsuba") is None:
        report.notes.append("Mitsuba 3 is not installed: recovery on its pictures is left out.")
        return
    solvers = {SOLVER: program.registry.get(KIND, SOLVER)}
    for light in LIGHTS:
        cases = {
            f"mitsuba/{case_name(SOLVER, light, STROKE, NOISE, one)}": (SOLVER, STROKE, NOISE, one)
            for one in PARAMETERS
        }
        wanted = {case: parts for case, parts in cases.items() if report.wants(case)}
        if not wanted:
            continue
        parameters = [parameter for *_, parameter in wanted.values()]
        tallies = {case: Tally() for case in wanted}
        for number, one in enumerate(trials(light, QUICK_TRIALS if report.quick else TRIALS, program)):
            take(tallies, wanted, rendered(one, parameters, program), number, solvers, program)
        for case, tally in tallies.items():
            if tally.right:
                tally.tell(report, case)
        report.keep()


def rendered(one: Trial, parameters: Sequence[str], program: Headless) -> Trial:
    """A trial with light by Mitsuba, and only some of its changes."""

    def shown(pictures: Sequence[Picture], values: Mapping[str, Value] | None) -> tuple[Picture, ...]:
        scene = one.scene if values is None else dressed(one.scene, one.node, one.slot, values)
        light = by_mitsuba(scene, one.views, program)
        return tuple(dataclasses.replace(p, linear=own) for p, own in zip(pictures, light, strict=True))

    after = {name: shown(one.after[name], one.truth[name][0]) for name in parameters}
    return dataclasses.replace(one, before=shown(one.before, None), after=after)


def by_mitsuba(scene: Scene, views: Sequence[View], program: Headless) -> list[F32]:
    """A picture (HEIGHT, WIDTH, 3) a view, all of the same random numbers."""
    from studio_plugins.export.mitsuba_run import DirectRenderer

    cameras = [
        Camera(id=f"bench-camera-{n}", name=f"Camera {n}", transform=view.transform, fov=view.fov)
        for n, view in enumerate(views)
    ]
    scene = Remove(tuple(node.id for node in scene.of(Camera)))(scene).with_nodes(*cameras)
    with tempfile.TemporaryDirectory() as name:
        program.registry.get("exporter", "mitsuba").save(scene, Path(name), program.registry)
        renderer = DirectRenderer(Path(name), (WIDTH, HEIGHT))
        return [renderer(SAMPLES, sensor=number) for number in range(len(views))]


__all__ = ["by_mitsuba", "rendered", "run"]
