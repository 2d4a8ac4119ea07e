"""Lines, dots, faces and words over a picture, as data that every canvas draws alike; no toolkit here.

Places are in the world and follow the view. Colours are `#rrggbb`, or names that the theme gives a meaning:
`accent` (what is chosen or follows the hand), `line` (what can be chosen), `problem`.
"""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import NodeId
from studio_core.session import View
from studio_ui.canvas.glyphs import Glyph
from studio_ui.canvas.projection import project

F64 = npt.NDArray[np.float64]
NEAR_GLYPH = 14.0
"""Logical pixels from which a glyph is touched."""


@dataclass(frozen=True, eq=False)
class Wires:
    """Segments (N, 2, 3), `width` logical pixels wide, with a dark rim unless `bare`."""

    segments: F64
    colour: str = "line"
    width: float = 1.0
    bare: bool = False


@dataclass(frozen=True, eq=False)
class Dot:
    """A disc around a point (3,), `radius` logical pixels."""

    at: F64
    colour: str = "line"
    radius: float = 3.0


@dataclass(frozen=True, eq=False)
class Face:
    """A filled polygon (N ≥ 3, 3), `opacity` 0…1; left out where it reaches behind the eye."""

    corners: F64
    colour: str = "accent"
    opacity: float = 0.25


@dataclass(frozen=True, eq=False)
class Label:
    """Words on a dark ground, `offset` logical pixels (right, down) from a point (3,)."""

    at: F64
    text: str
    colour: str = "line"
    offset: tuple[float, float] = (10.0, -10.0)


@dataclass(frozen=True, eq=False)
class Band:
    """A rectangle on the canvas, corners (x, y) in 0…1 from the top left: what a box selection has caught.

    With a full line where only what lies inside `whole` counts.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    colour: str = "accent"
    whole: bool = False


@dataclass(frozen=True, eq=False)
class Ring:
    """A circle about a point (x, y) of the canvas, 0…1 from the top left; `radius` logical pixels."""

    at: tuple[float, float]
    radius: float
    colour: str = "line"
    width: float = 1.0


@dataclass(frozen=True, eq=False)
class Film:
    """Pixels (H, W, 4) as displayed, the last their opacity, over a rectangle as `Band` has it."""

    pixels: npt.NDArray[np.uint8]
    start: tuple[float, float]
    end: tuple[float, float]


Mark = Wires | Dot | Face | Label | Band | Ring | Film


@dataclass(frozen=True)
class Overlay:
    """Marks in the order in which they are drawn."""

    marks: tuple[Mark, ...] = ()

    def __add__(self, other: Overlay) -> Overlay:
        return Overlay(self.marks + other.marks)


NOTHING = Overlay()


def guides(glyphs: Iterable[Glyph], boxes: F64 | None, chosen: Container[NodeId]) -> Overlay:
    """Lamps and cameras, lit when they are chosen, and the boxes (N, 2, 3) that follow a gesture."""
    made: list[Mark] = []
    for glyph in glyphs:
        lit = glyph.node in chosen
        colour = "accent" if lit else "line"
        made.append(Wires(glyph.segments, colour, 2.0 if lit else 1.0))
        made.append(Dot(glyph.anchor, colour))
    if boxes is not None:
        made.append(Wires(boxes, "accent", 1.5))
    return Overlay(tuple(made))


def glyph_near(
    glyphs: Iterable[Glyph], view: View, x: float, y: float, size: tuple[int, int]
) -> NodeId | None:
    """The lamp or camera nearest to a point of a canvas of so many logical pixels, if it is near."""
    best, found = NEAR_GLYPH, None
    for glyph in glyphs:
        distance = float(np.hypot(*((project(view, glyph.anchor)[0] - (x, y)) * size)))
        if distance < best:
            best, found = distance, glyph.node
    return found
