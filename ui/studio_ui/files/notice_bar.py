"""What went wrong, told over the picture until it is dismissed; nothing waits for an answer."""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QSizePolicy, QToolButton, QVBoxLayout

from studio_ui.context import Subscriptions
from studio_ui.files.report import ReportDialog, report_text
from studio_ui.journal import Entry, Journal
from studio_ui.look.icons import icon
from studio_ui.look.theme import DARK, Theme

_WIDEST = 760
_MOST = 3
_ADVICE = "The report stays here until you copy or save it. Nothing is sent."


class Bar(QFrame):
    """A sentence with buttons, as wide as it needs to be; `close` is None on one that stays."""

    def __init__(self, role: str, *, closable: bool = True) -> None:
        super().__init__()
        self.setObjectName("notice")
        self.setProperty("role", role)
        self.text = QLabel()
        self.text.setTextFormat(Qt.TextFormat.PlainText)
        self.text.setWordWrap(True)
        self.text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.text.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(12, 6, 6, 6)
        self._row.setSpacing(6)
        self._row.addWidget(self.text, 1)
        self.close_button: QToolButton | None = None
        if closable:
            self.close_button = QToolButton()
            self.close_button.setAutoRaise(True)
            self.close_button.setToolTip("Dismiss")
            self.close_button.setAccessibleName("Dismiss")
            self._row.addWidget(self.close_button)

    def button(self, text: str, tip: str, run: Callable[[], object]) -> QPushButton:
        """Another button."""
        made = QPushButton(text)
        made.setToolTip(tip)
        made.clicked.connect(lambda: run())
        at = self._row.count() - (1 if self.close_button is not None else 0)
        self._row.insertWidget(at, made)
        return made

    def set_theme(self, theme: Theme) -> None:
        """The icon's colour."""
        if self.close_button is not None:
            self.close_button.setIcon(icon("cancel", theme.text))

    def say(self, text: str) -> None:
        """The sentence."""
        self.text.setText(text)
        self.setAccessibleName(text)
        self.updateGeometry()

    def sizeHint(self) -> QSize:
        """One line where it fits."""
        words = self.text.fontMetrics().horizontalAdvance(self.text.text()) + 16
        others = super().minimumSizeHint().width()
        wide = min(_WIDEST, words + others)
        return QSize(wide, self.heightForWidth(wide))

    def hasHeightForWidth(self) -> bool:
        """Words wrap."""
        return True

    def heightForWidth(self, width: int) -> int:
        """For the words and the buttons."""
        return max(super().heightForWidth(width), 34)


class Notices(QFrame):
    """The journal's problems, the newest last, equal ones counted; the log has all."""

    def __init__(self, journal: Journal) -> None:
        super().__init__()
        self.setObjectName("notices")
        self._theme = DARK
        self._rows: list[tuple[Bar, Entry, int]] = []
        self._pinned: set[str] = set()
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(6)
        self._subscriptions = Subscriptions()
        self._subscriptions.add(journal.added.connect(self._added), journal.cleared.connect(self.clear))
        self.hide()

    @property
    def told(self) -> list[tuple[str, int]]:
        """What is shown, and how often it happened."""
        return [(entry.text, count) for _, entry, count in self._rows]

    @property
    def bars(self) -> list[Bar]:
        """The bars that are shown."""
        return [bar for bar, _, _ in self._rows]

    def set_theme(self, theme: Theme) -> None:
        """Colours."""
        self._theme = theme
        for bar, _, _ in self._rows:
            bar.set_theme(theme)

    def tell(self, text: str, detail: str) -> None:
        """Something that stays until it is dismissed, whatever is opened meanwhile."""
        entry = Entry("problem", text, detail, time.time())
        self._pinned.add(text)
        self._added(entry)

    def clear(self) -> None:
        """Dismiss what belongs to a document."""
        for bar, entry, _ in tuple(self._rows):
            if entry.text not in self._pinned:
                self._drop(bar)

    def close_panel(self) -> None:
        """Stop listening."""
        self._subscriptions.close()

    def hasHeightForWidth(self) -> bool:
        """Words wrap."""
        return True

    def heightForWidth(self, width: int) -> int:
        """Of all rows."""
        high = sum(bar.heightForWidth(width) for bar, _, _ in self._rows)
        return high + 6 * max(len(self._rows) - 1, 0)

    def sizeHint(self) -> QSize:
        """As wide as the widest."""
        wide = max((bar.sizeHint().width() for bar, _, _ in self._rows), default=0)
        return QSize(wide, self.heightForWidth(wide))

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Wrapped words may need another height."""
        self.updateGeometry()

    def _added(self, entry: Entry) -> None:
        if entry.level != "problem":
            return
        for index, (bar, known, count) in enumerate(self._rows):
            if known.text == entry.text:
                self._rows[index] = (bar, entry, count + 1)
                bar.say(f"{entry.text}  (×{count + 1})")
                return
        bar = Bar("problem")
        bar.say(entry.text)
        bar.set_theme(self._theme)
        bar.button("Details…", "What happened exactly, to copy or to save", lambda: self._details(bar))
        assert bar.close_button is not None
        bar.close_button.clicked.connect(lambda: self._drop(bar))
        self._rows.append((bar, entry, 1))
        self._column.addWidget(bar)
        if len(self._rows) > _MOST:
            self._drop(self._rows[0][0])
        self.show()
        self.updateGeometry()

    def _details(self, bar: Bar) -> None:
        entry = next((entry for known, entry, _ in self._rows if known is bar), None)
        if entry is not None:
            report = report_text(entry.text, entry.detail, entry.time)
            ReportDialog(self.window(), "What went wrong", entry.text, _ADVICE, report).open()

    def _drop(self, bar: Bar) -> None:
        self._rows = [row for row in self._rows if row[0] is not bar]
        self._column.removeWidget(bar)
        bar.hide()
        bar.deleteLater()
        self.setVisible(bool(self._rows))
        self.updateGeometry()
