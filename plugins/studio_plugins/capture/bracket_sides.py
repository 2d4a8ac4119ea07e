"""Which photographs show one view and which the other: from what they show, when they were taken, and how.

Every way to part them is given points: what is shown counts most, then a pause between two shots, a sequence
of exposures that is repeated, and the cameras' names. Not parting them is one of the ways.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio_core.capturing.settings import BACK, FRONT
from studio_core.imaging.photograph import ShotFacts
from studio_plugins.capture.bracket_looks import Look, alike

_SAME_VIEW = 0.65
"""Lower bound of the correlation from which two photographs show the same view. Over simulated phones in
four rooms, neighbours of 2 EV had 0.69 and more, views apart 0.73 and less, and mostly 0.5."""
_PAUSE, _REPEATED, _LOOKS_REPEATED, _PARTED, _ALONE = 0.25, 0.3, 0.2, 0.05, 0.25
_TURNING = 2.0  # seconds that it takes at least
_OTHER = 0.5  # upper bound below which a photograph shows something else
_AGREED = 0.5  # for parts in which all photographs are that a person has put together
_FORBIDDEN = -100.0


@dataclass(frozen=True)
class Member:
    """What is known of one photograph: `ev` is None where it does not tell."""

    facts: ShotFacts
    look: Look
    ev: float | None
    side: str | None = None
    """Where a person has put it."""


@dataclass(frozen=True)
class Parted:
    """Indices by side, in the order they were taken; `sure` tells whether anything spoke clearly for it.

    `strays` show neither view.
    """

    front: tuple[int, ...]
    back: tuple[int, ...]
    strays: tuple[int, ...] = ()
    sure: bool = True


def in_order(members: Sequence[ShotFacts]) -> list[int]:
    """Indices in the order they were taken: by clock where all tell it, else by name, numbers as numbers."""
    if all(facts.taken is not None for facts in members):
        clocks = [facts.taken or 0.0 for facts in members]
    else:
        clocks = [0.0] * len(members)
    return sorted(range(len(members)), key=lambda i: (clocks[i], natural(members[i].name), i))


def natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sorts IMG_9 before IMG_10."""
    parts = re.findall(r"\d{1,18}|\D+", name.lower())
    return tuple((0, int(p), "") if p.isascii() and p.isdigit() else (1, 0, p) for p in parts)


def part(members: Sequence[Member], *, may_be_one: bool = True) -> Parted:
    """The best way to part photographs into front and back; the front is what was taken first.

    `may_be_one`: they may show one view (then `back` is empty).
    """
    order = in_order([m.facts for m in members])
    known = [members[i] for i in order]
    low, high = _likeness([m.look for m in known])
    places = list(range(len(known)))
    loners = [p for p in places if known[p].side is None and _unlike(high[p])]
    strays: list[int] = []
    sides, sure = _best(known, low, may_be_one)
    if loners and len(loners) + 4 <= len(places):  # both views may be there without them
        rest = [p for p in places if p not in loners]
        parts, clear = _best([known[p] for p in rest], low[np.ix_(rest, rest)], may_be_one)
        if clear and any(parts):
            places, sides, sure, strays = rest, parts, clear, loners
    front = tuple(order[p] for p, behind in zip(places, sides, strict=True) if not behind)
    back = tuple(order[p] for p, behind in zip(places, sides, strict=True) if behind)
    return Parted(front, back, tuple(order[p] for p in strays), sure)


def _unlike(high: npt.NDArray[np.float64]) -> bool:
    """Whether a photograph is alike to none with which it can be compared."""
    known = high[np.isfinite(high)]
    return bool(known.size and known.max() < _OTHER)


def _best(known: Sequence[Member], low: npt.NDArray[np.float64], may_be_one: bool) -> tuple[list[bool], bool]:
    """For each photograph whether it is the back's, and whether that is clear."""
    count = len(known)
    named = _by_name(known)
    if named is not None:
        return named, True
    ways = [[place >= k for place in range(count)] for k in range(1, count)]
    ways += [way for way in (_by_camera(known), _by_view(low)) if way is not None]
    told = {m.side for m in known} - {None}
    if len(told) == 2:
        ways.append([m.side == BACK for m in known])
    points = [(_points(known, low, way), place, way) for place, way in enumerate(ways)]
    if may_be_one or count < 2:
        points.append((_points(known, low, [False] * count), -1, [False] * count))
    best, _, way = max(points, key=lambda p: (p[0], -p[1]))
    return _labelled(known, way), best > _PARTED or len(told) == 2


def _labelled(known: Sequence[Member], way: list[bool]) -> list[bool]:
    """The first part is the front unless a person named most otherwise; who was put somewhere is there."""
    turned = [not b for b in way]
    told = [(m.side == BACK) == b for m, b in zip(known, way, strict=True) if m.side is not None]
    chosen = turned if way and way[0] and not all(way) else way
    if 2 * len(told) >= len(known) and 2 * sum(told) != len(told):  # not only single ones that were moved
        chosen = way if 2 * sum(told) > len(told) else turned
    return [m.side == BACK if m.side else b for m, b in zip(known, chosen, strict=True)]


