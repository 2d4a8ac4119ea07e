"""Drags over a window under test, as Qt sends them."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDragLeaveEvent, QDragMoveEvent, QDropEvent
from PySide6.QtWidgets import QApplication
from ui_support import Driver


def files(*paths: Path) -> QMimeData:
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
    return data


class Drag:
    """A drag over the window, as Qt sends it."""

    def __init__(self, driver: Driver, data: QMimeData, keys: Qt.KeyboardModifier | None = None) -> None:
        self.driver, self.data = driver, data
        self.keys = keys or Qt.KeyboardModifier.NoModifier

    def _send(self, kind: type, at: QPoint) -> bool:
        point = at if kind is not QDropEvent else QPointF(at)
        copy, left = Qt.DropAction.CopyAction, Qt.MouseButton.LeftButton
        event = kind(point, copy, self.data, left, self.keys)
        event.setAccepted(False)
        QApplication.sendEvent(self.driver.window, event)
        return event.isAccepted()

    def over(self, at: QPoint) -> bool:
        entered = self._send(QDragEnterEvent, at)
        return self._send(QDragMoveEvent, at) and entered

    def drop(self, at: QPoint) -> bool:
        self.over(at)
        return self._send(QDropEvent, at)

    def leave(self) -> None:
        QApplication.sendEvent(self.driver.window, QDragLeaveEvent())


def on_canvas(driver: Driver, point: tuple[float, float, float]) -> QPoint:
    return driver.viewport.mapTo(driver.window, driver.at(point))
