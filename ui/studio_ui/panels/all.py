"""Every panel of the window, and on which side it is at first."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt

from studio_ui.ask import Ask
from studio_ui.capture.panel import CapturePanel
from studio_ui.context import Context
from studio_ui.library.library import MaterialLibrary
from studio_ui.library.panel import LibraryPanel
from studio_ui.library.taking import Taking
from studio_ui.panels.cameras import CamerasPanel
from studio_ui.panels.console import ConsolePanel
from studio_ui.panels.environment_shelf import EnvironmentShelf
from studio_ui.panels.history import HistoryPanel
from studio_ui.panels.jobs import JobsPanel
from studio_ui.panels.lighting import LightingPanel
from studio_ui.panels.log import LogPanel
from studio_ui.panels.materials import MaterialsPanel
from studio_ui.panels.outliner import OutlinerPanel
from studio_ui.panels.panel import Panel
from studio_ui.panels.properties import PropertiesPanel
from studio_ui.panels.shading import ShadingPanel
from studio_ui.plugins.panel import plugin_panels
from studio_ui.settings import Settings
from studio_ui.strokes.panel import StrokePanel
from studio_ui.views.camera_pictures import CameraPictures
from studio_ui.views.cameras import Cameras


def all_panels(
    context: Context,
    shelf: EnvironmentShelf,
    load_environment: Callable[[], object],
    ask: Ask,
    settings: Settings,
    save: Callable[[], object],
    cameras: Cameras,
    pictures: CameraPictures,
    capture: CapturePanel,
    strokes: StrokePanel,
    library: MaterialLibrary,
    taking: Taking,
    open_library: Callable[[], object],
) -> list[tuple[Panel, Qt.DockWidgetArea]]:
    """The panels in the order of the Window menu; tabs are in `layout`."""
    left, right = Qt.DockWidgetArea.LeftDockWidgetArea, Qt.DockWidgetArea.RightDockWidgetArea
    below = Qt.DockWidgetArea.BottomDockWidgetArea
    outliner, materials = OutlinerPanel(context), MaterialsPanel(context, library, open_library)
    taking.taken = materials.choose
    materials.list.dropped = taking.add_key
    outliner.model.given = taking.give_key
    return [
        (outliner, left),
        (LibraryPanel(context, library, taking, materials.work), left),
        (HistoryPanel(context), left),
        (CamerasPanel(context, cameras, pictures), left),
        (JobsPanel(context), left),
        (LogPanel(context), left),
        (PropertiesPanel(context), right),
        (materials, right),
        (LightingPanel(context, shelf, load_environment, ask.folder), right),
        (ShadingPanel(context), right),
        (ConsolePanel(context, ask, settings, save), below),
        (strokes, right),
        (capture, right),
        *((panel, right) for panel in plugin_panels(context)),
    ]
