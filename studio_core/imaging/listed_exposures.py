"""What is listed about exposures: the prior from which the true ones are solved.

Time × ISO / aperture² where photographs tell it and it is not plainly untrue; else the exposure correction;
else equal steps in the order of brightness. What a person typed stands above all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from studio_core.imaging.photograph import ShotFacts

_SAME = 0.1  # EV
_BRIGHTER = 0.7  # stops between pictures whose exposures cannot be equal
_TOLD, _CORRECTION, _STEPS = "told", "correction", "steps"


@dataclass(frozen=True)
class Exposed:
    """One photograph: facts, log2 of its mean light, and the EV that a person typed."""

    facts: ShotFacts
    brightness: float
    typed: float | None = None


@dataclass(frozen=True)
class Listed:
    """EV of each shot of a side, whether it is known (else guessed), and sentences."""

    evs: tuple[float, ...]
    certain: tuple[bool, ...]
    notes: tuple[str, ...] = ()


def listed_exposures(sides: Mapping[str, Sequence[Exposed]], step: float) -> dict[str, Listed]:
    """What is listed for each side.

    Where photographs tell their exposure, both sides have one origin, the median of all; else each side's
    median is 0. `step`: EV between exposures of which nothing is known.
    """
    found = {name: _side(name, shots, step) for name, shots in sides.items()}
    told = [ev for _, listed in found.values() for ev, sure in zip(*listed[:2], strict=True) if sure]
    common = all(how == _TOLD for how, _ in found.values())
    made = {}
    for name, (_, (evs, sure, notes)) in found.items():
        origin = float(np.median(told if common and told else evs))
        values = [ev - origin for ev in evs]
        typed = [shot.typed for shot in sides[name]]
        values = [v if t is None else t for v, t in zip(values, typed, strict=True)]
        certain = [s or t is not None for s, t in zip(sure, typed, strict=True)]
        if all(t is not None for t in typed):
            notes = []
        made[name] = Listed(tuple(values), tuple(certain), tuple(notes))
    return made


def completed(shots: Sequence[ShotFacts]) -> list[ShotFacts]:
    """With the ISO and the aperture that all others of the side share, where one shot lacks it.

    Where the others differ among themselves, a shot that lacks it tells no exposure.
    """
    made = list(shots)
    for name in ("iso", "aperture"):
        values = {getattr(f, name) for f in made} - {None}
        if len(values) == 1:
            made = [replace(f, **{name: next(iter(values))}) for f in made]
        elif len(values) > 1:
            made = [f if getattr(f, name) is not None else replace(f, seconds=None) for f in made]
    return made


def _side(
    name: str, shots: Sequence[Exposed], step: float
) -> tuple[str, tuple[list[float], list[bool], list[str]]]:
    evs = [facts.ev for facts in completed([s.facts for s in shots])]
    biases = [s.facts.bias for s in shots]
    bright = [s.brightness for s in shots]
    notes: list[str] = []
    known = [ev for ev in evs if ev is not None]
    same = len(known) > 1 and np.ptp(known) < _SAME
    if len(known) == len(evs) and not (same and np.ptp(bright) > _BRIGHTER):
        return _TOLD, (known, [True] * len(evs), notes)
    told_biases = [b for b in biases if b is not None]
    if len(told_biases) == len(shots) and (np.ptp(told_biases) > _SAME or not np.ptp(bright) > _BRIGHTER):
        return _CORRECTION, (told_biases, [True] * len(shots), notes)
    if known and not same:
        names = [s.facts.name for s, ev in zip(shots, evs, strict=True) if ev is None]
        notes.append(
            f"{joined(names)} {_do(names)} not tell the exposure; it is guessed from the brightness."
        )
        filled = [ev if ev is not None else _guess(b, evs, bright) for ev, b in zip(evs, bright, strict=True)]
        return _TOLD, (filled, [ev is not None for ev in evs], notes)
    if len(shots) > 1:
        why = (
            "say that all were exposed alike, which their brightness denies"
            if known
            else "do not tell their exposures"
        )
        notes.append(
            f"The photographs of the {name} {why}:"
            f" steps of {step:g} EV are assumed, in the order of brightness."
        )
    return _STEPS, (_steps(bright, step), [False] * len(shots), notes)


def _steps(bright: Sequence[float], step: float) -> list[float]:
    """Equal steps in the order of brightness; what is equally bright is on one."""
    order = np.argsort(bright, kind="stable")
    rungs = np.zeros(len(bright))
    for before, here in pairwise(order):
        rungs[here] = rungs[before] + (bright[here] - bright[before] > min(0.03, step / 20))
    return [float(r) * step for r in rungs]


def _guess(brightness: float, evs: Sequence[float | None], bright: Sequence[float]) -> float:
    """EV of a brightness by those that are told: between them linear, beyond them at their mean slope."""
    pairs = sorted((b, ev) for b, ev in zip(bright, evs, strict=True) if ev is not None)
    at, value = (np.array(v, np.float64) for v in zip(*pairs, strict=True))
    value = np.maximum.accumulate(value)
    steepness = (value[-1] - value[0]) / max(at[-1] - at[0], 1e-6) if len(at) > 1 else 1.0
    slope = float(np.clip(steepness, 0.5, 3.0))
    if brightness < at[0]:
        return float(value[0] + slope * (brightness - at[0]))
    if brightness > at[-1]:
        return float(value[-1] + slope * (brightness - at[-1]))
    return float(np.interp(brightness, at, value))


def joined(names: Sequence[str]) -> str:
    """Names in a sentence."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _do(names: Sequence[str]) -> str:
    return "does" if len(names) == 1 else "do"
