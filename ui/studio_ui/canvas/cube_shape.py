"""The view cube as geometry: faces of nine fields each, as a view turns them, and which field lies where.

A field stands for a side, an edge or a corner of the world: the direction (-1, 0 or 1 along x, y, z) that one
looks from. Fields of one edge or corner lie on two or three faces. Places are in units of half the cube's
side, x to the right and y down, from its middle.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
Way = tuple[int, int, int]
INNER = 0.56
"""Half the width of a face's middle field."""
_EYE = 7.0  # distance from which the cube is seen
_CUTS = {-1: (-1.0, -INNER), 0: (-INNER, INNER), 1: (INNER, 1.0)}

FACES: Mapping[Way, tuple[str, Way, Way]] = {
    (0, 0, 1): ("Front", (1, 0, 0), (0, 1, 0)),
    (0, 0, -1): ("Back", (-1, 0, 0), (0, 1, 0)),
    (1, 0, 0): ("Right", (0, 0, -1), (0, 1, 0)),
    (-1, 0, 0): ("Left", (0, 0, 1), (0, 1, 0)),
    (0, 1, 0): ("Top", (1, 0, 0), (0, 0, -1)),
    (0, -1, 0): ("Bottom", (1, 0, 0), (0, 0, 1)),
}
"""By outward direction: the name, and what is right and up for somebody who reads it."""


@dataclass(frozen=True, eq=False)
class Field:
    """A quadrilateral (4, 2) on a face."""

    way: Way
    corners: F64


@dataclass(frozen=True, eq=False)
class Face:
    """A face that is seen: its outline (4, 2) from the top left clockwise, how it faces the eye (0…1)."""

    way: Way
    name: str
    corners: F64
    facing: float
    fields: tuple[Field, ...]


def faces(axes: F64) -> list[Face]:
    """The faces that are seen by a camera with these axes (3, 3): rows right, up, back."""
    made = []
    for way, (name, right, up) in FACES.items():
        normal = axes @ np.array(way, np.float64)
        facing = float(normal @ (np.array([0.0, 0.0, _EYE]) - normal)) / _EYE
        if facing <= 0.02:
            continue
        corners = flat(axes, _on_face(way, right, up, (-1, 1), (-1, 1)))
        fields = []
        for i, j in product((-1, 0, 1), repeat=2):
            there = np.add(way, np.add(np.multiply(i, right), np.multiply(j, up)))
            quad = flat(axes, _on_face(way, right, up, _CUTS[i], _CUTS[j]))
            fields.append(Field((int(there[0]), int(there[1]), int(there[2])), quad))
        made.append(Face(way, name, corners, min(facing, 1.0), tuple(fields)))
    return made


def field_at(axes: F64, x: float, y: float) -> Way | None:
    """What lies at a place; None beside the cube."""
    for face in faces(axes):
        for field in face.fields:
            if _inside(field.corners, x, y):
                return field.way
    return None


def flat(axes: F64, points: F64) -> F64:
    """(N, 2) places of points (N, 3) of the cube's world, with a little perspective."""
    turned = points @ axes.T
    nearer = _EYE / (_EYE - turned[:, 2:])
    made: F64 = turned[:, :2] * nearer * (1.0, -1.0)
    return made


def ways() -> Iterator[Way]:
    """All twenty-six."""
    return (way for way in product((-1, 0, 1), repeat=3) if any(way))


def spoken(way: Way) -> str:
    """`Top`, `Front right`, `Top back left`."""
    axes = ((0, 1, 0), (0, 0, 1), (1, 0, 0))
    parts = []
    for axis in axes:
        along = int(np.dot(axis, way))
        if along:
            x, y, z = (int(c) * along for c in axis)
            parts.append(FACES[x, y, z][0])
    return " ".join(parts).capitalize()


def _on_face(way: Way, right: Way, up: Way, across: tuple[float, float], high: tuple[float, float]) -> F64:
    """(4, 3) a rectangle on a face, from the top left clockwise as one reads it."""
    (left, end), (low, top) = across, high
    spots = ((left, top), (end, top), (end, low), (left, low))
    return np.array([np.add(way, np.add(np.multiply(a, right), np.multiply(b, up))) for a, b in spots], float)


def _inside(quad: F64, x: float, y: float) -> bool:
    """Whether a convex, clockwise quadrilateral holds a place (y down)."""
    step = np.roll(quad, -1, axis=0) - quad
    beside = step[:, 0] * (y - quad[:, 1]) - step[:, 1] * (x - quad[:, 0])
    return bool((beside >= 0).all())
