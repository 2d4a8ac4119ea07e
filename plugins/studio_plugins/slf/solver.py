"""The solver that explains a whole stroke at once; see `joint`.

Strokes on a slot of an object are gone through in their order, each on what those before have made of the
bare material. What a stroke wants is a difference: its target is the light that the model makes there, plus
what was painted, minus what was shown. So what the model does not know (fine texture, noise) stays as it is.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.edits import Compound
from studio_core.params import param
from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_core.shading.job import Job
from studio_core.strokes.solution import Finding, Lit, Reason, Solution
from studio_core.strokes.solved import Solved
from studio_core.strokes.stroke import FIXATE, Stroke
from studio_plugins.slf.columns import sums_at
from studio_plugins.slf.corners import Corners
from studio_plugins.slf.dressed import Dressed
from studio_plugins.slf.explaining import (
    Painting,
    Step,
    as_curved,
    as_painted,
    explained,
    meant_first,
    on_region,
    one_light,
    paint_under,
    pooled_of,
    samples_of,
)
from studio_plugins.slf.incident import Incident
from studio_plugins.slf.outcome import Canvas, finding_of, label_of, told
from studio_plugins.slf.places import Places, places_of
from studio_plugins.slf.recolouring import PutBack
from studio_plugins.slf.reflected import Reflected
from studio_plugins.slf.regions import Region, regions_of, steps, touched
from studio_plugins.slf.samples import F64, Reflectance, Samples
from studio_plugins.slf.spread import Spread
from studio_plugins.slf.stylise import Style, stylise


@dataclass(frozen=True)
class Params:
    """Parameters of the solver."""

    coloured: bool = param(True, "Coloured shine", "Shine may take the colour that was painted")


class Joint:
    """See the module; satisfies `studio_core.contract.StrokeSolver`."""

    id = "joint"
    label = "Fewest changes"
    Params = Params

    def open(self, services: Services) -> JointRun:
        """A run of its own."""
        return JointRun(services)


@dataclass(frozen=True, eq=False)
class Said:
    """By stroke its samples and where they are; the material's mean there now, and its gloss.

    `curved` are the same, but before and at the gloss that there is as surfaces curve between vertices.
    """

    parts: tuple[tuple[Stroke, Samples, Places], ...]
    curved: tuple[tuple[Stroke, Samples, Places], ...]
    now: Reflectance
    gloss: float | None

    @property
    def strokes(self) -> tuple[Stroke, ...]:
        """Those that say something."""
        return tuple(stroke for stroke, _, _ in self.parts)

    @property
    def count(self) -> int:
        """Of places."""
        return sum(len(places) for _, _, places in self.parts)


class JointRun:
    """Satisfies `studio_core.contract.StrokeRun`."""

    def __init__(self, services: Services) -> None:
        self._services = services
        self._incident = Incident(services)
        self._spread = Spread(services)
        self._reflected = Reflected(services)

    def solve(self, scene: Scene, strokes: Sequence[NodeId], lit: Lit, params: Any, job: Job) -> Solution:
        """See `studio_core.contract.StrokeRun`."""
        asked = [node for node in map(scene.nodes.get, strokes) if isinstance(node, Stroke)]
        found, unpaintable = self.decided(scene, asked, lit, params, job)
        notes = [f"{stroke.name} lies on no surface" for stroke in asked if not regions_of(stroke)]
        notes += unpaintable
        names = frozenset(stroke.id for stroke in asked)
        canvas = Canvas(scene, lit.surfaces, self._spread, self._services, found, names)
        edit = canvas.edit(label_of(scene, asked, found))
        every = (finding_of(canvas, region) for region in found)
        findings = [finding for finding in every if finding is not None]
        counts = {
            "places": sum(step.places for painting in found.values() for step in painting.steps),
            "rays": sum(painting.rays for painting in found.values()),
            "systems": sum(len(step.verdict.explanations) for p in found.values() for step in p.steps),
        }
        solution = Solution(edit, tuple(findings), tuple(notes), frozen_map(counts))
        remade = canvas.whose
        far = [
            stroke
            for stroke in scene.of(Stroke)
            if (stroke.indirect and not stroke.hidden and stroke.tool != FIXATE)
            and (stroke in asked or not remade.isdisjoint(stroke.reached))
        ]
        return self._with_far(solution, scene, far, remade, lit, job) if far else solution

    def decided(
        self, scene: Scene, asked: Sequence[Stroke], lit: Lit, params: Params, job: Job
    ) -> tuple[dict[Region, Painting], list[str]]:
        """What is decided about all that the strokes lie on, not painted yet; and what cannot be painted."""
        found: dict[Region, Painting] = {}
        notes: list[str] = []
        for region, todo in steps(scene, touched(scene, asked)).items():
            name = region.material(scene)
            if name is None or region.node not in lit.surfaces.nodes:
                continue  # gone, or hidden: it keeps what it has
            painting = Painting.begin(scene.material(name), self._services)
            if painting is None:
                notes.append(f"nothing of {scene.material(name).name} can be painted")
                continue
            for group in todo:
                self._explain(painting, region, group, scene, lit, params, job)
            found[region] = painting
        return found, notes

    def _with_far(
        self,
        near: Solution,
        before: Scene,
        far: Sequence[Stroke],
        remade: frozenset[NodeId],
        lit: Lit,
        job: Job,
    ) -> Solution:
        """With strokes that change what lights or shows in their places.

        What they changed before is taken back first, if it is not gone with paint that is `remade`; of
        several, those that were explained already stay.
        """
        lost = [stroke for stroke in far if stroke.reached and not remade.isdisjoint(stroke.reached)]
        new = [stroke for stroke in far if not stroke.reached] + lost or [*far]
        on = {node for stroke in before.of(Stroke) if not stroke.indirect for node in stroke.objects}
        again = {node for stroke in new for node in stroke.reached if node in before.nodes and node not in on}
        bare = Solved("Paint what is reflected", frozen_map(dict.fromkeys(again)))
        scene = bare(near.edit(before))
        stay = [stroke for stroke in before.of(Stroke) if stroke.tool == FIXATE]
        found = self._reflected.solve(scene, [*new, *stay], lit, job)

        names = tuple(stroke.id for stroke in new)
        others = {node: thing for node in {one.node for one in found.findings}
                  if isinstance(thing := scene[node], MeshObject)}  # fmt: skip
        put_back = PutBack(names, frozen_map(others))

        def whole(reason: Reason, finding: Finding, chosen: bool) -> Reason:
            node = finding.node
            word: dict[str, Any] = {"reached": (node,)}
            if chosen:
                word |= {"meaning": reason.meaning, "through": node, "through_slot": finding.slot}
            remember = Solved(bare.label, strokes=frozen_map(dict.fromkeys(names, word)))
            edits = (near.edit, bare, put_back, reason.edit, remember)
            return dataclasses.replace(reason, edit=Compound(told(scene, node, reason.meaning), edits))

        findings = [
            dataclasses.replace(finding, reasons=tuple(whole(one, finding, True) for one in finding.reasons))
            for finding in found.findings
        ]
        edit = near.edit
        if found.findings:
            first = found.findings[0]
            edit = whole(first.reasons[0], first, False).edit
        counts = {**near.counts, **found.counts}
        notes = (*near.notes, *found.notes)
        return Solution(edit, (*findings, *near.findings), notes, frozen_map(counts))

    def stylise(self, scene: Scene, amount: float, lit: Lit, job: Job) -> Solution:
        """See `studio_core.contract.StrokeRun`."""
        return stylise(scene, lit, Style(amount), self._services, job)

    def shown(self, scene: Scene, strokes: Sequence[NodeId], lit: Lit, job: Job) -> Mapping[NodeId, Any]:
        """See `studio_core.contract.StrokeRun`; of paint, its mean where a stroke lies counts."""
        made: dict[NodeId, F64] = {}
        for stroke in (node for node in map(scene.nodes.get, strokes) if isinstance(node, Stroke)):
            if stroke.marks is None or stroke.tool == FIXATE:
                continue
            light = made[stroke.id] = np.full(stroke.marks.wanted.shape, np.nan)
            for region in regions_of(stroke):
                name = region.material(scene)
                painting = Painting.begin(scene.material(name), self._services) if name is not None else None
                if painting is None or region.node not in lit.surfaces.nodes:
                    continue
                painting.changes = paint_under(scene, stroke, region)
                said = self._said(painting, region, (stroke,), scene, lit, job, as_it_is=True)
                for _, samples, places in said.curved if said is not None else ():
                    light[places.mark] = samples.before + stroke.marks.wanted[places.mark] - samples.wanted
        return made

    def likeness(self, scene: Scene, stroke: NodeId, lit: Lit, params: Params, job: Job) -> Any:
        """See `studio_core.contract.StrokeRun`; before the stroke is solved, by materials as they are."""
        node = scene.nodes.get(stroke)
        if not isinstance(node, Stroke):
            return np.zeros(len(lit.surfaces.unrefined.mesh), np.float32)
        return self._spread.likeness(scene, lit.surfaces, node)

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
        dressed, parts = painting.dressed, said.parts
        verdict = explained(pooled_of(parts), dressed, said.now, said.strokes, params.coloured)
        if one_light(said.strokes):
            painted, curved = (pooled_of(some, beside=False) for some in (parts, said.curved))
            verdict = as_painted(verdict, painted, curved, dressed, said.now)
        verdict = meant_first(verdict, dressed, group)
        painting.take(Step(said.strokes, verdict, said.now, said.gloss, said.count))

    def _said(
        self,
        painting: Painting,
        region: Region,
        group: tuple[Stroke, ...],
        scene: Scene,
        lit: Lit,
        job: Job,
        as_it_is: bool = False,
    ) -> Said | None:
        """What strokes say of a region's material; None where they do not lie on it.

        With `as_it_is` there are columns of the gloss that there is alone.
        """
        parts: list[tuple[Stroke, Samples, Places]] = []
        curved: list[tuple[Stroke, Samples, Places]] = []
        dressed, mesh = painting.dressed, lit.surfaces.unrefined.mesh
        seen = []
        for stroke in group:
            places = places_of(scene, lit.surfaces.unrefined, stroke)
            places = places.some(np.flatnonzero(on_region(stroke, places, region)))
            if len(places):
                seen.append((stroke, places))
        if not seen:
            return None
        uvs = mesh.uvs[np.concatenate([places.vertex for _, places in seen])]
        now, gloss = dressed.now(uvs, painting.changes)
        own_shape = dressed.own_shape(gloss)[None]
        every = own_shape if as_it_is else np.concatenate([dressed.shapes(), own_shape])
        for stroke, places in seen:
            sums, curving, rays = self._sums(dressed, every, stroke, places, scene, lit, job)
            painting.rays += rays
            samples, offset = samples_of(stroke, places, sums, dressed, now)
            curved.append((stroke, as_curved(samples, curving, dressed, now), places))
            painting.offsets.setdefault(stroke.id, []).append((places.mark, offset))
            parts.append((stroke, samples, places))
        return Said(tuple(parts), tuple(curved), now, gloss)

    def _sums(
        self, dressed: Dressed, shapes: Any, stroke: Stroke, places: Places, scene: Scene, lit: Lit, job: Job
    ) -> tuple[F64, F64, int]:
        """(L, N, T, 3) columns at a stroke's places, the last (N, T, 3) as surfaces curve between vertices if
        the stroke is a flat one, and the rays that this took.
        """
        assert stroke.marks is not None
        brdf, workers = dressed.resolved.brdf, self._services.workers
        eye = stroke.marks.eye[places.mark] - lit.surfaces.unrefined.mesh.origin
        corners = Corners.of(lit, places, eye, workers)
        light = self._incident.at(scene, lit, corners.places, job)
        sums = sums_at(brdf.address, brdf.terms, shapes, light, corners.places, workers, job)
        made, rays = corners.between(sums), light.rays
        own = made[-1]
        if stroke.flat and len(corners.bent):
            light = self._incident.at(scene, lit, corners.own, job)
            there = sums_at(brdf.address, brdf.terms, shapes[-1:], light, corners.own, workers, job)
            own = own.copy()
            own[corners.bent] = there[0]
            rays += light.rays
        return made, own, rays


SOLVER = Joint()

__all__ = ["SOLVER", "Joint", "JointRun"]
