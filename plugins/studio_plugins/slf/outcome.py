"""From decisions to the edit, and to the reasons that are told: each with the edit that it would be."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_core.scene.paint import Paint
from studio_core.shading.artifacts import Surfaces
from studio_core.strokes.marks import Marks
from studio_core.strokes.paintable import paintable
from studio_core.strokes.solution import Finding, Reason
from studio_core.strokes.solved import Solved
from studio_core.strokes.stroke import FIXATE, Stroke
from studio_plugins.slf.elementwise import ElementStep
from studio_plugins.slf.explaining import WORDS, Painting, Step
from studio_plugins.slf.field import Decided, Field, Varied
from studio_plugins.slf.joint import SINGLE, Explanation
from studio_plugins.slf.regions import Region
from studio_plugins.slf.samples import F64
from studio_plugins.slf.similarity import Reach
from studio_plugins.slf.spots import SLOTS, Spots
from studio_plugins.slf.spread import Spread

TOLD = 4
"""Reasons that are shown, each with its edit."""
BESIDE = "/"
"""Between a number and the name of a parameter, where several changes are laid at once."""


@dataclass(frozen=True)
class Instead:
    """Another explanation of a region's last step than the best: its number among them."""

    region: Region
    number: int


@dataclass(frozen=True, eq=False)
class Canvas:
    """What edits are made from: the scene, who lies where, how changes spread, and what was decided.

    `asked` are the strokes of which other explanations will be told.
    """

    scene: Scene
    surfaces: Surfaces
    spread: Spread
    services: Services
    found: Mapping[Region, Painting]
    asked: frozenset[NodeId]

    @property
    def whose(self) -> frozenset[NodeId]:
        """Objects whose paint is made anew: those with strokes, and those that strokes reached before."""
        nodes = {region.node for region in self.found}
        nodes.update(node for stroke in self._strokes() for node in stroke.reached)
        return frozenset(node for node in nodes if isinstance(self.scene.nodes.get(node), MeshObject))

    def told(self, region: Region) -> tuple[Explanation, ...]:
        """Explanations of a region's last step, if one of the asked strokes is in it."""
        steps = self.found[region].steps
        if not steps or self.asked.isdisjoint(stroke.id for stroke in steps[-1].strokes):
            return ()
        return steps[-1].verdict.explanations[:TOLD]

    @cached_property
    def laid(self) -> Mapping[Instead | None, Mapping[NodeId, Paint]]:
        """Paint by object, of the best explanations (None), and with one of the others instead.

        All of it lies on the same points: what is wanted differs by what changes, not by where.
        """
        every = [None] + [
            Instead(region, number) for region in self.found for number in range(1, len(self.told(region)))
        ]
        scene = self.scene.with_materials(*(painting.dressed.material for painting in self.found.values()))
        field, made = self._field(scene, every), dict[NodeId, Paint]()
        if field.layers or field.varied:
            lay = self.spread.on_elements if field.varied else self.spread
            made = lay(scene, self.surfaces, field)
        alone = {
            instead: {node: _alone(paint, number) for node, paint in made.items()}
            for number, instead in enumerate(every)
        }
        return {
            instead: {node: paint for node, paint in paints.items() if paint is not None}
            for instead, paints in alone.items()
        }

    def edit(
        self,
        label: str,
        instead: Instead | None = None,
        meanings: Mapping[NodeId, str] = frozen_map(),
    ) -> Solved:
        """Paint on all regions, where the last step of one may end in another explanation than the best.

        With `meanings` somebody chose it, be it the best.
        """
        materials = {
            painting.was.id: painting.dressed.material
            for painting in self.found.values()
            if painting.changes or meanings or instead is not None
        }
        scene = self.scene.with_materials(*materials.values())
        made = self.laid[instead]
        others = {node for stroke in scene.of(Stroke) if not stroke.hidden for node in stroke.objects}
        paints: dict[NodeId, Paint | None] = dict.fromkeys(self.whose)
        for node, paint in made.items():
            if node in paints or node not in others:
                paints[node] = paint
        fields: dict[NodeId, dict[str, Any]] = {}
        for painting in self.found.values():
            for stroke_id, offsets in painting.offsets.items():
                values = fields.setdefault(stroke_id, {})
                table = values.get("table", getattr(scene[stroke_id], "table", None))
                values["table"] = _with_offsets(table, offsets)
        for stroke in self._strokes():
            beyond = (node for node, paint in paints.items() if paint is not None and node not in others)
            reached = tuple(beyond) if stroke.alike else ()
            if reached != stroke.reached:
                fields.setdefault(stroke.id, {})["reached"] = reached
        for stroke_id, meaning in meanings.items():
            fields.setdefault(stroke_id, {})["meaning"] = meaning
        for node, own in paints.items():
            for slot in np.unique(own.slots).tolist() if own is not None else ():
                material = Region(node, int(slot)).material(scene)
                if material is not None:
                    materials[material] = paintable(scene.material(material), self.services.registry)
        changed = tuple(new for name, new in materials.items() if new is not self.scene.material(name))
        return Solved(label, frozen_map(paints), changed, frozen_map(fields))

    def _strokes(self) -> list[Stroke]:
        steps = [step for painting in self.found.values() for step in painting.steps]
        return [*{stroke.id: stroke for step in steps for stroke in step.strokes}.values()]

    def _field(self, scene: Scene, every: Sequence[Instead | None]) -> Field:
        """All steps, each with the changes of all that may be instead, side by side.

        Where a stroke lies on several regions its changes say one thing, and meet.
        """
        layers: dict[tuple[NodeId, ...], list[Decided]] = {}
        varied: list[Varied] = []
        for region, painting in self.found.items():
            for step in painting.steps:
                changes, marks = self._changes(region, step, every), self._marks(scene, region, step)
                if not changes or not marks:
                    continue
                if isinstance(step, ElementStep):
                    spots = self.spread.spots(scene, self.surfaces).some(step.vertex)
                    varied.append(Varied(spots, changes, np.ones(len(spots), np.float32), marks))
                else:
                    strokes = tuple(stroke.id for stroke in step.strokes if stroke.tool != FIXATE)
                    meeting = (Decided(own, reach, changes) for own, reach in marks)
                    layers.setdefault(strokes, []).extend(meeting)
        return Field([*layers.values()], varied)

    def _changes(self, region: Region, step: Step, every: Sequence[Instead | None]) -> dict[str, Any]:
        painting = self.found[region]
        made: dict[str, Any] = {}
        for number, instead in enumerate(every):
            one = step.verdict.best
            if instead is not None and instead.region == region and step is painting.steps[-1]:
                one = step.verdict.explanations[instead.number]
            own: Mapping[str, Any] = (
                step.answer(one)
                if isinstance(step, ElementStep)
                else painting.dressed.changes(step.now, step.gloss, one.reflectance, one.change)
            )
            made |= {f"{number}{BESIDE}{name}": change for name, change in own.items()}
        return made

    def _marks(self, scene: Scene, region: Region, step: Step) -> list[tuple[Spots, Reach]]:
        """Where a step's strokes lie on a region, and how far each reaches."""
        part = self.surfaces.unrefined.mesh.index_of(region.node) * SLOTS + region.slot
        made = []
        for stroke in step.strokes:
            if stroke.tool != FIXATE:
                marks = self.spread.marks(scene, self.surfaces, stroke)
                own = marks.some(marks.part == part)
                if len(own):
                    made.append((own, Reach.of(stroke)))
        return made


