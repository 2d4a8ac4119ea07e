"""The rectangles of reflections over a lens' picture, drawn as sectors of the ring near the frame."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QKeyEvent, QPainter, QPen, QPolygonF

from studio_core.capturing.settings import RING, Patch
from studio_core.imaging.projection import Circle, Lens
from studio_ui.capture.tools.ring import at_ring, dragged, drawn, grip_at, outline
from studio_ui.capture.tools.tool import Canvas, Tool

_REACH = 7.0  # widget pixels
_CURSORS = {
    "start": Qt.CursorShape.PointingHandCursor,
    "end": Qt.CursorShape.PointingHandCursor,
    "inner": Qt.CursorShape.PointingHandCursor,
    "outer": Qt.CursorShape.PointingHandCursor,
    "body": Qt.CursorShape.SizeAllCursor,
}
_NUDGES = {
    Qt.Key.Key_Left: (0.5, 0.0),
    Qt.Key.Key_Right: (-0.5, 0.0),
    Qt.Key.Key_Up: (0.0, 0.5),
    Qt.Key.Key_Down: (0.0, -0.5),
}


class RingTool(Tool):
    """`patches` are those of one side; `chosen` is the index of one, or −1.

    `begin(label)`, `preview(index, patch)`, `commit()`, `cancel()` are a drag (the index of a new one is
    their number), `apply(index, patch)` and `remove(index)` one step, `choose(index)` a click.
    """

    tip = (
        "Click a rectangle to choose it, drag it or its sides; drag where there is none to add one; "
        "arrow keys turn it and move it in and out, Delete takes it away"
    )

    def __init__(self) -> None:
        self.side = ""
        self.patches: tuple[Patch, ...] = ()
        self.chosen = -1
        self.lens: Lens | None = None
        self.circle: Circle | None = None
        self.begin: Callable[[str], bool] = lambda label: False
        self.preview: Callable[[int, Patch], object] = lambda index, patch: None
        self.commit: Callable[[], object] = lambda: None
        self.cancel: Callable[[], object] = lambda: None
        self.apply: Callable[[int, Patch], object] = lambda index, patch: None
        self.remove: Callable[[int], object] = lambda index: None
        self.choose: Callable[[int], object] = lambda index: None
        self._grip = ""
        self._from: tuple[int, Patch | None, float, float] | None = None

    @property
    def widest(self) -> float:
        """The lens' largest angle from its axis, degrees."""
        return math.degrees(self.lens.half) if self.lens is not None else 90.0

    def paint(self, painter: QPainter, canvas: Canvas) -> None:
        """All of the side's, the chosen one filled, and where the clean one comes from."""
        if self.lens is None or self.circle is None:
            return
        for index, patch in enumerate(self.patches):
            colour = QColor(canvas.theme.mark if patch.used else "#b9b9b9")
            chosen = index == self.chosen
            fill = QColor(colour)
            fill.setAlpha(40)
            painter.setBrush(fill if chosen else Qt.BrushStyle.NoBrush)  # what is in it is looked at
            style = Qt.PenStyle.SolidLine if patch.used else Qt.PenStyle.DotLine
            painter.setPen(QPen(QColor(0, 0, 0, 140), 3.5 if chosen else 2.5))
            polygon = self._polygon(canvas, patch)
            painter.drawPolygon(polygon)
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.setPen(QPen(colour, 2.0 if chosen else 1.2, style))
            painter.drawPolygon(polygon)
            if chosen and patch.source == RING:
                painter.setBrush(Qt.BrushStyle.NoBrush)
                painter.setPen(QPen(QColor("#7fd08a"), 1.5, Qt.PenStyle.DashLine))
                painter.drawPolygon(self._polygon(canvas, replace(patch, azimuth=patch.source_azimuth)))

    def cursor(self, canvas: Canvas, at: QPointF) -> Qt.CursorShape | None:
        """Over a rectangle, its sides, and where one can be drawn."""
        found = self._under(canvas, at)
        if found is not None:
            return _CURSORS[found[1]]
        return Qt.CursorShape.CrossCursor if self._in_ring(canvas, at) else None

    def press(self, canvas: Canvas, at: QPointF, keys: Qt.KeyboardModifier) -> bool:
        """Choose and take one, or begin another."""
        place = self._place(canvas, at)
        if place is None:
            return False
        found = self._under(canvas, at)
        if found is not None:
            index, grip = found
            self.choose(index)
            if not self.begin("Change a reflection's rectangle"):
                return False
            self._grip, self._from = grip, (index, self.patches[index], *place)
            return True
        if not self._in_ring(canvas, at) or not self.begin("Add a rectangle of reflections"):
            self.choose(-1)
            return False
        self._grip, self._from = "new", (len(self.patches), None, *place)
        return True

    def move(self, canvas: Canvas, at: QPointF, keys: Qt.KeyboardModifier) -> None:
        """It follows."""
        place = self._place(canvas, at)
        if self._from is None or place is None:
            return
        index, patch, azimuth, theta = self._from
        if patch is None:
            self.preview(index, drawn(self.side, (azimuth, theta), place, self.widest))
            return
        turn = (place[0] - azimuth + 180) % 360 - 180
        self.preview(index, dragged(patch, self._grip, turn, place[1] - theta, self.widest))

    def release(self, canvas: Canvas) -> None:
        """One step."""
        begun, self._from, self._grip = self._from, None, ""
        self.commit()
        if begun is not None and begun[1] is None:
            self.choose(begun[0])

    def drop(self, canvas: Canvas) -> bool:
        """As before."""
        dragging, self._from, self._grip = self._from is not None, None, ""
        if dragging:
            self.cancel()
        return dragging

    def key(self, canvas: Canvas, event: QKeyEvent) -> bool:
        """Delete, and arrows for the chosen one."""
        if not 0 <= self.chosen < len(self.patches):
            return False
        if event.key() in (Qt.Key.Key_Delete, Qt.Key.Key_Backspace):
            self.remove(self.chosen)
            return True
        if event.key() not in _NUDGES or event.modifiers() & Qt.KeyboardModifier.ControlModifier:
            return False
        by = 10.0 if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1.0
        azimuth, theta = _NUDGES[Qt.Key(event.key())]
        patch = self.patches[self.chosen]
        self.apply(self.chosen, dragged(patch, "body", by * azimuth, by * theta, self.widest))
        return True

    def _polygon(self, canvas: Canvas, patch: Patch) -> QPolygonF:
        assert self.lens is not None
        assert self.circle is not None
        points = outline(self.lens, self.circle, patch)
        return QPolygonF([canvas.to_widget(float(x), float(y)) for x, y in points])

    def _place(self, canvas: Canvas, at: QPointF) -> tuple[float, float] | None:
        if self.lens is None or self.circle is None:
            return None
        return at_ring(self.lens, self.circle, *canvas.to_picture(at))

    def _in_ring(self, canvas: Canvas, at: QPointF) -> bool:
        """Whether reflections can be there: in the circle's outer third."""
        if self.circle is None:
            return False
        x, y = canvas.to_picture(at)
        reach = math.hypot(x - self.circle.x, y - self.circle.y) / self.circle.radius
        return 0.6 <= reach <= 1.02

    def _under(self, canvas: Canvas, at: QPointF) -> tuple[int, str] | None:
        place = self._place(canvas, at)
        if place is None or self.circle is None:
            return None
        x, y = canvas.to_picture(at)
        pixels = math.hypot(x - self.circle.x, y - self.circle.y)
        one = canvas.to_picture(at + QPointF(_REACH, 0))[0] - x
        reach_azimuth = math.degrees(one / max(pixels, one))
        reach_theta = self.widest * one / self.circle.radius
        order = sorted(range(len(self.patches)), key=lambda i: i != self.chosen)
        for index in order:
            grip = grip_at(self.patches[index], *place, reach_azimuth, reach_theta)
            if grip:
                return index, grip
        return None
