"""What the plots of a material share: colours of channels, and which curves say something different."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from studio_core.colour import LUMINANCE
from studio_ui.look.theme import DARK, Theme

F64 = npt.NDArray[np.float64]
_DARK = ("#ef6a5e", "#69c065", "#6f9bf2")
_LIGHT = ("#c0392b", "#2e8b3a", "#2f62c9")
_ALIKE = 0.01  # of the largest value: channels that differ by less are one curve


class Plot(QWidget):
    """A plot that painters draw: quick enough to follow a slider, and loads nothing."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.theme = DARK
        self.luminance = False
        self.setAccessibleName(name)
        self.setMinimumSize(90, 60)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)

    def set_theme(self, theme: Theme) -> None:
        """Other colours."""
        self.theme = theme
        self.update()

    def begin(self) -> QPainter:
        """A painter on a plain ground, in small letters."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(self.theme.base))
        painter.drawRoundedRect(self.rect(), 4, 4)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        font = painter.font()
        font.setPointSizeF(max(font.pointSizeF() * 0.8, 6.5))
        painter.setFont(font)
        return painter

    def faint(self, strength: int = 70) -> QPen:
        """The pen of grids."""
        colour = QColor(self.theme.dim)
        colour.setAlpha(strength)
        return QPen(colour, 1)

    def curves(self, values: F64) -> list[tuple[QColor, F64]]:
        """Colour and values (N,) of every curve worth drawing of values (N, 3)."""
        if self.luminance:
            return [(QColor(self.theme.text), values @ np.array(LUMINANCE))]
        middle = values.mean(axis=1)
        largest = float(np.abs(values).max(initial=0))
        if np.abs(values - middle[:, None]).max(initial=0) <= _ALIKE * largest:
            return [(QColor(self.theme.text), middle)]
        colours = _DARK if self.theme.name == "dark" else _LIGHT
        return [(QColor(colour), values[:, channel]) for channel, colour in enumerate(colours)]


def stroke(painter: QPainter, x: F64, y: F64, pen: QPen) -> None:
    """A line through pixels."""
    painter.setPen(pen)
    painter.drawPolyline(QPolygonF([QPointF(a, b) for a, b in zip(x.tolist(), y.tolist(), strict=True)]))


def dimmed(colour: QColor) -> QPen:
    """The pen of what is compared with."""
    faint = QColor(colour)
    faint.setAlpha(150)
    return QPen(faint, 1.2, Qt.PenStyle.DashLine)


def number(value: float) -> str:
    """Three digits at most."""
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"


__all__: Sequence[str] = ["Plot", "dimmed", "number", "stroke"]
