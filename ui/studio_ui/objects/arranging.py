"""Placing what is chosen without the hand: copies, dropping, aligning, spreading, materials of its own."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Literal

import numpy as np

from studio_core.copies import duplicate, with_own_materials
from studio_core.edits import Compound, Edit, Move
from studio_core.scene.arranging import PLACELESS, Placed, Side, aligned, distributed, roots, shifted
from studio_core.scene.bounds import exact_bounds
from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_core.scene.standing import dropped
from studio_ui.canvas import navigation
from studio_ui.canvas.drags import called, named
from studio_ui.context import Context

_BESIDE = 0.3  # metres between a thing and its copy
Way = Literal["across", "away", "up"]
"""As the picture shows it: left to right, near to far, floor to ceiling."""

ALIGN: dict[str, tuple[Way, Side, str]] = {
    "left": ("across", "low", "left"),
    "centre": ("across", "middle", "middle"),
    "right": ("across", "high", "right"),
    "front": ("away", "low", "front"),
    "depth": ("away", "middle", "middle of the depth"),
    "back": ("away", "high", "back"),
    "bottom": ("up", "low", "floor side"),
    "height": ("up", "middle", "middle of the height"),
    "top": ("up", "high", "top"),
}
"""By the end of an action's id: which way, which side, and what the history says."""
SPREAD: dict[str, Way] = {"across": "across", "away": "away", "up": "up"}


class Arranging:
    """Handlers and conditions of these actions."""

    def __init__(self, context: Context) -> None:
        self._context = context

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        made: dict[str, Callable[[], object]] = {
            "edit.duplicate": self.duplicate,
            "edit.duplicate_own": partial(self.duplicate, own_materials=True),
            "object.drop": self.drop,
            "object.own_material": self.own_material,
        }
        made |= {f"object.align_{name}": partial(self.align, name) for name in ALIGN}
        made |= {f"object.spread_{name}": partial(self.spread, way) for name, way in SPREAD.items()}
        return made

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name, as actions use them."""
        return {
            "two": lambda: len(self._movable()) >= 2,
            "three": lambda: len(self._movable()) >= 3,
            "mesh": self._any_mesh,
        }

    def duplicate(self, *, own_materials: bool = False) -> None:
        """Copies to the right of the originals, as it is seen; they are chosen then."""
        scene = self._scene
        nodes = tuple(n for n in self._chosen if not isinstance(scene[n], PLACELESS))
        if not nodes:
            return
        right, _ = navigation.nudge_axes(self._context.session.view)
        found = exact_bounds(scene, nodes)
        wide = float((found[1] - found[0]) @ np.abs(right)) if found is not None else 0.0
        add = duplicate(scene, nodes, own_materials=own_materials)
        fresh = {node.id for node in add.nodes}
        copies = tuple(node.id for node in add.nodes if node.parent not in fresh)
        beside = Move(shifted(add(scene), copies, right * (wide + _BESIDE)))
        edit = Compound(named(scene, nodes, "Duplicate"), (add, beside))
        if self._context.editing.apply(edit):
            self._context.session.select(copies)

    def drop(self) -> None:
        """Onto what lies below, else the floor."""
        self._move(dropped, "Drop {}")

    def align(self, name: str) -> None:
        """One side of all, or their middles."""
        way, side, words = ALIGN[name]
        axis, flipped = self._axis(way)
        if flipped and side != "middle":
            side = "high" if side == "low" else "low"
        self._move(lambda scene, nodes: aligned(scene, nodes, axis, side), f"Align {{}}: {words}")

    def spread(self, way: Way) -> None:
        """Equal gaps."""
        axis, _ = self._axis(way)
        self._move(lambda scene, nodes: distributed(scene, nodes, axis), "Distribute {}")

    def own_material(self) -> None:
        """Copies of the materials that other things use too."""
        scene, nodes = self._scene, self._chosen
        if nodes:
            title = f"Own materials for {called(scene, nodes)}"
            self._context.editing.apply(with_own_materials(scene, nodes, title))

    @property
    def _scene(self) -> Scene:
        return self._context.document.scene

    @property
    def _chosen(self) -> tuple[NodeId, ...]:
        return tuple(n for n in self._context.session.selection if n in self._scene.nodes)

    def _movable(self) -> tuple[NodeId, ...]:
        return roots(self._scene, self._chosen)

    def _any_mesh(self) -> bool:
        scene = self._scene
        below = (scene[b] for node in self._chosen for b in scene.subtree(node))
        return any(isinstance(node, MeshObject) for node in below)

    def _axis(self, way: Way) -> tuple[int, bool]:
        """The axis of the world that goes most nearly that way in the picture, and whether backwards."""
        if way == "up":
            return 1, False
        across, away = navigation.nudge_axes(self._context.session.view)
        towards = across if way == "across" else away
        axis = int(np.argmax(np.abs(towards)))
        return axis, bool(towards[axis] < 0)

    def _move(self, how: Callable[[Scene, tuple[NodeId, ...]], Placed], title: str) -> None:
        scene, nodes = self._scene, self._movable()
        if nodes:
            self._context.feed.step()
            edit: Edit = Move(how(scene, nodes), title.format(called(scene, nodes)))
            self._context.editing.apply(edit)
