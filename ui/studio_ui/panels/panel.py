"""What every panel has: a context, subscriptions that end with it, and a scroll area where it is long."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QScrollArea, QToolButton, QVBoxLayout, QWidget
from shiboken6 import isValid

from studio_ui.context import Context, Subscriptions
from studio_ui.look.icons import icon
from studio_ui.look.theme import DARK, GAP, Theme


class Panel(QWidget):
    """Base of the panels: `id` names it in stored layouts, `title` is shown."""

    id = ""
    title = ""

    def __init__(self, context: Context) -> None:
        super().__init__()
        self.context = context
        self.subscriptions = Subscriptions()
        self.theme = DARK
        self._icons: list[tuple[QToolButton, str]] = []
        self.column = QVBoxLayout(self)
        self.column.setContentsMargins(GAP, GAP, GAP, GAP)
        self.column.setSpacing(GAP)

    def close_panel(self) -> None:
        """Stop listening; called once when the window goes."""
        self.subscriptions.close()

    def set_theme(self, theme: Theme) -> None:
        """Icons and colours of another theme."""
        self.theme = theme
        self._icons = [(button, name) for button, name in self._icons if isValid(button)]
        for button, name in self._icons:
            button.setIcon(icon(name, theme.text, theme.on_accent))

    def use_actions(self, actions: Mapping[str, QAction]) -> None:
        """The window's actions by id, for panels that offer some of them."""

    def tool(self, name: str, tip: str) -> QToolButton:
        """A small button with an icon."""
        button = QToolButton()
        button.setToolTip(tip)
        button.setAccessibleName(tip)
        button.setAutoRaise(True)
        button.setIcon(icon(name, self.theme.text, self.theme.on_accent))
        self._icons.append((button, name))
        return button

    @staticmethod
    def column_of(widget: QWidget) -> QVBoxLayout:
        """A column that fills a widget."""
        made = QVBoxLayout(widget)
        made.setContentsMargins(0, 0, 0, 0)
        made.setSpacing(GAP)
        return made

    def scroller(self, into: QVBoxLayout | None = None) -> QVBoxLayout:
        """A column inside a vertical scroll area that fills the rest of the panel, or of `into`."""
        area = Scroller()
        area.setWidgetResizable(True)
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # what is in it scrolls into sight
        area.setFrameShape(QFrame.Shape.NoFrame)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        inside = QWidget()
        column = QVBoxLayout(inside)
        column.setContentsMargins(0, 0, 2, 0)
        column.setSpacing(GAP)
        area.setWidget(inside)
        (into or self.column).addWidget(area, 1)
        return column

    def inside(self, column: QVBoxLayout) -> QVBoxLayout:
        """A column in a column, that can be cleared by itself."""
        made = QVBoxLayout()
        made.setSpacing(GAP)
        column.addLayout(made)
        return made


class Scroller(QScrollArea):
    """Scrolls up and down alone: it is never narrower than what is in it."""

    def minimumSizeHint(self) -> QSize:
        """As wide as its content and the scroll bar."""
        found = super().minimumSizeHint()
        inside = self.widget()
        if inside is not None:
            wide = inside.minimumSizeHint().width() + self.verticalScrollBar().sizeHint().width()
            found.setWidth(max(found.width(), wide))
        return found


def row(*widgets: QWidget, stretch: int = -1) -> QHBoxLayout:
    """Widgets side by side; the one at index `stretch` takes the room."""
    layout = QHBoxLayout()
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setSpacing(4)
    for index, widget in enumerate(widgets):
        layout.addWidget(widget, 1 if index == stretch else 0)
    if stretch < 0:
        layout.addStretch(1)
    return layout


def stacked(*widgets: QWidget) -> QWidget:
    """Widgets one above the other, without gaps; the last takes the room."""
    made = QWidget()
    layout = QVBoxLayout(made)
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setSpacing(0)
    for widget in widgets:
        layout.addWidget(widget, 1 if widget is widgets[-1] else 0)
    return made


def heading(text: str) -> QLabel:
    """A title inside a panel."""
    label = QLabel(text)
    label.setProperty("role", "title")
    return label


def note(text: str) -> QLabel:
    """A remark that wraps."""
    label = QLabel(text)
    label.setProperty("role", "dim")
    label.setWordWrap(True)
    return label


def clear(layout: QVBoxLayout) -> None:
    """Remove everything in a column."""
    while layout.count():
        item = layout.takeAt(0)
        widget = item.widget() if item is not None else None
        if widget is not None:
            widget.hide()
            widget.deleteLater()
