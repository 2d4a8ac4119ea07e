"""The solver that explains a whole stroke at once; see `joint`.

Strokes on a slot of an object are gone through in their order, each on what those before have made of the
bare material. What a stroke wants is a difference: its target is the light that the model makes there, plus
what was painted, minus what was shown. So what the model does not know (fine texture, noise) stays as it is.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.params import param
from studio_core.scene.nodes import Material, MeshObject, NodeId, Scene
from studio_core.scene.paint import Paint
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.job import Job
from studio_core.strokes.marks import Marks
from studio_core.strokes.paintable import paintable
from studio_core.strokes.solution import Finding, Lit, Reason, Solution
from studio_core.strokes.solved import Solved
from studio_core.strokes.stroke import AUTOMATIC, FIXATE, Stroke
from studio_plugins.slf.columns import sums_at
from studio_plugins.slf.dressed import Dressed
from studio_plugins.slf.field import Decided, Field, Layer
from studio_plugins.slf.incident import Arriving, Incident
from studio_plugins.slf.joint import SINGLE, Change, Explanation, Verdict, decide
from studio_plugins.slf.places import Places, places_of
from studio_plugins.slf.regions import Region, regions_of, steps
from studio_plugins.slf.samples import F64, Reflectance, Samples
from studio_plugins.slf.similarity import Reach
from studio_plugins.slf.spots import SLOTS
from studio_plugins.slf.spread import Spread

WORDS: Mapping[Change, str] = {
    Change.NONE: "",
    Change.DIFFUSE: "colour",
    Change.SPECULAR: "shine",
    Change.GLOSS: "gloss",
    Change.DIFFUSE | Change.SPECULAR: "colour and shine",
    Change.DIFFUSE | Change.GLOSS: "colour and gloss",
    Change.SPECULAR | Change.GLOSS: "shine and gloss",
    Change.DIFFUSE | Change.SPECULAR | Change.GLOSS: "everything",
}
MEANT = {word: change for change, word in WORDS.items()}
STRANGE = 0.15
"""Relative error of a place's light as it is, from which on it says little of how it would change."""
TOLD = 4
"""Reasons that are shown, each with its edit."""


@dataclass(frozen=True)
class Params:
    """Parameters of the solver."""

    coloured: bool = param(True, "Coloured shine", "Shine may take the colour that was painted")


@dataclass(frozen=True, eq=False)
class Step:
    """One decision: what was found, and what each explanation adds to the material's parameters."""

    strokes: tuple[Stroke, ...]
    verdict: Verdict
    now: Reflectance
    gloss: float | None
    places: int


class Joint:
    """See the module; satisfies `studio_core.contract.StrokeSolver`."""

    id = "joint"
    label = "Fewest changes"
    Params = Params

    def open(self, services: Services) -> JointRun:
        """A run of its own."""
        return JointRun(services)


