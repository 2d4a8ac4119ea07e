"""Where the panels are: docks and their tabs, remembered between sessions."""

from __future__ import annotations

import base64
from collections.abc import Callable, Collection, Sequence
from itertools import pairwise

from PySide6.QtCore import QByteArray, Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow, QTabBar, QTabWidget

from studio_ui.look.theme import PANEL_WIDTH
from studio_ui.panels.panel import Panel
from studio_ui.settings import Settings

_VERSION = 1  # stored layouts of another number are left alone
THIRD_PARTY = "plugin-"  # how the ids of plugins' panels begin
_HIDDEN = ("console", "capture")  # at first, and what plugins bring
_TABS = (
    ("outliner", "library"),
    ("history", "cameras", "jobs", "log"),
    ("properties", "materials", "lighting", "shading", "strokes"),
)


class Layout:
    """The docks of a main window by panel id."""

    def __init__(
        self,
        window: QMainWindow,
        settings: Settings,
        panels: Sequence[tuple[Panel, Qt.DockWidgetArea]],
    ) -> None:
        self.panels = {panel.id: panel for panel, _ in panels}
        self.docks: dict[str, QDockWidget] = {}
        self._window, self._settings = window, settings
        self._in_front: dict[str, tuple[bool, bool]] = {}  # before the last change, and now
        for panel, area in panels:
            dock = QDockWidget(panel.title, window)
            dock.setObjectName(f"dock-{panel.id}")
            dock.setWidget(panel)
            dock.setMinimumWidth(PANEL_WIDTH - 60)
            window.addDockWidget(area, dock)
            self.docks[panel.id] = dock
            dock.visibilityChanged.connect(lambda seen, name=panel.id: self._seen(name, seen))
            dock.toggleViewAction().triggered.connect(lambda shown, name=panel.id: self._toggled(name, shown))
        docks = self.docks
        for names in _TABS:
            for one, other in pairwise(names):
                window.tabifyDockWidget(docks[one], docks[other])
            docks[names[0]].raise_()
        window.setTabPosition(Qt.DockWidgetArea.AllDockWidgetAreas, QTabWidget.TabPosition.North)
        for tabs in window.findChildren(QTabBar):
            tabs.setElideMode(Qt.TextElideMode.ElideNone)
            tabs.setUsesScrollButtons(False)
            tabs.setAcceptDrops(True)
            tabs.setChangeCurrentOnDrag(True)  # a material is on its way from one panel to another
            tabs.setAccessibleName("Panels")
        window.resizeDocks([docks["outliner"], docks["history"]], [560, 260], Qt.Orientation.Vertical)
        sides = [docks["outliner"], docks["properties"]]
        window.resizeDocks(sides, [PANEL_WIDTH - 40, PANEL_WIDTH + 20], Qt.Orientation.Horizontal)
        window.resizeDocks([docks["console"]], [230], Qt.Orientation.Vertical)
        for name, dock in docks.items():
            if name in _HIDDEN or name.startswith(THIRD_PARTY):
                dock.hide()
        self._first = QByteArray()
        self._before: QByteArray | None = None  # the picture was alone

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {"window.reset": self.reset}

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """None."""
        return {}

    def _seen(self, name: str, visible: bool) -> None:
        """A panel came to the front, or went behind another one or away."""
        _, before = self._in_front.get(name, (False, False))
        self._in_front[name] = (before, visible)

    def _toggled(self, name: str, shown: bool) -> None:
        """Its entry in the menu: a panel that is behind another one comes to the front instead of going."""
        before, _ = self._in_front.get(name, (False, False))
        if shown or not before:
            self.show(name)

    def show(self, name: str) -> None:
        """Bring a panel to the front."""
        self.docks[name].show()
        self.docks[name].raise_()

    def restore(self) -> None:
        """As it was left; what is here now becomes what `reset` goes back to."""
        self._first = self._window.saveState(_VERSION)
        geometry, state = (self._settings.get(name, "") for name in ("geometry", "layout"))
        if geometry:
            self._window.restoreGeometry(QByteArray.fromBase64(geometry.encode()))
        if state:
            self._restore(QByteArray.fromBase64(state.encode()))

    def reset(self) -> None:
        """The docks as at the first start."""
        self.set_state(self._first)

    def arrange(self, shown: Collection[str], front: Sequence[str]) -> None:
        """Those panels in their first places, some in front; names of no panel are left out."""
        self.set_state(self._first)
        for name, dock in self.docks.items():
            dock.setVisible(name in shown)
        for name in front:
            if name in self.docks:
                self.docks[name].raise_()

    def state(self) -> QByteArray:
        """Where the docks are."""
        return self._window.saveState(_VERSION)

    def set_state(self, state: QByteArray) -> None:
        """Put the docks where they were."""
        self._before = None
        self._restore(state)

    def _restore(self, state: QByteArray) -> None:
        """Panels that were not there when it was kept come behind the tab they belong to."""
        self._window.restoreState(state, _VERSION)
        written = state.data()
        for names in _TABS:
            docks = [self.docks[name] for name in names]
            known = [dock for dock in docks if dock.objectName().encode("utf-16-be") in written]
            for dock in docks if known else ():
                if dock not in known:
                    dock.setFloating(False)
                    self._window.tabifyDockWidget(known[0], dock)
                    dock.setVisible(not known[0].isHidden())
                    known[0].raise_()

    @property
    def picture_only(self) -> bool:
        """Whether all panels were hidden together, and still are."""
        return self._before is not None and all(dock.isHidden() for dock in self.docks.values())

    def toggle_picture_only(self) -> None:
        """Hide all panels; once more shows those again that were there."""
        if self.picture_only and self._before is not None:
            self.set_state(self._before)
            return
        self._before = self.state()
        for dock in self.docks.values():
            dock.hide()

    def keep(self) -> None:
        """Remember how it is."""
        state = self._before if self.picture_only and self._before is not None else self.state()
        stored = {"geometry": self._window.saveGeometry(), "layout": state}
        for name, state in stored.items():
            self._settings.set(name, base64.b64encode(state.data()).decode())
