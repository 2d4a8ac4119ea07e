"""A panel of one's own: how many things the scene has. Only here the plugin needs Qt."""

from __future__ import annotations

from collections import Counter
from typing import Any

from PySide6.QtWidgets import QLabel, QPushButton, QVBoxLayout, QWidget

from studio_core.edits import Compound, SetFields
from studio_core.scene.nodes import Light


class Census(QWidget):
    """Follows the document, and changes it through `editing`, so that it can be undone."""

    def __init__(self, context: Any) -> None:
        super().__init__()
        self._context = context
        self.label = QLabel()
        self.lights_out = QPushButton("Lights out")
        self.lights_out.setToolTip("Hides every light; undo brings them back")
        column = QVBoxLayout(self)
        column.addWidget(self.label)
        column.addWidget(self.lights_out)
        column.addStretch(1)
        self.lights_out.clicked.connect(self._lights_out)
        self._off = context.document.changed.connect(lambda *_: self.count())
        self.destroyed.connect(self._off)
        self.count()

    def count(self) -> None:
        """Show how many there are of each kind."""
        kinds = Counter(type(node).__name__ for node in self._context.document.scene.nodes.values())
        self.label.setText("\n".join(f"{name}: {number}" for name, number in sorted(kinds.items())))

    def _lights_out(self) -> None:
        lights = self._context.document.scene.of(Light)
        edits = tuple(SetFields(light.id, {"hidden": True}) for light in lights)
        self._context.editing.apply(Compound("Lights out", edits))


class Maker:
    """See `studio_core.contract.PanelMaker`."""

    title = "Census"

    def make(self, context: Any) -> QWidget:
        """The panel, when it is first shown."""
        return Census(context)


MAKER = Maker()
