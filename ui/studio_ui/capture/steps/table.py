"""The tables of the steps: Delete takes away what is chosen."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QTreeWidget


class Table(QTreeWidget):
    """`removed()` when Delete was pressed."""

    def __init__(self) -> None:
        super().__init__()
        self.removed: Callable[[], object] = lambda: None
        self.setRootIsDecorated(False)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Delete."""
        if event.key() == Qt.Key.Key_Delete:
            self.removed()
        else:
            super().keyPressEvent(event)
