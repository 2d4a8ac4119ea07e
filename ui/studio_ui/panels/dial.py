"""A dial seen from above: where the middle of the environment's picture is around the room."""

from __future__ import annotations

import math
from collections.abc import Callable

from PySide6.QtCore import QPointF, QSize, Qt
from PySide6.QtGui import QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

_STEP, _SNAP = 5.0, 15.0  # degrees
_KEYS = {
    Qt.Key.Key_Left: -_STEP,
    Qt.Key.Key_Down: -_STEP,
    Qt.Key.Key_Right: _STEP,
    Qt.Key.Key_Up: _STEP,
}


class Dial(QWidget):
    """Degrees about the vertical, 0 towards the front (+z), counted towards the right (+x).

    A drag calls `began`, `turned` …, `ended`; a key calls `set_to`. Shift turns in steps of 15°.
    """

    def __init__(self, label: str) -> None:
        super().__init__()
        self.began: Callable[[], bool] = lambda: True
        self.turned: Callable[[float], object] = lambda degrees: None
        self.ended: Callable[[], object] = lambda: None
        self.set_to: Callable[[float], object] = lambda degrees: None
        self.degrees = 0.0
        self._dragging = False
        self.setAccessibleName(label)
        self.setToolTip("Drag around; Shift turns in steps of 15°, the arrow keys in steps of 5°")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)

    def sizeHint(self) -> QSize:
        """Large enough for a hand."""
        return QSize(60, 60)

    def show_degrees(self, degrees: float) -> None:
        """Without telling."""
        if degrees != self.degrees:
            self.degrees = degrees
            self.setAccessibleDescription(f"{degrees:.0f} degrees")
            self.update()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """A drag starts and goes to the mouse."""
        if event.button() == Qt.MouseButton.LeftButton and self.began():
            self._dragging = True
            self._follow(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Follow the mouse."""
        if self._dragging:
            self._follow(event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """The end of it."""
        if self._dragging and event.button() == Qt.MouseButton.LeftButton:
            self._dragging = False
            self.ended()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Arrow keys turn."""
        step = _KEYS.get(Qt.Key(event.key()))
        if step is None:
            super().keyPressEvent(event)
            return
        self.set_to(wrapped(self.degrees + step))

    def paintEvent(self, event: QPaintEvent) -> None:
        """A ring with ticks, and a hand."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        palette = self.palette()
        middle = QPointF(self.width() / 2, self.height() / 2)
        radius = min(self.width(), self.height()) / 2 - 3
        accent = palette.highlight().color()
        painter.setPen(QPen(accent if self.hasFocus() else palette.placeholderText().color(), 1.2))
        painter.setBrush(palette.base())
        painter.drawEllipse(middle, radius, radius)
        painter.setPen(QPen(palette.placeholderText().color(), 1))
        for tick in range(0, 360, 45):
            along = _way(tick)
            inner = radius - (6 if tick % 90 == 0 else 4)
            painter.drawLine(middle + along * inner, middle + along * (radius - 2))
        hand = _way(self.degrees)
        painter.setPen(QPen(accent, 2.2))
        painter.drawLine(middle, middle + hand * (radius - 9))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(accent)
        painter.drawEllipse(middle + hand * (radius - 8), 4.5, 4.5)
        painter.end()

    def _follow(self, event: QMouseEvent) -> None:
        place = event.position() - QPointF(self.width() / 2, self.height() / 2)
        if place.manhattanLength() < 3:
            return
        degrees = math.degrees(math.atan2(place.x(), place.y()))
        if event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            degrees = _SNAP * round(degrees / _SNAP)
        self.show_degrees(degrees)
        self.turned(round(degrees, 1))


def wrapped(degrees: float) -> float:
    """The same direction in (-180, 180]."""
    return -((180 - degrees) % 360 - 180)


def _way(degrees: float) -> QPointF:
    """Unit step on the screen: x to the right, z down."""
    return QPointF(math.sin(math.radians(degrees)), math.cos(math.radians(degrees)))
