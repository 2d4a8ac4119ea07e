"""What the actions do to scene and view. Files and dialogs are elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from studio_core.edits import Add, Compound, Edit, Move, Remove, Reparent, SetFields
from studio_core.photographs import stand_in_photograph
from studio_core.scene.arranging import PLACELESS, is_locked, roots, shifted, turned
from studio_core.scene.nodes import Group, NodeId, Scene, new_id
from studio_core.scene.transform import Transform
from studio_ui.canvas import navigation
from studio_ui.canvas.drags import middle, named
from studio_ui.canvas.tools import TOOLS, CanvasTools
from studio_ui.context import Context
from studio_ui.panels.node_kinds import LISTED_APART

STEP = 0.05  # metres
ANGLE = 15.0  # degrees


class Commands:
    """Handlers and conditions of the actions."""

    def __init__(self, context: Context, tools: CanvasTools) -> None:
        self._context, self._tools = context, tools

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        made: dict[str, Callable[[], object]] = {
            "edit.undo": self._context.editing.undo,
            "edit.redo": self._context.editing.redo,
            "edit.delete": self.delete,
            "edit.select_all": self.select_all,
            "edit.select_box": self._tools.band,
            "edit.select_none": lambda: self._context.session.select([]),
            "object.photograph": self.stand_in_photograph,
            "object.group": self.group,
            "object.ungroup": self.ungroup,
            "object.hide": self.hide,
            "object.show_all": self.show_all,
            "object.lock": self.lock,
            "object.turn_left": lambda: self.turn(ANGLE),
            "object.turn_right": lambda: self.turn(-ANGLE),
            "shade.again": self._context.feed.restart,
            "shade.cancel": self._context.feed.cancel,
        }
        nudges = {"left": (-1, 0, 0), "right": (1, 0, 0), "away": (0, 0, 1), "near": (0, 0, -1)}
        nudges |= {"up": (0, 1, 0), "down": (0, -1, 0)}
        for name, way in nudges.items():
            made[f"object.{name}"] = partial(self.nudge, *way)
        for tool in TOOLS:
            made[f"tool.{tool}"] = partial(self._tools.use, tool)
        return made

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name, as actions use them."""
        document, feed = self._context.document, self._context.feed
        return {
            "undo": lambda: document.can_undo,
            "redo": lambda: document.can_redo,
            "selection": lambda: bool(self.chosen),
            "movable": lambda: bool(roots(document.scene, self.chosen)),
            "group": lambda: any(isinstance(document.scene[n], Group) for n in self.chosen),
            "computing": lambda: feed.busy,
        } | {f"tool_{tool}": partial(self._uses, tool) for tool in TOOLS}

    @property
    def chosen(self) -> tuple[NodeId, ...]:
        """The selection, without what is gone."""
        scene = self._context.document.scene
        return tuple(n for n in self._context.session.selection if n in scene.nodes)

    def _uses(self, tool: str) -> bool:
        return self._tools.tool == tool

    # scene

    def delete(self) -> None:
        """What is chosen, with what hangs under it; locked things stay."""
        scene = self._context.document.scene
        nodes = tuple(n for n in self.chosen if not is_locked(scene, n))
        if nodes and self._apply(Remove(nodes, named(scene, nodes, "Delete"))):
            self._context.session.select([])

    def select_all(self) -> None:
        """Everything at the top that is shown and not locked."""
        scene = self._context.document.scene
        tops = [node for node in scene.children(None) if not isinstance(node, LISTED_APART)]
        self._context.session.select(n.id for n in tops if not n.locked and not n.hidden)

    def nudge(self, right: int, up: int, away: int) -> None:
        """One step along the axes as they are seen."""
        along, ahead = navigation.nudge_axes(self._context.session.view)
        delta = STEP * (right * along + away * ahead + up * np.array([0.0, 1.0, 0.0]))
        self._move(lambda scene, nodes: shifted(scene, nodes, delta), "Nudge")

    def turn(self, degrees: float) -> None:
        """About the vertical through the middle."""
        self._move(lambda scene, nodes: turned(scene, nodes, degrees, middle(scene, nodes)), "Turn")

    def stand_in_photograph(self) -> None:
        """Shadows on the floor of the photographed room, which is seen under the furniture."""
        self._apply(stand_in_photograph(self._context.document.scene))

    def group(self) -> None:
        """A new group around what is chosen."""
        scene = self._context.document.scene
        nodes = tuple(n for n in self.chosen if not isinstance(scene[n], PLACELESS))
        if not nodes:
            return
        made = Group(id=new_id("group"), name="Group", parent=scene[nodes[0]].parent)
        if self._apply(Compound("Group", (Add((made,)), Reparent(nodes, made.id)))):
            self._context.session.select([made.id])

    def ungroup(self) -> None:
        """What the chosen groups hold goes up one level."""
        scene = self._context.document.scene
        edits: list[Edit] = []
        freed: list[NodeId] = []
        for node in self.chosen:
            if isinstance(scene[node], Group):
                inside = tuple(child.id for child in scene.children(node))
                freed += inside
                edits += [Reparent(inside, scene[node].parent), Remove((node,))]
        if edits and self._apply(Compound("Ungroup", tuple(edits))):
            self._context.session.select(freed)

    def hide(self) -> None:
        """Hide what is chosen."""
        self._fields("Hide", self.chosen, "hidden", True)

    def show_all(self) -> None:
        """Show everything that is hidden, but switch no lamp on and no stroke."""
        scene = self._context.document.scene
        there = (node for node in scene.nodes.values() if not isinstance(node, LISTED_APART))
        hidden = [node.id for node in there if node.hidden and not hasattr(node, "intensity")]
        self._fields("Show all", tuple(hidden), "hidden", False)

    def lock(self) -> None:
        """Lock what is chosen, or unlock it when all of it is locked."""
        scene = self._context.document.scene
        locked = all(scene[n].locked for n in self.chosen)
        self._fields("Unlock" if locked else "Lock", self.chosen, "locked", not locked)

    def _fields(self, verb: str, nodes: tuple[NodeId, ...], name: str, value: bool) -> None:
        if nodes:
            label = named(self._context.document.scene, nodes, verb) if verb != "Show all" else verb
            self._apply(Compound(label, tuple(SetFields(n, {name: value}) for n in nodes)))

    def _move(self, how: Callable[[Scene, tuple[NodeId, ...]], dict[NodeId, Transform]], verb: str) -> None:
        scene = self._context.document.scene
        nodes = roots(scene, self.chosen)
        if nodes:
            self._context.feed.step()
            self._apply(Move(how(scene, nodes), named(scene, nodes, verb)))

    def _apply(self, edit: Edit) -> bool:
        return self._context.editing.apply(edit)
