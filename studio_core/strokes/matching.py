"""Strokes that are explained again, under the light that the last answer brings, until they are met."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from studio_core.contract import StrokeRun
from studio_core.edits import Compound
from studio_core.scene.nodes import NodeId, Scene
from studio_core.shading.job import Job
from studio_core.strokes.settling import Settling, as_found, as_painted, asking, wishes_of
from studio_core.strokes.solution import Lit, Solution
from studio_core.strokes.stroke import Stroke

MET = 0.01
"""So near, relative, is as wanted."""
NEAR = 0.05
"""So near only light that is as good as it gets tells more."""
MOST = 8
"""Answers."""
IDLE = 2
"""Answers in a row that bring strokes no nearer, after which the best one is taken."""


class Match:
    """Strokes of a scene by name, that are explained together, as they were `held` to be if that is known.

    `edit` makes of that scene what was found until now. `offs` tells how far each round found it from what is
    wanted: 0.01 is one percent, in the worst channel of the worst stroke.
    """

    def __init__(
        self,
        label: str,
        scene: Scene,
        names: tuple[NodeId, ...],
        held: Solution | None = None,
        most: int = MOST,
        met: float = MET,
    ) -> None:
        self.label, self.names, self.offs = label, names, list[float]()
        self._strokes = [node for name in names if isinstance(node := scene[name], Stroke)]
        self.wishes: Mapping[NodeId, Settling] = wishes_of(self._strokes)
        self._said = as_painted(label, scene, self._strokes)
        self._given, self._most, self._met = held, most, met
        self.near = False
        self._answers: list[Solution] = []
        self._sums: list[float] = []  # of all strokes' squared offs, before each answer

    @property
    def edit(self) -> Compound:
        """All answers, or when it is over those up to the best."""
        return Compound(self.label, tuple(edit for one in self._answers for edit in (one.edit, self._said)))

    @property
    def held(self) -> Solution | None:
        """The last of these answers."""
        return self._answers[-1] if self._answers else self._given

    @property
    def off(self) -> float:
        """Of the best."""
        return self.offs[self._best] if self.offs else math.inf

    @property
    def _best(self) -> int:
        return self._sums.index(min(self._sums))

    def round(
        self, run: StrokeRun, scene: Scene, lit: Lit, params: Any, job: Job, *, sure: bool = True
    ) -> bool:
        """Ask once more: `scene` is as `edit` makes it, `lit` its light. False when it is over.

        Light that is not `sure` will be better soon: where that could decide, nothing is asked (`near`).
        """
        if not self.wishes:
            return False
        shown = run.shown(scene, tuple(self.wishes), lit, job)
        wishes = {name: one.after(shown[name]) if name in shown else one for name, one in self.wishes.items()}
        off = max(wish.off for wish in wishes.values())
        self.near = off <= NEAR
        if self.near and not sure:
            return True
        self.wishes = wishes
        self.offs.append(off)
        self._sums.append(sum(wish.off**2 for wish in wishes.values()))
        idle = len(self.offs) > IDLE and min(self._sums[-IDLE:]) >= min(self._sums[:-IDLE])
        if off <= self._met or len(self.offs) > self._most or idle:
            del self._answers[self._best :]
            return False
        held = self.held or run.solve(scene, self.names, lit, params, job)
        there = asking(as_found(scene, held), self.wishes)
        self._answers.append(run.solve(there, self.names, lit, params, job))
        return True


__all__ = ["IDLE", "MET", "MOST", "NEAR", "Match"]
