"""The main window: puts canvas, panels, actions and status bar together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QApplication, QMainWindow, QMessageBox, QToolBar, QWidget

from studio_core import __version__
from studio_core.errors import LucarneError
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Camera, Scene
from studio_core.shading.artifacts import MeasuredError
from studio_core.shading.scheduler import Executor
from studio_ui.actions import MOUSE, ActionSet, specs
from studio_ui.ask import Ask
from studio_ui.canvas.choice import PREFERENCES, CanvasChoice
from studio_ui.canvas.switch_viewport import SwitchViewport
from studio_ui.canvas.tools import CanvasTools
from studio_ui.canvas.viewport import Pointer
from studio_ui.commands import Commands
from studio_ui.context import Context, Subscriptions
from studio_ui.dialogs import Dialogs, KeysDialog, PluginsDialog
from studio_ui.feed import Shown
from studio_ui.hint_bar import HintBar
from studio_ui.layout import Layout
from studio_ui.panels.history import HistoryPanel
from studio_ui.panels.jobs import JobsPanel
from studio_ui.panels.lighting import LightingPanel
from studio_ui.panels.log import LogPanel
from studio_ui.panels.materials import MaterialsPanel
from studio_ui.panels.outliner import OutlinerPanel
from studio_ui.panels.panel import Panel, stacked
from studio_ui.panels.properties import PropertiesPanel
from studio_ui.panels.shading import ShadingPanel
from studio_ui.project_files import PROJECTS, SUFFIX, ProjectFiles
from studio_ui.quality import QualityControl
from studio_ui.settings import Settings
from studio_ui.status import StatusBar
from studio_ui.theme import DARK, THEMES, Theme, wear
from studio_ui.transfer import ENVIRONMENTS, Transfer
from studio_ui.view_controls import ViewControls

_AUTOSAVE_MS = 500


class MainWindow(QMainWindow):
    """One document's window. `ask` answers questions; tests bring their own."""

    def __init__(
        self,
        context: Context,
        viewport: SwitchViewport,
        settings: Settings,
        files_executor: Executor,
        samples: Mapping[str, Path] | None = None,
        ask: Ask | None = None,
    ) -> None:
        super().__init__()
        self.context, self.viewport, self.settings = context, viewport, settings
        self.canvas = CanvasChoice(viewport, settings, context.journal.write)
        self.ask = ask or Dialogs(self)
        self.closing = False
        self._in_close = False
        self._problem = ""  # the last failure of the picture that was told
        self._samples = samples or {}
        self._subscriptions = Subscriptions()
        self.files = ProjectFiles(context, self.ask, settings, files_executor)
        self.transfer = Transfer(context, self.ask, lambda: self.commands.frame_all())
        self.status = StatusBar()
        self.quality = QualityControl(context, width=64)
        self.status.addPermanentWidget(self.quality)
        self.tools = CanvasTools(
            viewport, context.document, context.session, context.editing, context.feed, self.status.say
        )
        self.commands = Commands(context, self.tools)
        self.setAcceptDrops(True)
        self.setDockNestingEnabled(True)
        self.hints = HintBar(context, settings)
        self.setCentralWidget(stacked(self.hints, viewport.widget))
        self.setStatusBar(self.status)
        self.actions_ = ActionSet(self, viewport.widget, self._handlers(), self._conditions())
        self.layout_ = Layout(self, settings, self._make_panels())
        self.panels, self.docks = self.layout_.panels, self.layout_.docks
        self._make_menus()
        self._make_bar()
        self._connect()
        self.set_theme(THEMES.get(settings.get("theme", DARK.name), DARK))
        self.resize(1440, 900)
        self.layout_.restore()
        self._refresh_soon()
        self._title()

    # putting together

    def _handlers(self) -> dict[str, Callable[[], object]]:
        files, transfer = self.files, self.transfer
        made = self.commands.handlers()
        made |= {
            "file.new": files.new,
            "file.open": self._open,
            "file.save": files.save,
            "file.save_as": files.save_as,
            "file.import": transfer.import_models,
            "file.environment": transfer.load_environment,
            "file.export_picture": lambda: transfer.export_picture(self._beside(".png")),
            "file.export_glb": lambda: transfer.export_scene("glb", self._beside(".glb")),
            "file.export_mitsuba": lambda: transfer.export_scene("mitsuba", self._beside("")),
            "file.quit": self.close,
            "view.dark": lambda: self.set_theme(THEMES["dark"]),
            "view.light": lambda: self.set_theme(THEMES["light"]),
            "view.grid": lambda: self.set_grid(self.actions_["view.grid"].isChecked()),
            "window.reset": lambda: self.layout_.reset(),
            "help.keys": self._keys,
            "help.plugins": lambda: PluginsDialog(self, self.context.host).open(),
            "help.about": self._about,
        }
        made |= {f"view.canvas_{name}": partial(self.canvas.prefer, name) for name in PREFERENCES}
        return made

    def _conditions(self) -> dict[str, Callable[[], bool]]:
        made = self.commands.conditions()
        made["savable"] = lambda: self.files.modified or self.files.path is None
        return made

    def _make_panels(self) -> list[tuple[Panel, Qt.DockWidgetArea]]:
        context = self.context
        left, right = Qt.DockWidgetArea.LeftDockWidgetArea, Qt.DockWidgetArea.RightDockWidgetArea
        return [
            (OutlinerPanel(context), left),
            (HistoryPanel(context), left),
            (JobsPanel(context), left),
            (LogPanel(context), left),
            (PropertiesPanel(context), right),
            (MaterialsPanel(context), right),
            (LightingPanel(context, self.transfer.load_environment), right),
            (ShadingPanel(context), right),
        ]

    def _make_menus(self) -> None:
        bar = self.menuBar()
        self.actions_.fill_menus(bar)
        file = self.actions_.menus["File"]
        before = file.actions()[2]
        self._recent_menu, self._sample_menu = file.addMenu("Open recent"), file.addMenu("Open sample")
        for menu in (self._recent_menu, self._sample_menu):
            file.insertMenu(before, menu)
        self._recent_menu.aboutToShow.connect(self._fill_recent)
        for name, path in self._samples.items():
            self._sample_menu.addAction(name, partial(self.files.open_copy, path))
        self._sample_menu.setEnabled(bool(self._samples))
        view = self.actions_.menus["View"]
        self._camera_menu = view.addMenu("Cameras")
        view.insertMenu(self.actions_["view.new_camera"], self._camera_menu)
        self._camera_menu.aboutToShow.connect(self._fill_cameras)
        window = self.actions_.menus["Window"]
        for dock in self.docks.values():
            window.insertAction(self.actions_["window.reset"], dock.toggleViewAction())
        window.insertSeparator(self.actions_["window.reset"])

    def _make_bar(self) -> None:
        bar = QToolBar("Toolbar")
        bar.setObjectName("toolbar")
        bar.setMovable(False)
        self.actions_.fill_bar(bar)
        room = QWidget()
        room.setSizePolicy(room.sizePolicy().Policy.Expanding, room.sizePolicy().Policy.Preferred)
        bar.addWidget(room)
        self.view_controls = ViewControls(self.context, self.commands)
        bar.addWidget(self.view_controls)
        self.addToolBar(bar)
        self.actions_["tool.move"].setChecked(True)

    def _connect(self) -> None:
        context, viewport = self.context, self.viewport
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self._refresh)
        self._autosave = QTimer(self)
        self._autosave.setInterval(_AUTOSAVE_MS)
        self._autosave.timeout.connect(self.files.tick)
        self._autosave.start()
        self._subscriptions.add(
            context.document.changed.connect(self._edited),
            context.session.selected.connect(self._refresh_soon),
            context.session.displayed.connect(self._display),
            context.session.changed.connect(lambda _: self._backend()),
            context.editing.began.connect(context.feed.hold),
            context.editing.settled.connect(context.feed.release),
            context.editing.settled.connect(self._refresh_soon),
            context.feed.shown.connect(self._shown),
            context.feed.freshness.connect(self._freshness),
            context.feed.failed.connect(self._failed),
            context.feed.measured.connect(self._measured),
            context.journal.added.connect(self.status.tell),
            context.warmed.connect(self._backend),
            self.files.changed.connect(self._title),
            self.files.opened.connect(self._opened),
            self.tools.tool_changed.connect(lambda tool: self.actions_[f"tool.{tool}"].setChecked(True)),
            viewport.resized.connect(context.feed.resized),
            viewport.pointer.connect(self._probe),
            viewport.left.connect(lambda: self.status.show_probe(None, context.document.scene)),
        )
        self._display()
        self._backend()
        self._greet()
        self.set_grid(self.settings.get("grid", False))
        self.actions_[f"view.canvas_{self.canvas.preference}"].setChecked(True)

    # following

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        gone = [n for n in self.context.session.selection if n not in after.nodes]
        if gone:
            self.context.session.select(n for n in self.context.session.selection if n in after.nodes)
        self._refresh_soon()
        self._greet()

    def _refresh_soon(self) -> None:
        if not self._soon.isActive():
            self._soon.start(0)

    def _refresh(self) -> None:
        self.actions_.refresh()
        document = self.context.document
        steps, at = document.history, document.position
        undo = f"Undo {steps[at].label}" if document.can_undo else "Undo"
        redo = f"Redo {steps[at + 1].label}" if document.can_redo else "Redo"
        self.actions_["edit.undo"].setText(undo)
        self.actions_["edit.redo"].setText(redo)

    def _display(self) -> None:
        session = self.context.session
        self.viewport.set_display(session.exposure, session.tonemap)

    def _backend(self) -> None:
        session = self.context.session
        label = session.backend
        if self.context.warm:
            try:
                label = self.context.host.get("backend", session.backend).label
            except LucarneError:
                label = session.backend
        self.status.show_backend(label)

    def _shown(self, shown: Shown) -> None:
        self._problem = ""
        self.viewport.set_picture(shown.picture, shown.view)
        self.status.show_picture(shown)
        self._refresh_soon()

    def _measured(self, error: MeasuredError | None) -> None:
        names = {node.id: node.name for node in self.context.document.scene.nodes.values()}
        self.status.show_error(error, names)

    def _freshness(self, state: object) -> None:
        self.viewport.set_freshness(self.context.feed.state)
        self.status.show_freshness(self.context.feed.state)
        self._refresh_soon()

    def _failed(self, error: Exception) -> None:
        """A stage failed: said once, until something else happens; the last picture stays."""
        told = f"{type(error).__name__}: {error}"
        if told == self._problem:
            return
        self._problem = told
        context, name = self.context, self.context.session.backend
        if not isinstance(error, LucarneError):
            try:
                plugin = context.host.provider("backend", name).id
            except LucarneError:
                plugin = name
            context.host.report(plugin, f"backend {name!r} failed while computing", error)
        context.journal.problem(f"Computing the picture with {name!r}", error)

    def _probe(self, pointer: Pointer) -> None:
        if pointer.kind == "move" and pointer.button == "none":
            probe = self.viewport.probe(pointer.x, pointer.y)
            self.status.show_probe(probe, self.context.document.scene)

    def _opened(self) -> None:
        self.viewport.set_picture(None, None)
        self.context.feed.forget()
        self.tools.entered = None
        self._greet()

    def _greet(self) -> None:
        empty = not self.context.document.scene.nodes
        text = "Drop a model, a picture of light or a project here,\nor open a sample from the File menu."
        self.viewport.set_message(text if empty else "")

    def _title(self) -> None:
        files = self.files
        where = " (read-only)" if files.read_only else ""
        self.setWindowTitle(f"{files.name}{where}[*] – Lucarne")
        self.setWindowModified(files.modified)
        self._refresh_soon()

    # looks

    def set_grid(self, shown: bool) -> None:
        """Lines on the ground, remembered."""
        self.settings.set("grid", shown)
        self.actions_["view.grid"].setChecked(shown)
        self.viewport.set_grid(shown)

    def set_theme(self, theme: Theme) -> None:
        """Another theme, remembered."""
        self.settings.set("theme", theme.name)
        application = QApplication.instance()
        if isinstance(application, QApplication):
            wear(application, theme)
        self.actions_.set_theme(theme)
        self.actions_[f"view.{theme.name}"].setChecked(True)
        self.viewport.set_theme(theme)
        self.hints.set_theme(theme)
        for panel in self.panels.values():
            panel.set_theme(theme)

    # menus

    def _open(self) -> None:
        chosen = self.ask.open_files("Open project", [PROJECTS])
        if chosen:
            self.files.open(chosen[0])

    def _beside(self, suffix: str) -> Path:
        path = self.files.path
        return (path.parent if path else Path.home()) / f"{self.files.name}{suffix}"

    def _fill_recent(self) -> None:
        self._recent_menu.clear()
        for path in self.settings.recent:
            self._recent_menu.addAction(str(path), partial(self.files.open, path))
        if self._recent_menu.isEmpty():
            self._recent_menu.addAction("None yet").setEnabled(False)

    def _fill_cameras(self) -> None:
        self._camera_menu.clear()
        for camera in self.context.document.scene.of(Camera):
            self._camera_menu.addAction(camera.name, partial(self.commands.look_through, camera.id))
        if self._camera_menu.isEmpty():
            self._camera_menu.addAction("None yet").setEnabled(False)

    def _keys(self) -> None:
        keys = [(spec.text.rstrip("…"), spec.shortcut) for spec in specs() if spec.shortcut]
        KeysDialog(self, [*MOUSE, *keys]).open()

    def _about(self) -> None:
        text = f"<b>Lucarne {__version__}</b><p>Furnish and light rooms truthfully.</p>"
        QMessageBox.about(self, "About Lucarne", text)

    # files dropped, and the end

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Files can be dropped anywhere."""
        if event.mimeData().hasUrls():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Projects open, pictures light the scene, anything else is imported."""
        self.take_files([Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()])
        event.acceptProposedAction()

    def take_files(self, paths: list[Path]) -> None:
        """What dropping does."""
        models = []
        for path in paths:
            if path.suffix.lower() == SUFFIX:
                self.files.open(path)
                return
            if path.suffix.lower() in ENVIRONMENTS.extensions:
                self.transfer.load_environment(path)
            else:
                models.append(path)
        if models:
            self.transfer.import_models(models)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Ask about unsaved changes; then let go of everything."""
        if not self.closing:
            self._in_close = True
            self.files.leave(self._leave)
            self._in_close = False
        if not self.closing:
            event.ignore()
            return
        self.shut()
        event.accept()

    def _leave(self) -> None:
        self.closing = True
        if not self._in_close:
            self.close()

    def shut(self) -> None:
        """Stop timers and subscriptions; a second call does nothing."""
        if not self._autosave.isActive():
            return
        self.layout_.keep()
        self.canvas.close()
        self.viewport.release()
        self._autosave.stop()
        self._soon.stop()
        self.tools.close()
        self.context.feed.close()
        self.context.tasks.cancel()
        self.files.close()
        self._subscriptions.close()
        self.view_controls.close_panel()
        self.hints.close_panel()
        self.quality.close_panel()
        for panel in self.panels.values():
            panel.close_panel()