class JointRun:
    """Satisfies `studio_core.contract.StrokeRun`."""

    def __init__(self, services: Services) -> None:
        self._services = services
        self._incident = Incident(services)
        self._spread = Spread(services)

    def solve(self, scene: Scene, strokes: Sequence[NodeId], lit: Lit, params: Params, job: Job) -> Solution:
        """See `studio_core.contract.StrokeRun`."""
        asked = [node for node in map(scene.nodes.get, strokes) if isinstance(node, Stroke)]
        regions = tuple(dict.fromkeys(region for stroke in asked for region in regions_of(stroke)))
        notes = [f"{stroke.name} lies on no surface" for stroke in asked if not regions_of(stroke)]
        found: dict[Region, _Painted] = {}
        for region, todo in steps(scene, regions).items():
            name = region.material(scene)
            if name is None or region.node not in lit.surfaces.nodes:
                continue  # gone, or hidden: it keeps what it has
            painting = _Painted.begin(scene.material(name), self._services)
            if painting is None:
                notes.append(f"nothing of {scene.material(name).name} can be painted")
                continue
            for group in todo:
                self._explain(painting, region, group, scene, lit, params, job)
            found[region] = painting
        canvas = _Canvas(scene, lit.surfaces, self._spread, self._services, found)
        edit = canvas.edit(_label(scene, asked, found))
        names = {stroke.id for stroke in asked}
        told = (_finding(canvas, region, names) for region in found)
        findings = [finding for finding in told if finding is not None]
        counts = {
            "places": sum(step.places for painting in found.values() for step in painting.steps),
            "rays": sum(painting.rays for painting in found.values()),
            "systems": sum(len(step.verdict.explanations) for p in found.values() for step in p.steps),
        }
        return Solution(edit, tuple(findings), tuple(notes), frozen_map(counts))

    def likeness(self, scene: Scene, stroke: NodeId, lit: Lit, params: Params, job: Job) -> Any:
        """See `studio_core.contract.StrokeRun`; before the stroke is solved, by materials as they are."""
        node = scene.nodes.get(stroke)
        if not isinstance(node, Stroke):
            return np.zeros(len(lit.surfaces.unrefined.mesh), np.float32)
        return self._spread.likeness(scene, lit.surfaces, node)

    def _explain(
        self,
        painting: _Painted,
        region: Region,
        group: tuple[Stroke, ...],
        scene: Scene,
        lit: Lit,
        params: Params,
        job: Job,
    ) -> None:
        parts: list[tuple[Stroke, Samples, Places]] = []
        dressed, mesh = painting.dressed, lit.surfaces.unrefined.mesh
        seen = []
        for stroke in group:
            places = places_of(scene, lit.surfaces.unrefined, stroke)
            places = places.some(np.flatnonzero(_on(stroke, places, region)))
            if len(places):
                seen.append((stroke, places))
        if not seen:
            return
        uvs = mesh.uvs[np.concatenate([places.vertex for _, places in seen])]
        now, gloss = dressed.now(uvs, painting.changes)
        shapes, own_shape = dressed.shapes(), dressed.own_shape(gloss)
        every = np.concatenate([shapes, own_shape[None]])
        for stroke, places in seen:
            light = self._incident.at(scene, lit, places, job)
            painting.rays += light.rays
            sums = self._sums(dressed, every, light, places, job)
            samples, offset = _samples(stroke, places, sums, dressed, now)
            painting.offsets.setdefault(stroke.id, []).append((places.mark, offset))
            parts.append((stroke, samples, places))
        pooled = _pooled(parts)
        allowed = _allowed(dressed, [stroke for stroke, _, _ in parts])
        tints = _tints(pooled, dressed, now) if params.coloured and not dressed.white else ()
        verdict = _meant(decide(pooled, dressed, now, allowed, tints), dressed, group)
        count = sum(len(places) for _, _, places in parts)
        painting.take(Step(tuple(stroke for stroke, _, _ in parts), verdict, now, gloss, count))

    def _sums(self, dressed: Dressed, shapes: Any, light: Arriving, places: Places, job: Job) -> F64:
        brdf, pattern = dressed.resolved.brdf, self._incident.pattern.directions[0]
        return sums_at(brdf.address, brdf.terms, shapes, light, places, pattern, self._services.workers, job)


@dataclass(eq=False)
class _Painted:
    """A region on the way: its material as it can be painted, and what was decided so far."""

    dressed: Dressed
    was: Material
    steps: list[Step]
    changes: dict[str, F64]
    offsets: dict[NodeId, list[tuple[npt.NDArray[np.int64], F64]]]
    rays: int = 0

    @staticmethod
    def begin(material: Material, services: Services) -> _Painted | None:
        dressed = Dressed.of(paintable(material, services.registry), services.registry)
        return None if dressed is None else _Painted(dressed, material, [], {}, {})

    def take(self, step: Step) -> None:
        """Goes on from its best explanation."""
        self.steps.append(step)
        best = step.verdict.best
        for name, change in self.dressed.changes(step.now, step.gloss, best.reflectance, best.change).items():
            self.changes[name] = self.changes.get(name, np.zeros_like(change)) + change


def _on(stroke: Stroke, places: Places, region: Region) -> npt.NDArray[np.bool_]:
    """(N,) which of a stroke's places lie on a region."""
    assert stroke.marks is not None
    node = np.array([name == region.node for name in stroke.objects], np.bool_)
    made: npt.NDArray[np.bool_] = node[stroke.marks.object[places.mark]] & (places.slot == region.slot)
    return made


