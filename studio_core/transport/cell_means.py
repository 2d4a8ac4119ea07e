"""Reflectance kernels as means over cells of directions, cosine-weighted on both sides.

Light from a mirror-sharp lobe must neither be missed nor counted twice, so a direction's hemisphere is looked
at twice: on a regular grid of three heights a ring, and on circles around the mirror direction whose radii
grow exponentially (as in `studio_core.brdfs.quadrature`). Both share the integral by the power heuristic
(Veach & Guibas 1995) on their densities. What both together get wrong of a cell's own size is made up for
where values hardly differ inside it: constants are exact, lobes are left alone.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.calls import evaluate_at
from studio_core.transport.cells import CELLS, PARTS, RINGS, cell_projected_angles
from studio_core.transport.symmetries import Symmetry, symmetry

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

VIEWS = 3  # heights a ring that are looked from
HEIGHTS = 3  # and to
CIRCLES, AROUND = 36, 32  # about the mirror direction, half a turn
WIDE_CIRCLES, WIDE_AROUND = 40, 28
GRADE = 12.0
CONSTANT = 1e-4  # of a term's largest value
ALIKE = 1e-3  # two values of a kernel that are taken for the same
ODD = 0.05  # share of probes that may differ: lobes at the edge of float32
NEAREST = np.array([0, 1e-6, 1e-5, 1e-4, 1e-3], np.float32)
"""How far from the mirror direction sharp lobes are looked for."""
VIEWED, LIT = 16, 24  # directions that probing looks from and to


@dataclass(frozen=True)
class Kernel:
    """A shape of a model: the C function's address, its terms, and what it reads."""

    address: int
    terms: int
    shape: F32

    def __call__(self, wo: npt.ArrayLike, wi: F32) -> F32:
        """(N, terms) of one wo (3,) and many wi (N, 3)."""
        return evaluate_at(self.address, self.terms, self.shape, wo, wi)


@dataclass(frozen=True)
class Traits:
    """What probing finds: `matte` (T,) the value of terms that are constant, else NaN; who is `signed` (T,).

    `turns` (T,): nothing changes when both directions turn around the normal; `even` (T,): nor when both are
    mirrored in y; `reciprocal` (T,): nor when they are exchanged. `alike`: what symmetries terms have that
    do not turn.
    """

    matte: F64
    signed: Bools
    turns: Bools
    even: Bools
    alike: Symmetry
    reciprocal: Bools


def ring_measures() -> F64:
    """(RINGS,) steradians times cosine of whole rings; π in all."""
    made: F64 = cell_projected_angles().astype(np.float64).reshape(RINGS, PARTS).sum(axis=1)
    return made


