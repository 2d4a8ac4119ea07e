"""History: every step by name; a click goes there."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, QTimer
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QListWidget, QListWidgetItem

from studio_ui.context import Context
from studio_ui.panels.panel import Panel
from studio_ui.theme import Theme


class HistoryPanel(Panel):
    """The document's steps, those undone dimmed."""

    id = "history"
    title = "History"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.list = QListWidget()
        self.list.setUniformItemSizes(True)
        self.list.itemClicked.connect(self._go)
        self.column.addWidget(self.list)
        self._shown: list[str] = []
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self.refresh)
        editing = context.editing
        self.subscriptions.add(
            context.document.changed.connect(lambda *_: None if editing.busy else self._soon.start(0)),
            editing.settled.connect(lambda: self._soon.start(0)),
        )
        self.refresh()

    def set_theme(self, theme: Theme) -> None:
        """Colours of another theme."""
        super().set_theme(theme)
        self.refresh()

    def refresh(self) -> None:
        """Show what the document remembers."""
        document = self.context.document
        labels = [step.label for step in document.history]
        with QSignalBlocker(self.list):
            same = len(_common(self._shown, labels))
            while self.list.count() > same:
                self.list.takeItem(self.list.count() - 1)
            for label in labels[same:]:
                self.list.addItem(QListWidgetItem(label))
            for index in range(self.list.count()):
                gone = index > document.position
                colour = QColor(self.theme.dim if gone else self.theme.text)
                item = self.list.item(index)
                item.setForeground(colour)
                font = item.font()
                font.setItalic(gone)
                item.setFont(font)
            self.list.setCurrentRow(document.position)
            self.list.scrollToItem(self.list.item(document.position))
        self._shown = labels

    def _go(self, item: QListWidgetItem) -> None:
        self.context.editing.go_to(self.list.row(item))
        self.refresh()


def _common(a: list[str], b: list[str]) -> list[str]:
    """The start that both share."""
    made = []
    for one, other in zip(a, b, strict=False):
        if one != other:
            break
        made.append(one)
    return made
