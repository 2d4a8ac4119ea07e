"""What an empty document shows: recent projects, samples, and how to begin."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QScrollArea, QVBoxLayout, QWidget

from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Scene
from studio_ui.context import Context, Subscriptions
from studio_ui.files.cards import WIDTH, Card, Shelf
from studio_ui.files.recent import RecentProjects, folder_text, when
from studio_ui.files.thumbnails import read_small
from studio_ui.look.icons import icon
from studio_ui.look.theme import DARK, Theme

_COLUMNS = 4
_SHOWN = 8


@dataclass(frozen=True)
class Begin:
    """A button of the page."""

    text: str
    tip: str
    icon: str
    run: Callable[[], object]


class StartPage(QWidget):
    """Over the canvas while the scene is empty."""

    def __init__(
        self,
        context: Context,
        recent: RecentProjects,
        samples: Mapping[str, Path],
        open_project: Callable[[Path], object],
        open_sample: Callable[[Path], object],
        begin: Sequence[Begin],
    ) -> None:
        super().__init__()
        self.setObjectName("start")
        self.setAccessibleName("Start page")
        self._context, self._recent, self._theme = context, recent, DARK
        self._open, self._dismissed = open_project, False
        self.samples, self.projects = Shelf(), Shelf()
        self.buttons: list[tuple[QPushButton, str]] = []
        self._column = QVBoxLayout()
        self._column.setSpacing(10)
        self._column.addLayout(self._buttons(begin))
        self._recent_title = _title("Recent projects")
        self._column.addSpacing(14)
        self._column.addWidget(self._recent_title)
        self._column.addWidget(self.projects)
        self._column.addSpacing(14)
        self._samples_title = _title("Samples")
        self._column.addWidget(self._samples_title)
        self._column.addWidget(self.samples)
        self._column.addSpacing(14)
        hint = QLabel("Or drop a model, a picture of light or a project here.")
        hint.setProperty("role", "dim")
        self._column.addWidget(hint)
        self._column.addStretch(1)
        self._frame()
        self.samples.put([self._sample(name, path, open_sample) for name, path in samples.items()])
        self._samples_title.setVisible(bool(samples))
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            context.document.changed.connect(self._edited), recent.changed.connect(self._fill)
        )
        self._fill()
        self.hide()

    def dismiss(self) -> None:
        """Hide the page until another document is opened."""
        self._dismissed = True
        self.refresh()

    def open_again(self) -> None:
        """Another document was opened."""
        self._dismissed = False
        self.refresh()

    def refresh(self) -> None:
        """Show the page if the scene is empty."""
        empty = not self._context.document.scene.nodes and not self._dismissed
        if empty == self.isHidden():
            self.setVisible(empty)
        if empty:
            self._recent.refresh()

    def close_panel(self) -> None:
        """Stop listening."""
        self._subscriptions.close()

    def set_theme(self, theme: Theme) -> None:
        """Colours and icons."""
        self._theme = theme
        for card in (*self.projects.cards, *self.samples.cards):
            card.set_theme(theme)
        for button, name in self.buttons:
            button.setIcon(icon(name, theme.text))
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """A ground of its own: what was shown before is gone."""
        QPainter(self).fillRect(self.rect(), QColor(self._theme.window))

    def _frame(self) -> None:
        """A column of bounded width in the middle, scrolled where it is too long."""
        inside = QWidget()
        across = QHBoxLayout(inside)
        across.setContentsMargins(28, 28, 28, 20)
        middle = QWidget()
        middle.setMaximumWidth(_COLUMNS * WIDTH + (_COLUMNS - 1) * 14 + 4)
        middle.setLayout(self._column)
        self._column.setContentsMargins(0, 0, 0, 0)
        across.addStretch(1)
        across.addWidget(middle, 100)
        across.addStretch(1)
        area = QScrollArea()
        area.setWidgetResizable(True)
        area.setFrameShape(QFrame.Shape.NoFrame)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        area.setWidget(inside)
        inside.setAutoFillBackground(False)
        area.viewport().setAutoFillBackground(False)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(area)

    def _buttons(self, begin: Sequence[Begin]) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setSpacing(8)
        for one in begin:
            button = QPushButton(one.text)
            button.setToolTip(one.tip)
            button.setAccessibleDescription(one.tip)
            button.clicked.connect(lambda checked=False, run=one.run: run())
            self.buttons.append((button, one.icon))
            row.addWidget(button)
        row.addStretch(1)
        return row

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        self.refresh()

    def _fill(self) -> None:
        cards = []
        for project in self._recent.projects[:_SHOWN]:
            path = project.path
            last = "not found" if project.saved is None else when(project.saved) if project.saved else ""
            card = Card(project.name, (folder_text(path), last), project.image, faded=not project.there)
            card.setToolTip(str(path) if project.there else f"{path}\nThis file is not there any more.")
            card.clicked.connect(partial(self._open, path))
            if not project.there:
                card.corner("Remove from list").clicked.connect(partial(self._recent.forget, path))
            card.set_theme(self._theme)
            cards.append(card)
        self.projects.put(cards)
        self._recent_title.setVisible(bool(cards))

    def _sample(self, name: str, path: Path, run: Callable[[Path], object]) -> Card:
        card = Card(name, ("Opens as a copy",), read_small(path.with_suffix(".jpg")))
        card.clicked.connect(partial(run, path))
        return card


def _title(text: str) -> QLabel:
    label = QLabel(text)
    label.setProperty("role", "title")
    return label
