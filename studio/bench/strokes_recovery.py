"""Recovery: whether a stroke that shows a known change of a material finds that change.

Cases are SOLVER/LIGHT/STROKE/NOISE/PARAMETER: what is painted is the picture after the change (`shape`), its
mean colour (`flat`), or that picture with its brightest 30 % cut off (`clipped`); each mark's wanted light is
then wrong by a normal NOISE, relative. `right_parameter` is the share of trials in which the first reason
names what was changed, with the deviation of such a share as spread; `value_error` the median relative error
of the values that were changed, where it does; `offered` the share in which it is among the reasons that are
shown: where two changes make the same light, no picture tells which was meant.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report
from studio.bench.strokes_trials import LIGHTS, NAMES, PARAMETERS, Trial, pixels_of, trials
from studio.headless import Headless
from studio_core.contract import StrokeRun, StrokeSolver
from studio_core.edits import Add
from studio_core.params import Value
from studio_core.shading.artifacts import Picture
from studio_core.shading.job import Job
from studio_core.strokes.brush import Brush
from studio_core.strokes.painting import marks_of, stroke_of
from studio_core.strokes.session import KIND
from studio_core.strokes.solution import Reason, Solution
from studio_core.strokes.stroke import REPLACE, Stroke

F32 = npt.NDArray[np.float32]

SOLVERS = ("joint", "mixed", "l0", "l2")
STROKES = ("shape", "flat", "clipped")
NOISES = (0.0, 0.02, 0.1)
TRIALS, QUICK_TRIALS = 24, 2
CUT = 0.7
WORDS: Mapping[str, frozenset[str]] = {
    "": frozenset(),
    "colour": frozenset({"diffuse"}),
    "shine": frozenset({"specular"}),
    "gloss": frozenset({"gloss"}),
    "colour and shine": frozenset({"diffuse", "specular"}),
    "colour and gloss": frozenset({"diffuse", "gloss"}),
    "shine and gloss": frozenset({"specular", "gloss"}),
    "everything": frozenset({"diffuse", "specular", "gloss"}),
}


@dataclass
class Tally:
    """Outcomes of one case: whether each was right, whether that was offered, and errors of right values."""

    right: list[bool] = field(default_factory=list)
    offered: list[bool] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)

    def add(self, outcome: tuple[bool, float], among: bool) -> None:
        """One trial's."""
        self.right.append(outcome[0])
        self.offered.append(among)
        if outcome[0] and math.isfinite(outcome[1]):
            self.errors.append(outcome[1])

    def tell(self, report: Report, case: str) -> None:
        """The rows of the case."""
        for metric, outcomes in (("right_parameter", self.right), ("offered", self.offered)):
            share = float(np.mean(outcomes))
            spread = math.sqrt(share * (1 - share) / len(outcomes))
            report.add(case, metric, share, "1", spread)
        if self.errors:
            low, middle, high = np.percentile(self.errors, [25, 50, 75])
            report.add(case, "value_error", float(middle), "1", float(high - low) / 2)


def run(report: Report, program: Headless) -> None:
    """All cases of the solvers that there are."""
    known = set(program.registry.names(KIND))
    report.notes += [f"{name}: there is no such solver." for name in SOLVERS if name not in known]
    solvers = {name: program.registry.get(KIND, name) for name in SOLVERS if name in known}
    for light in LIGHTS:
        of_light = itertools.product(solvers, STROKES, NOISES, PARAMETERS)
        cases = {case_name(s, light, *rest): (s, *rest) for s, *rest in of_light}
        wanted = {case: parts for case, parts in cases.items() if report.wants(case)}
        if not wanted:
            continue
        tallies = {case: Tally() for case in wanted}
        for number, one in enumerate(trials(light, QUICK_TRIALS if report.quick else TRIALS, program)):
            take(tallies, wanted, one, number, solvers, program)
        for case, tally in tallies.items():
            if tally.right:
                tally.tell(report, case)
        report.keep()


def case_name(solver: str, light: str, stroke: str, noise: float, parameter: str) -> str:
    """SOLVER/LIGHT/STROKE/NOISE/PARAMETER."""
    return f"{solver}/{light}/{stroke}/{noise:g}/{parameter}"


