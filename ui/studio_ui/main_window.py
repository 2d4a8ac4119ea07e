"""The main window: puts canvas, panels, features and status bar together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import QMainWindow

from studio_core.folders import user_cache
from studio_core.shading.scheduler import Executor
from studio_ui.actions.action_set import ActionSet
from studio_ui.ask import Ask
from studio_ui.canvas.choice import CanvasChoice
from studio_ui.canvas.switch_viewport import SwitchViewport
from studio_ui.canvas.tools import CanvasTools
from studio_ui.capture.feature import CaptureFeature
from studio_ui.capture.panel import CapturePanel
from studio_ui.context import Context
from studio_ui.dialogs import Dialogs
from studio_ui.features import Feature, gather
from studio_ui.files.drops import Drops
from studio_ui.files.first_room import FirstRoom
from studio_ui.files.front import Front
from studio_ui.files.importing import Importing
from studio_ui.files.project_files import ProjectFiles
from studio_ui.files.saved_label import SavedLabel
from studio_ui.files.thumbnails import Thumbnails
from studio_ui.files.transfer import Transfer
from studio_ui.files.versions import Versions
from studio_ui.following import Following
from studio_ui.help import Help
from studio_ui.hint_bar import HintBar
from studio_ui.keyboard import Keyboard
from studio_ui.layout import Layout
from studio_ui.layouts import Layouts
from studio_ui.library.library import MaterialLibrary
from studio_ui.library.palette_entries import library_entries
from studio_ui.library.taking import Taking
from studio_ui.look.appearance import Appearance
from studio_ui.look.badge import Badge
from studio_ui.material_fit.feature import MaterialFitting
from studio_ui.menus import Menus
from studio_ui.objects.arranging import Arranging
from studio_ui.objects.choosing import Choosing
from studio_ui.objects.commands import Commands
from studio_ui.objects.coordinates import TextureCoordinates
from studio_ui.objects.magnet import Magnet
from studio_ui.objects.rooms import Rooms
from studio_ui.palette.palette import Palette, menu_entries
from studio_ui.palette.scene_entries import scene_entries
from studio_ui.panels.all import all_panels
from studio_ui.panels.console import ConsoleDoor
from studio_ui.panels.environment_shelf import EnvironmentShelf
from studio_ui.panels.panel import Panel, stacked
from studio_ui.pictures.feature import PictureOut
from studio_ui.plugins.watch import BackendWatch
from studio_ui.preferences.effects import Effects
from studio_ui.preferences.feature import PreferencesFeature
from studio_ui.preferences.store import Preferences
from studio_ui.quality import QualityControl
from studio_ui.settings import Settings
from studio_ui.shortcuts import Shortcuts
from studio_ui.status import StatusBar
from studio_ui.strokes.feature import StrokeFeature
from studio_ui.strokes.panel import StrokePanel
from studio_ui.toolbar import Toolbar
from studio_ui.views.aids import ViewAids
from studio_ui.views.between import Between
from studio_ui.views.camera_pictures import CameraPictures
from studio_ui.views.cameras import Cameras
from studio_ui.views.controls import ViewControls
from studio_ui.views.viewing import Viewing

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
        thumbnails: Thumbnails | None = None,
    ) -> None:
        super().__init__()
        self.context, self.viewport, self.settings = context, viewport, settings
        self._samples = samples or {}
        self.closing = False
        self._in_close = False
        self.setDockNestingEnabled(True)
        self.status = StatusBar()
        self.setStatusBar(self.status)
        self.quality = QualityControl(context, width=64)
        self.status.addPermanentWidget(self.quality)
        self.shortcuts, self.preferences = Shortcuts(settings), Preferences(settings)
        self.hints = HintBar(context, settings)
        self.ask = ask or Dialogs(self)
        thumbnails = thumbnails or Thumbnails(settings.folder / "thumbnails")
        self.files = ProjectFiles(context, self.ask, settings, files_executor, thumbnails)
        self.saved = SavedLabel(self.files)
        self.status.addPermanentWidget(self.saved)
        self.badge = Badge(context.journal, lambda: self.layout_.show("log"))
        self.status.addPermanentWidget(self.badge)
        self.following = Following(self, context, viewport, self.status, self.files)
        features = self._features()
        load = self.transfer.load_environment
        self.drops = Drops(
            self,
            context,
            viewport,
            self.ask,
            self.files,
            self.importing,
            load,
            self.capture.take,
            self.taking,
            self.fitting.show,
        )
        room = FirstRoom(context, self.rooms.add, self.viewing.frame_all, self._samples)
        over = self.drops.overlay
        self.front = Front(context, viewport.widget, self.files, self._samples, load, over, room.begin)
        self.backend_watch = BackendWatch(context, self)
        self.front.widget.bar(self.backend_watch.bar)
        self.setCentralWidget(stacked(self.hints, self.front.widget))
        handlers, conditions = gather(features)
        self.actions_ = ActionSet(
            self, viewport.widget, handlers, conditions, self.following.soon, self.shortcuts
        )
        for panel in self.panels.values():
            panel.use_actions(self.actions_.actions)
        self.menus = Menus(self.menuBar(), self.actions_, self.cameras, self.files)
        self.menus.offer_samples(self._samples)
        self.menus.offer_panels(self.docks)
        self.layouts.offer(self.actions_.menus["Window/Layouts"])
        self._make_bar()
        wearers = [
            self.front.set_theme,
            self.backend_watch.bar.set_theme,
            self.aids.set_theme,
            self.toolbar.set_theme,
            self.fitting.set_theme,
            *(panel.set_theme for panel in self.panels.values()),
        ]
        self.appearance.start([self.actions_.set_theme, viewport.set_theme, self.hints.set_theme, *wearers])
        self._follow()
        self.resize(1440, 900)
        self.layout_.restore()

    def _features(self) -> list[Feature]:
        """What brings handlers of actions."""
        context, viewport, settings = self.context, self.viewport, self.settings
        self.magnet = Magnet(settings)
        self.tools = CanvasTools(
            viewport,
            context.document,
            context.session,
            context.editing,
            context.feed,
            self.magnet,
            self.status.say,
        )
        self.arranging = Arranging(context)
        self.commands = Commands(context, self.tools)
        self.viewing = Viewing(context, self.tools.looking, settings)
        self.cameras = Cameras(context, self.tools.looking, settings)
        self.pictures = PictureOut(
            self, context, self.ask, settings, self.cameras, lambda: self.files.name, self.files.beside
        )
        self.camera_pictures = CameraPictures(context, self.cameras, settings.folder / "cameras")
        self.aids = ViewAids(context, viewport, self.tools.looking, self.viewing, self.cameras, settings)
        self.transfer = Transfer(context, self.ask, self.files.beside)
        self.rooms = Rooms(context, self.status.say)
        self.importing = Importing(context, self.ask, settings, self.viewing.frame_all)
        self.canvas = CanvasChoice(viewport, settings, context.journal.write)
        self.appearance = Appearance(self.preferences, viewport, self.canvas)
        self.layout_ = Layout(self, settings, self._panels())
        self.layouts = Layouts(self.layout_, settings, self.ask)
        self.panels, self.docks = self.layout_.panels, self.layout_.docks
        self.capture = CaptureFeature(context, self.capture_panel, lambda: self.layout_.show("capture"))
        self.fitting = MaterialFitting(self, context, self.ask, self.library, self.taking)
        self.strokes = StrokeFeature(
            context,
            viewport,
            self.tools,
            settings,
            self.stroke_panel,
            self.status.say,
            lambda: self.layout_.show("strokes"),
        )
        self.keyboard = Keyboard(self, lambda: viewport.inner.widget, self.docks)
        chosen = PreferencesFeature(
            self, self.preferences, self.shortcuts, context.tasks, user_cache() / "computed"
        )
        self.preferences_ = chosen
        self.palette_ = Palette(
            self,
            settings,
            [
                lambda: menu_entries(self.menuBar(), self.actions_.reasons()),
                chosen.entries,
                lambda: scene_entries(context),
                lambda: library_entries(self.library, self.taking),
            ],
        )
        return [
            self,
            self.files,
            Versions(context, self.ask, self.files),
            self.transfer,
            self.importing,
            self.pictures,
            self.commands,
            self.viewing,
            self.arranging,
            TextureCoordinates(context),
            self.magnet,
            self.cameras,
            Between(context),
            self.aids,
            self.appearance,
            self.layout_,
            self.layouts,
            self.palette_,
            chosen,
            self.keyboard,
            self.hints,
            Choosing(context),
            ConsoleDoor(self.panels["console"], self.docks["console"]),
            Help(self, context, settings, self.shortcuts, self.viewing.mouse),
            self.rooms,
            self.capture,
            self.fitting,
            self.strokes,
        ]

    def _panels(self) -> list[tuple[Panel, Qt.DockWidgetArea]]:
        load, save = self.transfer.load_environment, self.files.save
        shelf = EnvironmentShelf(self.context, self.settings, self._samples, load)
        self.transfer.lit.connect(shelf.used)
        self.capture_panel = CapturePanel(
            self.context, self.ask, self.settings, self.files.beside, lambda: self.files.folder
        )
        seen, capture = self.camera_pictures, self.capture_panel
        self.stroke_panel = StrokePanel(self.context)
        self.library = MaterialLibrary(self.context, self.ask)
        self.library.opened.connect(lambda: self.layout_.show("library"))
        self.files.material = self.library.open
        self.taking = Taking(self.context, self.library)
        return all_panels(
            self.context,
            shelf,
            load,
            self.ask,
            self.settings,
            save,
            self.cameras,
            seen,
            capture,
            self.stroke_panel,
            self.library,
            self.taking,
            lambda: self.layout_.show("library"),
        )

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {"file.quit": self.close}

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """None."""
        return {}

    def _make_bar(self) -> None:
        self.view_controls = ViewControls(self.context, self.cameras)
        self.toolbar = Toolbar(self.actions_, self.view_controls)
        self.addToolBar(self.toolbar)
        self.keyboard.start([self.toolbar, self.status], self.actions_.menus["Object"])

    def _follow(self) -> None:
        self._autosave = QTimer(self)
        self._autosave.setInterval(_AUTOSAVE_MS)
        self._autosave.timeout.connect(self.files.tick)
        self._autosave.start()
        self.files.opened.connect(self._opened)
        self.tools.tool_changed.connect(lambda _: self.following.soon())
        self.cameras.changed.connect(self.following.soon)
        self.following.start(self.actions_)
        self.aids.start()
        self.effects = Effects(
            self.preferences, self.context, self.files, self.quality, self.viewing, self.following.soon
        )
        self.preferences_.dress_numbers()

    def _opened(self) -> None:
        self.tools.selecting.entered = None
        self.cameras.adopt()

    def take_files(self, paths: list[Path]) -> None:
        """What dropping does."""
        self.drops.take(paths)

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
        self.aids.close()
        self.camera_pictures.close()
        self.cameras.close()
        self.tools.close()
        self.context.feed.close()
        self.context.tasks.cancel()
        self.pictures.close()
        self.fitting.close()
        self.strokes.close()
        self.files.close()
        self.following.close()
        self.effects.close()
        self.appearance.close()
        self.preferences.close()
        self.backend_watch.close()
        self.front.close()
        self.saved.close_panel()
        self.view_controls.close_panel()
        self.hints.close_panel()
        self.quality.close_panel()
        self.badge.close_panel()
        for panel in self.panels.values():
            panel.close_panel()
