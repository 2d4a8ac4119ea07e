"""The scale of a picture in false colours, in a corner of the canvas."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSizeF, Qt
from PySide6.QtGui import QColor, QImage, QPainter

from studio_core.false_colour import false_colours

TITLE = "Share of light from other surfaces"
TICKS = ((0.0, "0 %"), (0.25, "25 %"), (0.5, "50 %"), (0.75, "75 %"), (1.0, "100 %"))
_GROUND, _TEXT = QColor(20, 20, 20, 200), QColor("#ececea")
_MARGIN, _PAD, _BAR = 12.0, 10.0, 10.0


def legend_box(painter: QPainter, size: QSizeF) -> QRectF:
    """Where it lies on a canvas of so many logical pixels: the lower left corner."""
    metrics = painter.fontMetrics()
    wide = max(metrics.horizontalAdvance(TITLE), 56 * len(TICKS)) + 2 * _PAD
    high = 2 * metrics.height() + _BAR + 2 * _PAD + 8
    return QRectF(_MARGIN, size.height() - high - _MARGIN, min(wide, size.width() - 2 * _MARGIN), high)


def paint_legend(painter: QPainter, size: QSizeF) -> None:
    """Title, colours, numbers."""
    box, line = legend_box(painter, size), painter.fontMetrics().height()
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(_GROUND)
    painter.drawRoundedRect(box, 6, 6)
    inside = box.adjusted(_PAD, _PAD, -_PAD, -_PAD)
    painter.setPen(_TEXT)
    painter.drawText(QRectF(inside.topLeft(), QSizeF(inside.width(), line)), TITLE)
    bar = QRectF(inside.left(), inside.top() + line + 4, inside.width(), _BAR)
    painter.drawImage(bar, ramp())
    for value, text in TICKS:
        wide = painter.fontMetrics().horizontalAdvance(text)
        left = bar.left() + value * bar.width() - wide / 2
        left = min(max(left, bar.left()), bar.right() - wide)
        painter.drawText(QPointF(left, bar.bottom() + line), text)
    painter.restore()


def ramp(steps: int = 256) -> QImage:
    """All colours from 0 to 1, side by side."""
    pixels = np.ascontiguousarray(false_colours(np.linspace(0, 1, steps)[None]))
    return QImage(pixels.data, steps, 1, 3 * steps, QImage.Format.Format_RGB888).copy()


__all__ = ["TITLE", "legend_box", "paint_legend", "ramp"]