def _alone(paint: Paint, number: int) -> Paint | None:
    """One of several changes that were laid at once."""
    before = f"{number}{BESIDE}"
    return paint.only({name.removeprefix(before): name for name in paint.changes if name.startswith(before)})


def _with_offsets(table: Any, offsets: Sequence[tuple[npt.NDArray[np.int64], F64]]) -> Any:
    marks = Marks.of_table(table)
    made = marks.offset.copy()
    for which, offset in offsets:
        made[which] = offset
    if np.array_equal(made, marks.offset, equal_nan=True):
        return table
    return dataclasses.replace(marks, offset=made).table()


def finding_of(canvas: Canvas, region: Region) -> Finding | None:
    """Of the last step, if one of the asked strokes is in it."""
    painting, explanations = canvas.found[region], canvas.told(region)
    if not explanations:
        return None
    step = painting.steps[-1]
    reasons = []
    who = [stroke for stroke in step.strokes if stroke.tool != FIXATE and stroke.id in canvas.asked]
    for number, one in enumerate(explanations):
        word = WORDS[one.change]
        meanings = {stroke.id: word for stroke in who} if word else {}
        instead = Instead(region, number) if number else None
        edit = canvas.edit(told(canvas.scene, region.node, word), instead, meanings)
        values = painting.dressed.values(one.reflectance)
        reasons.append(Reason(word, one.explained, one.score, frozen_map(values), edit))
    silent = tuple(WORDS[c] for c in SINGLE[1:] if c in step.verdict.silent and c in painting.dressed.can)
    ids = tuple(stroke.id for stroke in step.strokes)
    close = len(step.verdict.close)
    return Finding(region.node, region.slot, ids, tuple(reasons), close, silent)


def told(scene: Scene, node: NodeId, word: str) -> str:
    """What the history calls a change."""
    return f"Paint {word or 'nothing'} on {scene[node].name}"


def label_of(scene: Scene, asked: Sequence[Stroke], found: Mapping[Region, Painting]) -> str:
    """By the first region that was decided about."""
    for region, painting in found.items():
        if painting.steps:
            return told(scene, region.node, WORDS[painting.steps[-1].verdict.best.change])
    return "Paint" if asked else "Strokes"


__all__ = ["Canvas", "finding_of", "label_of", "told"]
