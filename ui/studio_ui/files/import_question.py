"""What is asked before a model comes in, and what was answered; remembered by file type."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import ImportedModel
from studio_core.scene.imported import Up, converted, likely_up
from studio_core.scene.nodes import Scene
from studio_core.scene.size import model_bounds, model_size, suspicious_size

UNITS = {"metres": 1.0, "centimetres": 0.01, "millimetres": 0.001, "inches": 0.0254, "feet": 0.3048}
_LIKELY = ((0.2, 5.0), (0.05, 15.0))  # metres that the longest side of furniture probably has
_UPRIGHT = {".glb", ".gltf"}  # whose axes and unit the format itself fixes
_MOST = 2400  # lines of a preview
_REMEMBERED = "import"
Lines = npt.NDArray[np.float32]


@dataclass(frozen=True)
class ImportChoice:
    """Metres of the file's unit, which of its axes points up, whether it is put on the floor and centred."""

    unit: float = 1.0
    up: Up = "y"
    stand: bool = True
    centre: bool = True
    remember: bool = False


@dataclass(frozen=True)
class ImportQuestion:
    """A model as its file has it (1 unit is 1 m, y up), why it is asked about, and what is suggested.

    `lines` (N, 2, 3) are some of its edges; `correcting` is a model that is in the scene already.
    """

    name: str
    triangles: int
    materials: int
    bounds: npt.NDArray[np.float64]
    lines: Lines
    guess: ImportChoice
    doubt: str = ""
    notes: tuple[str, ...] = ()
    suffix: str = ""
    correcting: bool = False

    def size(self, choice: ImportChoice) -> tuple[float, float, float]:
        """Width, depth and height in metres."""
        x, y, z = (float(side) * choice.unit for side in self.bounds[1] - self.bounds[0])
        return (x, z, y) if choice.up == "y" else (x, y, z)


def question(path: Path, model: ImportedModel, guess: ImportChoice) -> ImportQuestion:
    """About a model as its file has it; `guess` is what was remembered of such files.

    `doubt` is empty when the guess gives a sensible size and the model seems upright.
    """
    doubt = ""
    if suspicious_size(model) is not None and guess.unit == 1.0:
        guess = _with(guess, unit=likely_unit(model_size(model)))
        doubt = "Its size would be unusual in metres."
    elif guess.unit != 1.0 and suspicious_size(converted(model, guess.unit)) is not None:
        doubt = "Its size would be unusual in the unit that such files had so far."
    axis = likely_up(converted(model, up=guess.up))
    if axis == "z" and path.suffix.lower() not in _UPRIGHT:
        guess = _with(guess, up="z" if guess.up == "y" else "y")
        doubt = doubt or "It seems to lie on its back."
    return ImportQuestion(
        name=path.name,
        triangles=sum(len(node.geometry.faces) for node in model.objects),
        materials=len(model.materials),
        bounds=np.stack(model_bounds(model)),
        lines=some_lines(model),
        guess=guess,
        doubt=doubt,
        notes=model.notes,
        suffix=path.suffix.lower(),
    )


def likely_unit(size: tuple[float, float, float]) -> float:
    """Metres of the unit in which the longest side is most like furniture's."""
    for low, high in _LIKELY:
        for factor in UNITS.values():
            if low <= max(size) * factor <= high:
                return factor
    return 1.0


def some_lines(model: ImportedModel) -> Lines:
    """(N, 2, 3) edges of triangles spread over all meshes, at most some thousands."""
    scene = Scene().with_nodes(*model.nodes)
    total = sum(len(node.geometry.faces) for node in model.objects)
    stride = max(1, math.ceil(3 * total / _MOST))
    found = [np.zeros((0, 2, 3), np.float32)]
    for node in model.objects:
        matrix = scene.world(node.id).matrix()
        corners = node.geometry.positions[node.geometry.faces[::stride]].astype(np.float64)
        corners = corners @ matrix[:3, :3].T + matrix[:3, 3]
        for a, b in ((0, 1), (1, 2), (2, 0)):
            found.append(corners[:, [a, b]].astype(np.float32))
    return np.concatenate(found)


def remembered(values: Mapping[str, Any], suffix: str) -> ImportChoice:
    """What was chosen for files of that type; the default where nothing (sensible) was."""
    found = values.get(suffix)
    if not isinstance(found, dict):
        return ImportChoice()
    unit, up = found.get("unit"), found.get("up")
    return ImportChoice(
        unit=float(unit) if isinstance(unit, int | float) and 1e-9 < unit < 1e9 else 1.0,
        up="z" if up == "z" else "y",
        stand=found.get("stand") is not False,
        centre=found.get("centre") is not False,
    )


def kept(values: Mapping[str, Any], suffix: str, choice: ImportChoice) -> dict[str, Any]:
    """`values` with a choice for files of that type."""
    fields = asdict(choice)
    del fields["remember"]
    return {**values, suffix: fields}


def _with(choice: ImportChoice, **fields: Any) -> ImportChoice:
    return ImportChoice(**{**asdict(choice), **fields})
