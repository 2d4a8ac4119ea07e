"""Where the values of a stroke's form go: each is a change that is solved again before it is a step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from studio_core.edits import Edit, SetFields
from studio_core.params import Value, param_infos
from studio_core.scene.nodes import NodeId
from studio_core.strokes.stroke import AUTOMATIC, Stroke
from studio_ui.context import Context
from studio_ui.strokes.bench import Order
from studio_ui.strokes.brush_store import REACH, BrushStore
from studio_ui.strokes.work import StrokeWork

UNSOLVED = ("name",)
"""What may change without anything being solved again."""


class StrokeSink:
    """`stroke()` is the one that a value is for; `held(name)` tells while a hand drags one, "" after."""

    def __init__(
        self,
        context: Context,
        work: StrokeWork,
        store: BrushStore,
        stroke: Callable[[], NodeId | None],
        held: Callable[[str], object],
    ) -> None:
        self._context, self._work, self._store = context, work, store
        self._stroke, self._held = stroke, held
        self._order: Order | None = None

    def begin(self, name: str) -> bool:
        """A hand takes hold of a value."""
        node = self._there()
        if node is None or not self._work.begin(self._label(node, name)):
            return False
        self._order = None
        self._held(name)
        return True

    def preview(self, name: str, value: Value) -> None:
        """Another value, and what it makes of the material."""
        node = self._there()
        if node is not None:
            self._order = self._make(node, name, value)
            self._work.show(self._order)

    def commit(self) -> None:
        """The last value stays."""
        order, self._order = self._order, None
        if order is None:
            self._work.cancel()
        else:
            self._work.finish(order)
        self._held("")

    def cancel(self) -> None:
        """As before."""
        self._order = None
        self._work.cancel()
        self._held("")

    def apply(self, name: str, value: Value) -> None:
        """One step."""
        node = self._there()
        if node is None:
            return
        order = self._make(node, name, value)
        if name in UNSOLVED:
            self._context.editing.apply(self._edit(node, name, value))
        else:
            self._work.do(order, self._edit(node, name, value))

    def _there(self) -> Stroke | None:
        node = self._context.document.scene.nodes.get(self._stroke() or "")
        return node if isinstance(node, Stroke) else None

    def _make(self, stroke: Stroke, name: str, value: Value) -> Order:
        edit = self._edit(stroke, name, value)
        if name in REACH:
            self._store.use(**{name: value})  # the next ones are painted so, too
        return Order(edit.label, lambda: edit, stroke.id)

    def _edit(self, stroke: Stroke, name: str, value: Value) -> Edit:
        values: dict[str, Any] = {name: value}
        if name == "meaning" and value == AUTOMATIC:
            values |= {"through": "", "through_slot": -1}  # any object may change for it again
        return SetFields(stroke.id, values, self._label(stroke, name))

    @staticmethod
    def _label(stroke: Stroke, name: str) -> str:
        return f"{param_infos(Stroke)[name].label} of {stroke.name}"


__all__ = ["UNSOLVED", "StrokeSink"]
