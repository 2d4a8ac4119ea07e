"""The paper's decision about a stroke: each element by itself, then told in one word (section 5.3).

What an element takes is what of it changes by more than MOVED. The word is what most elements take, each
counted by how much light is to change there; values are medians over those. Other explanations are of all
elements changing the same.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_plugins.slf.explaining import Step
from studio_plugins.slf.joint import NOISE, PLACES, Change, Explanation, Verdict
from studio_plugins.slf.painted_rows import Columns, Rows
from studio_plugins.slf.paper import BOTH, DIFFUSE, SPECULAR, WEIGHTS, Chosen, Solver, Systems, choose
from studio_plugins.slf.retold import Albedos, Numbers, Retold
from studio_plugins.slf.samples import DARK, F64, Reflectance

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

MOVED = 0.05
"""Of the larger of before and after: a colour or a shine that changes by less is as it was."""


@dataclass(frozen=True, eq=False)
class ElementStep(Step):
    """A decision of elements, which are vertices (E,): by explanation what paint adds at each of them."""

    vertex: I64
    answers: tuple[Mapping[str, F32], ...]

    def answer(self, one: Explanation) -> Mapping[str, F32]:
        """What an explanation of the verdict adds."""
        return next(a for e, a in zip(self.verdict.explanations, self.answers, strict=True) if e is one)


@dataclass(frozen=True, eq=False)
class Question:
    """Of E elements: their moments, the painted rows in them and these rows' columns, and what they are now.

    sent (N, 3) is what elements send in the rows' cells; meant (E,) in which of them a change was painted.
    """

    systems: Systems
    rows: Rows
    columns: Columns
    sent: F64
    before: Albedos
    now: Numbers
    meant: Bools

    @property
    def importance(self) -> F64:
        """(N, 3) weights of squared differences, relative, as `Samples` have them."""
        light = np.maximum(np.maximum(self.sent + self.rows.change, self.sent), 0)
        scale = np.maximum(light + (DARK * light.mean() if light.size else 0.0), 1e-30)
        return np.asarray(self.rows.weight[:, None] / scale**2)

    @property
    def wanted(self) -> F64:
        """(E,) how much change was painted on elements: 0 where none is meant."""
        made = np.zeros(len(self.meant))
        np.add.at(made, self.rows.element, (self.importance * self.rows.change**2).sum(axis=1))
        return np.where(self.meant, made, 0)


@dataclass(frozen=True, eq=False)
class Settled:
    """Every element's answer: its numbers, and the word for all of them."""

    numbers: Numbers
    explanation: Explanation
    flagged: Bools


def settle(
    question: Question, retold: Retold, solver: Solver, literal: bool, can: Change, named: bool = True
) -> Settled:
    """By a solver of the paper, of what `can` change; `named` by what elements take, else by that."""
    may = Change.DIFFUSE in can, Change.SPECULAR in can, Change.GLOSS in can
    chosen = choose(question.systems, solver, literal, may)
    now, before = question.now, question.before
    moved = np.stack(
        [
            np.isin(chosen.kind, (DIFFUSE, BOTH)),
            np.isin(chosen.kind, (SPECULAR, BOTH)),
            chosen.level != question.systems.level,
        ],
        axis=1,
    )
    then = Albedos(chosen.reflectance.reshape(-1, 3, 2), chosen.level.astype(np.float64))
    numbers = retold.numbers(now, before, then, moved & ~chosen.flagged[:, None])
    took = moved & _noticed(before.reflectance, then.reflectance) & ~chosen.flagged[:, None]
    word, those = _most(took, np.where(chosen.flagged, 0, question.wanted))
    if not named:
        word, those = can, np.asarray((took & question.meant[:, None]).any(axis=1))
    those = those if those.any() else np.ones(len(those), np.bool_)
    middle = [np.median(one[those], axis=0) for one in (numbers.diffuse, numbers.specular, numbers.level)]
    reflectance = Reflectance(middle[0], middle[1], float(middle[2]))
    explained, left = _explained(question, chosen)
    told = Explanation(word, reflectance, left, _score(question, chosen, moved, solver), explained)
    return Settled(numbers, told, chosen.flagged)


def verdict_of(
    question: Question,
    retold: Retold,
    solver: Solver,
    literal: bool,
    allowed: Sequence[Change],
    meant: Change | None,
) -> tuple[Verdict, tuple[Mapping[str, F32], ...], Bools]:
    """The solver's own choice, then the same change of all elements, for every set that is `allowed`.

    What somebody `meant` comes first. With each what paint adds, and which elements (E,) are skipped.
    """
    can = Change.NONE
    for change in allowed:
        can |= change
    own = settle(question, retold, solver, literal, can)
    others = [
        settle(question, retold, "l2", literal, change, named=False)
        for change in allowed
        if change not in (Change.NONE, own.explanation.change)
    ]
    others.sort(key=lambda one: one.explanation.score)
    every = [own, *others]
    if meant is not None:
        every.sort(key=lambda one: one.explanation.change != meant)
    silent = can if own.flagged.all() else Change.NONE
    verdict = Verdict(tuple(one.explanation for one in every), silent)
    return verdict, tuple(retold.changes(question.now, one.numbers) for one in every), own.flagged


def _noticed(before: F64, then: F64) -> Bools:
    """(E, 3) whether matte part and shine, of (E, 3, 2), change by more than MOVED; a level always does."""
    change, low, high = (np.linalg.norm(one, axis=1) for one in (then - before, before, then))
    large = change > MOVED * np.maximum(low, high)
    return np.concatenate([large, np.ones((len(large), 1), np.bool_)], axis=1)


def _most(took: Bools, votes: F64) -> tuple[Change, Bools]:
    """What most votes (E,) are for, and which elements (E,) take that; nothing where there are none."""
    code = took @ np.array([1, 2, 4])
    best = int(np.bincount(code, votes, minlength=8).argmax())
    return Change(best), (votes > 0) & (code == best)


def _explained(question: Question, chosen: Chosen) -> tuple[float, float]:
    """1 − what is left of what was wanted to change, relative and squared; and the mean that is left."""
    rows, sent, importance = question.rows, question.sent, question.importance
    if not len(rows):
        return 0.0, 0.0
    found = chosen.reflectance.reshape(-1, 3, 2)[rows.element]
    made = question.columns.sent(found, chosen.level[rows.element])
    before = float((importance * rows.change**2).sum())
    left = float((importance * (made - sent - rows.change) ** 2).sum())
    return 1 - left / before if before > 0 else 0.0, left / (3 * float(rows.weight.sum()))


def _score(question: Question, chosen: Chosen, moved: Bools, solver: Solver) -> float:
    """The logarithm of what equation 4 compares, over what is wanted to change, as `joint` has scores."""
    weights = np.asarray(WEIGHTS if solver == "mixed" else (1.0, 1.0, 1.0, 1.0))
    rated = float((weights[np.maximum(moved.sum(axis=1), 1)] * chosen.residual).sum())
    kept = choose(question.systems, "l2", may=(False, False, False))
    before = float(kept.residual.sum())
    return PLACES * math.log(rated / before + NOISE**2) if before > 0 else 0.0


__all__ = ["ElementStep", "Question", "Settled", "settle", "verdict_of"]
