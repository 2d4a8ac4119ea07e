"""Over the canvas while something is dragged over it: what will happen, and where."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QWidget

from studio_core.session import View
from studio_ui.canvas.projection import project
from studio_ui.files.landing import Landing
from studio_ui.look.theme import DARK, Theme

_RADIUS = 0.25  # metres of the ring on the surface
_INSET = 6
_PILL = QColor(20, 20, 20, 225)


class DropOverlay(QWidget):
    """`tell` shows it, `hide` takes it away."""

    def __init__(self) -> None:
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._theme = DARK
        self.text, self.bad = "", False
        self._view: View | None = None
        self._where: Landing | None = None
        self.hide()

    def set_theme(self, theme: Theme) -> None:
        """Colours."""
        self._theme = theme

    def tell(self, text: str, *, bad: bool, view: View | None = None, where: Landing | None = None) -> None:
        """What will happen (or why not), and where on the picture."""
        self.text, self.bad, self._view, self._where = text, bad, view, where
        self.setAccessibleDescription(text)
        self.show()
        self.raise_()
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """A frame, a ring where it lands, and the sentence."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        tint = QColor(self._theme.problem if self.bad else self._theme.accent)
        painter.setPen(QPen(tint, 3, Qt.PenStyle.SolidLine if not self.bad else Qt.PenStyle.DashLine))
        frame = QRectF(self.rect()).adjusted(_INSET, _INSET, -_INSET, -_INSET)
        painter.drawRoundedRect(frame, 6, 6)
        self._ring(painter, tint)
        self._words(painter, tint)

    def _ring(self, painter: QPainter, tint: QColor) -> None:
        if self._view is None or self._where is None:
            return
        normal = np.array(self._where.normal)
        side = np.cross(normal, (1.0, 0.0, 0.0) if abs(normal[0]) < 0.9 else (0.0, 0.0, 1.0))
        side /= np.linalg.norm(side)
        other = np.cross(normal, side)
        angles = np.linspace(0, 2 * np.pi, 49)[:, None]
        for radius in (_RADIUS, 0.03):
            circle = np.array(self._where.point) + radius * (np.cos(angles) * side + np.sin(angles) * other)
            flat = project(self._view, circle) * (self.width(), self.height())
            if np.isfinite(flat).all():
                line = QPolygonF([QPointF(*point) for point in flat.tolist()])
                painter.setPen(QPen(QColor(0, 0, 0, 120), 4))
                painter.drawPolyline(line)
                painter.setPen(QPen(tint, 2))
                painter.drawPolyline(line)

    def _words(self, painter: QPainter, tint: QColor) -> None:
        metrics = painter.fontMetrics()
        room = max(self.width() - 90, 60)
        flags = int(Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap)
        box = QRectF(metrics.boundingRect(0, 0, room, 400, flags, self.text))
        box = QRectF(0, 0, box.width() + 28, box.height() + 14)
        box.moveCenter(QPointF(self.width() / 2, 0))
        box.moveTop(26)
        painter.setPen(QPen(tint, 1))
        painter.setBrush(_PILL)
        painter.drawRoundedRect(box, 8, 8)
        painter.setPen(QColor("#f2f2f0"))
        painter.drawText(box, flags, self.text)
