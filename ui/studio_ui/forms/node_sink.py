"""Where the values of a form of nodes go: one edit of all of them, named after what they are."""

from __future__ import annotations

from collections.abc import Callable

from studio_core.edits import Compound, Edit, SetFields
from studio_core.params import Value, param_infos
from studio_core.scene.nodes import NodeId
from studio_ui.context import Context
from studio_ui.forms.sinks import EditSink
from studio_ui.panels.node_kinds import kinds_name


class NodeSink(EditSink):
    """`nodes()` are those that a value is for when it comes."""

    def __init__(self, context: Context, nodes: Callable[[], tuple[NodeId, ...]]) -> None:
        super().__init__(context.editing, self.edit, self.label)
        self._context, self._nodes = context, nodes

    def label(self, name: str) -> str:
        """`Intensity of Floor lamp`, `Intensity of 3 lights`."""
        scene = self._context.document.scene
        nodes = [scene[node] for node in self._there()]
        what = nodes[0].name if len(nodes) == 1 else kinds_name(nodes)
        return f"{param_infos(type(nodes[-1]))[name].label} of {what}"

    def edit(self, name: str, value: Value) -> Edit:
        """The same value for all of them; names are numbered."""
        nodes = self._there()
        if len(nodes) == 1:
            return SetFields(nodes[0], {name: value}, self.label(name))
        if name == "name":
            edits = [SetFields(n, {name: f"{value} {i}"}) for i, n in enumerate(nodes, 1)]
        else:
            edits = [SetFields(n, {name: value}) for n in nodes]
        return Compound(self.label(name), tuple(edits))

    def _there(self) -> tuple[NodeId, ...]:
        scene = self._context.document.scene
        return tuple(node for node in self._nodes() if node in scene.nodes)
