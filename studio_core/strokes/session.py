"""Painting without a window: from planned strokes to the scene that they ask for."""

from __future__ import annotations

import dataclasses
import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from studio_core.arrays import frozen_map
from studio_core.contract import Services, ShadingBackend, StrokeRun, StrokeSolver
from studio_core.edits import Add, Compound, Edit
from studio_core.errors import InputError
from studio_core.raster import PictureStage
from studio_core.scene.diff import Aspect, Changes, diff, view_changed
from studio_core.scene.nodes import MeshObject, Scene, new_id
from studio_core.session import View
from studio_core.shading.artifacts import Picture
from studio_core.shading.frame import Frame, IndirectChoice
from studio_core.shading.indirect import UnrefinedShapes, with_indirect
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Pipeline
from studio_core.strokes.edits import applied
from studio_core.strokes.lit import lit_of
from studio_core.strokes.matching import Match
from studio_core.strokes.painting import marks_of, stroke_name, stroke_of
from studio_core.strokes.planned import Look, MarkedStroke, Planned
from studio_core.strokes.solution import Finding, Lit
from studio_core.strokes.stroke import Stroke
from studio_core.strokes.tools import Seen, wanted

KIND = "solver"
NEAR_ENOUGH = 0.002
"""Of what is wanted: rounds that were asked for are not done then."""


class Easel:
    """Pictures of a scene that changes, and what solvers need of the last one."""

    def __init__(
        self, backend: ShadingBackend, params: Any, services: Services, indirect: IndirectChoice | None = None
    ) -> None:
        stages = [*with_indirect(backend.stages(services), services), PictureStage(services)]
        self._pipeline = Pipeline(stages)
        self._shapes = UnrefinedShapes(services)
        self._frame = Frame(Scene(), View(), params, revision=0, indirect=indirect)

    def picture(self, scene: Scene, view: View, job: Job) -> Picture:
        """As exact as the backend's parameters want it."""
        before = self._frame
        changes = diff(before.scene, scene) | view_changed(Aspect.VIEW) if before.revision else Changes()
        self._frame = dataclasses.replace(before, scene=scene, view=view, revision=before.revision + 1)
        made: Picture = self._pipeline.update(self._frame, changes, job)
        return made

    def lit(self) -> Lit:
        """Of the last picture; InputError where its backend has nothing that solvers can use."""
        lit = lit_of(self._pipeline, self._frame.scene, self._shapes)
        if lit is None:
            raise InputError("this backend keeps nothing that strokes could be explained with; try cuts")
        return lit


@dataclass(frozen=True, eq=False)
class Painted:
    """The scene with strokes and what explains them, the edits that lead there, and what was found."""

    scene: Scene
    edits: tuple[Edit, ...]
    strokes: tuple[Stroke, ...]
    findings: tuple[Finding, ...]
    notes: tuple[str, ...]
    counts: Mapping[str, int] = field(default_factory=frozen_map)


def paint_and_solve(
    scene: Scene,
    planned: Sequence[Planned],
    solver: StrokeSolver,
    params: Any,
    easel: Easel,
    services: Services,
    job: Job | None = None,
    *,
    one_by_one: bool = False,
    rounds: int = 1,
) -> Painted:
    """Strokes on pictures of the scene, explained together (but for those that are planned otherwise).

    With `one_by_one` each is painted on the picture that those before have made, and is a step of its own.
    With several `rounds` strokes are explained again under the light that the last answer brings (figure
    15): see `settling`. InputError and EditError for cameras and objects that the scene does not have;
    Cancelled.
    """
    job = job or Job("Painting")
    run = solver.open(services)
    made = Painted(scene, (), (), (), ())
    groups = [[one] for one in planned] if one_by_one else [[*planned]]
    for group in groups:
        made = _group(made, group, run, params, easel, job, one_by_one, rounds)
    return made


def _group(
    before: Painted,
    planned: Sequence[Planned],
    run: StrokeRun,
    params: Any,
    easel: Easel,
    job: Job,
    apart: bool,
    rounds: int,
) -> Painted:
    """With some strokes more, painted on what there was before."""
    scene, strokes, notes = before.scene, list[Stroke](), [*before.notes]
    pictures: dict[View, Picture] = {}
    for one in planned:
        job.checkpoint()
        fields = {"together": bool(strokes) and not apart, **one.fields}
        if "through" in fields:
            fields["through"] = scene.named(fields["through"]).id
        if isinstance(one, MarkedStroke):
            strokes.append(_marked(scene, one, fields))
            continue
        view = one.look.view(scene)
        if view not in pictures:
            pictures[view] = easel.picture(scene, view, job)
        picture = pictures[view]
        seen = Seen.of(picture)
        mask = one.gesture.mask(seen)
        wish = wanted(one.tool, seen, one.gesture, one.settings, mask)
        marked = marks_of(picture, mask, wish)
        stroke = stroke_of(marked, scene, one.tool, **fields)
        notes += [*one.notes, *(f"{stroke.name}: {note}" for note in marked.notes)]
        if stroke.marks is not None:
            strokes.append(stroke)
    if not strokes:
        return dataclasses.replace(before, notes=tuple(notes))
    if not pictures:
        easel.picture(scene, Look().view(scene), job)
    label = strokes[0].name if len(strokes) == 1 else f"Paint {len(strokes)} strokes"
    there, asked = Add(tuple(strokes))(scene), [stroke.id for stroke in strokes]
    solution = run.solve(there, asked, easel.lit(), params, job)
    edit = applied(label, strokes, solution)
    if rounds > 1 and not any(stroke.indirect for stroke in strokes):
        start, view = edit(scene), next(iter(pictures), Look().view(scene))
        match = Match(label, start, tuple(asked), solution, met=NEAR_ENOUGH)
        play(match, start, run, params, easel, view, job, rounds - 1)
        edit, solution = Compound(label, (*edit.edits, match.edit)), match.held or solution
    return Painted(
        edit(scene),
        (*before.edits, edit),
        (*before.strokes, *strokes),
        (*before.findings, *solution.findings),
        (*notes, *solution.notes),
        frozen_map(Counter(before.counts) + Counter(solution.counts)),
    )


def play(
    match: Match,
    start: Scene,
    run: StrokeRun,
    params: Any,
    easel: Easel,
    view: View,
    job: Job,
    rounds: int | None = None,
) -> None:
    """Rounds of a match from a scene on, each with a picture: so many, or until it is over."""
    for _ in itertools.count() if rounds is None else range(rounds):
        now = match.edit(start)
        easel.picture(now, view, job)
        if not match.round(run, now, easel.lit(), params, job):
            break


def _marked(scene: Scene, planned: MarkedStroke, fields: Mapping[str, Any]) -> Stroke:
    """On the objects of those names; EditError where one is not there."""
    objects = []
    for name in planned.objects:
        node = scene.named(name)
        if not isinstance(node, MeshObject):
            raise InputError(f"{node.name!r} has no surface that could be painted")
        objects.append(node.id)
    given = {"name": stroke_name(scene, planned.tool, tuple(objects)), **fields}
    table = planned.marks.table()
    return Stroke(id=new_id("stroke"), tool=planned.tool, objects=tuple(objects), table=table, **given)


__all__ = ["KIND", "Easel", "Painted", "paint_and_solve", "play"]
