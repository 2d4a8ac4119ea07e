"""How well one change of one region explains a stroke: all that may be changed, fitted exactly over grids.

The change of light is quadratic in the coefficients of a material's terms, so a candidate costs a product
with a small matrix (`Moments`); coefficients are asked of the model at a grid of values, whatever curve
they follow.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from studio_plugins.slf.changeable import DIFFUSE, GLOSS, SPECULAR, Changeable, Look
from studio_plugins.slf.fixates import Rows
from studio_plugins.slf.influence import Columns
from studio_plugins.slf.joint import CLOSE, NOISE, PLACES, TINTS_APART
from studio_plugins.slf.ladder import LEVELS
from studio_plugins.slf.trials import Node

F64 = npt.NDArray[np.float64]
STEPS = 33
"""Values of a parameter that are tried before the best is refined."""
SIZE = 1.0
"""What a change of a whole parameter's range costs in score: of two that explain alike, the smaller one."""
PARTS = 8
TWO = CLOSE
"""What shine with gloss costs beside its numbers: as well explained by one of them, one it is."""
OTHER = 0.5
"""Levels that are nearer to today's are no change of gloss."""
LOOSE = np.linspace(0.92, 1.08, 9)
"""Columns know how much light comes back in all at another gloss no better than that."""


class Between(NamedTuple):
    """A level that lies between two nodes, `share` of the way to the second."""

    level: float
    first: int
    second: int
    share: float


NOW = (Between(-1.0, 0, 0, 0.0),)


@dataclass(frozen=True, eq=False)
class Candidate:
    """One region's change: its meaning (`strokes.stroke.MEANINGS`), the look it starts from, values by role;
    what it leaves of the wanted change (squared, relative), and the score, lower is better; `at` which level.
    """

    region: int
    meaning: str
    look: Look
    values: Mapping[str, F64]
    left: float
    score: float
    at: Between = NOW[0]

    @property
    def explained(self) -> float:
        """1 − left."""
        return 1 - self.left

    def predicted(self, nodes: list[Node]) -> list[F64]:
        """(P, 3) by each set of rays: how columns say that light changes."""
        values = {role: value[None] for role, value in self.values.items() if role != GLOSS}
        made = []
        for number in range(len(nodes[0].sides)):
            terms, sent = _between_nodes([node.sides[number] for node in nodes], self.region, [self.at])
            light = sent[0]
            if values:
                change = self.look.coefficients(values)[0] - self.look.plain
                width = min(len(change), terms.shape[2])
                light = light + np.einsum("ptc,tc->pc", terms[0, :, :width], change[:width])
            made.append(light)
        return made


@dataclass(frozen=True, eq=False)
class Moments:
    """Of one region at L levels, relative to the region as it is.

    left = rest + Σ_c Δ_cᵀ gram_c Δ_c − 2 Δ_c · light_c, with Δ (T, 3) changes of coefficients; levels (L,),
    gram (L, 3, T, T), light (L, 3, T), rest (L, 3). From products of two sets of rays, whose noise is not
    the same, it is without bias, and may come out below 0; of one set, the noise of its rays is in it.
    """

    levels: F64
    gram: F64
    light: F64
    rest: F64

    @classmethod
    def of(
        cls, rows: Rows, nodes: list[Node], region: int, at: Sequence[Between], off: Sequence[F64] = ()
    ) -> Moments:
        """At levels between nodes; `off` (P, 3) for each set of rays is what columns do not know of."""
        importance = rows.importance
        sides = []
        for number in range(len(nodes[0].sides)):
            terms, sent = _between_nodes([node.sides[number] for node in nodes], region, at)
            known = rows.change - off[number] if off else rows.change
            sides.append((terms, known - sent))  # (L, P, T, 3), (L, P, 3)
        grams, lights, rests = [], [], []
        pairs = itertools.permutations(sides, 2) if len(sides) > 1 else [(sides[0], sides[0])]
        for (terms, wanted), (other, wish) in pairs:
            weighed = (importance[:, None] * terms).transpose(0, 3, 2, 1)  # (L, 3, T, P)
            grams.append(weighed @ other.transpose(0, 3, 1, 2))
            lights.append((weighed @ wish.transpose(0, 2, 1)[..., None])[..., 0])
            rests.append((importance * wanted * wish).sum(axis=1))
        levels = np.array([one.level for one in at])
        return cls(levels, *(np.mean(values, axis=0) for values in (grams, lights, rests)))

    def left(self, changes: F64) -> F64:
        """(L, N, 3) of changes (N, T, 3) of coefficients."""
        width = min(changes.shape[1], self.gram.shape[2])
        by = changes[:, :width].transpose(2, 0, 1)  # (3, N, T)
        square = ((by @ self.gram[:, :, :width, :width]) * by).sum(axis=3)
        linear = (by @ self.light[:, :, :width, None])[..., 0]
        return np.asarray((self.rest[..., None] + square - 2 * linear).transpose(0, 2, 1))


