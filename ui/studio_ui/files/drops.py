"""Drag and drop onto the window: models where they are dropped, light, projects, materials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from PySide6.QtCore import QEvent, QObject, QPoint, Qt, QTimer
from PySide6.QtGui import QDragMoveEvent, QDropEvent
from PySide6.QtWidgets import QWidget

from studio_core.scene.nodes import NodeId
from studio_ui.ask import Ask
from studio_ui.canvas.switch_viewport import SwitchViewport
from studio_ui.context import Context
from studio_ui.files.drop_intent import Intent, intent, intent_of
from studio_ui.files.drop_overlay import DropOverlay
from studio_ui.files.importing import Importing
from studio_ui.files.landing import Landing, landing
from studio_ui.files.project_files import ProjectFiles
from studio_ui.library.taking import Taking
from studio_ui.objects.material_drag import dragged_entry, dragged_material, drop_material, object_at

Place = tuple[NodeId, int | None]


class Drops(QObject):
    """Watches a window's drags. What is dropped is dealt with later: the other program waits for nothing."""

    def __init__(
        self,
        window: QWidget,
        context: Context,
        viewport: SwitchViewport,
        ask: Ask,
        files: ProjectFiles,
        importing: Importing,
        load_environment: Callable[[Path], object],
        capture: Callable[[Sequence[Path]], object],
        taking: Taking,
        fit: Callable[[Path], object],
    ) -> None:
        super().__init__(window)
        self.overlay = DropOverlay()
        self._window, self._context, self._viewport, self._ask = window, context, viewport, ask
        self._files, self._importing, self._load = files, importing, load_environment
        self._capture, self._taking, self._fit = capture, taking, fit
        self._intent: Intent | None = None
        window.setAcceptDrops(True)
        window.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Drags over the window, and what is let go there."""
        kind = event.type()
        if kind == QEvent.Type.DragEnter and isinstance(event, QDragMoveEvent):
            self._intent = intent(event.mimeData(), self._known())
            self._over(event)
            if self._intent is not None:
                event.accept()  # who ignores this is told of no move: a material comes from beside the canvas
            return True
        if kind == QEvent.Type.DragMove and isinstance(event, QDragMoveEvent):
            return self._over(event)
        if kind == QEvent.Type.DragLeave:
            self._done()
            return True
        if kind == QEvent.Type.Drop and isinstance(event, QDropEvent):
            return self._drop(event)
        return False

    def take(self, paths: Sequence[Path], where: Landing | None = None, *, options: bool = False) -> None:
        """What dropping files does."""
        self._do(intent_of(paths, self._known()), where, options)

    def _over(self, event: QDragMoveEvent) -> bool:
        meant = self._intent
        if meant is None:
            event.ignore()
            return True
        at = self._at(event.position().toPoint())
        if meant.material:
            found = self._viewport.probe(*at) if at is not None else None
            if found is None or found.node is None:
                self.overlay.hide()
                event.ignore()
                return True
            name = self._context.document.scene[found.node].name
            self.overlay.tell(f"Give {name} this material", bad=False)
            event.acceptProposedAction()
            return True
        where = self._landing(at) if meant.models else None
        options = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
        onto = self._onto(meant, at)
        whom = self._context.document.scene[onto[0]].name if onto is not None else ""
        text = meant.told(here=where is not None, options=options, whom=whom)
        self.overlay.tell(text, bad=bool(meant.problem), view=self._context.session.view, where=where)
        # what cannot be done is taken too, so that the reason can be told where it is let go
        event.setDropAction(Qt.DropAction.CopyAction)
        event.accept()
        return True

    def _drop(self, event: QDropEvent) -> bool:
        meant = self._intent or intent(event.mimeData(), self._known())
        self._done()
        if meant is None:
            event.ignore()
            return True
        event.setDropAction(Qt.DropAction.CopyAction)
        event.accept()
        at = self._at(event.position().toPoint())
        if meant.material:
            material, key = dragged_material(event.mimeData()), dragged_entry(event.mimeData())
            if material is not None and at is not None:
                drop_material(self._context, self._viewport, material, *at)
            elif key is not None and at is not None:
                self._taking.drop(self._viewport, key, *at)
            return True
        where = self._landing(at)
        options = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
        onto = self._onto(meant, at)
        QTimer.singleShot(0, self, lambda: self._do(meant, where, options, onto))
        return True

    def _do(self, meant: Intent, where: Landing | None, options: bool, onto: Place | None = None) -> None:
        if meant.problem:
            self._context.journal.write(meant.problem, "problem")
            return
        if meant.project is not None:
            self._files.open(meant.project)
            return
        if meant.samples is not None:
            self._fit(meant.samples)
        if meant.capture and self._ask.capture(len(meant.capture)):
            self._capture(meant.capture)
        if meant.light is not None and (not meant.photograph or self._ask.photograph(meant.light.name)):
            self._load(meant.light)
        if meant.materials:
            self._taking.take_files(meant.materials, onto)
        if meant.models:
            self._importing.take(meant.models, where, options=options)

    def _onto(self, meant: Intent, at: tuple[float, float] | None) -> Place | None:
        """The object that a file of one material is held over."""
        if at is None or meant.models or len(meant.materials) != 1:
            return None
        return object_at(self._context, self._viewport, *at)

    def _done(self) -> None:
        self._intent = None
        self.overlay.hide()

    def _at(self, point: QPoint) -> tuple[float, float] | None:
        """Canvas coordinates 0…1 of a point of the window; None beside the canvas."""
        canvas = self._viewport.widget
        at = canvas.mapFrom(self._window, point)
        if not canvas.rect().contains(at):
            return None
        return (at.x() + 0.5) / canvas.width(), (at.y() + 0.5) / canvas.height()

    def _landing(self, at: tuple[float, float] | None) -> Landing | None:
        if at is None or not self._context.document.scene.nodes:
            return None
        return landing(self._viewport.probe, self._context.session.view, *at)

    def _known(self) -> tuple[str, ...]:
        """Endings of models; none while the importers are not loaded."""
        if not self._context.warm:
            return ()
        found = self._context.host.available("importer").values()
        return tuple(ending for importer in found for ending in importer.extensions)
