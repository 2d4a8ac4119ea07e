"""Capture: photographs of a room become its light. The inside is made when the panel is first shown."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QMimeData, QSignalBlocker, Qt, QTimer
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QHideEvent, QKeyEvent, QShowEvent
from PySide6.QtWidgets import QDockWidget, QLabel, QPushButton, QWidget

from studio_core.scene.capture import Capture
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Environment, NodeId, Scene
from studio_ui.ask import Ask
from studio_ui.capture.desk import CaptureDesk
from studio_ui.capture.reading import Reading
from studio_ui.context import Context
from studio_ui.files.drop_intent import CAMERAS, PHOTOGRAPHS, dropped_paths
from studio_ui.forms.fields import Combo
from studio_ui.look.theme import Theme
from studio_ui.panels.panel import Panel, note
from studio_ui.settings import Settings

if TYPE_CHECKING:
    from studio_ui.capture.work import CaptureWork

_PLACED = "capture_placed"
_SHARE = 0.8  # of the window, that the panel is large at first
_TELL_MS = 40


class CapturePanel(Panel):
    """Works on one capture of the scene; `desk` and the steps in `work` do so."""

    id = "capture"
    title = "Capture"

    def __init__(
        self,
        context: Context,
        ask: Ask,
        settings: Settings,
        beside: Callable[[str], Path],
        folder: Callable[[], Path | None],
    ) -> None:
        """`beside` suggests names of files; `folder` is the project's."""
        super().__init__(context)
        self._ask, self._settings, self._beside = ask, settings, beside
        self.reading = Reading(context, ask)
        self.desk = CaptureDesk(context, folder)
        self.reading.desk = self.desk
        self.reading.added = self.desk.open
        self.work: CaptureWork | None = None
        self.choice = Combo()
        self.choice.setAccessibleName("Capture")
        self.choice.setToolTip("Which capture of the project is worked on")
        self.choice.activated.connect(lambda i: self.desk.open(self.choice.itemData(i)))
        self.empty = QWidget()
        column = self.column_of(self.empty)
        column.addStretch(1)
        title = QLabel("A room's light, from photographs")
        title.setProperty("role", "title")
        title.setAlignment(Qt.AlignmentFlag.AlignHCenter)
        told = note(
            "Take the room to the front and to the back through a fisheye, each with several exposures, and "
            "drop the photographs here or on the window. One photograph with both circles, one lens or a "
            "picture all around will do, too."
        )
        told.setAlignment(Qt.AlignmentFlag.AlignHCenter)
        self.choose = QPushButton("Import photographs…")
        self.choose.clicked.connect(lambda: self.reading.choose())
        column.addWidget(title)
        column.addWidget(told)
        column.addWidget(self.choose, 0, Qt.AlignmentFlag.AlignHCenter)
        column.addStretch(1)
        self.column.addWidget(self.choice)
        self.column.addWidget(self.empty, 1)
        self.setAcceptDrops(True)
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self.refresh)
        self.subscriptions.add(
            context.document.changed.connect(self._edited),
            self.desk.changed.connect(self._follow),
            self.desk.told.connect(lambda: self._soon.start(_TELL_MS)),
            context.tasks.changed.connect(self._progress),
            self.desk.close,
        )
        self.choice.hide()

    def set_theme(self, theme: Theme) -> None:
        """Another theme."""
        super().set_theme(theme)
        if self.work is not None:
            self.work.set_theme(theme)

    def open(self, node: NodeId) -> None:
        """Work on this capture."""
        self.desk.open(node)

    def event(self, event: QEvent) -> bool:
        """Delete means something in this panel, or nothing: never what is chosen in the scene."""
        deletes = (Qt.Key.Key_Delete, Qt.Key.Key_Backspace)
        if (
            event.type() == QEvent.Type.ShortcutOverride
            and isinstance(event, QKeyEvent)
            and event.key() in deletes
        ):
            event.accept()
            return True
        return super().event(event)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Photographs, also while the panel is a window of its own."""
        if self._dropped(event.mimeData()):
            event.setDropAction(Qt.DropAction.CopyAction)
            event.accept()
        else:
            event.ignore()

    def dropEvent(self, event: QDropEvent) -> None:
        """More photographs of this room, or the first ones."""
        paths = self._dropped(event.mimeData())
        event.setDropAction(Qt.DropAction.CopyAction)
        event.accept()
        QTimer.singleShot(0, self, lambda: self.reading.take(paths, self.desk.node))

    def _dropped(self, data: QMimeData) -> list[Path]:
        """The photographs of a drag; none where it has other things, too."""
        if not data.hasUrls():
            return []
        paths = dropped_paths(data) or []
        known = {*PHOTOGRAPHS, *CAMERAS, ".tif", ".tiff"}
        return paths if all(path.suffix.lower() in known for path in paths) else []

    def showEvent(self, event: QShowEvent) -> None:
        """Somebody looks: what is not up to date is computed."""
        super().showEvent(event)
        self._choose_one()
        self.desk.want(True)
        self._soon.start(0)
        if not self._settings.get(_PLACED, False):
            QTimer.singleShot(0, self, self._place)

    def hideEvent(self, event: QHideEvent) -> None:
        """What runs ends, nothing new begins."""
        super().hideEvent(event)
        self.desk.want(False)

    def refresh(self) -> None:
        """What there is now."""
        if not self.isVisible():
            return
        self._choose_one()
        captures = list(self.context.document.scene.of(Capture))
        there = self.desk.capture is not None
        if there and self.work is None:
            self._build()
        self.empty.setVisible(not there)
        if self.work is not None:
            self.work.setVisible(there)
        self.choice.setVisible(len(captures) > 1)
        with QSignalBlocker(self.choice):
            self.choice.clear()
            for capture in captures:
                self.choice.addItem(capture.name, capture.id)
            self.choice.setCurrentIndex(self.choice.findData(self.desk.node))
        if there and self.work is not None:
            self.work.refresh()

    def _build(self) -> None:
        from studio_ui.capture.work import CaptureWork

        self.work = CaptureWork(
            self,
            self.context,
            self.desk,
            self._ask,
            self._beside,
            lambda: self.reading.choose(self.desk.node),
            self.reading.choose,
        )
        self.work.set_theme(self.theme)
        self.column.addWidget(self.work, 1)

    def _choose_one(self) -> None:
        """The last of the scene's captures where the one that was worked on is no more."""
        scene = self.context.document.scene
        if self.desk.capture is None:
            found = list(scene.of(Capture))
            if found:
                self.desk.open(found[-1].id)

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        there = (after.nodes.get(node, before.nodes.get(node)) for node in changes.nodes)
        if any(isinstance(node, Capture | Environment) for node in there):
            self._soon.start(0)

    def _follow(self) -> None:
        if self.work is not None:
            self.work.follow()
        self._soon.start(0)

    def _progress(self) -> None:
        if self.work is not None and self.isVisible():
            self.work.progress()

    def _place(self) -> None:
        """At first it floats and is large; after that it is where it was left."""
        dock = self.parentWidget()
        if not isinstance(dock, QDockWidget) or self._settings.get(_PLACED, False):
            return
        self._settings.set(_PLACED, True)
        window = dock.parentWidget()
        if window is None:
            return
        dock.setFloating(True)
        inside = window.frameGeometry()
        size = inside.size() * _SHARE
        dock.resize(size)
        dock.move(inside.center() - dock.rect().center())
