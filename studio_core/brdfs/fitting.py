"""The parameters with which a reflectance model comes nearest to a measurement.

Minimised is the mean square of ln(1 + cos θ_i f) − ln(1 + cos θ_i f_measured) over samples and channels, the
compressive, cosine-weighted metric of Löw et al. ("BRDF Models for Accurate and Efficient Rendering of
Glossy Surfaces", ACM TOG 31(1), 2012): plain squares see nothing but the highlight. Samples of a table are
its cells, which lie closer the nearer they are to the highlight's middle; so a sharp one counts as well
(`studio_core.brdfs.samples.of_table`).

Any model of the registry can be fitted: parameters, their ranges and scales come from its `Params`, which of
them change the kernels is found by asking. Kernels are needed again only for those; for each of many of
their settings all other parameters are fitted first, on some of the samples, and from the best few everything
is refined together (bounded trust-region least squares, scipy's `least_squares`).
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.brdfs.albedo import flat_coefficients
from studio_core.brdfs.samples import Difference, Samples, by_angle, compressed, difference, predicted
from studio_core.contract import Brdf
from studio_core.errors import InputError
from studio_core.kernels.pairs import evaluate_pairs
from studio_core.params import ParamInfo, Value, defaults, param_infos
from studio_core.scene.nodes import Material, new_id
from studio_core.shading.job import Job

F64 = npt.NDArray[np.float64]

STARTS = 48
"""Settings of the shape that are tried, for each choice of flags and lists."""
REFINED = 4
FEWER = 1200
"""Samples while starts are compared."""
MOST_CHOICES = 8
STEP = 1e-3
EXACT = 1e-5
"""Metric below which no other start can be better."""


@dataclass(frozen=True)
class Fit:
    """A model's best values for a measurement, and how far it stays from it.

    `by_view` and `by_half` are differences by the angle seen from and by that of the half vector, in degrees.
    `second` is the metric of the next best start: about the same where many starts ended at the same place.
    """

    model: str
    values: Mapping[str, Value]
    difference: Difference
    by_view: Mapping[str, Difference]
    by_half: Mapping[str, Difference]
    second: float

    def material(self, name: str, like: Material | None = None) -> Material:
        """A new material, or `like` with this model and these values; its tables are kept."""
        changes = {"name": name, "model": self.model, "values": frozen_map(self.values)}
        if like is None:
            return Material(id=new_id("material"), **changes)  # type: ignore[arg-type]
        return dataclasses.replace(like, **changes)  # type: ignore[arg-type]

    def report(self) -> dict[str, Any]:
        """Everything as plain values."""

        def plain(parts: Mapping[str, Difference]) -> dict[str, Any]:
            return {name: dataclasses.asdict(part) for name, part in parts.items()}

        return {
            "model": self.model,
            "values": {k: list(v) if isinstance(v, tuple) else v for k, v in self.values.items()},
            **dataclasses.asdict(self.difference),
            "second_metric": self.second,
            "by_view_degrees": plain(self.by_view),
            "by_half_degrees": plain(self.by_half),
        }


@dataclass(frozen=True)
class _Knob:
    """A number that is fitted, as a slider shows it: 0…1."""

    name: str
    info: ParamInfo
    channel: int | None
    shapes: bool

    def value(self, fraction: float) -> float:
        low, high = self.info.low, self.info.high
        if self.info.scale == "log" and low > 0:
            return min(max(float(low * (high / low) ** fraction), low), high)
        return min(max(low + fraction * (high - low), low), high)

    def fraction(self, value: float) -> float:
        low, high = self.info.low, self.info.high
        if high <= low:
            return 0.0
        if self.info.scale == "log" and low > 0:
            return float(np.clip(np.log(max(value, low) / low) / np.log(high / low), 0, 1))
        return float(np.clip((value - low) / (high - low), 0, 1))


class _Problem:
    """Samples, model, and the parameters that are not fitted."""

    def __init__(
        self, brdf: Brdf, samples: Samples, base: Mapping[str, Value], knobs: Sequence[_Knob]
    ) -> None:
        self.brdf, self.samples, self.base, self.knobs = brdf, samples, base, tuple(knobs)
        self.cosine = samples.cosine
        self.target = compressed(samples.values, self.cosine)
        self._root = np.sqrt(samples.weight / samples.weight.sum() / 3)[:, None]

    def values(self, x: F64) -> dict[str, Value]:
        made: dict[str, Any] = dict(self.base)
        for knob, fraction in zip(self.knobs, x, strict=True):
            value = knob.value(float(fraction))
            if knob.channel is None:
                made[knob.name] = value
            else:
                colour = list(made[knob.name])
                colour[knob.channel] = value
                made[knob.name] = tuple(colour)
        return made

    def terms(self, x: F64) -> F64:
        shape = np.atleast_1d(np.asarray(self.brdf.shape(self.values(x)), np.float32))
        return evaluate_pairs(self.brdf, shape, self.samples.wo, self.samples.wi).astype(np.float64)

    def residual(self, x: F64, terms: F64 | None = None) -> F64:
        found = (self.terms(x) if terms is None else terms) @ flat_coefficients(self.brdf, self.values(x))
        return np.asarray(((compressed(found, self.cosine) - self.target) * self._root).ravel())

    def solve(self, x: F64, free: Sequence[int], most: int, exact: bool = False) -> tuple[float, F64]:
        """Metric and place of the best values of `free` knobs from `x` on."""
        from scipy.optimize import least_squares

        shaping = [n for n in free if self.knobs[n].shapes]
        known = None if shaping else self.terms(x)
        index = np.array(free, np.int64)

        def whole(part: F64) -> F64:
            made = x.copy()
            made[index] = part
            return made

        def residual(part: F64) -> F64:
            return self.residual(whole(part), known)

        def slopes(part: F64) -> F64:
            """Central differences: kernels are float32, so steps must not be small."""
            here = whole(part)
            terms = self.terms(here) if known is None else known
            columns = []
            for n in free:
                low, high = here.copy(), here.copy()
                step = STEP * max(here[n], 0.02)
                low[n], high[n] = max(here[n] - step, 0.0), min(here[n] + step, 1.0)
                kept = None if self.knobs[n].shapes else terms
                rise = self.residual(high, kept) - self.residual(low, kept)
                columns.append(rise / (high[n] - low[n]))
            return np.stack(columns, axis=1)

        if not free:
            return float(np.linalg.norm(self.residual(x, known))), x
        tolerance = 1e-12 if exact else 1e-5
        start = np.clip(x[index], 1e-6, 1 - 1e-6)
        done = least_squares(
            residual, start, slopes, (0.0, 1.0), max_nfev=most, ftol=tolerance, xtol=tolerance, gtol=1e-12
        )
        return float(np.sqrt(2 * done.cost)), whole(np.asarray(done.x, np.float64))


def fit(
    brdf: Brdf,
    samples: Samples,
    fixed: Mapping[str, Value] | None = None,
    job: Job | None = None,
    starts: int = STARTS,
) -> Fit:
    """The best values of a model for measured samples; parameters in `fixed` keep theirs.

    Flags and lists are tried one by one where they make at most 8 combinations, else they keep their default.
    Raises InputError when there is nothing to fit to, Cancelled by the job.
    """
    if len(samples) < 8 or not samples.values.any():
        raise InputError("there is nothing to fit to: the measurement has no light or hardly any samples")
    fixed = fixed or {}
    found: list[tuple[float, F64, _Problem]] = []
    combinations = _choices(brdf, fixed)
    for base in combinations:
        knobs = _knobs(brdf, base, fixed)
        few, every = (_Problem(brdf, s, base, knobs) for s in (samples.some(FEWER), samples))
        tried = []
        for x, free in _starts(few, starts):
            if job is not None:
                job.checkpoint()
            tried.append(few.solve(x, free, 12))
        tried.sort(key=lambda one: one[0])
        for _, x in _apart(tried, REFINED):
            if job is not None:
                job.checkpoint()
            found.append((*every.solve(x, range(len(knobs)), 200, exact=True), every))
            if min(found, key=lambda one: one[0])[0] < EXACT:
                break
    found.sort(key=lambda one: one[0])
    _, x, problem = found[0]
    values = _whole(problem.values(x), brdf)
    made = predicted(brdf, values, samples)
    views, halves = by_angle(made, samples)
    return Fit(
        brdf.id,
        frozen_map(values),
        difference(made, samples),
        frozen_map(views),
        frozen_map(halves),
        found[1][0] if len(found) > 1 else found[0][0],
    )


def _choices(brdf: Brdf, fixed: Mapping[str, Value]) -> list[dict[str, Value]]:
    start = {**defaults(brdf.Params), **fixed}
    lists: dict[str, tuple[Value, ...]] = {}
    for name, info in param_infos(brdf.Params).items():
        if name in fixed:
            continue
        if info.kind == "flag":
            lists[name] = (False, True)
        elif info.kind == "choice":
            lists[name] = info.choices
    count = int(np.prod([len(values) for values in lists.values()], dtype=np.int64))
    if count > MOST_CHOICES:
        return [start]
    return [start | dict(zip(lists, chosen, strict=True)) for chosen in itertools.product(*lists.values())]


def _knobs(brdf: Brdf, base: Mapping[str, Value], fixed: Mapping[str, Value]) -> list[_Knob]:
    known, made = brdf.shape(base), []
    for name, info in param_infos(brdf.Params).items():
        if name in fixed or info.kind not in ("number", "integer", "colour"):
            continue
        if not (np.isfinite(info.low) and np.isfinite(info.high) and info.high > info.low):
            continue
        channels: tuple[int | None, ...] = (0, 1, 2) if info.kind == "colour" else (None,)
        knob = _Knob(name, info, channels[0], False)
        probes = [knob.value(f) for f in (0, 0.37, 1)]
        trial = [(v, v, v) if info.kind == "colour" else v for v in probes]
        shapes = any(not np.array_equal(brdf.shape({**base, name: v}), known) for v in trial)
        made += [_Knob(name, info, channel, shapes) for channel in channels]
    return made


def _starts(problem: _Problem, count: int) -> list[tuple[F64, list[int]]]:
    """Places to begin at and the knobs to turn there: many shapes, each with matte and with shiny colours."""
    from scipy.stats import qmc

    knobs = problem.knobs
    shaping = [n for n, knob in enumerate(knobs) if knob.shapes]
    rest = [n for n in range(len(knobs)) if n not in shaping]
    if not shaping:
        points = np.zeros((1, 0))
    elif len(shaping) == 1:
        points = ((np.arange(count) + 0.5) / count)[:, None]
    else:
        points = qmc.Halton(len(shaping), seed=0).random(count)
    half = len(points) // 2
    points[:half] = points[:half] ** 2  # sharp highlights lie close together on most sliders
    matte = np.clip(np.median(problem.samples.values, axis=0) * np.pi, 0.02, 0.98)
    bright = problem.samples.values[np.argsort(problem.samples.values.sum(axis=1))[-20:]].mean(axis=0)
    hue = np.clip(bright / max(float(bright.max()), 1e-9), 0.02, 0.98)
    made = []
    for point in points:
        for colour, other in ((matte, None), (hue, 0.9)):
            x = np.zeros(len(knobs))
            for n, knob in enumerate(knobs):
                start: Any = problem.base[knob.name]
                if knob.channel is not None:
                    x[n] = knob.fraction(float(colour[knob.channel]))
                else:
                    x[n] = knob.fraction(float(start)) if other is None else other
            x[shaping] = point
            made.append((x, rest))
    return made


def _apart(tried: Sequence[tuple[float, F64]], count: int) -> list[tuple[float, F64]]:
    """The best, no two of which are neighbours."""
    made: list[tuple[float, F64]] = []
    for metric, x in tried:
        if all(np.abs(x - other).max(initial=0) > 0.03 for _, other in made):
            made.append((metric, x))
        if len(made) == count:
            break
    return made


def _whole(values: Mapping[str, Value], brdf: Brdf) -> dict[str, Value]:
    infos = param_infos(brdf.Params)
    return {
        name: round(value) if infos[name].kind == "integer" and isinstance(value, float) else value
        for name, value in values.items()
    }