def take(
    tallies: Mapping[str, Tally],
    cases: Mapping[str, tuple[str, str, float, str]],
    one: Trial,
    number: int,
    solvers: Mapping[str, StrokeSolver],
    program: Headless,
) -> None:
    """One trial for every case; each solver remembers what surfaces see of each other."""
    runs: dict[str, StrokeRun] = {}
    for case, (name, kind, noise, parameter) in cases.items():
        if name not in runs:
            runs[name] = solvers[name].open(program.services)
        strokes = painted(one, kind, noise, parameter, number)
        if not strokes:
            continue
        scene = Add(tuple(strokes))(one.scene)
        ids = [stroke.id for stroke in strokes]
        solution = runs[name].solve(scene, ids, one.lit, solvers[name].Params(), Job("Trial"))
        tallies[case].add(judged(solution, one, parameter), offered(solution, one, parameter))


def painted(one: Trial, kind: str, noise: float, parameter: str, number: int) -> list[Stroke]:
    """A stroke a view, over much of the object; none where it shows nothing."""
    made: list[Stroke] = []
    for view, (before, after) in enumerate(zip(one.before, one.after[parameter], strict=True)):
        rng = np.random.default_rng((number, view, PARAMETERS.index(parameter)))
        own = pixels_of(before, one.node, one.slot)
        mask = np.where(own, _mask(own, rng), 0).astype(np.float32)
        marked = marks_of(before, mask, wish(before, after, mask, kind))
        if not len(marked.marks):
            continue
        marks = marked.marks
        told = (marks.wanted != marks.shown).any(axis=1, keepdims=True) | (parameter == "none")
        off = 1 + noise * rng.normal(size=marks.wanted.shape) * told
        noisy = dataclasses.replace(marks, wanted=np.asarray(marks.wanted * off, np.float32))
        flat = kind == "flat"
        stroke = stroke_of(dataclasses.replace(marked, marks=noisy), one.scene, REPLACE, together=bool(made))
        made.append(dataclasses.replace(stroke, flat=flat))
    return made


def wish(before: Picture, after: Picture, mask: F32, kind: str) -> F32:
    """(H, W, 3) the light that is painted."""
    under = mask > 0
    if kind == "flat":
        mean = np.average(after.linear[under], axis=0, weights=mask[under])
        return np.broadcast_to(mean.astype(np.float32), before.linear.shape)
    if kind == "clipped":
        level = np.quantile(after.linear[under], CUT, axis=0).astype(np.float32)
        return np.minimum(after.linear, level)
    return after.linear


def _mask(own: npt.NDArray[np.bool_], rng: np.random.Generator) -> F32:
    """A wide brush along some of the object's pixels."""
    height, width = own.shape
    places = np.argwhere(own)[rng.integers(0, int(own.sum()), 3)]
    path = (places[:, ::-1] + 0.5) / (width, height)
    return Brush(size=0.3, hardness=0.8).mask(path, width, height)


def judged(solution: Solution, one: Trial, parameter: str) -> tuple[bool, float]:
    """Whether what was changed is named, and how far off its values are (NaN where it is not)."""
    reasons = reasons_of(solution, one)
    values, roles = one.truth[parameter]
    if not reasons:
        return not roles, math.nan
    best = reasons[0]
    if WORDS[best.meaning] != roles:
        return False, math.nan
    errors = [relative(best.values[NAMES[role]], values[NAMES[role]]) for role in sorted(roles)]
    return True, max(errors, default=math.nan)


def offered(solution: Solution, one: Trial, parameter: str) -> bool:
    """Whether what was changed is among the reasons."""
    named = [WORDS[reason.meaning] for reason in reasons_of(solution, one)] or [frozenset()]
    return one.truth[parameter][1] in named


def reasons_of(solution: Solution, one: Trial) -> tuple[Reason, ...]:
    """Those for the object and slot that were painted."""
    place = (one.node, one.slot)
    found = (finding.reasons for finding in solution.findings if (finding.node, finding.slot) == place)
    return next(found, ())


def relative(found: Value, true: Value) -> float:
    """Of numbers and colours."""
    a, b = np.asarray(found, np.float64), np.asarray(true, np.float64)
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))
