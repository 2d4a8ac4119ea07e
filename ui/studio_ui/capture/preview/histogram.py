"""How much of a picture is how bright: shares of pixels over stops, and what is cut off at both ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from studio_ui.capture.preview.tone import linear
from studio_ui.look.theme import DARK

STOPS = (-12.0, 8.0)  # around what the display shows as white
_BINS, _PIXELS = 80, 200_000
_COLOURS = ("#e0564a", "#5fae5a", "#5a86e0")


@dataclass(frozen=True, eq=False)
class Histogram:
    """`counts` (3, bins): shares of red, green, blue over stops; `black`: share of pixels without light."""

    counts: npt.NDArray[np.float64]
    black: float


def histogram(pixels: npt.NDArray[Any]) -> Histogram:
    """Of some 200,000 pixels; pixels without light are counted apart."""
    skip = max(1, int((pixels.shape[0] * pixels.shape[1] / _PIXELS) ** 0.5))
    light = linear(pixels[::skip, ::skip, :3]).reshape(-1, 3)
    counts = np.zeros((3, _BINS))
    lit = light > 0
    for channel in range(3):
        stops = np.log2(light[lit[:, channel], channel])
        counts[channel] = np.histogram(np.clip(stops, *_WIDE), _BINS, _WIDE)[0]
    return Histogram(counts / max(len(light), 1), float((~lit.any(axis=1)).mean()) if len(light) else 0.0)


_WIDE = (-20.0, 20.0)


class HistogramView(QWidget):
    """Draws one; the line is where the display turns white."""

    def __init__(self) -> None:
        super().__init__()
        self.theme = DARK
        self.exposure = 0.0
        self.shares: tuple[tuple[str, float], ...] = ()
        self._found: Histogram | None = None
        self.setAccessibleName("Histogram")
        self.setMinimumSize(120, 48)

    def sizeHint(self) -> QSize:
        """Small."""
        return QSize(240, 56)

    def show_histogram(self, found: Histogram | None, shares: tuple[tuple[str, float], ...] = ()) -> None:
        """`shares`: what is clipped and dark, told beside it."""
        self._found, self.shares = found, shares
        told = ", ".join(f"{name} {100 * share:.2g} %" for name, share in shares)
        self.setToolTip(
            "How much of the picture is how bright, a stop more to the right; the line is the display's white"
            + (f"\n{told}" if told else "")
        )
        self.setAccessibleDescription(told)
        self.update()

    def set_exposure(self, exposure: float) -> None:
        """The display's white moved."""
        self.exposure = exposure
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Three curves, and white."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        box = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        painter.setPen(QColor(self.theme.border))
        painter.setBrush(QColor(self.theme.base))
        painter.drawRoundedRect(box, 3, 3)
        if self._found is not None:
            painter.setCompositionMode(
                QPainter.CompositionMode.CompositionMode_Screen
                if self.theme.name == "dark"
                else QPainter.CompositionMode.CompositionMode_Multiply
            )
            highest = float(self._found.counts.max()) or 1.0
            for counts, colour in zip(self._found.counts, _COLOURS, strict=True):
                painter.fillPath(self._curve(counts / highest, box), QColor(colour))
            painter.setCompositionMode(QPainter.CompositionMode.CompositionMode_SourceOver)
        painter.setPen(QPen(QColor(self.theme.text), 1, Qt.PenStyle.DashLine))
        white = box.left() + self._across(0.0) * box.width()
        painter.drawLine(round(white), round(box.top()), round(white), round(box.bottom()))
        painter.end()

    def _across(self, stop: float) -> float:
        return (stop - STOPS[0]) / (STOPS[1] - STOPS[0])

    def _curve(self, shares: npt.NDArray[np.float64], box: QRectF) -> QPainterPath:
        path = QPainterPath()
        edges = np.linspace(*_WIDE, _BINS + 1)
        middles = (edges[1:] + edges[:-1]) / 2 + self.exposure
        started = False
        for stop, share in zip(middles, np.sqrt(shares), strict=True):
            across = self._across(float(stop))
            if not 0 <= across <= 1:
                continue
            x, y = box.left() + across * box.width(), box.bottom() - float(share) * (box.height() - 3)
            if not started:
                path.moveTo(x, box.bottom())
                started = True
            path.lineTo(x, y)
            last = x
        if started:
            path.lineTo(last, box.bottom())
            path.closeSubpath()
        return path
