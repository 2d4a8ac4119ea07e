"""An edit as the line of a script that would do it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from studio_core.edits import Edit
from studio_core.scene.transform import Transform

_MOST = 400  # characters


def spelled(edit: Edit) -> str | None:
    """`apply(Move({'chair': Transform((1, 0, 0))}))`; None for an edit that holds a mesh or a picture.

    What is left to its default is left out.
    """
    text = _spell(edit)
    return f"apply({text})" if text is not None and len(text) <= _MOST else None


def _spell(value: Any) -> str | None:
    match value:
        case None | bool() | int() | str():
            return repr(value)
        case float() | np.floating():
            return f"{float(value):.6g}"
        case tuple():
            return _listed(value, "(", ",)" if len(value) == 1 else ")")
        case list():
            return _listed(value, "[", "]")
        case Mapping():
            pairs = [(_spell(key), _spell(entry)) for key, entry in value.items()]
            if any(part is None for pair in pairs for part in pair):
                return None
            return "{" + ", ".join(f"{key}: {entry}" for key, entry in pairs) + "}"
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _called(value)
    return None


def _listed(values: Any, start: str, end: str) -> str | None:
    parts = [_spell(one) for one in values]
    return None if None in parts else start + ", ".join(str(p) for p in parts) + end


def _called(value: Any) -> str | None:
    """Fields by position as long as none was left out, then by name."""
    if not (type(value).__module__ == "studio_core.edits" or isinstance(value, Transform)):
        return None
    made, by_name = [], False
    for field in dataclasses.fields(value):
        given = getattr(value, field.name)
        if field.default is not dataclasses.MISSING and given == field.default:
            by_name = True
            continue
        text = _spell(given)
        if text is None:
            return None
        made.append(f"{field.name}={text}" if by_name or field.name == "label" else text)
    return f"{type(value).__name__}({', '.join(made)})"
