"""Log: notes and problems in sentences; the technical detail of a problem is folded away below them."""

from __future__ import annotations

import time
from collections import Counter

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QColor, QFontDatabase, QPaintEvent
from PySide6.QtWidgets import (
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QPlainTextEdit,
    QPushButton,
    QToolButton,
)

from studio_ui.context import Context
from studio_ui.files.report import copy_text, report_text
from studio_ui.journal import Entry, Level
from studio_ui.look.theme import Theme
from studio_ui.panels.panel import Panel, row

_ROLE = Qt.ItemDataRole.UserRole
_LEVELS: dict[Level, str] = {"note": "Notes", "warning": "Warnings", "problem": "Problems"}
_DETAIL = 120  # pixels


class LogPanel(Panel):
    """The journal's lines by level and text; whoever sees the panel has seen its problems."""

    id = "log"
    title = "Log"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.levels: dict[Level, QToolButton] = {}
        for level in _LEVELS:
            self.levels[level] = button = QToolButton()
            button.setCheckable(True)
            button.setChecked(True)
            button.setProperty("role", "filter")
            button.toggled.connect(lambda _: self._narrow())
        self.find = QLineEdit()
        self.find.setPlaceholderText("Find in the log")
        self.find.setAccessibleName("Find in the log")
        self.find.setClearButtonEnabled(True)
        self.find.textChanged.connect(lambda _: self._narrow())
        self.list = QListWidget()
        self.list.setAccessibleName("Log")
        self.list.setWordWrap(True)
        self.list.setMinimumHeight(56)
        self.list.setTextElideMode(Qt.TextElideMode.ElideNone)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.fold = QToolButton()
        self.fold.setText("Technical detail")
        self.fold.setToolTip("What the program says of it, for whoever mends it")
        self.fold.setCheckable(True)
        self.fold.setAutoRaise(True)
        self.fold.setProperty("role", "fold")
        self.fold.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.fold.toggled.connect(lambda _: self._show())
        self.detail = QPlainTextEdit()
        self.detail.setReadOnly(True)
        self.detail.setAccessibleName("Technical detail")
        self.detail.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self.detail.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self.detail.setFixedHeight(_DETAIL)
        self.report = QPushButton("Copy report")
        self.report.setToolTip("The chosen line with its detail and all versions, to send to whoever helps")
        self.report.clicked.connect(self.copy_report)
        copy, clear = self.tool("duplicate", "Copy all lines"), self.tool("delete", "Clear the log")
        copy.clicked.connect(self.copy)
        clear.clicked.connect(context.journal.clear)
        self.column.addLayout(row(*self.levels.values()))
        self.column.addWidget(self.find)
        self.column.addWidget(self.list, 1)
        self.column.addWidget(self.fold)
        self.column.addWidget(self.detail)
        self.column.addLayout(row(copy, clear, self.report))
        self.list.currentItemChanged.connect(lambda *_: self._show())
        self._keep = QTimer(self)  # the chosen line stays in sight when the list gets lower
        self._keep.setSingleShot(True)
        self._keep.timeout.connect(lambda: self.list.scrollToItem(self.list.currentItem()))
        self._seen = QTimer(self)
        self._seen.setSingleShot(True)
        self._seen.timeout.connect(context.journal.see)
        for entry in context.journal.entries:
            self._add(entry)
        self._show()
        self._count()
        self.subscriptions.add(
            context.journal.added.connect(self._add), context.journal.cleared.connect(self._cleared)
        )

    def copy(self) -> None:
        """All lines with their details, as text."""
        lines = []
        for entry in self.context.journal.entries:
            lines.append(f"{_when(entry)} {entry.level}: {entry.text}")
            lines += [entry.detail] if entry.detail else []
        copy_text("\n".join(lines))

    def copy_report(self) -> None:
        """The chosen line, or the last problem, as a report."""
        entry = self._chosen() or next(
            (e for e in reversed(self.context.journal.entries) if e.level == "problem"), None
        )
        if entry is not None:
            copy_text(report_text(entry.text, entry.detail, entry.time))
            self.context.journal.write("The report is on the clipboard.")

    def paintEvent(self, event: QPaintEvent) -> None:
        """Only what can be seen is painted."""
        super().paintEvent(event)
        self._seen.start(0)

    def set_theme(self, theme: Theme) -> None:
        """Colour the lines anew."""
        super().set_theme(theme)
        for index in range(self.list.count()):
            item = self.list.item(index)
            self._colour(item, item.data(_ROLE))

    def _chosen(self) -> Entry | None:
        item = self.list.currentItem()
        found: Entry | None = item.data(_ROLE) if item is not None else None
        return found

    def _add(self, entry: Entry) -> None:
        item = QListWidgetItem(f"{_when(entry)}  {entry.text}")
        item.setData(_ROLE, entry)
        self._colour(item, entry)
        self.list.addItem(item)
        item.setHidden(not self._fits(entry))
        limit = self.context.journal.entries.maxlen or 500
        while self.list.count() > limit:
            self.list.takeItem(0)
        self.list.scrollToBottom()
        self._count()
        self.update()

    def _cleared(self) -> None:
        self.list.clear()
        self._count()
        self._show()

    def _count(self) -> None:
        found = Counter(entry.level for entry in self.context.journal.entries)
        for level, button in self.levels.items():
            button.setText(f"{_LEVELS[level]} {found[level]}")
            button.setToolTip(f"List {_LEVELS[level].lower()}")
        self.report.setEnabled(self._chosen() is not None or found["problem"] > 0)

    def _fits(self, entry: Entry) -> bool:
        text = self.find.text().strip().casefold()
        return self.levels[entry.level].isChecked() and text in entry.text.casefold()

    def _narrow(self) -> None:
        for index in range(self.list.count()):
            item = self.list.item(index)
            item.setHidden(not self._fits(item.data(_ROLE)))

    def _colour(self, item: QListWidgetItem, entry: Entry) -> None:
        colours = {"note": self.theme.text, "warning": self.theme.warning, "problem": self.theme.problem}
        item.setForeground(QColor(colours[entry.level]))

    def _show(self) -> None:
        entry = self._chosen()
        there = entry is not None and bool(entry.detail)
        open_ = self.fold.isChecked()
        self.fold.setArrowType(Qt.ArrowType.DownArrow if open_ else Qt.ArrowType.RightArrow)
        self.fold.setVisible(there)
        self.detail.setPlainText(entry.detail if entry is not None else "")
        self.detail.setVisible(there and open_)
        if there and open_:
            self._keep.start(0)
        self._count()


def _when(entry: Entry) -> str:
    return time.strftime("%H:%M:%S", time.localtime(entry.time))
