"""The fewest numbers of a material that explain what was painted on it, decided for the whole stroke at once.

A highlight that is painted on ten places says one thing about the material, not ten. All samples of a stroke
on one material are pooled; every set of parameters that may have changed is fitted as well as it can be, and
pays for each number it changes (the Bayesian information criterion over n_eff independent places):

    score = n_eff · ln(RSS − σ² + σ² n_eff / n + 0.03²) + k · ln(n_eff),

RSS the mean relative squared difference that is left, k = 0 for no change, 1 for the amount of shine or the
gloss, 3 for the matte colour, and sums of these. σ² of it is noise of single places, which tells nothing of
any of them, and is less in the mean of the n / n_eff places that say the same.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Flag, auto

import numpy as np

from studio_plugins.slf.grams import Found, Grams, Rungs, Shines
from studio_plugins.slf.grams import best as best_of
from studio_plugins.slf.samples import F64, Model, Reflectance, Samples

PLACES = 30.0  # n_eff
NOISE = 0.03
"""What is painted is meant no more exactly than that."""
CLOSE = 2.0 * math.log(PLACES)
"""Explanations whose scores are nearer than that to the best one's are shown beside it."""
TOLD = 0.02
"""Relative change that a stroke must be able to show, for it to say anything about a parameter."""
TINTS_APART = 0.02
APART = 0.25
"""Levels that are nearer to today's are no change of gloss."""


class Change(Flag):
    """What of a material changes."""

    NONE = 0
    DIFFUSE = auto()
    SPECULAR = auto()
    GLOSS = auto()

    @property
    def cost(self) -> int:
        """How many numbers that are: k."""
        return 3 * (Change.DIFFUSE in self) + (Change.SPECULAR in self) + (Change.GLOSS in self)


EVERY = tuple(Change(d | s | g) for d, s, g in itertools.product((0, 1), (0, 2), (0, 4)))
SINGLE = (Change.NONE, Change.DIFFUSE, Change.SPECULAR, Change.GLOSS)


@dataclass(frozen=True, eq=False)
class Explanation:
    """A reflectance, what of it is new, how well it explains the stroke, and what that costs.

    explained: 1 − (what is left) / (what was wanted to change), both relative and squared; 1 is all of it.
    """

    change: Change
    reflectance: Reflectance
    left: float
    score: float
    explained: float


@dataclass(frozen=True, eq=False)
class Verdict:
    """All explanations, best first; parameters that the stroke could not tell anything about."""

    explanations: tuple[Explanation, ...]
    silent: Change

    @property
    def best(self) -> Explanation:
        """The first."""
        return self.explanations[0]

    @property
    def close(self) -> tuple[Explanation, ...]:
        """Others that are nearly as good."""
        return tuple(one for one in self.explanations[1:] if one.score - self.best.score < CLOSE)


def half_levels(levels: int) -> F64:
    """Every level and the middles between them."""
    return np.arange(2 * levels - 1) / 2


