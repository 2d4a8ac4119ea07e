"""The part of `lucarne bench strokes` about one stroke: case `size/direct-stroke`, in the sample room.

About 500 marks on an object whose picture with another gloss is painted, 20 levels, 27,000 vertices, light
between surfaces as it is at rest. `ms` and `cpu_ms` are from release to decided parameters, where what
vertices see is kept, as it is of what the hand has painted until then; `first_ms` of a stroke that must look
around first. `solution_ms` is all that the window asks for, with the paint of the decision and of runners-up;
`near_ms` likewise for a change that fades out within 5 cm. Parts, in time of all processors: `light`,
`columns`, `decision`, and `laid`, the paint.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any
from unittest.mock import patch

import numpy as np

from studio.bench.harness import Report
from studio.bench.strokes_trials import dressed, pixels_of, view_of
from studio.headless import Headless
from studio.samples import sample
from studio_core.edits import Add
from studio_core.params import Value
from studio_core.project.store import load
from studio_core.scene.nodes import Scene
from studio_core.shading.frame import IndirectChoice
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params
from studio_core.strokes.painting import marks_of, stroke_of
from studio_core.strokes.session import Easel
from studio_core.strokes.solution import Lit
from studio_core.strokes.stroke import REPLACE, Stroke
from studio_plugins.slf import explaining, solver
from studio_plugins.slf.incident import Incident
from studio_plugins.slf.solver import JointRun, Params
from studio_plugins.slf.spread import Spread

CASE = "size/direct-stroke"
NODE = "mesh-sofa-seat-cushion-middle"
MARKS = 600  # at most; about 520 it is
QUALITY = {"directions": "1024", "vertices": "27000", "refine": "false"}
BEFORE: dict[str, Value] = {"diffuse": (0.35, 0.3, 0.22), "specular": (0.12,) * 3, "roughness": 0.35}
AFTER: dict[str, Value] = {**BEFORE, "roughness": 0.22}
NEAR = 20.0
REPEATS, QUICK_REPEATS = 7, 2
PARTS: dict[str, tuple[Any, str]] = {
    "light": (Incident, "at"),
    "columns": (solver, "sums_at"),
    "decision": (explaining, "decide"),
    "laid": (Spread, "__call__"),
}


@dataclass(frozen=True, eq=False)
class Stand:
    """A scene with a stroke, and what it was painted on."""

    scene: Scene
    stroke: Stroke
    lit: Lit

    def solve(self, run: JointRun) -> Any:
        """All that the window asks for."""
        return run.solve(self.scene, [self.stroke.id], self.lit, Params(), Job("bench"))

    def decide(self, run: JointRun) -> Any:
        """What it comes to."""
        return run.decided(self.scene, [self.stroke], self.lit, Params(), Job("bench"))

    def near(self) -> Stand:
        """With a change that fades out."""
        stroke = replace(self.stroke, near=NEAR)
        return replace(self, stroke=stroke, scene=self.scene.with_nodes(stroke))


def direct(report: Report, program: Headless) -> None:
    """See the module."""
    if not report.wants(CASE):
        return
    repeats = QUICK_REPEATS if report.quick else REPEATS
    stand = stand_of(program)
    kernels = JointRun(program.services)
    stand.solve(kernels)
    stand.near().solve(kernels)

    def of_new_run() -> Callable[[], Any]:
        run = JointRun(program.services)
        return lambda: stand.decide(run)

    _tell(report, "first_", of_new_run, 2)
    run = JointRun(program.services)
    stand.decide(run)
    _tell(report, "", lambda: lambda: stand.decide(run), repeats)
    solution = _tell(report, "solution_", lambda: lambda: stand.solve(run), repeats)
    _tell(report, "near_", lambda: lambda: stand.near().solve(run), repeats)
    for prefix, one in (("", stand), ("near_", stand.near())):
        with parts() as spent:
            made = one.solve(run)
        for name in PARTS if not prefix else ("laid",):
            report.add(CASE, f"{prefix}{name}_cpu_ms", 1000 * spent[name], "ms")
        painted = made.edit(one.scene)[NODE].paint
        report.add(CASE, f"{prefix}points", 0 if painted is None else len(painted.places), "1")
    for metric, count in solution.counts.items():
        report.add(CASE, metric, count, "1")


def stand_of(program: Headless) -> Stand:
    """The sample room, one object of which was painted as with another gloss."""
    backend = program.registry.get("backend", "cuts")
    between = IndirectChoice("gather", program.registry.get("indirect", "gather").Params())
    easel = Easel(backend, backend_params(backend, QUALITY), program.services, between)
    plain = load(sample()).scene
    before, after = (dressed(plain, NODE, 0, values) for values in (BEFORE, AFTER))
    view = view_of(before, NODE, np.random.default_rng(3))
    wanted = easel.picture(after, view, Job("bench")).linear
    shown = easel.picture(before, view, Job("bench"))
    mask = pixels_of(shown, NODE, 0).astype(np.float32)
    marked = marks_of(shown, mask, wanted, MARKS)
    stroke = stroke_of(marked, before, REPLACE)
    return Stand(Add((stroke,))(before), stroke, easel.lit())


def _tell(report: Report, prefix: str, prepared: Callable[[], Callable[[], Any]], repeats: int) -> Any:
    """`ms` and `cpu_ms` of what is prepared unmeasured, the least of repeats; what it gave last."""
    wall, used = [], []
    for _ in range(repeats):
        call = prepared()
        started, before = time.perf_counter(), time.process_time()
        made = call()
        wall.append(1000 * (time.perf_counter() - started))
        used.append(1000 * (time.process_time() - before))
    for name, taken in (("ms", wall), ("cpu_ms", used)):
        report.add(CASE, f"{prefix}{name}", min(taken), "ms", (max(taken) - min(taken)) / 2)
    return made


@contextmanager
def parts() -> Iterator[dict[str, float]]:
    """By name of PARTS the seconds of all processors that are spent there meanwhile."""
    spent = dict.fromkeys(PARTS, 0.0)

    def counted(name: str, original: Callable[..., Any]) -> Callable[..., Any]:
        def call(*given: Any, **named: Any) -> Any:
            before = time.process_time()
            made = original(*given, **named)
            spent[name] += time.process_time() - before
            return made

        return call

    with ExitStack() as stack:
        for name, (owner, attribute) in PARTS.items():
            stack.enter_context(patch.object(owner, attribute, counted(name, getattr(owner, attribute))))
        yield spent


__all__ = ["CASE", "direct", "stand_of"]
