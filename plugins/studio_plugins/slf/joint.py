"""The fewest numbers of a material that explain what was painted on it, decided for the whole stroke at once.

A highlight that is painted on ten places says one thing about the material, not ten. All samples of a stroke
on one material are pooled; every set of parameters that may have changed is fitted as well as it can be, and
pays for each number it changes (the Bayesian information criterion over n_eff independent places):

    score = n_eff · ln(RSS + 0.05²) + k · ln(n_eff),

RSS the mean relative squared difference that is left, k = 0 for no change, 1 for the amount of shine or the
gloss, 3 for the matte colour, and sums of these.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Flag, auto

import numpy as np

from studio_plugins.slf.constrained import Found, Moments, fit_both, fit_diffuse, fit_specular
from studio_plugins.slf.samples import F64, Reflectance, Samples

PLACES = 30.0  # n_eff
NOISE = 0.05
"""What is painted is meant no more exactly than that."""
CLOSE = 2.0 * math.log(PLACES)
"""Explanations whose scores are nearer than that to the best one's are shown beside it."""
TOLD = 0.02
"""Relative change that a stroke must be able to show, for it to say anything about a parameter."""
TINTS_APART = 0.02


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
    """(2 levels − 1,) all levels and those half way between."""
    return np.arange(2 * levels - 1) / 2


def decide(
    samples: Samples, now: Reflectance, allowed: Sequence[Change] = EVERY, tints: Sequence[F64] = ()
) -> Verdict:
    """What of `now` changes such that the samples come out; places with numbers that are none are left out.

    The shine keeps its colour, or takes one of the `tints` (3,), which cost two numbers more. Nothing
    at all explains a stroke on which no light falls: then the one explanation is that nothing changes.
    """
    samples = samples.some(np.flatnonzero(samples.finite & (samples.weight > 0)))
    total = samples.weight.sum() * 3
    if not len(samples) or total <= 0:
        nothing = Explanation(Change.NONE, now, 0.0, 0.0, 0.0)
        return Verdict((nothing,), Change.DIFFUSE | Change.SPECULAR | Change.GLOSS)
    importance = samples.importance

    def left(reflectance: Reflectance) -> float:
        squares = importance * (samples.made(reflectance) - samples.wanted) ** 2
        return float(squares.sum() / total)

    before = float((importance * (samples.before - samples.wanted) ** 2).sum() / total)
    made = []
    for change in allowed:
        found = []
        for reflectance, extra in _candidates(change, samples, now, tints):
            rest = left(reflectance)
            score = PLACES * math.log(rest + NOISE**2) + (change.cost + extra) * math.log(PLACES)
            explained = 1 - rest / before if before > 0 else 0.0
            found.append(Explanation(change, reflectance, rest, score, explained))
        if found:
            made.append(min(found, key=lambda one: one.score))
    made.sort(key=lambda one: (one.score, one.change.cost))
    return Verdict(tuple(made), _silent(samples, now, importance, total))


def _candidates(
    change: Change, samples: Samples, now: Reflectance, tints: Sequence[F64]
) -> Iterator[tuple[Reflectance, int]]:
    """The best reflectance of each level and tint, with what its tint costs."""
    levels = np.array([now.level])
    if Change.GLOSS in change:
        levels = half_levels(samples.levels)
        levels = levels[np.abs(levels - now.level) > 0.25]
    if Change.SPECULAR not in change:
        if Change.DIFFUSE not in change:
            for level in levels:
                yield Reflectance(now.diffuse, now.specular, float(level)), 0
            return
        yield from _of(fit_diffuse(Moments.of(samples, levels), now), levels, 0)
        return
    moments = Moments.of(samples, levels)
    fit = fit_both if Change.DIFFUSE in change else fit_specular
    own = now.tint
    yield from _of(fit(moments, now, own), levels, 0)
    for tint in tints:
        if np.abs(tint - own).max() > TINTS_APART:
            yield from _of(fit(moments, now, tint), levels, 2)


def _of(found: Found, levels: F64, extra: int) -> Iterator[tuple[Reflectance, int]]:
    for diffuse, specular, level in zip(found.diffuse, found.specular, levels, strict=True):
        yield Reflectance(diffuse, specular, float(level)), extra


def _silent(samples: Samples, now: Reflectance, importance: F64, total: float) -> Change:
    """Parameters that these places would hardly show, however they changed."""

    def shows(change: F64) -> bool:
        return math.sqrt((importance * change**2).sum() / total) > TOLD

    silent = Change.NONE
    if not shows(samples.diffuse * np.maximum(1 - now.specular, 0)):
        silent |= Change.DIFFUSE
    if not shows(samples.column(now.level) * now.tint):
        silent |= Change.SPECULAR
    shine = samples.specular * np.maximum(now.specular, 0)
    if not shows(shine.max(axis=0) - shine.min(axis=0)):
        silent |= Change.GLOSS
    return silent
