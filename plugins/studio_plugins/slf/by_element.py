"""The paper's own solvers for strokes: every element that a stroke touches decides by itself (section 5.3).

What strokes want is told as for `joint`, as a difference; it is added to what the elements send towards the
places it was painted from (`painted_rows`), and all their other directions are to stay as they are. Their
answers become paint that varies from element to element, with a point at each of them.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.params import param
from studio_core.scene.nodes import NodeId, Scene
from studio_core.shading.job import Job
from studio_core.strokes.solution import Lit, Solution
from studio_core.strokes.stroke import AUTOMATIC, FIXATE, Stroke
from studio_plugins.slf.elementwise import ElementStep, Question, verdict_of
from studio_plugins.slf.explaining import MEANT, Painting
from studio_plugins.slf.field import Field, Varied
from studio_plugins.slf.moments import moments
from studio_plugins.slf.painted_rows import Columns, Rows, with_rows
from studio_plugins.slf.paper import Solver
from studio_plugins.slf.regions import Region
from studio_plugins.slf.retold import Numbers, Retold
from studio_plugins.slf.series import half_level, sent_of
from studio_plugins.slf.solver import JointRun, Said
from studio_plugins.slf.spread import RIM
from studio_plugins.slf.stylise import Style, stylise
from studio_plugins.slf.touched import Around, Touched

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

STRENGTH = 1e5
"""σ_m: what a stroke does not show hardly holds it back, but decides where it tells nothing."""


@dataclass(frozen=True)
class Params:
    """Parameters of the solvers."""

    strength: float = param(
        STRENGTH, "Strength", "How many other directions a painted one counts as (σ_m)", low=0.0, high=1e9,
        advanced=True,
    )  # fmt: skip
    literal: bool = param(
        True, "As printed", "Equations 5 and 6 and the rescaling as printed, not the true minimum"
    )


class ByElement:
    """See the module; satisfies `studio_core.contract.StrokeSolver`."""

    Params = Params

    def __init__(self, kind: Solver, label: str) -> None:
        self.id: str = kind
        self.label = label
        self._kind: Solver = kind

    def open(self, services: Services) -> ElementRun:
        """A run of its own."""
        return ElementRun(services, self._kind)


class ElementRun(JointRun):
    """Satisfies `studio_core.contract.StrokeRun`."""

    def __init__(self, services: Services, kind: Solver) -> None:
        super().__init__(services)
        self._kind: Solver = kind
        self._touched = Touched(services.workers)
        self._counts = Counter[str]()

    def solve(self, scene: Scene, strokes: Sequence[NodeId], lit: Lit, params: Any, job: Job) -> Solution:
        """See `studio_core.contract.StrokeRun`."""
        self._counts.clear()
        made = super().solve(scene, strokes, lit, params, job)
        return dataclasses.replace(made, counts=frozen_map({**made.counts, **self._counts}))

    def stylise(self, scene: Scene, amount: float, lit: Lit, job: Job) -> Solution:
        """See `studio_core.contract.StrokeRun`."""
        return stylise(scene, lit, Style(amount, self._kind), self._services, job)

    def _explain(
        self,
        painting: Painting,
        region: Region,
        group: tuple[Stroke, ...],
        scene: Scene,
        lit: Lit,
        params: Any,
        job: Job,
    ) -> None:
        said = self._said(painting, region, group, scene, lit, job)
        if said is None:
            return
        mesh = lit.surfaces.unrefined.mesh
        at = np.concatenate([places.vertex for _, _, places in said.parts])
        vertex, element = np.unique(self._touched.owners(mesh, lit.casters.meshes, at), return_inverse=True)
        around = self._touched.light(scene, lit, vertex, job)
        rows = _rows_of(said, element, around.frames)
        retold = Retold(painting.dressed)
        now = retold.now(mesh.uvs[vertex], self._changed(painting, vertex, scene, lit))
        question = asked(around, rows, retold, now, params.strength, _meant(said, element, len(vertex)))
        meanings = [stroke.meaning for stroke in said.strokes if stroke.meaning != AUTOMATIC]
        meant = MEANT[meanings[0]] & painting.dressed.can if meanings else None
        allowed = painting.dressed.allowed
        verdict, answers, flagged = verdict_of(question, retold, self._kind, params.literal, allowed, meant)
        lit_ones = np.flatnonzero(~flagged)
        kept = tuple({name: one[lit_ones] for name, one in answer.items()} for answer in answers)
        step = (said.strokes, verdict, said.now, said.gloss, said.count)
        painting.steps.append(ElementStep(*step, vertex[lit_ones], kept))
        for name, change in kept[0].items() if len(lit_ones) else ():
            mean = change.mean(axis=0, dtype=np.float64)
            painting.changes[name] = painting.changes.get(name, np.zeros_like(mean)) + mean
        painting.rays += around.rays
        self._counts.update(solved=len(lit_ones), skipped=int(flagged.sum()))

    def _changed(self, painting: Painting, vertex: I64, scene: Scene, lit: Lit) -> dict[str, F32]:
        """By parameter (E, C) what the steps before have changed at elements."""
        spots = self._spread.spots(scene, lit.surfaces)
        varied = [
            Varied(spots.some(step.vertex), step.answer(step.verdict.best), _ones(len(step.vertex)))
            for step in painting.steps
            if isinstance(step, ElementStep) and len(step.vertex)
        ]
        return Field(varied=varied).at(spots.some(vertex))


def asked(
    around: Around, rows: Rows, retold: Retold, now: Numbers, strength: float, meant: Bools
) -> Question:
    """Moments of all directions of E elements, which are to stay as they are, with the rows' wishes."""
    before = retold.albedos(now)
    level = before.nearest
    diffuse, specular = np.moveaxis(before.reflectance, 2, 0)
    target = sent_of(around.series, diffuse, specular, half_level(level))
    columns = Columns.of(around.series, rows)
    sent = columns.sent(before.reflectance[rows.element], level[rows.element])
    systems = moments(around.series, target, before.reflectance, level)
    systems = with_rows(systems, columns, rows, sent, strength)
    return Question(systems, rows, columns, sent, before, now, meant)


