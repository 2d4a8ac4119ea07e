"""The lens' circle over its picture: moved by its middle, made larger by its rim, nudged by arrow keys."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QKeyEvent, QPainter, QPen

from studio_core.imaging.projection import Circle
from studio_ui.capture.tools.tool import Canvas, Tool

_GRIP = 9.0  # widget pixels
_RIM_POINTS = (0, 90, 180, 270)
_LEAST = 8.0  # pixels of a radius


class CircleTool(Tool):
    """`begin()`, `preview(circle)`, `commit()`, `cancel()` are the drag; `apply(circle)` is one step."""

    tip = (
        "Drag the middle to move the circle, its rim to make it larger or smaller; "
        "arrow keys nudge it by a pixel, with Alt its radius, with Shift ten times as far"
    )

    def __init__(self) -> None:
        self.circle: Circle | None = None
        self.sure = True
        self.begin: Callable[[], bool] = lambda: False
        self.preview: Callable[[Circle], object] = lambda circle: None
        self.commit: Callable[[], object] = lambda: None
        self.cancel: Callable[[], object] = lambda: None
        self.apply: Callable[[Circle], object] = lambda circle: None
        self._grip = ""
        self._start: tuple[Circle, float, float] | None = None

    def paint(self, painter: QPainter, canvas: Canvas) -> None:
        """Circle, cross and handles."""
        circle = self.circle
        if circle is None:
            return
        middle, reach = canvas.to_widget(circle.x, circle.y), self._reach(canvas, circle)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for colour, width in ((QColor(0, 0, 0, 150), 3.0), (QColor(canvas.theme.mark), 1.5)):
            style = Qt.PenStyle.SolidLine if self.sure else Qt.PenStyle.DashLine
            painter.setPen(QPen(colour, width, style))
            painter.drawEllipse(middle, reach, reach)
            painter.drawLine(middle - QPointF(_GRIP, 0), middle + QPointF(_GRIP, 0))
            painter.drawLine(middle - QPointF(0, _GRIP), middle + QPointF(0, _GRIP))
        painter.setPen(QPen(QColor(0, 0, 0, 160), 1))
        painter.setBrush(QColor(canvas.theme.mark))
        for degrees in _RIM_POINTS:
            angle = math.radians(degrees)
            painter.drawEllipse(middle + reach * QPointF(math.cos(angle), math.sin(angle)), 4.5, 4.5)

    def cursor(self, canvas: Canvas, at: QPointF) -> Qt.CursorShape | None:
        """Over the middle and the rim."""
        return {
            "middle": Qt.CursorShape.SizeAllCursor,
            "rim": Qt.CursorShape.PointingHandCursor,
        }.get(self._under(canvas, at))

    def press(self, canvas: Canvas, at: QPointF, keys: Qt.KeyboardModifier) -> bool:
        """Take the middle or the rim."""
        grip = self._under(canvas, at)
        if not grip or self.circle is None or not self.begin():
            return False
        self._grip = grip
        self._start = (self.circle, *canvas.to_picture(at))
        return True

    def move(self, canvas: Canvas, at: QPointF, keys: Qt.KeyboardModifier) -> None:
        """It follows."""
        if self._start is None:
            return
        start, x0, y0 = self._start
        x, y = canvas.to_picture(at)
        if self._grip == "middle":
            made = replace(start, x=start.x + x - x0, y=start.y + y - y0)
        else:
            grown = math.hypot(x - start.x, y - start.y) - math.hypot(x0 - start.x, y0 - start.y)
            made = replace(start, radius=max(start.radius + grown, _LEAST))
        self.preview(made)

    def release(self, canvas: Canvas) -> None:
        """One step."""
        self._start, self._grip = None, ""
        self.commit()

    def drop(self, canvas: Canvas) -> bool:
        """As before."""
        dragging, self._start, self._grip = self._start is not None, None, ""
        if dragging:
            self.cancel()
        return dragging

    def key(self, canvas: Canvas, event: QKeyEvent) -> bool:
        """Arrows."""
        steps = {
            Qt.Key.Key_Left: (-1, 0),
            Qt.Key.Key_Right: (1, 0),
            Qt.Key.Key_Up: (0, -1),
            Qt.Key.Key_Down: (0, 1),
        }
        keys = event.modifiers()
        if self.circle is None or event.key() not in steps or keys & Qt.KeyboardModifier.ControlModifier:
            return False
        by = 10.0 if keys & Qt.KeyboardModifier.ShiftModifier else 1.0
        dx, dy = steps[Qt.Key(event.key())]
        if keys & Qt.KeyboardModifier.AltModifier:
            radius = max(self.circle.radius + by * (dx - dy), _LEAST)
            self.apply(replace(self.circle, radius=radius))
        else:
            self.apply(replace(self.circle, x=self.circle.x + by * dx, y=self.circle.y + by * dy))
        return True

    def _reach(self, canvas: Canvas, circle: Circle) -> float:
        return (
            canvas.to_widget(circle.x + circle.radius, circle.y).x()
            - canvas.to_widget(circle.x, circle.y).x()
        )

    def _under(self, canvas: Canvas, at: QPointF) -> str:
        if self.circle is None:
            return ""
        away = at - canvas.to_widget(self.circle.x, self.circle.y)
        distance = math.hypot(away.x(), away.y())
        if abs(distance - self._reach(canvas, self.circle)) <= _GRIP:
            return "rim"
        return "middle" if distance <= 2 * _GRIP else ""
