"""A capture's settings as a JSON file and as `step.name=value`, checked strictly where people write them."""

from __future__ import annotations

import dataclasses
import json
import types
from collections.abc import Sequence
from typing import Any, Union, get_args, get_origin, get_type_hints

from studio_core.capturing.settings import CaptureSettings
from studio_core.errors import InputError, ProjectError
from studio_core.params import check, param_infos, parse
from studio_core.project.canonical import loads
from studio_core.project.fields import Record


def settings_to_json(settings: CaptureSettings) -> str:
    """All settings as readable JSON text, one object a step."""
    made = Record(CaptureSettings).write(settings, None, "the settings")
    return json.dumps(made, indent=1, ensure_ascii=False) + "\n"


def settings_from_json(text: str, name: str = "the settings") -> CaptureSettings:
    """The settings of a JSON text; what it leaves out is as by default.

    InputError, one sentence that begins with `name`, for names that there are not, for values out of their
    range and for what is no JSON.
    """
    try:
        return _read(loads(text, name), name)
    except ProjectError as error:
        raise InputError(str(error)) from None


def with_values(settings: CaptureSettings, assignments: Sequence[str]) -> CaptureSettings:
    """`settings` changed by texts such as `lens.fov=195`, `lens.front=1503,998,930` or `stitch.level=no`.

    Values of several parts have commas between; `none` is what the program finds itself. InputError names
    the text that does not fit.
    """
    made = Record(CaptureSettings).write(settings, None, "the settings")
    steps = get_type_hints(CaptureSettings)
    for text in assignments:
        place, equals, value = text.partition("=")
        step, _, name = place.strip().partition(".")
        if not equals or not name:
            raise InputError(f"{text!r}: write STEP.NAME=VALUE, such as lens.fov=195")
        _known(place.strip(), step, tuple(steps))
        hints = get_type_hints(steps[step])
        _known(place.strip(), name, tuple(hints))
        made[step][name] = _spelled(place.strip(), value.strip(), hints[name], steps[step], name)
    return _read(made, "the settings")


def _known(place: str, name: str, names: Sequence[str]) -> None:
    if name not in names:
        raise InputError(f"there is no setting {place!r}; known: {', '.join(names)}")


def _spelled(place: str, text: str, hint: Any, owner: type, name: str) -> Any:
    """JSON of a value as it is written on a command line."""
    info = param_infos(owner).get(name)
    if info is not None:
        return parse(place, info, text)
    if text.lower() == "none":
        return None
    for form in (text, f"[{text}]"):
        try:
            value = loads(form, place)
        except ProjectError:
            continue
        inner = _inner(hint)
        if get_origin(inner) is tuple and not isinstance(value, list):
            value = [value]
        if dataclasses.is_dataclass(inner) and isinstance(value, list):
            names = [field.name for field in dataclasses.fields(inner)]
            if len(value) != len(names):
                raise InputError(f"{place} = {text!r} does not fit: expected {', '.join(names)}")
            value = dict(zip(names, value, strict=True))
        return value
    raise InputError(f"{place} = {text!r} does not fit: expected numbers with commas between, or JSON")


def _read(value: Any, name: str) -> CaptureSettings:
    try:
        made: CaptureSettings = Record(CaptureSettings).read(
            _checked(value, CaptureSettings, name), None, name
        )
        return made
    except ProjectError as error:
        raise InputError(str(error)) from None


def _inner(hint: Any) -> Any:
    """What an optional value is when it is there."""
    if get_origin(hint) in (Union, types.UnionType):
        return next(arg for arg in get_args(hint) if arg is not type(None))
    return hint


def _checked(value: Any, hint: Any, part: str) -> Any:
    """The value as `Record` reads it: names known, parameters in their ranges, whole numbers as floats."""
    if value is None:
        return None
    hint = _inner(hint)
    if hint is float and type(value) is int:
        return float(value)
    if get_origin(hint) is tuple and isinstance(value, list):
        args = get_args(hint)
        each = args[:1] * len(value) if args[-1] is Ellipsis or len(args) != len(value) else args
        return [_checked(v, h, f"{part} ▸ {i + 1}") for i, (v, h) in enumerate(zip(value, each, strict=True))]
    if not (isinstance(hint, type) and dataclasses.is_dataclass(hint) and isinstance(value, dict)):
        return value
    hints, infos, made = get_type_hints(hint), param_infos(hint), {}
    for name, inner in value.items():
        if name not in hints:
            raise InputError(f"{part}: there is no setting {name[:40]!r}; known: {', '.join(hints)}")
        place = f"{part} ▸ {name}"
        made[name] = _checked(inner, hints[name], place)
        if name in infos:
            made[name] = _in_range(place, infos[name], made[name])
    return made


def _in_range(place: str, info: Any, value: Any) -> Any:
    if info.kind in ("number", "integer") and not (isinstance(value, int | float) and value is not True):
        raise InputError(f"{place} = {value!r} does not fit: expected a number")
    return check(place, info, value)
