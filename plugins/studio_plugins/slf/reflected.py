"""Strokes in indirect mode: the surface stays as it is, and what lights it or shows in it changes.

Which material of which object changed, and what of it, is decided as in `joint`: every change is fitted as
well as it can be, and pays for each number it changes. What the changes do is known by columns, the
derivatives of the light under the stroke (`influence`, `further`); here they are put together and the edit
is written.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.scene.nodes import NodeId, Scene
from studio_core.shading.job import Job
from studio_core.strokes.solution import Finding, Lit, Reason
from studio_core.strokes.stroke import AUTOMATIC, FIXATE, Stroke
from studio_plugins.slf.candidates import Candidate, candidates, fitted_again, score_of
from studio_plugins.slf.changeable import Changeable, changeables_of
from studio_plugins.slf.fixates import NOBODY, Rows, rows_of
from studio_plugins.slf.forward import Forward
from studio_plugins.slf.influence import SIDES, Sights
from studio_plugins.slf.joint import CLOSE
from studio_plugins.slf.recolouring import edit_of
from studio_plugins.slf.trials import Node, Trials

F64 = npt.NDArray[np.float64]
NEARLY, CARRIED = 16.0, 4
"""At rest candidates whose scores are that near to the best one's are carried forward; at most so many."""
STRANGE = 2.0
"""Times the light that is shown at a row: where the light of others is more, it says nothing."""
SHOWN = 4
"""Objects that are told of."""


@dataclass(frozen=True)
class Reflections:
    """Findings, best first: the first one's first reason explains the strokes best. Notes are sentences."""

    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)


class Reflected:
    """Remembers what rows under strokes see; owned by the compute thread."""

    def __init__(self, services: Services) -> None:
        self._services = services
        self._sights = Sights(services)
        self._trials = Trials(services)

    def solve(
        self,
        scene: Scene,
        strokes: Sequence[Stroke],
        lit: Lit,
        job: Job,
        now: Mapping[NodeId, F64] | None = None,
    ) -> Reflections:
        """What explains the strokes, of which fixates tell what must stay; `now` as in `fixates.rows_of`."""
        asked = [s for s in strokes if not s.hidden and (s.indirect or s.tool == FIXATE)]
        known = None if lit.indirect is None else lit.indirect.sent
        if known is None:
            return Reflections(
                notes=("Light does not go on between surfaces here: nothing lights the stroke.",)
            )
        surfaces = lit.surfaces.unrefined
        covered = known.surface.covered
        rows = rows_of(asked, surfaces, NOBODY if covered is None else covered.vertices, now)
        if not len(rows) or not (rows.importance * rows.change**2).sum() > 0:
            return Reflections(notes=("The stroke wants no change of what is reflected.",))
        resting = lit.indirect is not None and lit.indirect.final
        sights = self._sights.of(scene, surfaces, lit.casters, known, rows, job, SIDES if resting else 1)
        own = [(surfaces.nodes[i], s) for i, s in _under(rows, surfaces.mesh)]
        regions, region = changeables_of(scene, surfaces, own, self._services.registry)
        if not regions:
            return Reflections(notes=("Nothing whose material could change lights the stroke.",))
        nodes = self._trials(scene, surfaces, known, rows, sights, regions, region, job)
        pooled, share = _known(rows, nodes[0]).pooled(surfaces.mesh.positions)
        means = [node.pooled(share) for node in nodes]
        meant = meant_by(asked, scene)

        def rank(one: Candidate) -> tuple[bool, float]:
            return not meant(regions[one.region], one.meaning), one.score

        found = sorted(candidates(pooled, means, regions), key=rank)
        nearly = [one for one in found if rank(one) < (rank(found[0])[0], found[0].score + NEARLY)]
        near = nearly[: CARRIED if resting else 0]
        if near:
            looks = self._trials.looks(scene, surfaces)
            forward = Forward(known, surfaces, sights, self._trials.separator, self._services, job)
            again = []
            for one in near:
                made = forward(one, regions[one.region], region == one.region, looks)
                means_of = [share @ each for each in made]
                again.append(fitted_again(one, means_of, pooled, means, regions[one.region]))
            found = sorted([*again, *(one for one in found if one not in near)], key=rank)
        traced = sum(sight.traced for sight in sights)
        counts = {"rows": len(rows), "regions": len(regions), "rays": traced, "candidates": len(found)}
        counts["carried"] = len(near)
        nothing = score_of(1.0, 0, 0.0)
        better = [one for one in found if one.score < nothing]
        if not better or rank(better[0])[0]:  # there is none, or none that is meant
            return Reflections(counts=counts)
        return Reflections(self._findings(scene, asked, regions, better), (), counts)

    def _findings(
        self, scene: Scene, strokes: Sequence[Stroke], regions: list[Changeable], found: list[Candidate]
    ) -> tuple[Finding, ...]:
        by_region: dict[int, list[Candidate]] = {}
        for one in found:
            by_region.setdefault(one.region, []).append(one)
        close = sum(one.score - found[0].score < CLOSE for one in found[1:])
        ids = tuple(stroke.id for stroke in strokes)
        made: list[Finding] = []
        for number, own in list(by_region.items())[:SHOWN]:
            region = regions[number]
            reasons = tuple(self._reason(scene, region, one) for one in own)
            near = close if not made else 0
            made.append(Finding(region.node, region.slot, ids, reasons, near, rivals=True))
        return tuple(made)

    def _reason(self, scene: Scene, region: Changeable, one: Candidate) -> Reason:
        values: dict[str, float | tuple[float, float, float]] = {}
        for role, value in one.values.items():
            numbers = [float(v) for v in np.atleast_1d(value)]
            name = one.look.roles[role]
            values[name] = numbers[0] if len(numbers) == 1 else (numbers[0], numbers[1], numbers[2])
        edit = edit_of(scene, region, one.look, one.values)
        return Reason(one.meaning, one.explained, one.score, values, edit)


