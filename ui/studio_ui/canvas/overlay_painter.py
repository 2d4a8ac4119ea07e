"""Paints what `canvas.overlay` describes, and the words and the badge of a canvas."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QLineF, QPointF, QRectF, QSizeF, Qt
from PySide6.QtGui import QColor, QFont, QImage, QPainter, QPen, QPolygonF

from studio_core.session import View
from studio_ui.canvas.overlay import Band, Dot, Face, Film, Label, Overlay, Ring, Wires
from studio_ui.canvas.projection import project, project_segments
from studio_ui.feed import Freshness
from studio_ui.look.theme import Theme

LINE = "#f2f2f0"
_RIM = QColor(0, 0, 0, 120)
_GROUND = QColor(20, 20, 20, 175)
_FURTHEST = 1e5  # pixels beside the canvas: further is left out


def colour(name: str, theme: Theme) -> QColor:
    """A colour of the overlay in a theme."""
    named = {"accent": theme.mark, "problem": theme.alarm, "line": LINE}
    return QColor(named.get(name, name))


def paint_overlay(painter: QPainter, size: QSizeF, view: View, overlay: Overlay, theme: Theme) -> None:
    """All marks, as `view` sees them, over a canvas of so many logical pixels."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    scale = (size.width(), size.height())
    for mark in overlay.marks:
        if isinstance(mark, Film):
            _film(painter, scale, mark)
            continue
        tint = colour(mark.colour, theme)
        if isinstance(mark, Wires):
            _wires(painter, scale, view, mark, tint)
        elif isinstance(mark, Dot):
            spot = project(view, mark.at)[0] * scale
            if np.isfinite(spot).all():
                painter.setPen(QPen(_RIM, 1))
                painter.setBrush(tint)
                painter.drawEllipse(QPointF(*spot), mark.radius, mark.radius)
        elif isinstance(mark, Face):
            corners = project(view, mark.corners) * scale
            if np.isfinite(corners).all() and (np.abs(corners) < _FURTHEST).all():
                tint.setAlphaF(mark.opacity)
                painter.setPen(Qt.PenStyle.NoPen)
                painter.setBrush(tint)
                painter.drawPolygon(QPolygonF([QPointF(*corner) for corner in corners.tolist()]))
        elif isinstance(mark, Label):
            spot = project(view, mark.at)[0] * scale + mark.offset
            if np.isfinite(spot).all():
                _words(painter, QPointF(*spot), mark.text, tint)
        elif isinstance(mark, Ring):
            middle = QPointF(*np.multiply(mark.at, scale))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            for pen in (QPen(_RIM, mark.width + 2), QPen(tint, mark.width)):
                painter.setPen(pen)
                painter.drawEllipse(middle, mark.radius, mark.radius)
        elif isinstance(mark, Band):
            box = QRectF(QPointF(*np.multiply(mark.start, scale)), QPointF(*np.multiply(mark.end, scale)))
            painter.setPen(QPen(tint, 1, Qt.PenStyle.SolidLine if mark.whole else Qt.PenStyle.DashLine))
            tint.setAlphaF(0.12)
            painter.setBrush(tint)
            painter.drawRect(box.normalized())
    painter.setBrush(Qt.BrushStyle.NoBrush)


def paint_message(painter: QPainter, size: QSizeF, text: str, theme: Theme) -> None:
    """A line over an empty canvas."""
    kept, font = painter.font(), QFont(painter.font())
    font.setPointSizeF(font.pointSizeF() * 1.25)
    painter.setFont(font)
    painter.setPen(QColor(theme.dim))
    flags = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
    painter.drawText(QRectF(QPointF(), size).adjusted(40, 40, -40, -40), int(flags), text)
    painter.setFont(kept)


def paint_badge(painter: QPainter, size: QSizeF, state: Freshness, theme: Theme) -> None:
    """A small mark in the lower right corner unless the picture is up to date."""
    colours = {
        Freshness.STALE: theme.mark,
        Freshness.REFINING: "#8fb8d8",
        Freshness.FAILED: theme.alarm,
    }
    if state not in colours:
        return
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    width = painter.fontMetrics().horizontalAdvance(state.value) + 34
    box = QRectF(size.width() - width - 12, size.height() - 36, width, 24)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(_GROUND)
    painter.drawRoundedRect(box, 12, 12)
    painter.setBrush(QColor(colours[state]))
    painter.drawEllipse(QPointF(box.left() + 14, box.center().y()), 4, 4)
    painter.setPen(QColor("#ececea"))
    painter.drawText(box.adjusted(24, 0, -8, 0), int(Qt.AlignmentFlag.AlignVCenter), state.value)


def _wires(painter: QPainter, scale: tuple[float, float], view: View, mark: Wires, tint: QColor) -> None:
    flat = project_segments(view, mark.segments) * scale
    flat = flat[(np.abs(flat) < _FURTHEST).all(axis=(1, 2))]
    lines = [QLineF(*start, *end) for start, end in flat.tolist()]
    if not mark.bare:
        painter.setPen(QPen(_RIM, mark.width + 2))
        painter.drawLines(lines)
    painter.setPen(QPen(tint, mark.width))
    painter.drawLines(lines)


def _film(painter: QPainter, scale: tuple[float, float], mark: Film) -> None:
    pixels = np.ascontiguousarray(mark.pixels)
    height, width = pixels.shape[:2]
    image = QImage(pixels.data, width, height, 4 * width, QImage.Format.Format_RGBA8888)
    painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
    painter.drawImage(
        QRectF(QPointF(*np.multiply(mark.start, scale)), QPointF(*np.multiply(mark.end, scale))), image
    )


def _words(painter: QPainter, at: QPointF, text: str, tint: QColor) -> None:
    metrics = painter.fontMetrics()
    box = QRectF(at, QSizeF(metrics.horizontalAdvance(text) + 12, metrics.height() + 6))
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(_GROUND)
    painter.drawRoundedRect(box, 4, 4)
    painter.setPen(tint)
    painter.drawText(box, int(Qt.AlignmentFlag.AlignCenter), text)
