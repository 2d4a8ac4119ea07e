"""What lives on the compute thread: solvers, and what strokes make of the newest picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from studio_core.contract import Services, StrokeRun
from studio_core.edits import Compound, Edit, SetPaint
from studio_core.errors import InputError, PluginError
from studio_core.scene.nodes import NodeId, Scene
from studio_core.shading.job import Job
from studio_core.strokes.edits import bared, concerned
from studio_core.strokes.matching import Match
from studio_core.strokes.solution import Lit, Solution
from studio_core.strokes.stroke import Stroke

SOLVER = "joint"
NOTHING = Solution(Compound("Nothing", ()))


@dataclass(frozen=True, eq=False)
class Order:
    """A change of strokes: what makes it, on the compute thread (None: it says nothing), and its name."""

    label: str
    make: Callable[[], Edit | None]
    concerned: NodeId | None = None
    """The stroke that is new or other than before."""

    def strokes(self, start: Scene, scene: Scene) -> list[Stroke]:
        """What it was before, and is after the order: both tell on what it lies."""
        there = (where.nodes.get(self.concerned or "") for where in (start, scene))
        return [stroke for stroke in there if isinstance(stroke, Stroke)]


@dataclass(frozen=True, eq=False)
class Answer:
    """The order's own edit, the scene with it, the strokes that were solved, and what came of them."""

    edit: Edit
    scene: Scene
    strokes: tuple[NodeId, ...]
    solution: Solution

    def whole(self, label: str) -> Edit:
        """Strokes and what explains them, as one step."""
        return Compound(label, (self.edit, self.solution.edit))


class Bench:
    """Solvers by name, opened when they are first asked."""

    def __init__(self, services: Services) -> None:
        self._services = services
        self._runs: dict[str, tuple[StrokeRun, Any]] = {}

    def answer(self, order: Order, start: Scene, lit: Lit, solver: str, job: Job) -> Answer | None:
        """What the scene `start` should come to; None where the order says nothing."""
        edit = order.make()
        if edit is None:
            return None
        scene = edit(start)
        bare = bared(start, scene)
        if bare:
            edit = Compound(order.label, (edit, *(SetPaint(node, None) for node in bare)))
            scene = edit(start)
        strokes = concerned(scene, order.strokes(start, scene))
        solution = NOTHING
        if any(not scene[stroke].hidden for stroke in strokes):
            run, params = self._run(solver)
            solution = run.solve(scene, strokes, lit, params, job)
        return Answer(edit, scene, strokes, solution)

    def round(self, match: Match, scene: Scene, lit: Lit, solver: str, job: Job, *, sure: bool) -> bool:
        """See `Match.round`."""
        run, params = self._run(solver)
        return match.round(run, scene, lit, params, job, sure=sure)

    def stylise(self, scene: Scene, amount: float, lit: Lit, solver: str, job: Job) -> Solution:
        """See `StrokeRun.stylise`."""
        run, _ = self._run(solver)
        return run.stylise(scene, amount, lit, job)

    def likeness(self, scene: Scene, stroke: NodeId, lit: Lit, solver: str, job: Job) -> Any:
        """(V,) as `StrokeRun.likeness`."""
        run, params = self._run(solver)
        return run.likeness(scene, stroke, lit, params, job)

    def _run(self, name: str) -> tuple[StrokeRun, Any]:
        known = self._services.registry.names("solver")
        name = name if name in known else SOLVER if SOLVER in known else next(iter(known), "")
        if not name:
            raise PluginError("no plugin is there that finds the material which explains a stroke")
        if name not in self._runs:
            solver = self._services.registry.get("solver", name)
            self._runs[name] = (solver.open(self._services), solver.Params())
        return self._runs[name]


def lit_for(pipeline: Any, scene: Scene, kept: dict[str, Lit]) -> Lit | None:
    """What the newest picture has for `scene`, looked up once for all that `kept` is for."""
    if "lit" not in kept:
        found: Lit | None = pipeline.lit(scene)
        if found is None:
            return None
        kept["lit"] = found
    return kept["lit"]


NOT_YET = InputError("There is no picture yet that could be painted on.")

__all__ = ["NOTHING", "NOT_YET", "SOLVER", "Answer", "Bench", "Order", "lit_for"]
