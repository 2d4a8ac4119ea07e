"""History: every step by name; a click, or an arrow key, goes there."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, QSize, Qt, QTimer
from PySide6.QtGui import QColor, QIcon, QPixmap
from PySide6.QtWidgets import QListWidget, QListWidgetItem

from studio_ui.context import Context
from studio_ui.look.icons import icon
from studio_ui.look.theme import Theme
from studio_ui.panels.panel import Panel, note

_FIRST = {"Open": "As it was opened", "New": "Empty project"}
_ICON = QSize(13, 13)


class HistoryPanel(Panel):
    """The document's steps: those undone dimmed, the one that is in the file marked."""

    id = "history"
    title = "History"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.list = QListWidget()
        self.list.setAccessibleName("Steps")
        self.list.setUniformItemSizes(True)
        self.list.setIconSize(_ICON)
        self.list.setTextElideMode(Qt.TextElideMode.ElideMiddle)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.currentRowChanged.connect(self._go)
        self.told = note("")
        self.column.addWidget(self.list, 1)
        self.column.addWidget(self.told)
        self._shown: list[str] = []
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self.refresh)
        editing = context.editing
        self.subscriptions.add(
            context.document.changed.connect(lambda *_: None if editing.busy else self._soon.start(0)),
            context.document.saved.connect(lambda: self._soon.start(0)),
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
        at, steps = document.position, document.history
        labels = [step.label for step in steps]
        labels[0] = _FIRST.get(labels[0], labels[0])
        saved = icon("save", self.theme.dim, selected=self.theme.on_accent)
        blank = QPixmap(_ICON)
        blank.fill(Qt.GlobalColor.transparent)
        empty = QIcon(blank)
        with QSignalBlocker(self.list):
            same = len(_common(self._shown, labels))
            while self.list.count() > same:
                self.list.takeItem(self.list.count() - 1)
            for label in labels[same:]:
                self.list.addItem(QListWidgetItem(label))
            for index, step in enumerate(steps):
                item = self.list.item(index)
                gone, in_file = index > at, step.scene is document.saved_scene
                item.setForeground(QColor(self.theme.dim if gone else self.theme.text))
                font = item.font()
                font.setItalic(gone)
                item.setFont(font)
                item.setIcon(saved if in_file else empty)
                told = "Undone: click to have it again" if gone else "Click to go back to this"
                told = "What is shown" if index == at else told
                item.setToolTip(f"{labels[index]}\n{told}{' (saved in the file)' * in_file}")
            self.list.setCurrentRow(at)
            self.list.scrollToItem(self.list.item(at))
        self._shown = labels
        self.told.setText(_told(at, len(steps)))

    def _go(self, row: int) -> None:
        if row >= 0 and row != self.context.document.position:
            self.context.editing.go_to(row)
            self.refresh()


def _told(at: int, count: int) -> str:
    undone = count - 1 - at
    if count == 1:
        return "Nothing was changed yet."
    return f"{at} step{'s' * (at != 1)} done" + (f", {undone} undone" if undone else "")


def _common(a: list[str], b: list[str]) -> list[str]:
    """The start that both share."""
    made = []
    for one, other in zip(a, b, strict=False):
        if one != other:
            break
        made.append(one)
    return made
