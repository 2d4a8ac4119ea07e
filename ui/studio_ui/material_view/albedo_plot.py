"""How much of the light comes back in all, by the angle it comes from; more than 1 is not possible."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QPaintEvent, QPen

from studio_ui.material_view.plots import F64, Plot, dimmed, stroke
from studio_ui.material_view.work import ALBEDO_ANGLES

LIMIT = 1.001  # above which a material gives light


class AlbedoPlot(Plot):
    """Angles 0 to 90° to the right, albedo 0 to 1 upwards."""

    def __init__(self) -> None:
        super().__init__("Albedo")
        self.incidence = 45.0
        self._own: F64 | None = None
        self._other: F64 | None = None
        self.show_albedo(None, None)

    def show_albedo(self, own: F64 | None, other: F64 | None) -> None:
        """Albedo (A, 3) at `ALBEDO_ANGLES`, of the material and of what it is compared with."""
        self._own, self._other = own, other
        told = "How much light comes back in all, by its angle from the normal"
        if own is not None:
            there = " / ".join(f"{np.interp(self.incidence, ALBEDO_ANGLES, own[:, c]):.2f}" for c in range(3))
            told += f"\n{there} (red, green, blue) at {self.incidence:.0f}°"
            if self.gives_light:
                told += "\nMore light than arrives: this material is not possible"
        self.setToolTip(told)
        self.setAccessibleDescription(told)
        self.update()

    @property
    def gives_light(self) -> bool:
        """Whether more comes back than arrives."""
        return self._own is not None and float(self._own.max()) > LIMIT

    def paintEvent(self, event: QPaintEvent) -> None:
        """Axes, the limit, curves."""
        painter = self.begin()
        line = painter.fontMetrics().height()
        area = QRectF(self.rect()).adjusted(line + 8, 6, -8, -line - 4)
        there = [float(one.max()) for one in (self._own, self._other) if one is not None]
        top = max([1.08, *(1.05 * value for value in there)])

        def up(value: float) -> float:
            return area.bottom() - area.height() * value / top

        painter.setPen(self.faint())
        for value in (0.0, 0.5):
            painter.drawLine(round(area.left()), round(up(value)), round(area.right()), round(up(value)))
        for degrees in (0, 30, 60, 90):
            x = area.left() + area.width() * degrees / 90
            painter.drawLine(round(x), round(area.top()), round(x), round(area.bottom()))
        limit = QColor(self.theme.problem if self.gives_light else self.theme.warning)
        painter.setPen(QPen(limit, 1, Qt.PenStyle.DashLine))
        painter.drawLine(round(area.left()), round(up(1)), round(area.right()), round(up(1)))
        x = area.left() + area.width() * self.incidence / 90
        painter.setPen(QPen(QColor(self.theme.accent), 1, Qt.PenStyle.DotLine))
        painter.drawLine(round(x), round(area.top()), round(x), round(area.bottom()))
        painter.setPen(QColor(self.theme.dim))
        for value, text in ((0.0, "0"), (0.5, "½"), (1.0, "1")):
            place = QRectF(0, up(value) - line / 2, area.left() - 3, line)
            painter.drawText(place, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter, text)
        for degrees, side in ((0, Qt.AlignmentFlag.AlignLeft), (90, Qt.AlignmentFlag.AlignRight)):
            painter.drawText(QRectF(area.left(), area.bottom() + 2, area.width(), line), side, f"{degrees}°")
        across = area.left() + area.width() * ALBEDO_ANGLES / 90
        for values, faint in ((self._other, True), (self._own, False)):
            if values is not None:
                for colour, curve in self.curves(values):
                    height = area.bottom() - area.height() * curve / top
                    stroke(painter, across, height, dimmed(colour) if faint else QPen(colour, 1.6))
        painter.end()


__all__ = ["LIMIT", "AlbedoPlot"]
