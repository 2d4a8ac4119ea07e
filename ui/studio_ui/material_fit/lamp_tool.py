"""A lamp that is dragged over the picture: its middle is the camera, its edges are 80° away."""

from __future__ import annotations

import math
from collections.abc import Callable

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QPainter, QPen

from studio_ui.capture.tools.tool import Canvas, Tool

FURTHEST = 80.0  # degrees
_RADIUS = 8.0
Place = tuple[float, float]


class LampTool(Tool):
    """`moved(azimuth, height)` follows the hand, in degrees; Esc puts it back."""

    tip = "Drag the lamp over the picture"

    def __init__(self) -> None:
        self.size = (1, 1)
        self.place: Place = (0.0, 0.0)
        self.moved: Callable[[float, float], object] = lambda azimuth, height: None
        self._before: Place | None = None

    def paint(self, painter: QPainter, canvas: Canvas) -> None:
        """A disc with rays."""
        at = self._at(canvas)
        for colour, width in ((QColor(0, 0, 0, 170), 4.0), (QColor(canvas.theme.mark), 1.8)):
            painter.setPen(QPen(colour, width))
            painter.drawEllipse(at, _RADIUS, _RADIUS)
            for turn in range(8):
                ray = QPointF(math.cos(turn * math.pi / 4), math.sin(turn * math.pi / 4))
                painter.drawLine(at + ray * (_RADIUS + 3), at + ray * (_RADIUS + 7))

    def cursor(self, canvas: Canvas, at: QPointF) -> Qt.CursorShape | None:
        """A hand."""
        return Qt.CursorShape.PointingHandCursor

    def press(self, canvas: Canvas, at: QPointF, keys: Qt.KeyboardModifier) -> bool:
        """The lamp comes here."""
        self._before = self.place
        self.move(canvas, at, keys)
        return True

    def move(self, canvas: Canvas, at: QPointF, keys: Qt.KeyboardModifier) -> None:
        """And further."""
        x, y = canvas.to_picture(at)
        across, down = (2 * x / self.size[0] - 1), (2 * y / self.size[1] - 1)
        self._tell((_within(across * FURTHEST), _within(-down * FURTHEST)))

    def release(self, canvas: Canvas) -> None:
        """It stays."""
        self._before = None

    def drop(self, canvas: Canvas) -> bool:
        """As before."""
        before, self._before = self._before, None
        if before is not None:
            self._tell(before)
        return before is not None

    def _tell(self, place: Place) -> None:
        self.place = place
        self.moved(*place)

    def _at(self, canvas: Canvas) -> QPointF:
        azimuth, height = self.place
        x = (azimuth / FURTHEST + 1) / 2 * self.size[0]
        y = (1 - height / FURTHEST) / 2 * self.size[1]
        return canvas.to_widget(x, y)


def _within(degrees: float) -> float:
    return round(min(max(degrees, -FURTHEST), FURTHEST), 1)


__all__ = ["FURTHEST", "LampTool"]