@functools.cache
def _probes() -> tuple[F32, F32, F64]:
    """Views (N, 3), for each of them light (N, M, 3), half of it near its mirror image, and a turn (N,)."""
    rng = np.random.default_rng(11)
    a, b = rng.normal(size=(VIEWED, 1, 3)), rng.normal(size=(VIEWED, LIT, 3))
    a[..., 2] = np.abs(a[..., 2]) + 0.02
    a /= np.linalg.norm(a, axis=-1, keepdims=True)
    near = slice(0, LIT // 2)
    b[:, near] = a * [-1, -1, 1] + 10.0 ** rng.uniform(-3, -0.3, (VIEWED, LIT // 2, 1)) * b[:, near]
    b[..., 2] = np.abs(b[..., 2]) + 0.02
    b /= np.linalg.norm(b, axis=-1, keepdims=True)
    return a[:, 0].astype(np.float32), b.astype(np.float32), rng.uniform(0.2, 2 * math.pi - 0.2, VIEWED)


def _turned(w: F32, turn: F64 | float) -> F32:
    c, s = np.cos(turn), np.sin(turn)
    x, y = w[..., 0], w[..., 1]
    return np.stack([c * x - s * y, s * x + c * y, w[..., 2]], axis=-1).astype(np.float32)


def traits(kernel: Kernel) -> Traits:
    """By evaluating at fixed probes: a model's name says nothing."""
    a, b, turn = _probes()

    def at(wo: F32, wi: F32) -> F64:
        return np.stack([kernel(o, i) for o, i in zip(wo, wi, strict=True)]).astype(np.float64)

    plain = at(a, b)
    mirrored = a * np.array([-1, -1, 1], np.float32)
    sharpest = at(a, mirrored[:, None] + NEAREST[:, None] * b[:, :1])  # lobes that all other probes miss
    every = np.concatenate([plain, sharpest], axis=1)
    low, high = every.min(axis=(0, 1)), every.max(axis=(0, 1))
    largest = np.maximum(np.abs(low), np.abs(high))
    constant = high - low <= CONSTANT * largest
    matte = np.where(constant, plain.mean(axis=(0, 1)), np.nan)

    def same(other: F64, one: F64) -> Bools:
        limit = ALIKE * np.maximum(np.abs(other), np.abs(one)) + 1e-6 * largest
        far = (np.abs(other - one) > limit).mean(axis=(0, 1))
        return np.asarray(constant | (far <= ODD), np.bool_)

    flip_x, flip_y = np.array([-1, 1, 1], np.float32), np.array([1, -1, 1], np.float32)
    along = same(at(a * flip_y, b * flip_y), plain)
    turns = same(at(_turned(a, turn), _turned(b, turn[:, None])), plain)
    alike = symmetry(True, True, True)
    if not turns.all():
        across = turns | same(at(a * flip_x, b * flip_x), plain)
        half = turns | same(at(a * (flip_x * flip_y), b * (flip_x * flip_y)), plain)
        alike = symmetry(bool(across.all()), bool((turns | along).all()), bool(half.all()))
    exchanged = b[:, :: LIT // 4]
    there = plain[:, :: LIT // 4]
    back = np.stack(
        [at(i, np.repeat(o[None, None], len(i), 0))[:, 0] for o, i in zip(a, exchanged, strict=True)]
    )
    return Traits(matte, low < -1e-6 * largest, turns, along, alike, same(back, there))


@dataclass(frozen=True)
class _Look:
    """Directions (3, P) seen from one height, first those of the grid: `grid` (K, rings, bins) points a bin.

    Weights dω cosθ of the grid, and of the others with the bins (ring · bins + bin) that they are in;
    `missing` (rings, bins) is what all of them lack of a bin's own measure.
    """

    directions: F32
    grid: F32
    others: F32
    bins: I64
    missing: F64

    def sums(self, values: F32) -> F64:
        """(rings, bins) integrals of a term's values (P,) over each bin."""
        regular: F32 = values[: self.grid.size].reshape(self.grid.shape)
        rest = values[self.grid.size :] * self.others
        found = np.bincount(self.bins, rest, minlength=self.missing.size)
        made: F64 = found.reshape(self.missing.shape) + (regular * self.grid).sum(axis=0)
        least, most = regular.min(axis=0), regular.max(axis=0)
        made += self.missing * (np.maximum(2 * least - most, 0.0) + np.minimum(2 * most - least, 0.0))
        return made


def _circles(theta: float, circles: int, around: int) -> tuple[F64, F64]:
    """(P, 3) around the mirror direction of (sin θ, 0, cos θ), in the half space y > 0, and their dω."""
    s, f = np.meshgrid(
        (np.arange(circles) + 0.5) / circles, (np.arange(around) + 0.5) / around * math.pi, indexing="ij"
    )
    end = np.arctan2(math.cos(theta), -math.sin(theta) * np.cos(f))
    away = end * np.expm1(GRADE * s) / math.expm1(GRADE)
    mirror, up, aside = _mirror_frame(theta)
    made = np.cos(away)[..., None] * mirror
    made = made + np.sin(away)[..., None] * (np.cos(f)[..., None] * up + np.sin(f)[..., None] * aside)
    angle = np.sin(away) * end * GRADE * np.exp(GRADE * s) / math.expm1(GRADE) / circles * math.pi / around
    return made.reshape(-1, 3), angle.ravel()


def _circle_angles(theta: float, w: F64, circles: int, around: int) -> F64:
    """dω that `_circles` has about directions w (P, 3)."""
    mirror, up, aside = _mirror_frame(theta)
    away = 2 * np.arcsin(np.minimum(np.linalg.norm(w - mirror, axis=1) / 2, 1.0))
    f = np.arctan2(w @ aside, w @ up)
    end = np.arctan2(math.cos(theta), -math.sin(theta) * np.cos(f))
    grown = np.minimum(away / end, 1.0) * math.expm1(GRADE) + 1
    made: F64 = np.sin(away) * end * GRADE * grown / math.expm1(GRADE) / circles * math.pi / around
    return made


def _mirror_frame(theta: float) -> tuple[F64, F64, F64]:
    s, c = math.sin(theta), math.cos(theta)
    return np.array([-s, 0.0, c]), np.array([c, 0.0, s]), np.array([0.0, 1.0, 0.0])


def _look(theta: float, azimuths: Any, heights: int, columns: int, circles: int, around: int) -> _Look:
    """From (sin θ, 0, cos θ); the grid's azimuths, `columns` a bin, are equally far apart."""
    step, turn = math.pi / 2 / (RINGS * heights), float(azimuths[1] - azimuths[0])
    t, p = np.meshgrid((np.arange(RINGS * heights) + 0.5) * step, azimuths, indexing="ij")
    regular = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1).reshape(-1, 3)
    round_, own = _circles(theta, circles, around)
    if len(azimuths) * turn > 1.5 * math.pi:  # all around
        round_, own = np.concatenate([round_, round_ * [1, -1, 1]]), np.tile(own, 2)
    w = np.concatenate([regular, round_])
    by_circles = np.maximum(_circle_angles(theta, w, circles, around), 1e-300)
    # the grid counts as no denser at the pole than its heights are
    ratio = np.minimum(step * turn / by_circles, 1e100) ** 2
    share = np.where(np.arange(len(w)) < len(regular), 1 / (1 + ratio), ratio / (1 + ratio))
    weights = np.concatenate([np.sin(t).ravel() * step * turn, own]) * share * np.maximum(w[:, 2], 0.0)
    count, own_points = len(azimuths) // columns, len(regular)
    order = np.arange(own_points).reshape(RINGS, heights, count, columns).transpose(1, 3, 0, 2)
    grid, others = weights[order].reshape(-1, RINGS, count), weights[own_points:]
    height = np.arccos(np.clip(round_[:, 2], 0, 1)) * (RINGS * 2 / math.pi)
    since = np.arctan2(round_[:, 1], round_[:, 0]) - (azimuths[0] - turn / 2)
    place = np.floor(since / (turn * columns)).astype(np.int64)
    place = place % count if columns > 1 else np.clip(place, 0, count - 1)
    bins = np.minimum(height.astype(np.int64), RINGS - 1) * count + place
    missing = np.repeat(ring_measures()[:, None] * (turn * columns / (2 * math.pi)), count, axis=1)
    missing -= grid.sum(axis=0)
    missing -= np.bincount(bins, others, minlength=missing.size).reshape(missing.shape)
    w = np.concatenate([regular[order.ravel()], round_])
    directions = np.ascontiguousarray(w.T, np.float32)
    return _Look(directions, grid.astype(np.float32), others.astype(np.float32), bins, missing)


@functools.cache
def _half_looks() -> tuple[tuple[float, float, _Look], ...]:
    """Angle, weight within its ring, and what is looked at: bins are half parts of half a turn, 0 to π."""
    found = []
    azimuths = (np.arange(PARTS) + 0.5) * (math.pi / PARTS)
    for ring in range(RINGS):
        angles = (ring + (np.arange(VIEWS) + 0.5) / VIEWS) * (math.pi / 2 / RINGS)
        weights = np.sin(angles) * np.cos(angles)
        for theta, weight in zip(angles.tolist(), (weights / weights.sum()).tolist(), strict=True):
            found.append((theta, weight, _look(theta, azimuths, HEIGHTS, 1, CIRCLES, AROUND)))
    return tuple(found)


def ring_means(kernel: Kernel, terms: Sequence[int], even: bool = True) -> F64:
    """(T, RINGS of wo, RINGS of wi, PARTS of turn between them) of terms that turn with the normal.

    Of terms that are not `even`, such as noisy measurements, the mean of left and right.
    """
    made = np.zeros((len(terms), RINGS, RINGS, PARTS))
    for row, (theta, weight, look) in enumerate(_half_looks()):
        wo = np.array([math.sin(theta), 0.0, math.cos(theta)], np.float32)
        values = kernel(wo, look.directions.T)
        if not even:
            other = kernel(wo, (look.directions * np.array([[1], [-1], [1]], np.float32)).T)
            values = np.float32(0.5) * (values + other)
        for number, term in enumerate(terms):
            made[number, row // VIEWS] += weight * look.sums(values[:, term])
    half = made / (ring_measures() / (2 * PARTS))[:, None]
    whole = np.concatenate([half, half[..., ::-1]], axis=3)  # half parts of a whole turn, from 0 on
    # two cells that lie j parts apart, each as wide as a part: a triangle over the turn between them
    own = (whole[..., ::2], np.roll(whole, 1, -1)[..., ::2])
    next_ = (np.roll(whole, -1, -1)[..., ::2], np.roll(whole, 2, -1)[..., ::2])
    means: F64 = 0.375 * (own[0] + own[1]) + 0.125 * (next_[0] + next_[1])
    return means


@functools.cache
def _whole_looks() -> tuple[tuple[float, _Look], ...]:
    """An angle in each ring, and what is looked at all around: bins are cells, azimuths from wo's on.

    They are half a part off, so that wo in the middle of part 0 sees its own part in the middle.
    """
    azimuths = (np.arange(2 * PARTS) - 0.5) * (math.pi / PARTS)
    angles = ((np.arange(RINGS) + 0.5) * (math.pi / 2 / RINGS)).tolist()
    return tuple((theta, _look(theta, azimuths, 2, 2, WIDE_CIRCLES, WIDE_AROUND)) for theta in angles)


def cell_means(kernel: Kernel, terms: Sequence[int], alike: Symmetry) -> F32:
    """(T, representatives of wo, CELLS of wi) of terms that may have a direction of their own."""
    parts = alike.parts
    made = np.empty((len(terms), RINGS, len(parts), RINGS, PARTS), np.float32)
    for ring, (theta, look) in enumerate(_whole_looks()):
        x, y, z = look.directions
        w = np.empty_like(look.directions)
        w[2] = z
        for number, part in enumerate(parts):
            turn = (part + 0.5) * (2 * math.pi / PARTS)
            c, s = np.float32(math.cos(turn)), np.float32(math.sin(turn))
            w[0], w[1] = c * x - s * y, s * x + c * y
            wo = np.array([c * math.sin(theta), s * math.sin(theta), math.cos(theta)])
            values = kernel(wo, w.T)
            for row, term in enumerate(terms):
                made[row, ring, number] = np.roll(look.sums(values[:, term]), part, axis=1)
    flat = made.reshape(len(terms), -1, CELLS)
    flat /= cell_projected_angles()
    return flat


__all__ = ["Kernel", "Traits", "cell_means", "ring_means", "ring_measures", "traits"]
