"""Recovery in indirect mode: whether a stroke finds the object, and what of it, whose change lights it so.

Cases are joint/indirect/STROKE/NOISE/PARAMETER. What is painted is the light after the change (`shape`) or
its mean (`flat`), at vertices; NOISE is normal, of the RMS of the change that is painted, which is 0.3 % of
the light or more. `right_parameter` is the share of trials whose first finding is that object with that
parameter and no other; `value_error` and `offered` are as in `strokes_recovery`.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np

from studio.bench.harness import Report
from studio.bench.strokes_indirect_trials import CHANGES, Change, IndirectTrial, trials
from studio.bench.strokes_recovery import WORDS, Tally, relative
from studio.headless import Headless
from studio_core.edits import Add
from studio_core.shading.job import Job
from studio_core.strokes.paintable import material_roles
from studio_core.strokes.session import KIND
from studio_core.strokes.solution import Reason, Solution
from studio_core.strokes.stroke import REPLACE, Stroke

SOLVER = "joint"
STROKES = ("shape", "flat")
NOISES = (0.0, 0.02, 0.1, 0.3)
TRIALS, QUICK_TRIALS = 20, 1


def run(report: Report, program: Headless) -> None:
    """All cases."""
    every = itertools.product(STROKES, NOISES, CHANGES)
    cases = {f"{SOLVER}/indirect/{kind}/{noise:g}/{role}": (kind, noise, role) for kind, noise, role in every}
    wanted = {case: parts for case, parts in cases.items() if report.wants(case)}
    roles = tuple(role for role in CHANGES if any(parts[2] == role for parts in wanted.values()))
    if not wanted:
        return
    solver = program.registry.get(KIND, SOLVER)
    run = solver.open(program.services)
    tallies = {case: Tally() for case in wanted}
    for number, found in enumerate(trials(QUICK_TRIALS if report.quick else TRIALS, program, roles)):
        for case, (kind, noise, role) in wanted.items():
            if role not in found:
                continue
            one = found[role]
            scene = Add((painted(one, kind, noise, number),))(one.scene)
            solution = run.solve(scene, ["stroke-indirect"], one.lit, solver.Params(), Job("Trial"))
            right, error = judged(solution, one.change, program)
            tallies[case].add((right, error), right or is_told(solution, one.change))
    for case, tally in tallies.items():
        if tally.right:
            tally.tell(report, case)
    report.keep()


def painted(one: IndirectTrial, kind: str, noise: float, number: int) -> Stroke:
    """The light after the change, or its mean, with noise."""
    marks, rng = one.marks, np.random.default_rng((number, CHANGES.index(one.change.role)))
    change = marks.wanted.astype(np.float64) - marks.shown
    off = noise * float(np.sqrt((change**2).mean())) * rng.normal(size=change.shape)
    flat = kind == "flat"
    wanted = (marks.wanted.mean(axis=0) if flat else marks.wanted) + off
    noisy = dataclasses.replace(marks, wanted=np.asarray(wanted, np.float32))
    return Stroke(
        id="stroke-indirect", name="Stroke", tool=REPLACE, indirect=True, flat=flat, objects=(one.node,),
        table=noisy.table(),
    )  # fmt: skip


def judged(solution: Solution, change: Change, program: Headless) -> tuple[bool, float]:
    """Whether the first finding is the change, and how far off its value is (NaN where it is not)."""
    if not solution.findings or not solution.findings[0].reasons:
        return False, math.nan
    first = solution.findings[0]
    best = first.reasons[0]
    if (first.node, first.slot) != (change.node, change.slot) or not _names(best, change):
        return False, math.nan
    name = material_roles(change.material, program.registry)[change.role]
    return True, relative(best.values[name], change.material.values[name])


def is_told(solution: Solution, change: Change) -> bool:
    """Whether any reason of any finding is the change."""
    return any(
        (found.node, found.slot) == (change.node, change.slot) and _names(reason, change)
        for found in solution.findings
        for reason in found.reasons
    )


def _names(reason: Reason, change: Change) -> bool:
    return WORDS[reason.meaning] == {change.role}
