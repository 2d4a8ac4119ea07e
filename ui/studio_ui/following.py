"""What the window shows by itself: title, status bar, badge, messages, which actions can be done."""

from __future__ import annotations

import traceback

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QMainWindow

from studio_core.errors import LucarneError
from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.nodes import Scene
from studio_core.shading.artifacts import MeasuredError
from studio_ui.actions.action_set import ActionSet
from studio_ui.canvas.switch_viewport import SwitchViewport
from studio_ui.canvas.viewport import Pointer
from studio_ui.context import Context, Subscriptions
from studio_ui.feed import Shown
from studio_ui.files.project_files import ProjectFiles
from studio_ui.plugins.watch import plugin_of
from studio_ui.status import StatusBar

_WELCOME = "Drop a model, a picture of light or a project here,\nor open a sample from the File menu."


class Following:
    """Follows document, session, feed and files for one window; `soon` asks the actions again."""

    def __init__(
        self,
        window: QMainWindow,
        context: Context,
        viewport: SwitchViewport,
        status: StatusBar,
        files: ProjectFiles,
    ) -> None:
        self._window, self._context, self._viewport = window, context, viewport
        self._status, self._files = status, files
        self._actions: ActionSet | None = None
        self._problem = ""  # the last failure of the picture that was told
        self._subscriptions = Subscriptions()
        self._soon = QTimer(window)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self.refresh)

    def start(self, actions: ActionSet) -> None:
        """Show how everything is, and follow it."""
        self._actions = actions
        context, viewport = self._context, self._viewport
        self._subscriptions.add(
            context.document.changed.connect(self._edited),
            context.session.selected.connect(self.soon),
            context.session.displayed.connect(self._display),
            context.session.changed.connect(self._computed),
            context.editing.began.connect(context.feed.hold),
            context.editing.settled.connect(context.feed.release),
            context.editing.settled.connect(self.soon),
            context.feed.shown.connect(self._shown),
            context.feed.freshness.connect(self._freshness),
            context.feed.failed.connect(self._failed),
            context.feed.measured.connect(self._measured),
            context.journal.added.connect(self._status.tell),
            context.journal.added.connect(lambda _: self.soon()),
            context.tasks.changed.connect(self.soon),
            context.warmed.connect(self._backend),
            self._files.changed.connect(self._title),
            self._files.opened.connect(self._opened),
            viewport.resized.connect(context.feed.resized),
            viewport.pointer.connect(self._probe),
            viewport.left.connect(lambda: self._status.show_probe(None, context.document.scene)),
        )
        viewport.set_scene(context.document.scene)
        self._display()
        self._backend()
        self._greet()
        self._title()
        self.refresh()

    def close(self) -> None:
        """Stop following."""
        self._soon.stop()
        self._subscriptions.close()
        self._actions = None

    @property
    def pending(self) -> bool:
        """Whether the actions are about to be asked again."""
        return self._soon.isActive()

    def soon(self) -> None:
        """Ask the actions again when the events at hand are done."""
        if self._actions is not None and not self._soon.isActive():
            self._soon.start(0)

    def refresh(self) -> None:
        """Ask the actions again."""
        if self._actions is None:
            return
        self._actions.refresh()
        document = self._context.document
        steps, at = document.history, document.position
        undo = f"Undo {steps[at].label}" if document.can_undo else "Undo"
        redo = f"Redo {steps[at + 1].label}" if document.can_redo else "Redo"
        failed = len({failure.plugin for failure in self._context.host.failures})
        self._actions["help.plugins"].setText(f"Plugins ({failed} failed)" if failed else "Plugins")
        self._actions["edit.undo"].setText(undo)
        self._actions["edit.redo"].setText(redo)

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        session = self._context.session
        if any(n not in after.nodes for n in session.selection):
            session.select(n for n in session.selection if n in after.nodes)
        self._viewport.set_scene(after)
        self.soon()
        self._greet()

    def _display(self) -> None:
        session = self._context.session
        self._viewport.set_display(session.exposure, session.tonemap)

    def _computed(self, aspect: Aspect) -> None:
        if aspect & (Aspect.QUALITY | Aspect.INDIRECT):
            self._backend()
            self.soon()

    def _backend(self) -> None:
        session = self._context.session
        label = session.backend
        if self._context.warm:
            try:
                label = self._context.host.get("backend", session.backend).label
            except LucarneError:
                label = session.backend
        self._status.show_backend(label)

    def _shown(self, shown: Shown) -> None:
        self._problem = ""
        self._viewport.set_picture(shown.picture, shown.view)
        self._status.show_picture(shown)
        self.soon()

    def _measured(self, error: MeasuredError | None) -> None:
        names = {node.id: node.name for node in self._context.document.scene.nodes.values()}
        self._status.show_error(error, names)

    def _freshness(self, state: object) -> None:
        self._viewport.set_freshness(self._context.feed.state)
        self._status.show_freshness(self._context.feed.state)
        self.soon()

    def _failed(self, error: Exception) -> None:
        """A stage failed: said once, until something else happens; the last picture stays."""
        told = f"{type(error).__name__}: {error}"
        if told == self._problem:
            return
        self._problem = told
        context, name = self._context, self._context.session.backend
        if isinstance(error, LucarneError):
            context.journal.problem("Computing the picture", error)
            return
        plugin = plugin_of(context, name)
        context.host.report(plugin, f"backend {name!r} failed while computing", error)
        fault = f"a fault in the plugin {plugin} ({error})"
        text = f"The picture could not be computed with {name!r} because of {fault}."
        context.journal.write(text, "problem", "".join(traceback.format_exception(error)))

    def _probe(self, pointer: Pointer) -> None:
        if pointer.kind == "move" and pointer.button == "none":
            probe = self._viewport.probe(pointer.x, pointer.y)
            self._status.show_probe(probe, self._context.document.scene)

    def _opened(self) -> None:
        self._viewport.set_picture(None, None)
        self._status.forget_picture()
        self._context.feed.forget()
        self._greet()

    def _greet(self) -> None:
        empty = not self._context.document.scene.nodes
        self._viewport.set_message(_WELCOME if empty else "")

    def _title(self) -> None:
        files = self._files
        where = " (read-only)" if files.read_only else ""
        self._window.setWindowTitle(f"{files.name}{where}[*] – Lucarne")
        self._window.setWindowModified(files.modified)
        self.soon()