def _ones(count: int) -> F32:
    return np.ones(count, np.float32)


def _rows_of(said: Said, element: I64, frames: F32) -> Rows:
    """The samples as rows; those that their element faces away from count for nothing."""
    ways = [np.einsum("ni,nij->nj", places.wo, places.axes) for _, _, places in said.parts]
    towards = np.einsum("nij,nj->ni", frames[element].astype(np.float64), np.concatenate(ways))
    change = np.concatenate([one.wanted - one.before for _, one, _ in said.parts])
    weight = np.concatenate([one.weight for _, one, _ in said.parts])
    return Rows.of(element, towards.astype(np.float32), change, np.where(towards[:, 2] > 0, weight, 0))


def _meant(said: Said, element: I64, count: int) -> Bools:
    """(E,) elements in which something is to change; all where nothing is, anywhere."""
    wants = []
    for stroke, _, places in said.parts:
        assert stroke.marks is not None
        marks = stroke.marks.some(places.mark)
        some = (marks.wanted != marks.shown).any(axis=1) & (marks.weight > RIM * marks.weight.max(initial=0))
        wants.append(some & (stroke.tool != FIXATE))
    made = np.zeros(count, np.bool_)
    made[element[np.concatenate(wants)]] = True
    return made if made.any() else ~made


MIXED = ByElement("mixed", "Paper: mixed, 1 / 5 / 25")
SPARSE = ByElement("l0", "Paper: one change (L0)")
FULL = ByElement("l2", "Paper: everything (L2)")

__all__ = ["FULL", "MIXED", "SPARSE", "STRENGTH", "ByElement", "ElementRun"]