def _known(rows: Rows, now: Node) -> Rows:
    """Without weight where others are thought to give much more light than is shown there.

    Such rows stand for what is buried in other things; being dark, they would count most of all.
    """
    arriving = np.mean([side.whole.sum(axis=(1, 2)) for side in now.sides], axis=0)
    strange = arriving > STRANGE * rows.light.sum(axis=1)
    return rows if strange.all() else dataclasses.replace(rows, weight=rows.weight * ~strange)


def _under(rows: Rows, mesh: Any) -> set[tuple[int, int]]:
    """Number of the object and slot under each row."""
    made = set()
    for vertex in np.unique(rows.vertex).tolist():
        index = int(mesh.object[vertex])
        slot = int(mesh.objects[index].mesh.slot[vertex - mesh.vertex_offsets[index]])
        made.add((index, slot))
    return made


def meant_by(strokes: Sequence[Stroke], scene: Scene) -> Callable[[Changeable, str], bool]:
    """Whether a change of an object's slot is one that strokes allow, on an object that somebody chose."""
    asking = [stroke for stroke in strokes if stroke.tool != FIXATE]
    meanings = {stroke.meaning for stroke in asking} - {AUTOMATIC}
    chosen = {(one.through, one.through_slot) for one in asking if one.through in scene.nodes}

    def meant(region: Changeable, meaning: str) -> bool:
        there = not chosen or not chosen.isdisjoint({(region.node, region.slot), (region.node, -1)})
        return there and meanings <= {meaning}

    return meant


def solve_reflected(
    scene: Scene, strokes: Sequence[Stroke], lit: Lit, services: Services, params: Any, job: Job
) -> tuple[Finding, ...]:
    """Findings of strokes in indirect mode, best first, by somebody who remembers nothing."""
    return Reflected(services).solve(scene, strokes, lit, job).findings


__all__ = ["Reflected", "Reflections", "meant_by", "solve_reflected"]
