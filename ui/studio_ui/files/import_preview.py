"""A model beside a person of 1.75 m: a wrong unit or axis is seen at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QLineF, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from studio_core.scene.imported import Up
from studio_ui.canvas.projection import box_segments
from studio_ui.files.import_question import ImportChoice, ImportQuestion

F64 = npt.NDArray[np.float64]
PERSON = 1.75
"""Metres."""
_WIDE = 0.5  # metres across the shoulders, with some air
_AZIMUTH, _HEIGHT = np.radians(32.0), np.radians(14.0)
_MARGIN = 14
_BODY = (  # x and y in heights of the person, the right half from the neck down to the foot
    *((0.03, 0.86), (0.03, 0.82), (0.12, 0.80), (0.135, 0.74), (0.15, 0.50), (0.115, 0.50), (0.095, 0.68)),
    *((0.085, 0.48), (0.075, 0.25), (0.055, 0.03), (0.08, 0.0), (0.02, 0.0), (0.005, 0.42)),
)


class ImportPreview(QWidget):
    """Follows a choice."""

    def __init__(self, question: ImportQuestion) -> None:
        super().__init__()
        self._question, self._choice = question, question.guess
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(280, 240)
        self.setAccessibleName("The model beside a person of 1.75 m")

    def sizeHint(self) -> QSize:
        """Some room."""
        return QSize(320, 280)

    def show_choice(self, choice: ImportChoice) -> None:
        """Another unit or axis."""
        self._choice = choice
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Both on one floor, as large as they fit."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        palette = self.palette()
        ground = QPainterPath()
        ground.addRoundedRect(QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5), 4, 4)
        painter.fillPath(ground, palette.base())
        lines, box = self._model()
        flat = seen(np.concatenate([box, lines]))
        low, high = flat.reshape(-1, 2).min(axis=0), flat.reshape(-1, 2).max(axis=0)
        gap = max(0.06 * float(high[0] - low[0]), 0.15)
        left = float(low[0]) - gap - _WIDE
        bottom, top = min(float(low[1]), 0.0), max(float(high[1]), PERSON)
        scale = min(
            (self.width() - 2 * _MARGIN) / (float(high[0]) - left),
            (self.height() - 2 * _MARGIN) / (top - bottom),
        )
        middle = (left + float(high[0])) / 2

        def at(x: float, y: float) -> QPointF:
            return QPointF(
                self.width() / 2 + (x - middle) * scale,
                self.height() / 2 - (y - (bottom + top) / 2) * scale,
            )

        dim = QColor(palette.placeholderText().color())
        painter.setPen(QPen(dim, 1))
        painter.drawLine(
            QPointF(_MARGIN / 2, at(0, 0).y()), QPointF(self.width() - _MARGIN / 2, at(0, 0).y())
        )
        self._person(painter, at(left + _WIDE / 2, 0), PERSON * scale, dim)
        accent = QColor(palette.highlight().color())
        mesh = QColor(palette.text().color())
        mesh.setAlphaF(0.35 if len(lines) < 600 else 0.16)
        for segments, colour, width in ((flat[len(box) :], mesh, 1.0), (flat[: len(box)], accent, 1.2)):
            painter.setPen(QPen(colour, width))
            painter.drawLines([QLineF(at(*a), at(*b)) for a, b in segments.tolist()])
        if max(high[0] - low[0], high[1] - low[1]) * scale < 3:  # a speck
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(accent)
            painter.drawEllipse(at(*flat.reshape(-1, 2).mean(axis=0)), 3, 3)

    def _model(self) -> tuple[F64, F64]:
        """Lines of the mesh and of its box (N, 2, 3), in metres, standing over the origin."""
        unit, up = self._choice.unit, self._choice.up
        corners = turned(self._question.bounds, up) * unit
        low, high = corners.min(axis=0), corners.max(axis=0)
        foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        lines = turned(self._question.lines.astype(np.float64).reshape(-1, 3), up) * unit - foot
        return lines.reshape(-1, 2, 3), box_segments(low - foot, high - foot)

    @staticmethod
    def _person(painter: QPainter, foot: QPointF, height: float, colour: QColor) -> None:
        path = QPainterPath()
        right = [QPointF(foot.x() + x * height, foot.y() - y * height) for x, y in _BODY]
        left = [QPointF(foot.x() - x * height, foot.y() - y * height) for x, y in reversed(_BODY)]
        path.moveTo(right[0])
        for point in (*right[1:], *left):
            path.lineTo(point)
        path.closeSubpath()
        path.addEllipse(QPointF(foot.x(), foot.y() - 0.93 * height), 0.05 * height, 0.07 * height)
        path.setFillRule(Qt.FillRule.WindingFill)
        fill = QColor(colour)
        fill.setAlphaF(0.6)
        painter.fillPath(path, fill)


def turned(points: F64, up: Up) -> F64:
    """(N, 3) points of the file with the y axis up."""
    return points if up == "y" else np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)


def seen(segments: F64) -> F64:
    """(N, 2, 2) of segments (N, 2, 3): without perspective, from a little above and to the right."""
    x, y, z = (segments[..., i] for i in range(3))
    across = np.cos(_AZIMUTH) * x - np.sin(_AZIMUTH) * z
    away = np.sin(_AZIMUTH) * x + np.cos(_AZIMUTH) * z
    return np.stack([across, np.cos(_HEIGHT) * y - np.sin(_HEIGHT) * away], axis=-1)
