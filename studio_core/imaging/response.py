"""A camera's response and the true exposures of its brackets, measured on the brackets themselves.

Listed exposures are a prior only. Whether *all* of them are wrong by one factor cannot be told: a curve with
another exponent then explains the same pictures (docs/capture.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Bracket, Exposures, Motion, Response
from studio_core.errors import InputError
from studio_core.imaging.curve_fit import FEWEST, Fit, Sample, fit, linked
from studio_core.imaging.curve_spline import basis, usual_scale
from studio_core.imaging.exposure_check import compared, shared_scale
from studio_core.imaging.levels import Levels, find_levels
from studio_core.imaging.projection import Circle, Lens
from studio_core.imaging.sensor_noise import fit_noise
from studio_core.imaging.tiles import Tiles, choose, look_up
from studio_core.shading.job import Job

F64 = npt.NDArray[np.float64]
MEASURED, SRGB, LINEAR, LISTED = "measured", "sRGB", "linear", "listed"
FINE_LEVELS = 4096
"""Of a curve for 16 bit or linear numbers; bytes have 256."""
_APART = 0.3  # EV between the darkest and the brightest exposure from which a curve can be measured


def solve_response(
    brackets: Mapping[str, Bracket],
    motions: Mapping[str, Sequence[Motion]] | None = None,
    lenses: Mapping[str, tuple[Circle, Lens | None]] | None = None,
    *,
    response: str = MEASURED,
    exposures: str = MEASURED,
    job: Job | None = None,
) -> tuple[Response, dict[str, Exposures]]:
    """One curve for all brackets, which are of one camera, and each bracket's exposures.

    `motions`: of each bracket's shots, in their order; `lenses`: circle and lens of brackets behind a
    fisheye. `response`: "measured", "sRGB" or "linear"; `exposures`: "measured" or "listed". What cannot be
    measured is assumed, which `Response.notes` tells. InputError when photographs do not fit together.
    """
    job = job or Job("response")
    motions, lenses = motions or {}, lenses or {}
    frames = {side: _numbers(bracket, brackets) for side, bracket in brackets.items()}
    steps = sum(len(f) for f in frames.values()) + 3
    everything = [frame for part in frames.values() for frame in part]
    levels = find_levels(everything, [ev for b in brackets.values() for ev in b.listed])
    done = 1
    job.checkpoint(done, steps)
    tiles: dict[str, Tiles] = {}
    for side, part in frames.items():
        circle, lens = lenses.get(side, (None, None))
        still = motions.get(side) or [Motion()] * len(part)
        tiles[side] = look_up(part, still, levels, circle, lens)
        done += len(part)
        job.checkpoint(done, steps)
    kind = next(iter(brackets.values())).shots[0].kind
    count = 256 if kind == "8 bit" else FINE_LEVELS
    rounding = 0.0 if kind == "linear" else 1 / 12 / levels.top**2
    samples = {side: _sample(brackets[side], tiles[side], levels, rounding) for side in brackets}
    curve = _assumed(LINEAR if kind == "linear" else response, levels, count)
    notes: list[str] = []
    measure = kind != "linear" and response == MEASURED
    if measure and not _tells(samples):
        measure = False
        notes.append(
            "The response curve is assumed to be sRGB's: there are no two exposures of the same thing "
            "to measure it on."
        )
    known = None if measure else _relative(curve, levels)
    made = fit(list(samples.values()), known, exposures == MEASURED)
    job.checkpoint(steps - 1, steps)
    if measure:
        scale = 1.0
        if exposures == MEASURED:
            scale, note = _scale(made, samples)
            notes += note
        curve = _levels_of(made, scale, levels, count)
        made = replace(
            made, evs=tuple(e * scale for e in made.evs), tints=tuple(t * scale for t in made.tints)
        )
    found = {}
    for (side, bracket), evs, tints in zip(brackets.items(), made.evs, made.tints, strict=True):
        names = [shot.facts.name for shot in bracket.shots]
        order = np.argsort(np.asarray(bracket.listed), kind="stable")
        found[side] = _exposures(bracket, samples[side], evs, tints, [names[i] for i in order], order)
    answer = Response(
        curve, levels.top, levels.black, levels.white, (0.0, 0.0, 0.0), measure, made.rms,
        kind == "linear" or (response == LINEAR),
        tuple(notes),
    )  # fmt: skip
    job.checkpoint(steps, steps)
    least = max(rounding, float(np.mean(made.extra**2)))
    return replace(answer, noise=_noise(answer, list(tiles.values()), least)), found


def _numbers(bracket: Bracket, brackets: Mapping[str, Bracket]) -> list[npt.NDArray[Any]]:
    first = next(iter(brackets.values())).shots[0]
    for shot in bracket.shots:
        if shot.pixels.shape != bracket.shots[0].pixels.shape:
            raise InputError(
                f"{shot.facts.name} is {shot.size[0]} × {shot.size[1]} pixels, and "
                f"{bracket.shots[0].facts.name} of the same bracket "
                f"{bracket.shots[0].size[0]} × {bracket.shots[0].size[1]}"
            )
        if shot.kind != first.kind:
            raise InputError(
                f"{shot.facts.name} has {shot.kind} numbers and {first.facts.name} {first.kind} ones: "
                "they cannot share a response curve"
            )
    return [shot.pixels for shot in bracket.shots]


def _sample(bracket: Bracket, tiles: Tiles, levels: Levels, rounding: float) -> Sample:
    """The chosen places of one bracket, dark to bright."""
    order = np.argsort(np.asarray(bracket.listed), kind="stable")
    some = tiles.chosen(choose(tiles))
    black, white = (np.asarray(v) / levels.top for v in (levels.black, levels.white))
    number = (some.number - black) / (white - black)
    # a hand's rest of motion, the mean's noise, and what rounding leaves where noise does not spread it
    spread = np.sqrt(some.variance / some.size**2 + (0.3 * some.slant) ** 2 + rounding / 4)
    # a number that noise could make of nothing says nothing, and its logarithm much
    clear = some.number - black > np.maximum(4 * spread, 1.5 / 255)
    fair = some.fair & clear & (number < 1)
    return Sample(
        number[order], (spread / (white - black))[order], fair[order],
        np.asarray(bracket.listed, np.float64)[order], np.asarray(bracket.certain, np.bool_)[order],
    )  # fmt: skip


def _tells(samples: Mapping[str, Sample]) -> bool:
    """Whether any bracket shows enough places in exposures that differ."""
    for s in samples.values():
        for dark in range(len(s.listed) - 1):
            for bright in range(dark + 1, len(s.listed)):
                both = s.fair[dark] & s.fair[bright]
                if np.count_nonzero(both) < 3 * FEWEST:
                    continue
                rough = 2.2 * np.median(np.log2(s.number[bright][both] / s.number[dark][both]))
                if abs(rough) > _APART:
                    return True
    return False


def _assumed(which: str, levels: Levels, count: int) -> F64:
    """(3, count) of a curve that is known, over black … white."""
    number = np.linspace(0, 1, count)
    made = np.empty((3, count))
    for c in range(3):
        black = levels.black[c] / levels.top
        x = np.maximum((number - black) / (1 - black), 0.0)
        light = x if which == LINEAR else np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
        made[c] = _logs(light)
    return made


def _logs(light: F64) -> F64:
    """log2, 0 at the middle level; levels without light keep falling by one a level."""
    first = int(np.argmax(light > 0))
    made = np.empty(len(light))
    made[first:] = np.log2(light[first:])
    made[:first] = made[first] - np.arange(first, 0, -1)
    return made - np.interp(0.5, np.linspace(0, 1, len(light)), made)


def _relative(curve: F64, levels: Levels) -> F64:
    """The curve over 0 … 1 between black and white of each channel, fine enough for the dark end."""
    at = np.linspace(0, 1, 16384)
    number = np.linspace(0, 1, curve.shape[1])
    made = np.empty((3, len(at)))
    for c in range(3):
        black, white = levels.black[c] / levels.top, levels.white[c] / levels.top
        made[c] = np.log2(
            np.maximum(np.interp(black + at * (white - black), number, np.exp2(curve[c])), 1e-12)
        )
    return made


def _scale(made: Fit, samples: Mapping[str, Sample]) -> tuple[float, list[str]]:
    """What brings solved steps to listed ones, or else the curve to sRGB's."""
    some = list(samples.values())
    seen = [linked(s) for s in some]
    assert made.curve is not None
    usual = usual_scale(made.curve)
    scale = shared_scale(made.evs, [s.listed for s in some], [s.certain for s in some], seen, usual)
    if scale is None:
        return usual, [
            "No listed step says how far the exposures are apart: as far as gives an ordinary camera's curve."
        ]
    if not any((s.certain[1:] & s.certain[:-1] & link).any() for s, link in zip(some, seen, strict=True)):
        return scale, [
            "How far the exposures are apart is a guess, and with it how much brighter lamps are than walls: "
            "type the exposures where you know them."
        ]
    return scale, []


