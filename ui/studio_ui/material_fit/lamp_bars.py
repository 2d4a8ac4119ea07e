"""A bar a lamp: how wrong the fit is there. Lamps stand in rows of their height, from left to right."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QToolTip

from studio_core.fitting import LampError
from studio_ui.material_fit.words import lamp_told, percent
from studio_ui.material_view.plots import Plot

_ROW = 5.0  # degrees of height that are one row
_GAP = 0.8  # bars between rows
_SPREAD = 6  # decades at most
_DOT = 2.2  # pixels


class LampBars(Plot):
    """`picked(index)`: that lamp is to be looked at. Arrow keys go from lamp to lamp."""

    def __init__(self) -> None:
        super().__init__("Error of every lamp")
        self.picked: Callable[[int], object] = lambda index: None
        self.lamps: Sequence[LampError] = ()
        self.now = -1
        self.order: list[int] = []
        self._places: list[float] = []  # of bars' left edges, in bars
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        self.setMinimumSize(120, 70)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)

    def sizeHint(self) -> QSize:
        """Wide rather than high."""
        return QSize(420, 120)

    def show_lamps(self, lamps: Sequence[LampError]) -> None:
        """Other lamps; none is chosen."""
        self.lamps, self.now = lamps, -1
        row = [round(lamp.height / _ROW) for lamp in lamps]
        self.order = sorted(range(len(lamps)), key=lambda i: (row[i], lamps[i].azimuth, i))
        self._places, at = [], 0.0
        for before, i in zip([None, *self.order], self.order, strict=False):
            at += 0.0 if before is None else 1.0 if row[before] == row[i] else 1.0 + _GAP
            self._places.append(at)
        self.choose(self.now)

    def choose(self, index: int) -> None:
        """Mark a lamp, without telling."""
        self.now = index
        told = "Error of every lamp"
        if 0 <= index < len(self.lamps):
            told = lamp_told(self.lamps[index])
        self.setAccessibleDescription(told)
        self.update()

    @property
    def range(self) -> tuple[int, int]:
        """Powers of ten that the axis goes from and to."""
        values = [max(lamp.whole, 1e-9) for lamp in self.lamps] or [0.01]
        high = math.ceil(math.log10(max(values)) + 1e-9)
        low = math.floor(math.log10(min(values)) - 1e-9)
        return max(low, high - _SPREAD), max(high, low + 1)

    def bar(self, index: int) -> QRectF:
        """Where the bar of a lamp is drawn."""
        area, wide = self._area()
        low, high = self.range
        value = max(self.lamps[index].whole, 10.0**low)
        tall = area.height() * max((math.log10(value) - low) / (high - low), 0.02)
        x = area.left() + self._places[self.order.index(index)] * wide
        return QRectF(x + 0.1 * wide, area.bottom() - tall, 0.8 * wide, tall)

    def at(self, x: float) -> int:
        """The lamp whose bar is nearest; -1 without lamps."""
        if not self.order:
            return -1
        area, wide = self._area()
        middle = (x - area.left()) / wide - 0.5
        return min(zip(self._places, self.order, strict=True), key=lambda one: abs(one[0] - middle))[1]

    def _area(self) -> tuple[QRectF, float]:
        left = self.fontMetrics().horizontalAdvance("0.001 %") + 6
        area = QRectF(self.rect()).adjusted(left, 8, -8, -12)
        count = (self._places[-1] if self._places else 0.0) + 1.0
        return area, min(max(area.width(), 1.0) / count, 40.0)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """That lamp."""
        if event.button() == Qt.MouseButton.LeftButton:
            self._pick(self.at(event.position().x()))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Tell its numbers; with the button held, look at it."""
        found = self.at(event.position().x())
        if found < 0:
            return
        if event.buttons() & Qt.MouseButton.LeftButton and found != self.now:
            self._pick(found)
        QToolTip.showText(event.globalPosition().toPoint(), lamp_told(self.lamps[found]), self)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """To the next one."""
        keys = Qt.Key
        last = len(self.order) - 1
        here = self.order.index(self.now) if self.now in self.order else -1
        to = {
            keys.Key_Left: max(here - 1, 0),
            keys.Key_Right: min(here + 1, last),
            keys.Key_Home: 0,
            keys.Key_End: last,
        }.get(keys(event.key()))
        if to is None or not self.order:
            super().keyPressEvent(event)
            return
        self._pick(self.order[to])

    def _pick(self, index: int) -> None:
        if index >= 0:
            self.choose(index)
            self.picked(index)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Decades, bars, what is held back."""
        painter = self.begin()
        area, _ = self._area()
        low, high = self.range
        line = self.fontMetrics().height()
        for power in range(low, high + 1):
            y = area.bottom() - area.height() * (power - low) / (high - low)
            painter.setPen(self.faint(50))
            painter.drawLine(QPointF(area.left(), y), QPointF(area.right(), y))
            painter.setPen(QColor(self.theme.dim))
            place = QRectF(0, y - line / 2, area.left() - 4, line)
            flags = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            painter.drawText(place, flags, percent(10.0**power) if power > -5 else "")
        for index in self.order:
            lamp, bar = self.lamps[index], self.bar(index)
            colour = QColor(self.theme.accent if lamp.held else self.theme.dim)
            painter.fillRect(bar, colour)
            if lamp.held:
                painter.setPen(Qt.PenStyle.NoPen)
                painter.setBrush(colour)
                painter.drawEllipse(QPointF(bar.center().x(), area.bottom() + 5), _DOT, _DOT)
                painter.setBrush(Qt.BrushStyle.NoBrush)
            if index == self.now:
                painter.setPen(QPen(QColor(self.theme.text), 1.5))
                around = QRectF(bar.left(), area.top(), bar.width(), area.height())
                painter.drawRoundedRect(around.adjusted(-2, -2, 2, 2), 2, 2)
        painter.end()


__all__ = ["LampBars"]
