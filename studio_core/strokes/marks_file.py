"""Marks as JSON: their columns by name, `objects` by name or id."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from studio_core.errors import InputError
from studio_core.scene.nodes import NodeId, Scene
from studio_core.strokes.json_values import counts, entries, known, numbers
from studio_core.strokes.marks import Marks

MOST_MARKS = 20_000
MOST_SLOTS = 1 << 16
_VECTORS = ("place", "normal", "eye", "shown", "wanted")
_COLUMNS = ("objects", *(field.name for field in dataclasses.fields(Marks)))
_DIGITS = 9
"""Enough to give a float32 back."""


def marks_from_json(value: Any, part: str) -> tuple[tuple[str, ...], Marks]:
    """Names or ids of objects, and the marks; InputError names the column."""
    told = known(value, _COLUMNS, part)
    objects = entries(told.get("objects"), MOST_MARKS, f"{part}, objects")
    if not all(isinstance(name, str) for name in objects):
        raise InputError(f"{part}, objects: expected names")
    made: dict[str, Any] = {
        name: numbers(told.get(name), MOST_MARKS, (3,), f"{part}, {name}") for name in _VECTORS
    }
    count = len(made["place"])
    weight = entries(told.get("weight", [1] * count), MOST_MARKS, f"{part}, weight")
    made["weight"] = numbers([[one] for one in weight], MOST_MARKS, (1,), f"{part}, weight")[:, 0]
    offset = entries(told.get("offset", [None] * count), MOST_MARKS, f"{part}, offset")
    rows = [[math.nan] * 3 if one is None else one for one in offset]
    made["offset"] = numbers(rows, MOST_MARKS, (3,), f"{part}, offset")
    for name, column in made.items():
        if len(column) != count:
            raise InputError(f"{part}, {name}: there are {count} places and {len(column)} of these")
    if ((made["weight"] < 0) | (made["weight"] > 1)).any():
        raise InputError(f"{part}, weight: expected 0 to 1")
    if (np.abs(np.linalg.norm(made["normal"], axis=1) - 1) > 1e-3).any():
        raise InputError(f"{part}, normal: expected unit vectors")
    columns = {name: column.astype(np.float32) for name, column in made.items()}
    for name, most in (("object", len(objects)), ("slot", MOST_SLOTS)):
        columns[name] = counts(told.get(name, [0] * count), count, most, f"{part}, {name}")
    return tuple(objects), Marks(**columns)


def marks_json(scene: Scene, objects: Sequence[NodeId], marks: Marks) -> str:
    """Objects go by `name_of`."""
    names = [name_of(scene, node) for node in objects]
    offset = [None if np.isnan(row).any() else _short(row) for row in marks.offset]
    columns: dict[str, Any] = {"objects": names, "object": marks.object.tolist(), "slot": marks.slot.tolist()}
    columns |= {name: [_short(row) for row in getattr(marks, name)] for name in _VECTORS}
    columns |= {"weight": _short(marks.weight), "offset": offset}
    lines = (f"   {json.dumps(name)}: {json.dumps(value)}" for name, value in columns.items())
    return "{\n" + ",\n".join(lines) + "}"


def name_of(scene: Scene, node: NodeId) -> str:
    """A node's name where that is its alone, else its id."""
    name = scene.nodes[node].name if node in scene.nodes else ""
    alone = sum(one.name == name for one in scene.nodes.values()) == 1
    return name if alone and name not in scene.nodes else node


def _short(row: Any) -> list[float]:
    return [float(f"{one:.{_DIGITS}g}") for one in row]


__all__ = ["marks_from_json", "marks_json", "name_of"]
