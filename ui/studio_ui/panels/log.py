"""Log: notes and problems in sentences; the technical detail of a problem on request."""

from __future__ import annotations

import time

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QGuiApplication
from PySide6.QtWidgets import QListWidget, QListWidgetItem, QPlainTextEdit, QSplitter

from studio_ui.context import Context
from studio_ui.journal import Entry
from studio_ui.panels.panel import Panel, row
from studio_ui.theme import Theme


class LogPanel(Panel):
    """The journal's lines; choosing one shows its detail."""

    id = "log"
    title = "Log"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.list = QListWidget()
        self.list.setWordWrap(True)
        self.list.setTextElideMode(Qt.TextElideMode.ElideNone)
        self.detail = QPlainTextEdit()
        self.detail.setReadOnly(True)
        self.detail.setPlaceholderText("Technical detail of the chosen line")
        self.detail.hide()
        split = QSplitter(Qt.Orientation.Vertical)
        split.addWidget(self.list)
        split.addWidget(self.detail)
        copy, clear = self.tool("duplicate", "Copy all lines"), self.tool("delete", "Clear the log")
        copy.clicked.connect(self.copy)
        clear.clicked.connect(context.journal.clear)
        self.column.addWidget(split, 1)
        self.column.addLayout(row(copy, clear))
        self.list.currentItemChanged.connect(lambda item, _: self._show(item))
        for entry in context.journal.entries:
            self._add(entry)
        self.subscriptions.add(
            context.journal.added.connect(self._add), context.journal.cleared.connect(self.list.clear)
        )

    def copy(self) -> None:
        """All lines with their details, as text."""
        lines = []
        for entry in self.context.journal.entries:
            lines.append(
                f"{time.strftime('%H:%M:%S', time.localtime(entry.time))} {entry.level}: {entry.text}"
            )
            lines += [entry.detail] if entry.detail else []
        QGuiApplication.clipboard().setText("\n".join(lines))

    def set_theme(self, theme: Theme) -> None:
        """Colour the lines anew."""
        super().set_theme(theme)
        for index in range(self.list.count()):
            item = self.list.item(index)
            self._colour(item, item.data(Qt.ItemDataRole.UserRole))

    def _add(self, entry: Entry) -> None:
        when = time.strftime("%H:%M:%S", time.localtime(entry.time))
        item = QListWidgetItem(f"{when}  {entry.text}")
        item.setData(Qt.ItemDataRole.UserRole, entry)
        self._colour(item, entry)
        self.list.addItem(item)
        limit = self.context.journal.entries.maxlen or 500
        while self.list.count() > limit:
            self.list.takeItem(0)
        self.list.scrollToBottom()

    def _colour(self, item: QListWidgetItem, entry: Entry) -> None:
        colours = {"note": self.theme.text, "warning": self.theme.warning, "problem": self.theme.problem}
        item.setForeground(QColor(colours[entry.level]))

    def _show(self, item: QListWidgetItem | None) -> None:
        entry = item.data(Qt.ItemDataRole.UserRole) if item is not None else None
        self.detail.setPlainText(entry.detail if entry is not None else "")
        self.detail.setVisible(bool(entry is not None and entry.detail))
