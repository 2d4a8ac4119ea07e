"""What scripts do to place things: drop, scale, align, distribute; all in the axes of the world."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from studio_core.document import Document
from studio_core.edits import Move
from studio_core.errors import EditError
from studio_core.scene.arranging import Placed, Side, aligned, distributed, roots, scaled
from studio_core.scene.bounds import exact_bounds
from studio_core.scene.nodes import NodeId, Scene
from studio_core.scene.standing import dropped

SIDES: dict[str, tuple[int, Side]] = {
    "left": (0, "low"),
    "right": (0, "high"),
    "bottom": (1, "low"),
    "top": (1, "high"),
    "back": (2, "low"),
    "front": (2, "high"),
    "x": (0, "middle"),
    "y": (1, "middle"),
    "z": (2, "middle"),
}
"""Axis of the world, and which end of a box or its middle."""


class Placing(ABC):
    """Part of the names that scripts have; each call is one entry of the history."""

    _document: Document

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """The scene as it is now."""

    @abstractmethod
    def find(self, name: Any) -> Any:
        """A node as it is now."""

    def drop(self, *things: Any) -> None:
        """Let things stand on what lies below each of them, else on the floor at y = 0."""
        nodes = self._movable(things)
        self._put(dropped(self.scene, nodes), nodes, "Drop")

    def scale(self, thing: Any, factor: float) -> None:
        """Make a thing `factor` times as large; the middle of its foot stays where it is."""
        nodes = self._movable((thing,))
        box = exact_bounds(self.scene, nodes)
        if box is None or not factor > 0:
            raise EditError("things are scaled by a factor above 0, and while they are shown")
        low, high = box
        foot = ((low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2)
        self._put(scaled(self.scene, nodes, factor, foot), nodes, "Scale")

    def align(self, *things: Any, side: str) -> None:
        """Bring one side of all to where the outermost has it: left, right, bottom, top, back, front.

        With `side="x"`, `"y"` or `"z"` their middles are brought to the middle of all.
        """
        if side not in SIDES:
            raise EditError(f"there is no side {side!r}; known: {', '.join(SIDES)}")
        nodes = self._movable(things)
        self._put(aligned(self.scene, nodes, *SIDES[side]), nodes, "Align")

    def distribute(self, *things: Any, along: str = "x") -> None:
        """Equal gaps between three things or more along `x`, `y` or `z`; the outermost stay."""
        if along not in ("x", "y", "z"):
            raise EditError(f"there is no axis {along!r}; known: x, y, z")
        nodes = self._movable(things)
        self._put(distributed(self.scene, nodes, "xyz".index(along)), nodes, "Distribute")

    def _movable(self, things: tuple[Any, ...]) -> tuple[NodeId, ...]:
        found = [self.find(thing) for thing in things]
        nodes = roots(self.scene, [node.id for node in found])
        if not nodes:
            named = ", ".join(repr(node.name) for node in found) or "nothing"
            raise EditError(f"{named} cannot be moved: it is locked, or has no place")
        return nodes

    def _put(self, placed: Placed, nodes: tuple[NodeId, ...], verb: str) -> None:
        what = self.scene[nodes[0]].name if len(nodes) == 1 else f"{len(nodes)} objects"
        self._document.apply(Move(placed, f"{verb} {what}"))
