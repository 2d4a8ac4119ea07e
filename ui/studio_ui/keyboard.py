"""The window without a mouse: F6 goes round picture, toolbar and panels; Esc goes back to the picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from PySide6.QtCore import QEvent, QObject, QPoint, Qt
from PySide6.QtGui import QContextMenuEvent, QKeyEvent
from PySide6.QtWidgets import QApplication, QDockWidget, QMainWindow, QMenu, QWidget

_REACHED = Qt.FocusPolicy.TabFocus


class Keyboard(QObject):
    """Places in the order of F6: the picture (or what lies over it), the bars, the panels that are seen.

    `menu` opens over the picture by the context menu's key.
    """

    def __init__(
        self, window: QMainWindow, picture: Callable[[], QWidget], docks: Mapping[str, QDockWidget]
    ) -> None:
        super().__init__(window)
        self._window, self._picture, self._docks = window, picture, docks
        self._bars: list[QWidget] = []
        self._menu: QMenu | None = None
        self._last: dict[QWidget, QWidget] = {}  # where the focus was in a place

    def start(self, bars: list[QWidget], menu: QMenu) -> None:
        """What there is besides the picture and the panels."""
        self._bars, self._menu = bars, menu
        for place in (*bars, *self._docks.values(), self._window.centralWidget()):
            place.installEventFilter(self)

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {"window.next": lambda: self.go(1), "window.previous": lambda: self.go(-1)}

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """None."""
        return {}

    @property
    def places(self) -> list[QWidget]:
        """What F6 goes round now."""
        docks = [dock for dock in self._docks.values() if _seen(dock)]
        central = self._window.centralWidget()
        return [central, *(bar for bar in self._bars if bar.isVisible()), *docks]

    def go(self, by: int) -> None:
        """To the next place (1) or the one before (-1), where the focus was in it."""
        places, now = self.places, QApplication.focusWidget()
        at = next((i for i, place in enumerate(places) if now is place or _holds(place, now)), 0)
        if now is not None:
            self._last[places[at]] = now
        for step in range(1, len(places) + 1):
            place = places[(at + by * step) % len(places)]
            target = self._target(place)
            if target is not None:
                target.window().activateWindow()
                target.setFocus(Qt.FocusReason.ShortcutFocusReason)
                return

    def to_picture(self) -> None:
        """The focus where the keys of the picture work."""
        self._window.activateWindow()
        self._picture().setFocus(Qt.FocusReason.ShortcutFocusReason)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Keys that nothing inside a place wanted."""
        if event.type() is QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            if event.key() == Qt.Key.Key_Escape and QApplication.focusWidget() is not self._picture():
                self.to_picture()
                return True
        elif event.type() is QEvent.Type.ContextMenu and isinstance(event, QContextMenuEvent):
            asked = event.reason() is QContextMenuEvent.Reason.Keyboard
            picture = self._picture()
            if asked and self._menu is not None and QApplication.focusWidget() is picture:
                middle = QPoint(picture.width() // 2, picture.height() // 2)
                self._menu.popup(picture.mapToGlobal(middle))
                return True
        return False

    def _target(self, place: QWidget) -> QWidget | None:
        last = self._last.get(place)
        if last is not None and last.isVisible() and last.isEnabled() and _holds(place, last):
            return last
        if place is self._window.centralWidget() and _usable(self._picture()):
            return self._picture()
        return next((w for w in in_order(place) if _usable(w)), None)


def in_order(place: QWidget) -> list[QWidget]:
    """The widgets in a place, as they were put there.

    (`QWidget.nextInFocusChain` would be truer to Tab, but each call makes PySide forget who owns what it
    returns, and soon the window's menus are gone.)
    """
    return place.findChildren(QWidget)


def _usable(widget: QWidget) -> bool:
    return widget.isVisible() and widget.isEnabled() and bool(widget.focusPolicy() & _REACHED)


def _holds(place: QWidget, widget: QWidget | None) -> bool:
    return widget is not None and place.isAncestorOf(widget)


def _seen(dock: QDockWidget) -> bool:
    """Not hidden, and not behind another tab."""
    return dock.isVisible() and not dock.visibleRegion().isEmpty()
