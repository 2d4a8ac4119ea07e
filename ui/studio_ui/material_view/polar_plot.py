"""The lobe in the plane of incidence, as a half disc; the light is dragged around it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen

from studio_ui.material_view.plots import F64, Plot, dimmed, number, stroke

_DECADES = 4  # of a logarithmic radius
_STEP = 5.0  # degrees a key turns the light
_LAST = 89.0
Lobe = tuple[F64, F64]


class PolarPlot(Plot):
    """`turned(degrees)`: the light is to come from there."""

    def __init__(self) -> None:
        super().__init__("Lobe")
        self.turned: Callable[[float], object] = lambda degrees: None
        self.incidence = 45.0
        self.logarithmic = False
        self.cosine = True
        self._own: Lobe | None = None
        self._other: Lobe | None = None
        self._held = False
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setCursor(Qt.CursorShape.SizeHorCursor)
        self._tell()

    def show_lobe(self, own: Lobe | None, other: Lobe | None) -> None:
        """Angles (N,) in degrees and values (N, 3), of the material and of what it is compared with."""
        self._own, self._other = own, other
        self._tell()
        self.update()

    @property
    def peak(self) -> float:
        """The largest value that is drawn."""
        there = [float(lobe[1].max()) for lobe in (self._own, self._other) if lobe is not None]
        return max([*there, 1e-6])

    def _tell(self) -> None:
        what = "f cos θ" if self.cosine else "f"
        lines = [
            f"Where light from {self.incidence:.0f}° goes: {what}, up to {number(self.peak)} per sr",
            "Drag to move the light; arrow keys too. Dashed: what it is compared with",
        ]
        self.setToolTip("\n".join(lines))
        self.setAccessibleDescription(lines[0])

    def _place(self) -> tuple[QPointF, float]:
        """Foot of the normal, and the largest radius."""
        line = self.fontMetrics().height()
        radius = min(self.width() / 2 - 8, self.height() - line - 16)
        return QPointF(self.width() / 2, self.height() - line), max(radius, 10.0)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Grid, lobes, light."""
        painter = self.begin()
        foot, radius = self._place()
        self._grid(painter, foot, radius)
        for lobe, faint in ((self._other, True), (self._own, False)):
            if lobe is None:
                continue
            turn = np.radians(lobe[0])
            for colour, values in self.curves(lobe[1]):
                far = radius * self._share(values)
                pen = dimmed(colour) if faint else QPen(colour, 1.6)
                stroke(painter, foot.x() + far * np.sin(turn), foot.y() - far * np.cos(turn), pen)
        self._light(painter, foot, radius)
        painter.setPen(QColor(self.theme.dim))
        below = QRectF(4, foot.y() + 1, self.width() - 8, self.height() - foot.y() - 1)
        scale = "log" if self.logarithmic else ""
        painter.drawText(below, Qt.AlignmentFlag.AlignLeft, f"{self.incidence:.0f}°")
        painter.drawText(below, Qt.AlignmentFlag.AlignRight, f"{scale} {number(self.peak)}/sr".strip())
        if self.hasFocus():
            painter.setPen(QPen(QColor(self.theme.accent), 1))
            painter.drawRoundedRect(QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5), 4, 4)
        painter.end()

    def _share(self, values: F64) -> F64:
        """Of the radius, 0…1."""
        part = np.clip(values / self.peak, 0, 1)
        if not self.logarithmic:
            return np.asarray(part)
        return np.asarray(np.clip(1 + np.log10(np.maximum(part, 1e-12)) / _DECADES, 0, 1))

    def _grid(self, painter: QPainter, foot: QPointF, radius: float) -> None:
        painter.setPen(self.faint())
        for part in (0.25, 0.5, 0.75, 1.0):
            r = radius * part
            painter.drawArc(QRectF(foot.x() - r, foot.y() - r, 2 * r, 2 * r), 0, 180 * 16)
        for degrees in range(-90, 91, 30):
            turn = math.radians(degrees)
            edge = QPointF(foot.x() + radius * math.sin(turn), foot.y() - radius * math.cos(turn))
            painter.drawLine(foot, edge)

    def _light(self, painter: QPainter, foot: QPointF, radius: float) -> None:
        turn = math.radians(self.incidence)
        accent = QColor(self.theme.accent)
        start = QPointF(foot.x() - radius * math.sin(turn), foot.y() - radius * math.cos(turn))
        painter.setPen(QPen(accent, 1.6))
        painter.drawLine(start, foot)
        mirror = QPointF(foot.x() + radius * math.sin(turn), foot.y() - radius * math.cos(turn))
        painter.setPen(QPen(accent, 1, Qt.PenStyle.DotLine))
        painter.drawLine(foot, mirror)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(accent)
        painter.drawEllipse(start, 4.5, 4.5)
        painter.setBrush(Qt.BrushStyle.NoBrush)

    # the hand

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """The light goes there."""
        if event.button() == Qt.MouseButton.LeftButton:
            self._held = True
            self._aim(event.position())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """And follows."""
        if self._held:
            self._aim(event.position())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Until it is let go."""
        self._held = False

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Left and right turn the light by 5°."""
        by = {Qt.Key.Key_Left: _STEP, Qt.Key.Key_Right: -_STEP}.get(Qt.Key(event.key()))
        if by is None:
            super().keyPressEvent(event)
        else:
            self._turn(self.incidence + by)

    def _aim(self, at: QPointF) -> None:
        foot, _ = self._place()
        beside, above = abs(at.x() - foot.x()), max(foot.y() - at.y(), 0.0)
        if beside or above:
            self._turn(math.degrees(math.atan2(beside, above)))

    def _turn(self, degrees: float) -> None:
        wanted = float(round(min(max(degrees, 0.0), _LAST)))
        if wanted != self.incidence:
            self.incidence = wanted
            self._tell()
            self.update()
            self.turned(wanted)


__all__ = ["PolarPlot"]
