"""The parameters of any reflectance model, walked through from end to end for checks and tables."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np

from studio_core.contract import Brdf
from studio_core.params import ParamInfo, Value, defaults, param_infos


def at_fraction(info: ParamInfo, fraction: float) -> Any:
    """The value that a slider shows at `fraction` of its way; all channels alike in colours."""
    if info.kind == "flag":
        return fraction > 0.5
    if info.kind == "choice":
        return info.choices[round(fraction * (len(info.choices) - 1))]
    if info.scale == "log":
        value = float(np.exp((1 - fraction) * np.log(info.low) + fraction * np.log(info.high)))
        value = min(max(value, info.low), info.high)
    else:
        value = info.low + fraction * (info.high - info.low)
    if info.kind == "integer":
        return round(value)
    return (value, value, value) if info.kind == "colour" else value


def shaping(brdf: Brdf) -> tuple[list[str], list[str]]:
    """Names of the parameters that change the shape, and of the other numbers and colours."""
    infos = {name: info for name, info in param_infos(brdf.Params).items() if info.kind != "text"}
    start = defaults(brdf.Params)
    known = brdf.shape(start)

    def matters(name: str, info: ParamInfo) -> bool:
        tried = [brdf.shape({**start, name: at_fraction(info, f)}) for f in (0.0, 0.37, 1.0)]
        return any(not np.array_equal(shape, known) for shape in tried)

    first = [name for name, info in infos.items() if matters(name, info)]
    return first, [name for name in infos if name not in first]


def shaped(brdf: Brdf, *fractions: float) -> dict[str, Value]:
    """Defaults, with what changes the shape at these fractions of its way, the last one for all the rest.

    Flags stay as they are: they have no way between their ends.
    """
    infos, names = param_infos(brdf.Params), _walked(brdf)
    each = itertools.chain(fractions, itertools.repeat(fractions[-1]))
    made = {name: at_fraction(infos[name], f) for name, f in zip(names, each, strict=False)}
    return {**defaults(brdf.Params), **made}


def _walked(brdf: Brdf) -> list[str]:
    infos = param_infos(brdf.Params)
    return [name for name in shaping(brdf)[0] if infos[name].kind != "flag"]


def shapes(brdf: Brdf, fractions: tuple[float, ...], mixed: int = 0) -> Iterator[dict[str, Value]]:
    """Defaults with the shape at each fraction; and as many mixed ones where it has several parameters."""
    names = _walked(brdf)
    for fraction in fractions if names else fractions[:1]:
        yield shaped(brdf, fraction)
    rng = np.random.default_rng(len(names))
    for _ in range(mixed if len(names) > 1 else 0):
        yield shaped(brdf, *rng.choice([0.0, 1.0, *rng.random(4)], len(names)))


def colour_corners(brdf: Brdf) -> Iterator[dict[str, Value]]:
    """Every combination of least and largest of what does not change the shape."""
    infos, names = param_infos(brdf.Params), shaping(brdf)[1]
    for corner in itertools.product((0.0, 1.0), repeat=len(names)):
        yield {name: at_fraction(infos[name], f) for name, f in zip(names, corner, strict=True)}


__all__ = ["at_fraction", "colour_corners", "shaped", "shapes", "shaping"]
