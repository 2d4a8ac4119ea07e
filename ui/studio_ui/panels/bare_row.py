"""A word under pictures that cannot be seen: objects without texture coordinates, and the way out."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtWidgets import QLabel, QPushButton, QVBoxLayout, QWidget

_MOST = 3


class BareRow(QWidget):
    """`make()` gives them coordinates. Hidden while all have some."""

    def __init__(self, make: Callable[[], object]) -> None:
        super().__init__()
        self.told = QLabel()
        self.told.setProperty("role", "dim")
        self.told.setWordWrap(True)
        self.button = QPushButton("Make texture coordinates")
        self.button.setToolTip("Unroll the surfaces, so that pictures lie on them in their size")
        self.button.clicked.connect(lambda: make())
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.told)
        column.addWidget(self.button)
        self.setVisible(False)

    def show_bare(self, names: Sequence[str]) -> None:
        """Names of the objects that have none."""
        self.setVisible(bool(names))
        if names:
            more = len(names) - _MOST
            listed = ", ".join(names[:_MOST]) + (f" and {more} more" if more > 0 else "")
            lacking = f"{listed} lacks" if len(names) == 1 else f"these lack: {listed}"
            self.told.setText(f"Pictures need texture coordinates, which {lacking}.")