def _levels_of(made: Fit, scale: float, levels: Levels, count: int) -> F64:
    """The spline at the levels; beyond black and white it goes on, rising."""
    assert made.curve is not None
    number = np.linspace(0, 1, count)
    curve = np.empty((3, count))
    for c in range(3):
        black, white = levels.black[c] / levels.top, levels.white[c] / levels.top
        x = (number - black) / (white - black)
        inside = (x > 0) & (x <= 1)
        own = scale * (basis(x[inside]) @ made.curve[c])
        first, last = np.flatnonzero(inside)[[0, -1]]
        curve[c, inside] = own
        curve[c, :first] = own[0] - np.arange(first, 0, -1)
        curve[c, last + 1 :] = own[-1] + (own[-1] - own[-2]) * np.arange(1, count - last)
        curve[c] -= np.interp(0.5, number, curve[c])
    return curve


def _exposures(
    bracket: Bracket, sample: Sample, evs: F64, tints: F64, names: list[str], order: npt.NDArray[Any]
) -> Exposures:
    """In the order of the bracket's shots."""
    sorted_one, solved = compared(evs, sample.listed, sample.certain, names)
    place = np.argsort(order)
    return replace(
        sorted_one,
        listed=tuple(float(e) for e in bracket.listed),
        solved=tuple(float(e) for e in solved[place]),
        wrong=tuple(sorted(int(order[i]) for i in sorted_one.wrong)),
        tints=tuple((float(t[0]), float(t[1]), float(t[2])) for t in (tints - tints.mean(axis=0))[place]),
    )


def _noise(response: Response, tiles: Sequence[Tiles], rounding: float) -> tuple[float, float, float]:
    number = np.linspace(0, 1, response.curve.shape[1])

    def exposure(at: F64, channel: int) -> F64:
        return np.asarray(np.interp(at, number, np.exp2(response.curve[channel])), np.float64)

    return fit_noise(tiles, exposure, rounding)
