"""From decisions to the edit, and to the reasons that are told: each with the edit that it would be."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
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
from studio_plugins.slf.explaining import WORDS, Painting
from studio_plugins.slf.field import Decided, Field, Layer
from studio_plugins.slf.joint import SINGLE, Explanation
from studio_plugins.slf.regions import Region
from studio_plugins.slf.samples import F64
from studio_plugins.slf.similarity import Reach
from studio_plugins.slf.spots import SLOTS
from studio_plugins.slf.spread import Spread

TOLD = 4
"""Reasons that are shown, each with its edit."""


@dataclass(frozen=True, eq=False)
class Canvas:
    """What edits are made from: the scene, who lies where, how changes spread, and what was decided."""

    scene: Scene
    surfaces: Surfaces
    spread: Spread
    services: Services
    found: Mapping[Region, Painting]

    @property
    def whose(self) -> frozenset[NodeId]:
        """Objects whose paint is made anew: those with strokes, and those that strokes reached before."""
        nodes = {region.node for region in self.found}
        nodes.update(node for stroke in self._strokes() for node in stroke.reached)
        return frozenset(node for node in nodes if isinstance(self.scene.nodes.get(node), MeshObject))

    def edit(
        self,
        label: str,
        instead: Mapping[Region, Explanation] = frozen_map(),
        meanings: Mapping[NodeId, str] = frozen_map(),
    ) -> Solved:
        """Paint on all regions, where the last steps of some end in other explanations than the best."""
        materials = {
            painting.was.id: painting.dressed.material
            for painting in self.found.values()
            if painting.changes or instead
        }
        scene = self.scene.with_materials(*materials.values())
        layers: dict[tuple[NodeId, ...], list[Decided]] = {}
        for region in self.found:
            for strokes, layer in self._layers(scene, region, instead.get(region)):
                layers.setdefault(strokes, []).extend(layer)
        field = Field([*layers.values()])
        made = self.spread(scene, self.surfaces, field) if field.layers else {}
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

    def _layers(
        self, scene: Scene, region: Region, last: Explanation | None
    ) -> Iterator[tuple[tuple[NodeId, ...], Layer]]:
        """With the strokes that each is of: on several regions they say one thing, and it meets itself."""
        painting = self.found[region]
        part = self.surfaces.unrefined.mesh.index_of(region.node) * SLOTS + region.slot
        for step in painting.steps:
            one = step.verdict.best if last is None or step is not painting.steps[-1] else last
            changes = painting.dressed.changes(step.now, step.gloss, one.reflectance, one.change)
            layer = []
            for stroke in step.strokes if changes else ():
                marks = self.spread.marks(scene, self.surfaces, stroke)
                own = marks.some(marks.part == part)
                if stroke.tool != FIXATE and len(own):
                    layer.append(Decided(own, Reach.of(stroke), changes))
            if layer:
                yield tuple(stroke.id for stroke in step.strokes if stroke.tool != FIXATE), layer


def _with_offsets(table: Any, offsets: Sequence[tuple[npt.NDArray[np.int64], F64]]) -> Any:
    marks = Marks.of_table(table)
    made = marks.offset.copy()
    for which, offset in offsets:
        made[which] = offset
    if np.array_equal(made, marks.offset, equal_nan=True):
        return table
    return dataclasses.replace(marks, offset=made).table()


def finding_of(canvas: Canvas, region: Region, asked: set[NodeId]) -> Finding | None:
    """Of the last step, if one of the asked strokes is in it."""
    painting = canvas.found[region]
    if not painting.steps or asked.isdisjoint(stroke.id for stroke in painting.steps[-1].strokes):
        return None
    step = painting.steps[-1]
    reasons = []
    who = [stroke for stroke in step.strokes if stroke.tool != FIXATE and stroke.id in asked]
    for one in step.verdict.explanations[:TOLD]:
        word = WORDS[one.change]
        meanings = {stroke.id: word for stroke in who} if word else {}
        edit = canvas.edit(told(canvas.scene, region.node, word), {region: one}, meanings)
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