def _samples(
    stroke: Stroke, places: Places, sums: F64, dressed: Dressed, now: Reflectance
) -> tuple[Samples, F64]:
    """What a stroke says, its targets as the model would make them; and the offsets (N, 3)."""
    assert stroke.marks is not None
    marks = stroke.marks.some(places.mark)
    shown, wanted = marks.shown.astype(np.float64), marks.wanted.astype(np.float64)
    if stroke.tool == FIXATE:
        wanted = shown
    coefficients = dressed.coefficients(now.diffuse, now.specular)
    before = np.einsum("ntc,tc->nc", sums[-1], coefficients)
    known = np.isfinite(marks.offset).all(axis=1, keepdims=True)
    offset = np.where(known, marks.offset, shown - before)
    weight = marks.weight.astype(np.float64) * stroke.weight * _trust(offset, shown, before)
    return Samples(wanted - offset, before, sums[:-1], sums[-1], weight), offset


def _trust(offset: F64, shown: F64, before: F64) -> F64:
    """(N,) how well the model knows the light of a place: 1 / (1 + (its relative error / STRANGE)²)²."""
    error = np.abs(offset).mean(axis=1)
    light = np.maximum(np.abs(shown), np.abs(before)).mean(axis=1)
    relative = error / np.maximum(light, 1e-30)
    return np.asarray(1 / (1 + (relative / STRANGE) ** 2) ** 2)


def _pooled(parts: Sequence[tuple[Stroke, Samples, Places]]) -> Samples:
    """All samples; of a stroke in one flat colour its mean, and what lies beside it as it is."""
    made: Samples | None = None
    for stroke, samples, places in parts:
        one = samples
        if stroke.flat and stroke.tool != FIXATE and stroke.marks is not None:
            marks = stroke.marks.some(places.mark)
            painted = np.not_equal(marks.wanted, marks.shown).any(axis=1)
            one = samples.some(np.flatnonzero(painted)).mean() + samples.some(np.flatnonzero(~painted))
        made = one if made is None else made + one
    assert made is not None
    return made


def _allowed(dressed: Dressed, strokes: Sequence[Stroke]) -> tuple[Change, ...]:
    """What may change: single changes for flat strokes and what somebody chose, else all that there is."""
    painted = [stroke for stroke in strokes if stroke.tool != FIXATE]
    if painted and all(stroke.flat for stroke in painted):
        some = (*SINGLE, *(MEANT[stroke.meaning] for stroke in painted if stroke.meaning != AUTOMATIC))
        return tuple(change for change in dict.fromkeys(some) if change & dressed.can == change)
    return dressed.allowed


def _meant(verdict: Verdict, dressed: Dressed, strokes: Sequence[Stroke]) -> Verdict:
    """With what somebody chose as the first explanation."""
    for stroke in strokes:
        if stroke.meaning == AUTOMATIC:
            continue
        chosen = [one for one in verdict.explanations if one.change == MEANT[stroke.meaning] & dressed.can]
        others = [one for one in verdict.explanations if one not in chosen]
        return dataclasses.replace(verdict, explanations=(*chosen, *others))
    return verdict


def _tints(samples: Samples, dressed: Dressed, now: Reflectance) -> tuple[F64, ...]:
    """White, and the colour in which the shine would have what was painted."""
    more = samples.wanted - samples.before
    full = Reflectance(now.diffuse, np.ones(3), now.level)
    none = Reflectance(now.diffuse, np.zeros(3), now.level)
    shine = samples.made(dressed, full, own=True) - samples.made(dressed, none, own=True)
    weight = samples.weight[:, None]
    colour = (weight * shine * more).sum(axis=0) / np.maximum((weight * shine**2).sum(axis=0), 1e-30)
    colour = np.clip(colour + now.specular, 0, None)
    return (np.ones(3), colour) if colour.max() > 0 else (np.ones(3),)