def _between_nodes(sides: Sequence[Columns], region: int, at: Sequence[Between]) -> tuple[F64, F64]:
    """Of one region at levels between nodes: columns (L, P, T, 3), and what it sends more than now."""
    width = max(one.terms.shape[2] for one in sides)
    every = np.zeros((len(sides), len(sides[0].terms), width, 3))
    for one, into in zip(sides, every, strict=True):
        into[:, : one.terms.shape[2]] = one.terms[:, region]
    whole = np.stack([one.whole[:, region] for one in sides])
    first, second = [one.first for one in at], [one.second for one in at]
    by = np.array([one.share for one in at])[:, None, None, None]
    terms = (1 - by) * every[first] + by * every[second]
    sent = (1 - by[..., 0]) * whole[first] + by[..., 0] * whole[second] - whole[0]
    return terms, sent


def candidates(rows: Rows, nodes: list[Node], regions: list[Changeable]) -> list[Candidate]:
    """The best change of each kind of each region."""
    made: list[Candidate] = []
    for number, region in enumerate(regions):
        made += _best_of_each(_of_region(number, region, rows, nodes))
    return made


def fitted_again(
    one: Candidate, made: Sequence[F64], rows: Rows, nodes: list[Node], region: Changeable
) -> Candidate:
    """A candidate whose change was carried forward, made (P, 3) for each set of rays, in place of columns."""
    off = [then - now for then, now in zip(made, one.predicted(nodes), strict=True)]
    found = [
        found for found in _of_region(one.region, region, rows, nodes, off) if found.meaning == one.meaning
    ]
    return min(found, key=lambda one: one.score)


def _of_region(
    number: int, region: Changeable, rows: Rows, nodes: list[Node], off: Sequence[F64] = ()
) -> Iterator[Candidate]:
    own = Moments.of(rows, nodes[:1], number, NOW, off)
    yield from _colours(number, region, own)
    if SPECULAR in region.now.roles:
        yield from _shine(number, region.now, own, NOW)
    if GLOSS in region.full.roles and len(nodes) > 1:
        yield from _glosses(number, region, rows, nodes, off)


def _glosses(
    number: int, region: Changeable, rows: Rows, nodes: list[Node], off: Sequence[F64]
) -> Iterator[Candidate]:
    """Changes to levels other than today's, if the region shines at all today."""
    full, at = region.full, _between(region, nodes)
    if not at:
        return
    levels = Moments.of(rows, nodes, number, at, off)
    if region.full is region.now and full.shiny:
        left = _loosely(full, levels)
        best = int(np.argmin(left))
        level = float(levels.levels[best])
        score = score_of(float(left[best]), 1, abs(level - full.level) / LEVELS)
        values = {GLOSS: np.asarray(full.gloss_at(level))}
        yield Candidate(number, "gloss", full, values, float(left[best]), score, at[best])
    if SPECULAR in full.roles:
        yield from _shine(number, full, levels, at)


def _between(region: Changeable, nodes: list[Node]) -> list[Between]:
    """Levels that are tried, each between two nodes: those with columns of their own, and PARTS between them.

    A region whose model stays has a node at its own level as well; levels near that are no change.
    """
    known = [(node.level, number) for number, node in enumerate(nodes) if number]
    own = region.full.level if region.full is region.now and region.full.shiny else -1.0
    if own >= 0:
        known = sorted([*known, (own, 0)])
    made = []
    for (low, one), (high, other) in itertools.pairwise(known):
        for part in range(PARTS):
            share = part / PARTS
            made.append(Between(low + share * (high - low), one, other, share))
    made.append(Between(known[-1][0], known[-1][1], known[-1][1], 0.0))
    return [one for one in made if own < 0 or abs(one.level - own) > OTHER]


def _best_of_each(found: Iterable[Candidate]) -> list[Candidate]:
    best: dict[str, Candidate] = {}
    for one in found:
        if one.meaning not in best or one.score < best[one.meaning].score:
            best[one.meaning] = one
    return list(best.values())


