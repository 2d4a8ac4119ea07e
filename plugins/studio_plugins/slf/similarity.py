"""How alike surface is to what a stroke lies on (section 4.3), from 0 to 1.

The paper's similarity of two places is t_s + t_n + t_r with

    t_s = σ_s / ‖x − y‖,   t_n = σ_n ⟨n, n⟩ / (1 − ⟨n, n⟩),   t_r = σ_r / Δ_R:

infinite at the stroke, of no unit, and once one of them is small the others decide. A designer's weights say
how much *only* near, like-facing or like-looking surface changes. So the reciprocals, which are differences,
add up, and likeness to a stroke of marks y is

    max over y of exp(−(σ_s d / 1 m + σ_n (1 − ⟨n, n⟩) / ⟨n, n⟩⁺ + σ_r Δ_R)),

less what is too little to see. Weights of 0 ask for nothing: then all of the stroke's part is as likely as
the stroke itself. A weight of 100 lets likeness fall by e within 1 cm, 8° or a hundredth of the way from
black to white. d is counted from as far around a mark as marks lie apart, so that a stroke has no holes;
Δ_R is the distance between looks (`looks`), per channel of colour.

Other slots and other objects take part only if σ_r is not 0, their material's model is that of the stroke,
and then by ELSEWHERE at least: surface that looks the same, whatever it is called.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from studio_core.jit import kernel
from studio_core.parallel import Workers
from studio_core.strokes.stroke import Stroke
from studio_plugins.slf.spots import Spots

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

ELSEWHERE = 20.0
"""σ_r at least beyond the stroke's own part: falls by e within a twentieth of the way from black to white."""
FARTHEST = 5.0
"""Differences from which on nothing is alike; exp(−5) = 0.7 % is taken off so that likeness ends smoothly."""
MOST = 512
"""Marks of a stroke that are asked; more are thinned evenly."""
ALONE = 3.0
"""Times the median of how far marks lie apart: what lies alone does not count farther around it."""
GROUP = 16
CHUNK = 1 << 11
_BITS = 10


@dataclass(frozen=True)
class Reach:
    """σ_s (per metre), σ_n and σ_r."""

    near: float = 0.0
    facing: float = 0.0
    alike: float = 0.0

    @staticmethod
    def of(stroke: Stroke) -> Reach:
        """What a stroke says."""
        return Reach(stroke.near, stroke.facing, stroke.alike)


def likeness_of(spots: Spots, marks: Spots, reach: Reach, workers: Workers | None = None) -> F32:
    """(V,) likeness of all spots to a stroke's marks; zeros without any."""
    made = np.zeros(len(spots), np.float32)
    if not len(marks) or not len(spots):
        return made
    strictness = _strictness(spots, marks, reach)
    if not (reach.near or reach.facing or reach.alike):
        made[strictness >= 0] = 1.0
        return made
    chosen, gap = _thinned(marks)
    differs = (spots.look != chosen.look[0]).any(axis=0) if reach.alike else np.zeros(0, np.int64)
    look, other = (np.ascontiguousarray(one.look[:, differs]) for one in (spots, chosen))
    centre, radius = _groups(chosen.place, gap)

    def body(start: int, stop: int) -> None:
        add_likeness(
            start, stop, spots.place, spots.normal, look, spots.model, strictness,
            chosen.place, chosen.normal, other, chosen.model, gap,
            centre, radius, reach.near, reach.facing, made,
        )  # fmt: skip

    if workers is None:
        body(0, len(spots))
    else:
        workers.run(len(spots), CHUNK, body)
    return made


def _strictness(spots: Spots, marks: Spots, reach: Reach) -> F32:
    """(V,) the σ_r that counts at each spot, −1 where nothing is to change."""
    own = np.isin(spots.part, np.unique(marks.part)) & (spots.model >= 0)
    made = np.where(own, reach.alike, -1.0)
    if reach.alike:
        same = ~own & np.isin(spots.model, np.unique(marks.model[marks.model >= 0]))
        made[same] = max(reach.alike, ELSEWHERE)
    return made.astype(np.float32)


def _thinned(marks: Spots) -> tuple[Spots, F32]:
    """As `_thin` makes them, once for the same marks."""
    if marks not in _known:
        _known[marks] = _thin(marks)
    return _known[marks]


_known: WeakKeyDictionary[Spots, tuple[Spots, F32]] = WeakKeyDictionary()


