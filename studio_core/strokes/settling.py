"""Strokes that are explained again under the light that their answer brings, until what comes out is meant.

A wall lights itself by way of others: half as bright, it sends less than half. To ask again for the same
light, now under that of the last answer, is the paper's iteration (its figure 15); with much light between
surfaces it goes to and fro with growing steps. So the share of what is missing is asked for that the picture
followed last time, in logarithms and by channel (the secant method): with E(ρ) ∝ ρ^e, light ρ E(ρ) that has
to change by a factor wants ρ changed by its 1 + e-th root.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.scene.nodes import NodeId, Scene
from studio_core.session import View
from studio_core.strokes.solution import Solution
from studio_core.strokes.solved import Solved
from studio_core.strokes.stroke import AUTOMATIC, FIXATE, Stroke

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

LEAST = 1e-6
TOLD = 0.01
"""Of a factor's logarithm: what was asked for with less says nothing of how the picture follows."""
STEEPEST = 20.0


@dataclass(frozen=True, eq=False)
class Settling:
    """One stroke on a picture: from where that is seen, how much each pixel counts (H, W), the mean light
    (3,) that is wanted there, what there `was` last, what was `asked` for then, and how steeply (3,) the
    picture follows.
    """

    view: View
    share: F64
    goal: F64
    was: F64
    asked: F64
    steep: F64

    @classmethod
    def of(cls, name: NodeId, view: View, shown: F32, mask: F32, wanted: F32) -> dict[NodeId, Settling]:
        """Of a stroke as it was painted, by its id; none where it says nothing."""
        told = np.isfinite(wanted).all(axis=2) & (wanted != shown).any(axis=2)
        share = np.where(told, mask, 0).astype(np.float64)
        if share.sum() <= 0:
            return {}
        share /= share.sum()
        goal = _mean(share, np.nan_to_num(wanted))
        return {name: cls(view, share, goal, _mean(share, shown), goal, np.ones(3))}

    def after(self, shown: F32) -> Settling:
        """With what is to be asked for, now that the last answer shows so."""
        now = _mean(self.share, shown)
        step = np.log(self.asked / self.was)
        small = np.abs(step) < TOLD
        followed = np.log(now / self.was) / np.where(small, 1.0, step)
        steep = np.where(small, self.steep, np.clip(followed, 1.0, STEEPEST))
        asked = now * (self.goal / now) ** (1 / steep)
        return dataclasses.replace(self, was=now, asked=asked, steep=steep)


def asking(scene: Scene, wishes: Mapping[NodeId, Settling]) -> Scene:
    """With strokes that ask for so much."""
    made = []
    for name, wish in wishes.items():
        stroke = scene[name]
        assert isinstance(stroke, Stroke)
        assert stroke.marks is not None
        told = (stroke.marks.wanted != stroke.marks.shown).any(axis=1, keepdims=True)
        scale = np.where(told, wish.asked / wish.goal, 1.0)
        marks = dataclasses.replace(stroke.marks, wanted=np.asarray(stroke.marks.wanted * scale, np.float32))
        made.append(dataclasses.replace(stroke, table=marks.table()))
    return scene.with_nodes(*made)


def as_found(scene: Scene, solution: Solution) -> Scene:
    """With strokes that mean what was found of them: under other light its amount is new, not what it is."""
    found: dict[str, set[str]] = {}
    for finding in solution.findings:
        for name in finding.strokes if finding.reasons else ():
            found.setdefault(name, set()).add(finding.reasons[0].meaning)
    sure = {name: next(iter(one)) for name, one in found.items() if len(one) == 1 and "" not in one}
    strokes = (stroke for stroke in scene.of(Stroke) if stroke.id in sure and stroke.tool != FIXATE)
    meant = (dataclasses.replace(one, meaning=sure[one.id]) for one in strokes if one.meaning == AUTOMATIC)
    return scene.with_nodes(*meant)


def as_painted(label: str, scene: Scene, strokes: list[Stroke]) -> Solved:
    """Puts back what strokes of a scene say."""
    tables = {stroke.id: {"table": getattr(scene[stroke.id], "table", None)} for stroke in strokes}
    return Solved(label, strokes=frozen_map(tables))


def _mean(share: F64, light: F32) -> F64:
    return np.asarray(np.maximum(np.einsum("hw,hwc->c", share, light.astype(np.float64)), LEAST))


__all__ = ["Settling", "as_found", "as_painted", "asking"]
