"""Strokes that are explained again under the light that their answer brings, until what comes out is meant.

A wall lights itself by way of others: half as bright, it sends less than half. To ask again for the same
light, now under that of the last answer, is the paper's iteration (its figure 15); with much light between
surfaces it goes to and fro with growing steps. So the share of what is missing is asked for that the picture
followed last time, in logarithms and by channel (the secant method): with E(ρ) ∝ ρ^e, light ρ E(ρ) that has
to change by a factor wants ρ changed by its 1 + e-th root.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.scene.nodes import NodeId, Scene
from studio_core.strokes.marks import Marks
from studio_core.strokes.solution import Solution
from studio_core.strokes.solved import Solved
from studio_core.strokes.stroke import AUTOMATIC, FIXATE, Stroke

F64 = npt.NDArray[np.float64]

LEAST = 1e-6
TOLD = 0.01
"""Of a factor's logarithm: what was asked for with less says nothing of how the picture follows."""
STEEPEST = 20.0


@dataclass(frozen=True, eq=False)
class Settling:
    """One stroke on its way: the mean light (3,) that it wants, what there `was` last, what was `asked` for
    then, and how steeply (3,) that followed.
    """

    marks: Marks
    goal: F64
    was: F64
    asked: F64
    steep: F64

    @classmethod
    def of(cls, stroke: Stroke) -> Settling | None:
        """As it was painted, and asked for once; None where it says nothing that could be met."""
        marks = stroke.marks
        if marks is None or stroke.tool == FIXATE or stroke.indirect or not _share(marks).sum() > 0:
            return None
        goal, was = (_mean(_share(marks), light) for light in (marks.wanted, marks.shown))
        return cls(marks, goal, was, goal, np.ones(3))

    @property
    def off(self) -> float:
        """How far what there was last is from what is wanted: 0.01 is one percent, in the worst channel."""
        return float(np.abs(np.log(self.was / self.goal)).max())

    def after(self, light: F64) -> Settling:
        """With what is to be asked for, now that the last answer makes the marks (N, 3) so light.

        Where light is no number, as on things that are hidden now, marks do not count.
        """
        share = np.where(np.isfinite(light).all(axis=1), _share(self.marks), 0.0)
        if share.sum() <= 0:
            return self
        now, goal = _mean(share, np.nan_to_num(light)), _mean(share, self.marks.wanted)
        step = np.log(self.asked / self.was)
        small = np.abs(step) < TOLD
        followed = np.log(now / self.was) / np.where(small, 1.0, step)
        steep = np.where(small, self.steep, np.clip(followed, 1.0, STEEPEST))
        asked = now * (goal / now) ** (1 / steep)
        return dataclasses.replace(self, goal=goal, was=now, asked=asked, steep=steep)


def wishes_of(strokes: Iterable[Stroke]) -> dict[NodeId, Settling]:
    """By stroke, those that count and want something."""
    made = {stroke.id: Settling.of(stroke) for stroke in strokes if not stroke.hidden and stroke.weight > 0}
    return {name: wish for name, wish in made.items() if wish is not None}


def asking(scene: Scene, wishes: Mapping[NodeId, Settling]) -> Scene:
    """With strokes that ask for so much."""
    made = []
    for name, wish in wishes.items():
        stroke = scene[name]
        assert isinstance(stroke, Stroke)
        marks = stroke.marks
        assert marks is not None
        scale = np.where(marks.painted[:, None], wish.asked / wish.goal, 1.0)
        table = dataclasses.replace(marks, wanted=np.asarray(marks.wanted * scale, np.float32)).table()
        made.append(dataclasses.replace(stroke, table=table))
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


def _share(marks: Marks) -> F64:
    return np.asarray(marks.weight * marks.painted, np.float64)


def _mean(share: F64, light: npt.NDArray[np.floating]) -> F64:
    return np.asarray(np.maximum(np.average(light.astype(np.float64), axis=0, weights=share), LEAST))


__all__ = ["Settling", "as_found", "as_painted", "asking", "wishes_of"]