def _points(known: Sequence[Member], low: npt.NDArray[np.float64], way: list[bool]) -> float:
    back = np.array(way)
    told = [(m.side == BACK) == b for m, b in zip(known, way, strict=True) if m.side is not None]
    agreed = _AGREED * max(sum(told), len(told) - sum(told)) / max(len(told), 1)
    if not back.any() or back.all():
        if {m.side for m in known} >= {FRONT, BACK}:
            return _FORBIDDEN
        weakest = _weakest(low)
        return agreed + (_PARTED if np.isnan(weakest) else weakest - _SAME_VIEW)
    total = agreed
    across = low[np.ix_(~back, back)]
    if np.isfinite(across).any():
        total += _SAME_VIEW - float(np.nanmax(across))
        inside = [_weakest(low[np.ix_(own, own)]) for own in (back, ~back)]
        total += sum(min(w - _SAME_VIEW, 0.0) for w in inside if not np.isnan(w))
    if min(back.sum(), (~back).sum()) == 1 and len(back) > 2:
        total -= _ALONE
    return total + _pause(known, back) + _ladder(known, back) + _cameras(known, back)


def _pause(known: Sequence[Member], back: npt.NDArray[np.bool_]) -> float:
    """For a pause at the one change of side that is longer than all others."""
    changes = np.flatnonzero(np.diff(back.astype(int)))
    timed = all(m.facts.taken is not None for m in known)
    if len(changes) != 1:  # to and fro
        return -_PAUSE if timed else -_PAUSE / 3
    if not timed:
        return 0.0
    gaps = np.diff([m.facts.taken or 0.0 for m in known])
    here = float(gaps[changes[0]])
    others = np.delete(gaps, changes[0])
    longest = float(others.max()) if len(others) else 1.0
    if here >= max(2 * longest, _TURNING):
        return _PAUSE
    return -_PAUSE if here < max(longest / 2, _TURNING / 2) else 0.0


def _ladder(known: Sequence[Member], back: npt.NDArray[np.bool_]) -> float:
    """For exposures that are repeated, or that begin again from the other end."""
    told = all(m.ev is not None for m in known)
    values = np.array([m.ev if told else m.look.brightness for m in known], np.float64)
    front_values, back_values = values[~back], values[back]
    if len(front_values) == len(back_values) > 1:
        a, b = np.sort(front_values), np.sort(back_values)
        a, b = a - np.median(a), b - np.median(b)
        if np.ptp(a) > 0.5 and np.abs(a - b).max() < (0.35 if told else 1.0):
            return _REPEATED if told else _LOOKS_REPEATED
    ways = [_way(v) for v in (front_values, back_values)]
    together = _way(np.concatenate([front_values, back_values]))
    return _LOOKS_REPEATED / 2 if ways[0] and ways[0] == ways[1] and together == 0 else 0.0


def _way(values: npt.NDArray[np.float64]) -> int:
    """1 for a rising sequence, −1 for a falling one, 0 for none."""
    steps = np.diff(values)
    if len(steps) and (steps > 0.2).all():
        return 1
    return -1 if len(steps) and (steps < -0.2).all() else 0


def _cameras(known: Sequence[Member], back: npt.NDArray[np.bool_]) -> float:
    way = _by_camera(known)
    return 1.0 if way is not None and (way == list(back) or way == list(~back)) else 0.0


def _by_name(known: Sequence[Member]) -> list[bool] | None:
    """Where every file's name says front or back (or rear), and none was put elsewhere."""
    found = []
    for member in known:
        words = set(re.findall(r"[a-z]+", Path(member.facts.name).stem.lower()))
        says = {FRONT: "front" in words, BACK: bool(words & {"back", "rear"})}
        if says[FRONT] == says[BACK]:
            return None
        found.append(member.side == BACK if member.side else says[BACK])
    return found


def _by_camera(known: Sequence[Member]) -> list[bool] | None:
    names = [f"{m.facts.camera} {m.facts.lens}" for m in known]
    kinds = sorted(set(names), key=names.index)
    if len(kinds) != 2 or not all(m.facts.camera for m in known):
        return None
    return [name == kinds[1] for name in names]


def _likeness(looks: Sequence[Look]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Bounds of the likeness of every two, (n, n) each, NaN where nothing is known."""
    count = len(looks)
    low, high = np.full((count, count), np.nan), np.full((count, count), np.nan)
    for i in range(count):
        for j in range(i):
            low[i, j], high[i, j] = low[j, i], high[j, i] = alike(looks[i], looks[j])
    return low, high


def _links(low: npt.NDArray[np.float64]) -> list[tuple[float, int, int]]:
    """The strongest links that join all that can be joined (Kruskal), strongest first."""
    count = len(low)
    group = list(range(count))
    made = []
    pairs = [(low[i, j], i, j) for i in range(count) for j in range(i) if np.isfinite(low[i, j])]
    for strength, i, j in sorted(pairs, key=lambda p: -p[0]):
        if group[i] != group[j]:
            old, new = group[i], group[j]
            group = [new if g == old else g for g in group]
            made.append((float(strength), i, j))
    return made


def _weakest(low: npt.NDArray[np.float64]) -> float:
    links = _links(low)
    return links[-1][0] if links else float("nan")


def _by_view(low: npt.NDArray[np.float64]) -> list[bool] | None:
    """Cut at the weakest of the strongest links; what is alike to none goes with its neighbour in time."""
    links = _links(low)
    if not links:
        return None
    count = len(low)
    group = list(range(count))
    for _, i, j in links[:-1]:
        old, new = group[i], group[j]
        group = [new if g == old else g for g in group]
    first, second = (group[i] for i in links[-1][1:])
    sorted_out = [g in (first, second) for g in group]
    made = []
    for place in range(count):
        near = min((k for k in range(count) if sorted_out[k]), key=lambda k: (abs(k - place), k))
        made.append(group[near] == second)
    return [not b for b in made] if made[0] else made