def score_of(left: float, numbers: int, size: float) -> float:
    """See the module `joint`; and a little for the size of the change."""
    return PLACES * math.log(max(left, 0) + NOISE**2) + numbers * math.log(PLACES) + SIZE * size


def _colours(number: int, region: Changeable, own: Moments) -> Iterator[Candidate]:
    look = region.now
    if DIFFUSE not in look.roles or look.at(DIFFUSE).ndim == 0:
        return
    info, now = look.infos[look.roles[DIFFUSE]], look.at(DIFFUSE)
    grid = np.linspace(info.low, info.high, STEPS)
    left = own.left(look.coefficients({DIFFUSE: np.repeat(grid[:, None], 3, axis=1)}) - look.plain)[0]
    value = np.array([_refined(grid, left[:, c]) for c in range(3)])
    rest = float(own.left(look.coefficients({DIFFUSE: value[None]}) - look.plain).sum())
    yield Candidate(number, "colour", look, {DIFFUSE: value}, rest, score_of(rest, 3, _size(value, now)))


def _loosely(look: Look, levels: Moments) -> F64:
    """(L,) what is left at levels with about as much shine as now."""
    now = look.at(SPECULAR)
    about = LOOSE if now.ndim == 0 else LOOSE[:, None]
    left = levels.left(look.coefficients({SPECULAR: about * now}) - look.plain).sum(axis=2)
    # Squared in the share, but for the curve of the model: the parabola through ends and middle.
    middle = len(LOOSE) // 2
    low, mid, high = left[:, 0], left[:, middle], left[:, -1]
    slope, bend = (high - low) / 2, (high + low) / 2 - mid
    at = np.where(bend > 0, np.clip(-slope / np.maximum(2 * bend, 1e-30), -1, 1), 0)
    return np.asarray(np.minimum(mid + slope * at + bend * at**2, left.min(axis=1)))


def _shine(number: int, look: Look, levels: Moments, between: Sequence[Between]) -> Iterator[Candidate]:
    """More or less shine: of its own colour or white, of any colour; another level is one number more."""
    info, now = look.infos[look.roles[SPECULAR]], look.at(SPECULAR)
    grid = info.low + (info.high - info.low) * np.linspace(0, 1, STEPS) ** 2
    other = bool(levels.levels[0] >= 0)
    meaning = "shine and gloss" if other and look.shiny else "shine"

    def left(values: F64) -> F64:
        return levels.left(look.coefficients({SPECULAR: values}) - look.plain)

    def candidate(value: F64, level: int, numbers: int) -> Candidate:
        rest = float(left(value[None])[level].sum())
        at = float(levels.levels[level])
        gloss = {GLOSS: np.asarray(look.gloss_at(at))} if other else {}
        score = score_of(rest, numbers + other, _size(value, now))
        score += TWO if meaning == "shine and gloss" else 0.0
        values = {SPECULAR: value, **gloss}
        return Candidate(number, meaning, look, values, rest, score, between[level])

    if now.ndim == 0:
        found = left(grid).sum(axis=2)
        level = int(np.argmin(found.min(axis=1)))
        yield candidate(np.asarray(_refined(grid, found[level])), level, 1)
        return
    tint = now / now.max() if now.max() > 0 else np.ones(3)
    for colour in (tint, np.ones(3)):
        if colour is not tint and np.abs(colour - tint).max() <= TINTS_APART:
            continue
        found = left(grid[:, None] * colour).sum(axis=2)
        level = int(np.argmin(found.min(axis=1)))
        yield candidate(_refined(grid, found[level]) * colour, level, 1 if colour is tint else 3)
    each = left(np.repeat(grid[:, None], 3, axis=1))
    level = int(np.argmin(each.min(axis=1).sum(axis=1)))
    yield candidate(np.array([_refined(grid, each[level, :, c]) for c in range(3)]), level, 3)


def _refined(grid: F64, left: F64) -> float:
    """Where the parabola through the least of (N,) and its neighbours is least."""
    best = int(np.argmin(left))
    if best in (0, len(grid) - 1):
        return float(grid[best])
    (x, y, z), (a, b, c) = grid[best - 1 : best + 2], left[best - 1 : best + 2]
    one, two = (b - a) / (y - x), (c - b) / (z - y)
    bend = (two - one) / (z - x)
    if bend <= 0:
        return float(y)
    return float(np.clip((x + y) / 2 - one / (2 * bend), x, z))


def _size(value: F64, now: F64) -> float:
    return float(np.sqrt(np.mean((value - now) ** 2)))


__all__ = ["Candidate", "Moments", "candidates", "fitted_again", "score_of"]