# -- edits and reasons -----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Canvas:
    """What edits are made from: the scene, who lies where, how changes spread, and what was decided."""

    scene: Scene
    surfaces: Surfaces
    spread: Spread
    services: Services
    found: Mapping[Region, _Painted]

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
        field = Field([layer for region in self.found for layer in self._layers(region, instead.get(region))])
        made = self.spread(scene, self.surfaces, field) if field.layers else {}
        others = {node for stroke in scene.of(Stroke) if not stroke.hidden for node in stroke.objects}
        paints: dict[NodeId, Paint | None] = dict.fromkeys(self.whose)
        for node, paint in made.items():
            if node in paints or node not in others:
                paints[node] = paint
        strokes: dict[NodeId, dict[str, Any]] = {}
        for painting in self.found.values():
            for stroke_id, offsets in painting.offsets.items():
                values = strokes.setdefault(stroke_id, {})
                table = values.get("table", getattr(scene[stroke_id], "table", None))
                values["table"] = _with_offsets(table, offsets)
        for stroke in self._strokes():
            beyond = (node for node, paint in paints.items() if paint is not None and node not in others)
            reached = tuple(beyond) if stroke.alike else ()
            if reached != stroke.reached:
                strokes.setdefault(stroke.id, {})["reached"] = reached
        for stroke_id, meaning in meanings.items():
            strokes.setdefault(stroke_id, {})["meaning"] = meaning
        for node, own in paints.items():
            for slot in np.unique(own.slots).tolist() if own is not None else ():
                material = Region(node, int(slot)).material(scene)
                if material is not None:
                    materials[material] = paintable(scene.material(material), self.services.registry)
        changed = tuple(new for name, new in materials.items() if new is not self.scene.material(name))
        return Solved(label, frozen_map(paints), changed, frozen_map(strokes))

    def _strokes(self) -> list[Stroke]:
        steps = [step for painting in self.found.values() for step in painting.steps]
        return [*{stroke.id: stroke for step in steps for stroke in step.strokes}.values()]

    def _layers(self, region: Region, last: Explanation | None) -> Iterator[Layer]:
        painting = self.found[region]
        part = self.surfaces.unrefined.mesh.index_of(region.node) * SLOTS + region.slot
        for step in painting.steps:
            one = step.verdict.best if last is None or step is not painting.steps[-1] else last
            changes = painting.dressed.changes(step.now, step.gloss, one.reflectance, one.change)
            layer = []
            for stroke in step.strokes if changes else ():
                marks = self.spread.marks(self.scene, self.surfaces, stroke)
                own = marks.some(marks.part == part)
                if stroke.tool != FIXATE and len(own):
                    layer.append(Decided(own, Reach.of(stroke), changes))
            if layer:
                yield layer


def _with_offsets(table: Any, offsets: Sequence[tuple[npt.NDArray[np.int64], F64]]) -> Any:
    marks = Marks.of_table(table)
    made = marks.offset.copy()
    for which, offset in offsets:
        made[which] = offset
    if np.array_equal(made, marks.offset, equal_nan=True):
        return table
    return dataclasses.replace(marks, offset=made).table()


def _finding(canvas: _Canvas, region: Region, asked: set[NodeId]) -> Finding | None:
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
        edit = canvas.edit(_told(canvas.scene, region, word), {region: one}, meanings)
        values = painting.dressed.values(one.reflectance)
        reasons.append(Reason(word, one.explained, one.score, frozen_map(values), edit))
    silent = tuple(WORDS[c] for c in SINGLE[1:] if c in step.verdict.silent and c in painting.dressed.can)
    ids = tuple(stroke.id for stroke in step.strokes)
    close = len(step.verdict.close)
    return Finding(region.node, region.slot, ids, tuple(reasons), close, silent)


def _told(scene: Scene, region: Region, word: str) -> str:
    return f"Paint {word or 'nothing'} on {scene[region.node].name}"


def _label(scene: Scene, asked: Sequence[Stroke], found: Mapping[Region, _Painted]) -> str:
    for region, painting in found.items():
        if painting.steps:
            return _told(scene, region, WORDS[painting.steps[-1].verdict.best.change])
    return "Paint" if asked else "Strokes"


SOLVER = Joint()

__all__ = ["SOLVER", "Joint", "JointRun"]