def decide(
    samples: Samples,
    model: Model,
    now: Reflectance,
    allowed: Sequence[Change] = EVERY,
    tints: Sequence[F64] = (),
    exactness: float = NOISE,
) -> Verdict:
    """What of `now` changes such that the samples come out; places with numbers that are none are left out.

    The shine keeps its colour, or takes one of the `tints` (3,), which cost two numbers more. Nothing
    at all explains a stroke on which no light falls: then the one explanation is that nothing changes.
    """
    samples = samples.that_count()
    total = samples.weight.sum() * 3
    if not len(samples) or total <= 0:
        nothing = Explanation(Change.NONE, now, 0.0, 0.0, 0.0)
        return Verdict((nothing,), Change.DIFFUSE | Change.SPECULAR | Change.GLOSS)
    importance = samples.importance
    before = float((importance * (samples.before - samples.wanted) ** 2).sum() / total)
    rungs = Rungs.of(samples, importance)
    every = rungs.at(half_levels(samples.levels))
    here = Grams.of(samples, np.array([now.level]), importance, samples.own[None])
    others = every.some(np.flatnonzero(np.abs(every.levels - now.level) > APART))
    offered = [(now.tint, 0)]
    offered += [(t / max(t.max(), 1e-9), 2) for t in tints if _apart(t, now.tint)]
    changing = [(Shines.start(model, now, tint), extra) for tint, extra in offered]
    staying = [(Shines.start(model, now, None), 0)]
    tried: list[tuple[Change, int, Found]] = []
    for change in allowed:
        grams, diffuse = others if Change.GLOSS in change else here, Change.DIFFUSE in change
        for shines, extra in changing if Change.SPECULAR in change else staying:
            tried.append((change, extra, _finer(rungs, grams, model, now, diffuse, shines)))
    change, _, nearest = min(tried, key=lambda one: one[2].left)
    scatter = _scatter(samples, model, nearest.reflectance, Change.GLOSS not in change)
    noise = min(scatter, nearest.left) / total
    floor = noise * min(PLACES / len(samples), 1) + exactness**2
    made = []
    for change, extra, one in tried:
        left = one.left / total
        score = PLACES * math.log(left - noise + floor) + (change.cost + extra) * math.log(PLACES)
        explained = 1 - left / before if before > 0 else 0.0
        made.append(Explanation(change, one.reflectance, left, score, explained))
    best: dict[Change, Explanation] = {}
    for explanation in made:
        if explanation.change not in best or explanation.score < best[explanation.change].score:
            best[explanation.change] = explanation
    ranked = sorted(best.values(), key=lambda one: (one.score, one.change.cost))
    return Verdict(tuple(ranked), _silent(samples, model, now, importance, total))


def _finer(
    rungs: Rungs, grams: Grams, model: Model, now: Reflectance, diffuse: bool, shines: Shines
) -> Found:
    """The best at the levels, and then between them where there are several."""
    found = best_of(grams, model, now, diffuse, shines)
    if len(grams.levels) > 1:
        about = found.reflectance.level + np.array([-0.25, -0.125, 0.125, 0.25])
        about = np.clip(about, 0, len(rungs.across) - 1)
        again = best_of(rungs.at(about), model, now, diffuse, shines)
        if again.left < found.left:
            return again
    return found


def _scatter(samples: Samples, model: Model, found: Reflectance, own: bool) -> float:
    """Of the weighted squared error that is left, what differs at random from each place to the next.

    Places follow each other along rows of the stroke, so half the mean squared difference of successive ones
    is the variance of what they do not share (von Neumann 1941, "Distribution of the Ratio of the Mean Square
    Successive Difference to the Variance").
    """
    error = samples.made(model, found, own) - samples.wanted
    each = np.sqrt(samples.importance / samples.weight[:, None]) * error
    weight = np.minimum(samples.weight[1:], samples.weight[:-1])
    return float((weight[:, None] * (each[1:] - each[:-1]) ** 2).sum() / 2)


def _apart(tint: F64, own: F64) -> bool:
    return bool(np.abs(tint / max(tint.max(), 1e-9) - own).max() > TINTS_APART)


def _silent(samples: Samples, model: Model, now: Reflectance, importance: F64, total: float) -> Change:
    """Parameters that these places would hardly show, however they changed."""

    def shows(one: Reflectance, other: Reflectance, own: bool = True) -> bool:
        change = samples.made(model, one, own) - samples.made(model, other, own)
        return math.sqrt((importance * change**2).sum() / total) > TOLD

    def shine(level: float) -> Reflectance:
        return Reflectance(now.diffuse, now.specular, level)

    silent, nothing = Change.NONE, np.zeros(3)
    if not shows(
        Reflectance(nothing, now.specular, now.level),
        Reflectance(model.room(now.specular), now.specular, now.level),
    ):
        silent |= Change.DIFFUSE
    if not shows(Reflectance(nothing, nothing, now.level), Reflectance(nothing, now.tint, now.level)):
        silent |= Change.SPECULAR
    levels = np.linspace(0, samples.levels - 1, 5)
    if not any(shows(shine(now.level), shine(float(level)), False) for level in levels):
        silent |= Change.GLOSS
    return silent
