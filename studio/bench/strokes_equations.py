"""The paper's equations 5 and 6 beside the true minimum, on moments of real elements of the sample room.

A third of the elements want another matte part, a third another shine, a third another gloss, with noise: in
all directions (`paper/whole/…`), or in STROKED of them that weigh as those of a stroke do, while the others
are to stay (`paper/stroke/…`).

- `equation-5` and `-6`: `residual_printed` and `residual_minimum` are what the fit of one number leaves, over
  what was wanted to change, as roots of sums of squares over the elements that want that number changed
- SOLVER: likewise of what the solver chooses; `named_right_…` the shares of elements in which it names what
  was changed, and `name_changed` of those in which the equations as printed make it another name
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report
from studio.bench.strokes_trials import sample_scene
from studio.headless import Headless
from studio_core.scene.nodes import Camera, Light
from studio_core.session import View
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params
from studio_core.strokes.session import Easel
from studio_core.transport.cells import CELLS, PARTS
from studio_plugins.slf.by_element import STRENGTH
from studio_plugins.slf.ladder import LEVELS
from studio_plugins.slf.moments import moments
from studio_plugins.slf.painted_rows import Columns, Rows, with_rows
from studio_plugins.slf.paper import (
    BOTH,
    DIFFUSE,
    KEPT,
    SPECULAR,
    Chosen,
    Solver,
    Systems,
    choose,
    errors,
    fits,
)
from studio_plugins.slf.series import light_of, series_of
from studio_plugins.slf.whole import Reflectances, Whole

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

SOLVERS: tuple[Solver, ...] = ("mixed", "l0", "l2")
EQUATIONS = {"equation-5": DIFFUSE, "equation-6": SPECULAR}
ELEMENTS, QUICK_ELEMENTS = 2000, 300
NOISE = 0.02
GLOSS = 3
STROKED, STEEPEST = 4, 12
"""Directions of an element that a stroke has, within so many rings."""


def run(report: Report, program: Headless) -> None:
    """All that is wanted."""
    wanted = [
        where
        for where in ("whole", "stroke")
        if any(report.wants(f"paper/{where}/{name}") for name in (*EQUATIONS, *SOLVERS))
    ]
    if wanted:
        count = QUICK_ELEMENTS if report.quick else ELEMENTS
        whole, stroke, changed = elements_of(count, program)
        for where in wanted:
            _compare(report, f"paper/{where}", whole if where == "whole" else stroke, changed)


def _compare(report: Report, where: str, systems: Systems, changed: I64) -> None:
    before = _cost(systems, np.full(len(changed), KEPT), systems.now)
    for name, kind in EQUATIONS.items():
        if report.wants(f"{where}/{name}"):
            own = (changed == kind) & (before > 0)
            for metric, literal in (("residual_printed", True), ("residual_minimum", False)):
                made = fits(systems, literal)[np.arange(len(systems.now)), np.repeat(systems.level, 3), kind]
                left = _cost(systems, changed, made)
                report.add(f"{where}/{name}", metric, _share(left[own], before[own]), "1")
    for solver in SOLVERS:
        if report.wants(f"{where}/{solver}"):
            _tell(report, f"{where}/{solver}", solver, systems, changed, before)


def _tell(report: Report, case: str, solver: Solver, systems: Systems, changed: I64, before: F64) -> None:
    printed, true = choose(systems, solver, literal=True), choose(systems, solver)
    own = ~true.flagged & (before > 0)
    for metric, one in (("residual_printed", printed), ("residual_minimum", true)):
        report.add(case, metric, _share(one.residual[own], before[own]), "1")
    names = [_name(one, systems) for one in (printed, true)]
    for metric, name in zip(("named_right_printed", "named_right_minimum"), names, strict=True):
        right = np.where(changed == GLOSS, name == 4 + KEPT, name == changed)
        report.add(case, metric, float(right[own].mean()), "1")
    report.add(case, "name_changed", float((names[0] != names[1])[own].mean()), "1")
    report.add(case, "elements", int(own.sum()), "1")


def elements_of(count: int, program: Headless) -> tuple[Systems, Systems, I64]:
    """Moments of elements of the sample room under its sky, wanting a change everywhere or where a stroke is.

    And what each wants to be changed: (E,).
    """
    scene = sample_scene("environment")
    backend = program.registry.get("backend", "reference")
    easel = Easel(backend, backend_params(backend, {"directions": "1024"}), program.services)
    camera = next(scene.of(Camera))
    easel.picture(scene, View(camera.transform, camera.fov, 32, 20), Job("bench"))
    lit = easel.lit()
    whole = Whole(program.services.workers, count)
    lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
    everything = np.ones(len(lit.surfaces.unrefined.mesh), np.bool_)
    whole.update(lit.surfaces, lit.casters, lit.lighting, lights, everything, Job("bench"))
    rng = np.random.default_rng(7)
    count = len(whole.elements)
    level = rng.integers(4, LEVELS - 4, count)
    now = Reflectances(
        rng.uniform(0.1, 0.5, (count, 3)), rng.uniform(0.1, 0.4, (count, 3)), level.astype(float)
    )
    changed = rng.choice([DIFFUSE, SPECULAR, GLOSS], count)
    factor = rng.uniform(0.3, 0.7, count)[:, None]
    other = Reflectances(
        np.where((changed == DIFFUSE)[:, None], factor * now.diffuse, now.diffuse),
        np.where((changed == SPECULAR)[:, None], factor * now.specular, now.specular),
        np.where(changed == GLOSS, level + rng.choice([-3, 3], count), level).astype(float),
    )
    series = whole.incident(whole.dark(), 0, count)
    series[whole.buried] = 0
    wanted = light_of(whole.sent(series, other, 0))
    wanted *= 1 + NOISE * rng.standard_normal(wanted.shape).astype(np.float32)
    both = np.stack([now.diffuse, now.specular], axis=2)
    element, cell = np.repeat(np.arange(count), STROKED), rng.integers(0, STEEPEST * PARTS, STROKED * count)
    plain = whole.sent(series, now, 0)
    sent = light_of(plain).reshape(count, 3, CELLS)[element, :, cell].astype(np.float64)
    change = wanted.reshape(count, 3, CELLS)[element, :, cell] - sent
    rows = Rows(element, cell, change, np.ones(len(cell)))
    stroke = with_rows(moments(series, plain, both, level), Columns.of(series, rows), rows, sent, STRENGTH)
    return moments(series, series_of(wanted), both, level), stroke, changed


def _cost(systems: Systems, changed: I64, made: F64) -> F64:
    """(E,) what reflectances (R, 2) leave at the gloss that there is; `changed` tells how many E are."""
    level = np.repeat(systems.level, systems.channels)[:, None]
    one = dataclasses.replace(
        systems,
        **{name: np.take_along_axis(getattr(systems, name), level, 1) for name in ("c12", "c22", "d2")},
    )
    return np.asarray(errors(one, made[:, None, None]).reshape(len(changed), -1).sum(axis=1))


def _share(left: F64, before: F64) -> float:
    return math.sqrt(float(left.sum() / before.sum()))


def _name(one: Chosen, systems: Systems) -> I64:
    """KEPT … BOTH, and 4 more where the gloss is new."""
    return np.asarray(one.kind + (BOTH + 1) * (one.level != systems.level))
