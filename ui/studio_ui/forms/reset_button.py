"""A small button that brings a default back, there only while something differs from it."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, QSize, Qt
from PySide6.QtWidgets import QHBoxLayout, QToolButton, QWidget

from studio_ui.look.icons import icon

_SIZE = 20  # pixels


class ResetButton(QToolButton):
    """Keeps its place while it is hidden, so that nothing jumps."""

    def __init__(self, label: str, reset: Callable[[], object]) -> None:
        super().__init__()
        self.setToolTip(f"Reset {label[:1].lower()}{label[1:]}")
        self.setAccessibleName(self.toolTip())
        self.setAutoRaise(True)
        self.setFixedSize(_SIZE, _SIZE)
        self.setIconSize(QSize(13, 13))
        self.setProperty("role", "small")
        policy = self.sizePolicy()
        policy.setRetainSizeWhenHidden(True)
        self.setSizePolicy(policy)
        self.setVisible(False)
        self.clicked.connect(lambda: reset())
        self._dress()

    def offer(self, differs: bool) -> None:
        """Whether there is something to reset."""
        if differs == self.isHidden():
            self.setVisible(differs)

    def changeEvent(self, event: QEvent) -> None:
        """Another theme: another colour."""
        if event.type() in (QEvent.Type.PaletteChange, QEvent.Type.StyleChange):
            self._dress()
        super().changeEvent(event)

    def _dress(self) -> None:
        colour = self.palette().placeholderText().color().name()
        if colour != self.property("colour"):
            self.setProperty("colour", colour)
            self.setIcon(icon("reset", colour))


def beside(field: QWidget, button: QWidget) -> QWidget:
    """A field with its button at the right."""
    made = QWidget()
    layout = QHBoxLayout(made)
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setSpacing(2)
    layout.addWidget(field, 1)
    layout.addWidget(button, 0, Qt.AlignmentFlag.AlignTop)
    return made
