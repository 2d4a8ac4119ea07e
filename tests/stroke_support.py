"""A solver of strokes for tests: each object's colour is changed by the mean factor that strokes want."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from studio_core.contract import API, Plugin, Services
from studio_core.edits import Compound, SetFields, SetPaint
from studio_core.params import param
from studio_core.scene.nodes import NodeId, Scene
from studio_core.scene.paint import Paint
from studio_core.shading.job import Job
from studio_core.strokes.solution import Finding, Lit, Reason, Solution
from studio_core.strokes.stroke import Stroke


@dataclass(frozen=True)
class Params:
    """How much of what is wanted it does."""

    share: float = param(1.0, "Share", low=0.0, high=1.0)


@dataclass
class MeanRun:
    """See the module. `asked` are the strokes of each call, `lit` what each was given."""

    asked: list[tuple[NodeId, ...]]
    lit: list[Lit]

    def solve(self, scene: Scene, strokes: Sequence[NodeId], lit: Lit, params: Any, job: Job) -> Solution:
        """See `studio_core.contract.StrokeRun`."""
        self.asked.append(tuple(strokes))
        self.lit.append(lit)
        found, wants = [], {}
        for ident in strokes:
            stroke = scene[ident]
            assert isinstance(stroke, Stroke)
            for number, node in enumerate(stroke.objects):
                own = stroke.marks.object == number
                wants.setdefault(node, []).append((ident, stroke.marks.some(own)))
        for node, parts in wants.items():
            shown = np.concatenate([marks.shown for _, marks in parts]).mean(axis=0)
            goal = np.concatenate([marks.wanted for _, marks in parts]).mean(axis=0)
            before = np.asarray(scene.material(scene[node].materials[0]).values["base_color"])
            change = params.share * (goal / shown - 1) * before
            edit = SetPaint(node, Paint.of([(0, 0, 0)], [(0, 1, 0)], [0], {"base_color": change[None]}))
            values = {"base_color": tuple((before + change).tolist())}
            reasons = (Reason("colour", 1.0, -3.0, values, edit), Reason("", 0.0, 0.0, {}, Compound("", ())))
            found.append(Finding(node, 0, tuple(ident for ident, _ in parts), reasons, 1, ("gloss",)))
        edits = [one.reasons[0].edit for one in found]
        edits += [SetFields(ident, {"hidden": scene[ident].hidden}) for ident in strokes]
        counts = {"places": sum(len(marks) for parts in wants.values() for _, marks in parts)}
        return Solution(Compound("Paint", tuple(edits)), tuple(found), ("the mean alone",), counts)

    def shown(self, scene: Scene, strokes: Sequence[NodeId], lit: Lit, job: Job) -> Any:
        """As before, whatever was painted."""
        return {ident: scene[ident].marks.shown for ident in strokes}

    def likeness(self, scene: Scene, stroke: NodeId, lit: Lit, params: Any, job: Job) -> Any:
        """1 on the stroke's objects."""
        mesh = lit.surfaces.unrefined.mesh
        return np.isin([mesh.objects[i].node for i in mesh.object], scene[stroke].objects).astype(np.float32)


class MeanSolver:
    """See the module."""

    id = "mean"
    label = "The mean"
    Params = Params

    def __init__(self) -> None:
        self.runs: list[MeanRun] = []

    def open(self, services: Services) -> MeanRun:
        """A run that tells what it was asked."""
        self.runs.append(MeanRun([], []))
        return self.runs[-1]


MEAN = MeanSolver()
plugin = Plugin(id="mean-strokes", api=API, provides={"solver": {"mean": "stroke_support:MEAN"}})