def _thin(marks: Spots) -> tuple[Spots, F32]:
    """At most MOST of them, in the order of a curve that fills space, and how far around each counts (N,)."""
    low = marks.place.min(axis=0)
    size = max(float((marks.place - low).max()), 1e-9)
    cell = ((marks.place - low) / size * ((1 << _BITS) - 1)).astype(np.int64)
    code = np.zeros(len(marks), np.int64)
    for bit in range(_BITS):
        for axis in range(3):
            code |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    order = np.argsort(code, kind="stable")
    if len(order) > MOST:
        order = order[np.linspace(0, len(order) - 1, MOST).astype(np.int64)]
    near = min(4, len(marks))
    if near == 1:
        return marks.some(np.arange(1)), np.zeros(1, np.float32)
    place = marks.place[order]
    gap = cKDTree(marks.place).query(place, k=near)[0][:, 1:].mean(axis=1)
    gap = np.minimum(gap, ALONE * np.median(gap))
    if len(order) < len(marks):  # as far as what each stands for
        distance, owner = cKDTree(place).query(marks.place)
        stood = np.zeros(len(order))
        np.maximum.at(stood, owner, distance)
        gap += stood
    return marks.some(order), gap.astype(np.float32)


def _groups(place: F32, gap: F32) -> tuple[F32, F32]:
    """Centres (G, 3) and radii (G,) of balls around every GROUP marks and as far as each of them counts."""
    starts = np.arange(0, len(place), GROUP)
    low = np.minimum.reduceat(place, starts)
    high = np.maximum.reduceat(place, starts)
    centre = ((low + high) / 2).astype(np.float32)
    away = np.linalg.norm(place - np.repeat(centre, GROUP, axis=0)[: len(place)], axis=1) + gap
    return centre, np.maximum.reduceat(away, starts).astype(np.float32)


@kernel
def add_likeness(
    start: int,
    stop: int,
    place: F32,
    normal: F32,
    look: F32,
    model: I32,
    strictness: F32,
    mark_place: F32,
    mark_normal: F32,
    mark_look: F32,
    mark_model: I32,
    gap: F32,
    centre: F32,
    radius: F32,
    near: float,
    facing: float,
    out: F32,
) -> None:
    """out[start:stop] = likeness to the marks (N, …), GROUP of which lie in each ball; 0 if strictness < 0.

    Balls that are farther away than what was found are skipped; the mark that was best for the spot before is
    asked first.
    """
    count, channels = len(mark_place), look.shape[1]
    most = np.float32(FARTHEST)
    sigma_s, sigma_n = np.float32(near), np.float32(facing)
    third = np.float32(3.0)
    least = np.exp(-FARTHEST)
    first = 0
    for v in range(start, stop):
        sigma_r = strictness[v]
        out[v] = 0
        if sigma_r < 0:
            continue
        best = most
        found = first
        for g in range(-1, len(centre)):
            if g < 0:
                begin, end = first, first + 1
            else:
                begin, end = g * GROUP, min(g * GROUP + GROUP, count)
                x, y, z = place[v, 0] - centre[g, 0], place[v, 1] - centre[g, 1], place[v, 2] - centre[g, 2]
                if sigma_s > 0:
                    reach = best / sigma_s + radius[g]
                    if x * x + y * y + z * z > reach * reach:
                        continue
            for m in range(begin, end):
                if mark_model[m] != model[v]:
                    continue
                cost = np.float32(0)
                if sigma_n > 0:
                    cosine = normal[v, 0] * mark_normal[m, 0] + normal[v, 1] * mark_normal[m, 1]
                    cosine += normal[v, 2] * mark_normal[m, 2]
                    if sigma_n * (np.float32(1) - cosine) >= best * cosine:
                        continue
                    cost += sigma_n * max(np.float32(1) / cosine - np.float32(1), np.float32(0))
                if sigma_s > 0:
                    x, y, z = (
                        place[v, 0] - mark_place[m, 0],
                        place[v, 1] - mark_place[m, 1],
                        place[v, 2] - mark_place[m, 2],
                    )
                    away = np.sqrt(x * x + y * y + z * z) - gap[m]
                    cost += sigma_s * max(away, np.float32(0))
                    if cost >= best:
                        continue
                if sigma_r > 0:
                    room = (best - cost) / sigma_r
                    square, most_square = np.float32(0), third * room * room
                    for k in range(channels):
                        difference = look[v, k] - mark_look[m, k]
                        square += difference * difference
                    if square >= most_square:
                        continue
                    cost += sigma_r * np.sqrt(square / third)
                if cost < best:
                    best, found = cost, m
            if best <= 0:
                break
        first = found
        if best < most:
            out[v] = (np.exp(-best) - least) / (1.0 - least)


__all__ = ["ELSEWHERE", "FARTHEST", "Reach", "likeness_of"]
