"""Turning the joined picture by dragging it, over a grid of horizon and compass."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QKeyEvent, QPainter, QPen

from studio_ui.capture.tools.tool import Canvas, Tool

Place = tuple[float, float]
_STEP = 0.5 / 360  # of the width, that an arrow key turns by


class TurnTool(Tool):
    """`begin()`, `preview(start, end, level)`, `commit()`, `cancel()`; `nudge(…)` of the same is a key."""

    tip = (
        "Drag the picture: sideways turns the room, up and down tilts the horizon there, "
        "with Shift it only turns; arrow keys do it by half a degree. Drag with the middle button to move"
    )

    def __init__(self) -> None:
        self.size = (2, 1)
        self.begin: Callable[[], bool] = lambda: False
        self.preview: Callable[[Place, Place, bool], object] = lambda start, end, level: None
        self.commit: Callable[[], object] = lambda: None
        self.cancel: Callable[[], object] = lambda: None
        self.nudge: Callable[[Place, Place, bool], object] = lambda start, end, level: None
        self._from: Place | None = None

    def paint(self, painter: QPainter, canvas: Canvas) -> None:
        """Horizon, and eight directions."""
        width, height = self.size
        for colour, wide in ((QColor(0, 0, 0, 130), 2.5), (QColor(canvas.theme.mark), 1.0)):
            painter.setPen(QPen(colour, wide))
            painter.drawLine(canvas.to_widget(0, height / 2), canvas.to_widget(width, height / 2))
            colour.setAlpha(colour.alpha() // 3)
            painter.setPen(QPen(colour, wide, Qt.PenStyle.DotLine))
            for eighth in range(9):
                x = width * eighth / 8
                painter.drawLine(canvas.to_widget(x, 0), canvas.to_widget(x, height))
            for quarter in (0.25, 0.75):
                painter.drawLine(
                    canvas.to_widget(0, height * quarter), canvas.to_widget(width, height * quarter)
                )

    def cursor(self, canvas: Canvas, at: QPointF) -> Qt.CursorShape | None:
        """A hand over the picture."""
        return Qt.CursorShape.OpenHandCursor if self._inside(self._place(canvas, at)) else None

    def press(self, canvas: Canvas, at: QPointF, keys: Qt.KeyboardModifier) -> bool:
        """Take the picture there."""
        place = self._place(canvas, at)
        if not self._inside(place) or not self.begin():
            return False
        self._from = place
        return True

    def move(self, canvas: Canvas, at: QPointF, keys: Qt.KeyboardModifier) -> None:
        """It follows."""
        if self._from is not None:
            level = bool(keys & Qt.KeyboardModifier.ShiftModifier)
            self.preview(self._from, self._place(canvas, at), level)

    def release(self, canvas: Canvas) -> None:
        """One step."""
        self._from = None
        self.commit()

    def drop(self, canvas: Canvas) -> bool:
        """As before."""
        dragging, self._from = self._from is not None, None
        if dragging:
            self.cancel()
        return dragging

    def key(self, canvas: Canvas, event: QKeyEvent) -> bool:
        """Arrows: at the middle of the picture."""
        moves = {
            Qt.Key.Key_Left: (-1, 0),
            Qt.Key.Key_Right: (1, 0),
            Qt.Key.Key_Up: (0, -1),
            Qt.Key.Key_Down: (0, 1),
        }
        if event.key() not in moves or event.modifiers() & Qt.KeyboardModifier.ControlModifier:
            return False
        by = _STEP * (10 if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1)
        dx, dy = moves[Qt.Key(event.key())]
        self.nudge((0.5, 0.5), (0.5 + by * dx, 0.5 + 2 * by * dy), dy == 0)
        return True

    def _place(self, canvas: Canvas, at: QPointF) -> Place:
        x, y = canvas.to_picture(at)
        return x / self.size[0], y / self.size[1]

    @staticmethod
    def _inside(place: Place) -> bool:
        return 0 <= place[0] < 1 and 0 <= place[1] < 1
