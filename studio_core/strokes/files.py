"""Strokes as a JSON file that people write, read strictly; the format is told in docs/strokes.md."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.errors import InputError, ProjectError
from studio_core.kernels.tonemap import KINDS
from studio_core.params import ParamInfo, param_infos
from studio_core.project.canonical import loads
from studio_core.scene.nodes import Scene
from studio_core.strokes.brush import Brush
from studio_core.strokes.json_values import entries, flag, known, numbers, parameter, parameters, vector
from studio_core.strokes.marks_file import marks_from_json, marks_json, name_of
from studio_core.strokes.picking import radiance_of_display
from studio_core.strokes.planned import Look, MarkedStroke, PaintedStroke, Planned
from studio_core.strokes.stroke import CLONE, REPLACE, TOOLS, Stroke
from studio_core.strokes.tools import Gesture, ToolSettings

MOST_BYTES = 64 << 20
MOST_STROKES = 1000
MOST_POINTS = 20_000
MOST_PIXELS = 4096
LONGEST_NAME = 200
FAR = 10.0
"""How far a path may leave the picture, in parts of it."""
_REACH = ("near", "facing", "alike")
_FIELDS = ("name", "indirect", "weight", "meaning", "together", "hidden")
_THROUGH = "through"
_LOOK = ("camera", "size", "exposure", "tonemap")
_SETTINGS = (*param_infos(ToolSettings), "source")
_PAINTED = ("tool", "brush", "path", "reach", _THROUGH, *_FIELDS, *_LOOK, *_SETTINGS)
_MARKED = ("tool", "marks", "flat", "reach", _THROUGH, *_FIELDS)
_EXPOSURE = ParamInfo("number", "Exposure", low=-64, high=64)
_ANGLE = ParamInfo("number", "Angle", low=1, high=170)
_SCREEN = re.compile("#[0-9a-fA-F]{6}")


def strokes_from_file(path: Path) -> tuple[Planned, ...]:
    """The strokes of a JSON file; InputError, one sentence that names file, stroke and cause."""
    try:
        with path.open("rb") as file:
            found = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    if len(found) > MOST_BYTES:
        raise InputError(f"{path}: strokes take at most {MOST_BYTES >> 20} MB")
    try:
        text = found.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: this is no text") from None
    return strokes_from_json(text, str(path))


def strokes_from_json(text: str, name: str = "the strokes") -> tuple[Planned, ...]:
    """The same of a text; what it leaves out is as by default."""
    try:
        top = loads(text, name, MOST_BYTES)
    except ProjectError as error:
        raise InputError(str(error)) from None
    top = {"strokes": top} if isinstance(top, list) else known(top, ("strokes", *_LOOK), name)
    common = {key: value for key, value in top.items() if key != "strokes"}
    several = entries(top.get("strokes"), MOST_STROKES, f"{name}: strokes")
    return tuple(_stroke(one, common, f"{name}: stroke {i + 1}") for i, one in enumerate(several))


def strokes_json(scene: Scene) -> str:
    """All strokes of a scene with their marks, as a file has them."""
    made = []
    for stroke in scene.of(Stroke):
        if stroke.marks is None:
            continue
        told = {name: getattr(stroke, name) for name in ("tool", *_FIELDS, "flat")}
        told["reach"] = {name: getattr(stroke, name) for name in _REACH}
        if stroke.through in scene.nodes:
            told[_THROUGH] = name_of(scene, stroke.through)
        lines = [f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in told.items()]
        lines.append(f'  "marks": {marks_json(scene, stroke.objects, stroke.marks)}')
        made.append("{\n" + ",\n".join(lines) + "\n }")
    return '{"strokes": [' + ",\n ".join(made) + "]}\n"


def _stroke(value: Any, common: Mapping[str, Any], part: str) -> Planned:
    marked = isinstance(value, dict) and "marks" in value
    told = known(value, _MARKED if marked else _PAINTED, part)
    tool = told.get("tool", REPLACE)
    if tool not in TOOLS:
        raise InputError(f"{part}: there is no tool {str(tool)[:40]!r}; known: {', '.join(TOOLS)}")
    chosen = {name: told[name] for name in _FIELDS if name in told}
    chosen |= known(told.get("reach", {}), _REACH, f"{part}, reach")
    through = told.get(_THROUGH, "")
    if not isinstance(through, str):
        raise InputError(f"{part}, through: expected the name of an object")
    fields = frozen_map({**parameters(Stroke, chosen, part), **({_THROUGH: through} if through else {})})
    if not 0 < len(fields.get("name", tool)) <= LONGEST_NAME:
        raise InputError(f"{part}: a name has 1 to {LONGEST_NAME} letters")
    if marked:
        objects, marks = marks_from_json(told["marks"], f"{part}, marks")
        flat = flag(told.get("flat", False), f"{part}, flat")
        return MarkedStroke(tool, objects, marks, frozen_map({**fields, "flat": flat}))
    if "path" not in told:
        raise InputError(f'{part}: it needs a "path", or "marks"')
    path = numbers(told["path"], MOST_POINTS, (2, 3), f"{part}, path")
    if np.abs(path[:, :2]).max() > FAR:
        raise InputError(f"{part}, path: places of the picture run from 0 to 1")
    given = {**common, **told}
    place = f"{part}, brush"
    brush = Brush(**parameters(Brush, known(told.get("brush", {}), param_infos(Brush), place), place))
    settings, notes = _settings(given, part)
    if tool == CLONE and settings.source is None:
        raise InputError(f'{part}: a clone needs a "source", the place where it begins')
    return PaintedStroke(tool, Gesture.of(brush, path), settings, _look(given, part), fields, notes)


def _settings(value: Mapping[str, Any], part: str) -> tuple[ToolSettings, tuple[str, ...]]:
    """With the colour as it is seen on the screen turned into light; and what is to be said of that."""
    given = {name: value[name] for name in _SETTINGS if name in value}
    source, colour = given.pop("source", None), given.get("colour")
    exposure = parameter(value.get("exposure", 0.0), _EXPOSURE, f"{part}, exposure")
    kind, notes = value.get("tonemap", "srgb"), ()
    if kind not in KINDS:
        raise InputError(f"{part}: there is no view transform {str(kind)[:40]!r}; known: {', '.join(KINDS)}")
    if isinstance(colour, str):
        given["colour"], notes = _of_screen(colour, exposure, kind, f"{part}, colour")
    elif colour is not None:
        given["colour"] = vector(colour, f"{part}, colour")
    made = ToolSettings(**parameters(ToolSettings, given, part))
    if source is not None:
        x, y = (float(one) for one in numbers([source], 1, (2,), f"{part}, source")[0])
        made = dataclasses.replace(made, source=(x, y))
    return made, notes


def _of_screen(text: str, exposure: float, kind: str, part: str) -> tuple[Any, Any]:
    if not _SCREEN.fullmatch(text):
        raise InputError(f"{part}: write [red, green, blue] of radiance, or #rrggbb of the screen")
    radiance, exact = radiance_of_display([int(text[i : i + 2], 16) / 255 for i in (1, 3, 5)], exposure, kind)
    return radiance, () if exact else (f"{part}: no light alone shows as {text}; the nearest is taken",)


def _look(value: Mapping[str, Any], part: str) -> Look:
    size, camera = value.get("size", [960, 540]), value.get("camera")
    fits = isinstance(size, list) and len(size) == 2
    if not fits or not all(type(one) is int and 1 <= one <= MOST_PIXELS for one in size):
        raise InputError(f"{part}, size: expected [width, height] of 1 to {MOST_PIXELS} pixels")
    width, height = size
    if camera is None or isinstance(camera, str):
        return Look(camera, width=width, height=height)
    place = f"{part}, camera"
    known(camera, ("from", "to", "fov"), place)
    eye, target = (vector(camera.get(name), f"{place}, {name}") for name in ("from", "to"))
    if math.dist(eye, target) < 1e-9:
        raise InputError(f"{place}: it looks from where it looks to")
    fov = parameter(camera.get("fov", 45.0), _ANGLE, f"{place}, fov")
    return Look(place=(eye, target), fov=fov, width=width, height=height)


__all__ = ["strokes_from_file", "strokes_from_json", "strokes_json"]
