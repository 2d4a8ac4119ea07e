"""Places of the finished picture: a click says where the grey card or the measured surface is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPolygonF

from studio_core.imaging.latlong import direction_to_uv, equirect_direction
from studio_ui.capture.tools.tool import Canvas, Tool

Place = tuple[float, float]
_POINTS = 48


@dataclass(frozen=True)
class Pin:
    """A place (u, v) with its name; `size`: degrees across, 0 for a point."""

    name: str
    place: Place
    size: float = 0.0


class PlaceTool(Tool):
    """`pins` are drawn; a click or drag calls `begin()`, `preview(place)` …, `commit()` where `picking`."""

    tip = "Click where it is in the picture, or drag the mark"

    def __init__(self) -> None:
        self.size = (1, 1)
        self.pins: tuple[Pin, ...] = ()
        self.picking = ""
        self.begin: Callable[[], bool] = lambda: False
        self.preview: Callable[[Place], object] = lambda place: None
        self.commit: Callable[[], object] = lambda: None
        self.cancel: Callable[[], object] = lambda: None
        self._dragging = False

    def paint(self, painter: QPainter, canvas: Canvas) -> None:
        """Rings as wide as what is averaged, with their names."""
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for pin in self.pins:
            at = canvas.to_widget(pin.place[0] * self.size[0], pin.place[1] * self.size[1])
            for colour, width in ((QColor(0, 0, 0, 170), 4.0), (QColor(canvas.theme.mark), 1.8)):
                painter.setPen(QPen(colour, width))
                if pin.size > 0:
                    for run in self._ring(canvas, pin):
                        painter.drawPolyline(run)
                for dx, dy in ((7, 0), (-7, 0), (0, 7), (0, -7)):
                    painter.drawLine(at + QPointF(dx, dy) * 0.4, at + QPointF(dx, dy))
            corner = at + QPointF(10, -10)
            painter.setPen(QColor(0, 0, 0, 200))
            painter.drawText(corner + QPointF(1, 1), pin.name)
            painter.setPen(QColor("#ffffff"))
            painter.drawText(corner, pin.name)

    def cursor(self, canvas: Canvas, at: QPointF) -> Qt.CursorShape | None:
        """A cross where a place can be chosen."""
        return Qt.CursorShape.CrossCursor if self.picking and self._place(canvas, at) else None

    def press(self, canvas: Canvas, at: QPointF, keys: Qt.KeyboardModifier) -> bool:
        """Here."""
        place = self._place(canvas, at)
        if not self.picking or place is None or not self.begin():
            return False
        self._dragging = True
        self.preview(place)
        return True

    def move(self, canvas: Canvas, at: QPointF, keys: Qt.KeyboardModifier) -> None:
        """Or rather here."""
        place = self._place(canvas, at)
        if place is not None:
            self.preview(place)

    def release(self, canvas: Canvas) -> None:
        """One step."""
        self._dragging = False
        self.commit()

    def drop(self, canvas: Canvas) -> bool:
        """As before."""
        dragging, self._dragging = self._dragging, False
        if dragging:
            self.cancel()
        return dragging

    def _place(self, canvas: Canvas, at: QPointF) -> Place | None:
        x, y = canvas.to_picture(at)
        u, v = x / self.size[0], y / self.size[1]
        return (u, v) if 0 <= u < 1 and 0 <= v < 1 else None

    def _ring(self, canvas: Canvas, pin: Pin) -> list[QPolygonF]:
        """Around the place, in pieces where it goes over the picture's edge."""
        axis = equirect_direction(*pin.place)
        aside = np.cross(axis, (0.0, 1.0, 0.0) if abs(axis[1]) < 0.9 else (1.0, 0.0, 0.0))
        aside /= np.linalg.norm(aside)
        other = np.cross(axis, aside)
        angle, half = np.linspace(0, 2 * np.pi, _POINTS)[:, None], np.radians(pin.size / 2)
        u, v = direction_to_uv(
            np.cos(half) * axis + np.sin(half) * (np.cos(angle) * aside + np.sin(angle) * other)
        )
        runs: list[list[QPointF]] = [[]]
        for i in range(_POINTS):
            if i and abs(u[i] - u[i - 1]) > 0.5:
                runs.append([])
            runs[-1].append(canvas.to_widget(float(u[i]) * self.size[0], float(v[i]) * self.size[1]))
        return [QPolygonF(run) for run in runs if len(run) > 1]
