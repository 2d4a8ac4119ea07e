"""Parameters as data: ranges, units and labels beside the value.

A `Params` class is a frozen dataclass whose fields are made with `param`. The window builds its forms
from the metadata, the command line parses `key=value` with it, and scripts read the same text.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from studio_core.errors import InputError

Colour = tuple[float, float, float]
Value = float | int | bool | str | Colour
Kind = Literal["number", "integer", "flag", "choice", "colour", "text"]


@dataclass(frozen=True)
class ParamInfo:
    """What a form, a parser and a reader need to know of one parameter.

    `low`/`high` bound the value (inclusive), `scale` says how a slider moves, `unit` is shown after the
    number, `advanced` hides it in the short form.
    """

    kind: Kind
    label: str
    doc: str = ""
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    scale: Literal["linear", "log"] = "linear"
    choices: tuple[str, ...] = ()
    advanced: bool = False


def param(default: Any, label: str, doc: str = "", **info: Any) -> Any:
    """A dataclass field with `ParamInfo`; the kind follows from the default's type."""
    kind: Kind
    if "choices" in info:
        kind = "choice"
    elif isinstance(default, bool):
        kind = "flag"
    elif isinstance(default, int):
        kind = "integer"
    elif isinstance(default, float):
        kind = "number"
    elif isinstance(default, tuple):
        kind = "colour"
    else:
        kind = "text"
    return dataclasses.field(default=default, metadata={"param": ParamInfo(kind, label, doc, **info)})


def param_infos(params: type) -> dict[str, ParamInfo]:
    """The parameters of a dataclass by field name, in order; fields without metadata are left out."""
    return {f.name: f.metadata["param"] for f in dataclasses.fields(params) if "param" in f.metadata}


def defaults(params: type) -> dict[str, Value]:
    """Default value of every parameter."""
    found: dict[str, Any] = {f.name: f.default for f in dataclasses.fields(params) if "param" in f.metadata}
    return found


def check(name: str, info: ParamInfo, value: object) -> Value:
    """`value` in the parameter's own type, or InputError when it does not fit its range."""
    try:
        match info.kind:
            case "flag":
                if not isinstance(value, bool):
                    raise ValueError("expected true or false")
                return value
            case "choice":
                if value not in info.choices:
                    raise ValueError(f"choose one of {', '.join(info.choices)}")
                return str(value)
            case "text":
                return str(value)
            case "colour":
                red, green, blue = (_number(info, v) for v in value)  # type: ignore[attr-defined]
                return (red, green, blue)
            case "integer":
                number = _number(info, value)
                if number != int(number):
                    raise ValueError("expected a whole number")
                return int(number)
            case _:
                return _number(info, value)
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(f"{name} = {value!r} does not fit: {error}") from None


def _number(info: ParamInfo, value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("not a finite number")
    if not info.low <= number <= info.high:
        raise ValueError(f"expected {info.low:g} to {info.high:g}{' ' + info.unit if info.unit else ''}")
    return number


def nearest(info: ParamInfo, value: Any) -> Any:
    """The value of the parameter's own type that is in its range and nearest to `value`."""
    match info.kind:
        case "number" | "integer":
            return min(max(value, info.low), info.high)
        case "colour":
            return tuple(min(max(v, info.low), info.high) for v in value)
        case _:
            return value


def parse(name: str, info: ParamInfo, text: str) -> Value:
    """A value from the command line's text (`0.5`, `true`, `0.8/0.2/0.1` or `#c83214` for colours)."""
    match info.kind:
        case "flag":
            flags = {"true": True, "yes": True, "on": True, "1": True}
            flags |= {"false": False, "no": False, "off": False, "0": False}
            if text.lower() not in flags:
                raise InputError(f"{name} = {text!r} does not fit: expected true or false")
            return flags[text.lower()]
        case "colour":
            return check(name, info, parse_colour(name, text))
        case _:
            return check(name, info, text)


def parse_colour(name: str, text: str) -> Colour:
    """Scene-linear RGB from `r/g/b`, one number, or an sRGB `#rrggbb`."""
    try:
        if text.startswith("#") and len(text) == 7:
            bytes_ = [int(text[i : i + 2], 16) / 255 for i in (1, 3, 5)]
            red, green, blue = (b / 12.92 if b <= 0.04045 else ((b + 0.055) / 1.055) ** 2.4 for b in bytes_)
            return (red, green, blue)
        parts = [float(part) for part in text.split("/")]
        if len(parts) == 1:
            parts *= 3
        red, green, blue = parts
        return (red, green, blue)
    except ValueError:
        raise InputError(f"{name} = {text!r} is no colour: write r/g/b (linear) or #rrggbb") from None


def build(params: type, values: Mapping[str, object]) -> Any:
    """An instance of `params` from checked `values`; unknown names raise InputError."""
    infos = param_infos(params)
    for name in values:
        if name not in infos:
            raise InputError(f"there is no parameter {name!r}; known: {', '.join(infos) or 'none'}")
    return params(**{name: check(name, infos[name], value) for name, value in values.items()})
