"""Edit ▸ Preferences: pages made from the catalogue, and the page of keys. Everything counts at once."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QFrame,
    QHBoxLayout,
    QListWidget,
    QListWidgetItem,
    QScrollArea,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from studio_ui.panels.panel import heading
from studio_ui.preferences.cache_part import CachePart
from studio_ui.preferences.catalogue import ALL, BY_NAME, FILES, KEYS, PAGES
from studio_ui.preferences.keys_page import KeysPage
from studio_ui.preferences.rows import PreferenceRows
from studio_ui.preferences.store import Preferences
from studio_ui.shortcuts import Shortcuts
from studio_ui.tasks import Tasks


class PreferencesDialog(QDialog):
    """Not modal: what changes is seen in the window beside it."""

    def __init__(
        self,
        parent: QWidget | None,
        preferences: Preferences,
        shortcuts: Shortcuts,
        tasks: Tasks,
        cache: Path,
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Preferences")
        self.resize(720, 560)
        self.list, self._pages = QListWidget(), QStackedWidget()
        self.list.setAccessibleName("Pages")
        self.list.setFixedWidth(130)
        self.rows: dict[str, PreferenceRows] = {}
        for page in PAGES:
            listed = [preference for preference in ALL if preference.page == page]
            self.rows[page] = PreferenceRows(preferences, listed)
            self._add(page, self.rows[page])
        self.cache = CachePart(tasks, cache)
        self._below(self.rows[FILES], self.cache)
        self.keys = KeysPage(shortcuts)
        self._add(KEYS, self.keys, scrolls=False)
        self.list.currentRowChanged.connect(self._pages.setCurrentIndex)
        self.list.setCurrentRow(0)
        beside = QHBoxLayout()
        beside.addWidget(self.list)
        beside.addWidget(self._pages, 1)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        buttons.rejected.connect(self.reject)
        column = QVBoxLayout(self)
        column.addLayout(beside)
        column.addWidget(buttons)
        self.cache.refresh()

    def show_page(self, page: str) -> None:
        """Turn to a page."""
        self.list.setCurrentRow([*PAGES, KEYS].index(page))

    def show_preference(self, name: str) -> None:
        """Turn to a preference and put the focus on it."""
        page = BY_NAME[name].page
        self.show_page(page)
        field = self.rows[page].fields[name]
        inner = next(
            (w for w in field.findChildren(QWidget) if w.focusPolicy() & Qt.FocusPolicy.TabFocus), field
        )
        inner.setFocus(Qt.FocusReason.ShortcutFocusReason)

    def done(self, result: int) -> None:
        """Closed, in whichever way: stop following and go."""
        super().done(result)
        for rows in self.rows.values():
            rows.close_panel()
        self.keys.close_panel()
        self.deleteLater()

    def _add(self, title: str, content: QWidget, *, scrolls: bool = True) -> None:
        page = QWidget()
        column = QVBoxLayout(page)
        column.setContentsMargins(8, 0, 0, 0)
        column.addWidget(heading(title))
        if scrolls:
            area = QScrollArea()
            area.setWidgetResizable(True)
            area.setFrameShape(QFrame.Shape.NoFrame)
            area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            area.setWidget(content)
            column.addWidget(area, 1)
        else:
            column.addWidget(content, 1)
        item = QListWidgetItem(title)
        item.setSizeHint(QSize(0, self.fontMetrics().height() + 12))
        self.list.addItem(item)
        self._pages.addWidget(page)

    @staticmethod
    def _below(rows: PreferenceRows, part: QWidget) -> None:
        layout = rows.layout()
        assert isinstance(layout, QVBoxLayout)
        layout.insertWidget(1, part)
