"""The colour scale of error maps: logarithmic from 1 % to 100 %, dark to bright, and its legend."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy

from studio_core.false_colour import false_colours
from studio_ui.material_view.plots import Plot

LEAST, MOST = 0.01, 1.0  # of the lamp's usual brightness
_NOTHING = (70, 78, 84)  # where nothing counts: no colour of the scale
_TICKS = ((0.01, "1 %"), (0.03, "3 %"), (0.1, "10 %"), (0.3, "30 %"), (1.0, "100 %"))


def heat(error: npt.NDArray[np.float32]) -> npt.NDArray[np.uint8]:
    """(h, w, 3) colours of relative errors (h, w); NaN is grey."""
    with np.errstate(divide="ignore", invalid="ignore"):
        place = np.log(error / LEAST) / np.log(MOST / LEAST)
    made = false_colours(np.nan_to_num(place, nan=0.0, neginf=0.0, posinf=1.0))
    made[np.isnan(error)] = _NOTHING
    return np.ascontiguousarray(made)


class HeatLegend(Plot):
    """The scale with its numbers."""

    def __init__(self) -> None:
        super().__init__("Colours of the difference")
        self.setMinimumSize(160, 10)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        ramp = np.geomspace(LEAST, MOST, 256).astype(np.float32)[None]
        colours = heat(ramp)
        self._ramp = QImage(colours.tobytes(), 256, 1, 768, QImage.Format.Format_RGB888).copy()
        told = (
            "Difference between photograph and reconstruction, of the usual brightness under this lamp. "
            "Grey: not lit, clipped, or beside the sample"
        )
        self.setToolTip(told)
        self.setAccessibleDescription(told)

    def sizeHint(self) -> QSize:
        """A bar and a line of text."""
        return QSize(260, 16 + self.fontMetrics().height())

    def paintEvent(self, event: QPaintEvent) -> None:
        """Bar and numbers."""
        painter: QPainter = self.begin()
        bar = QRectF(14, 5, max(self.width() - 28, 10), 9)
        painter.drawImage(bar, self._ramp)
        painter.setPen(QColor(self.theme.dim))
        for value, text in _TICKS:
            x = bar.left() + bar.width() * np.log(value / LEAST) / np.log(MOST / LEAST)
            place = QRectF(x - 40, bar.bottom() + 1, 80, self.height() - bar.bottom() - 1)
            side = Qt.AlignmentFlag.AlignHCenter
            if value == LEAST:
                place, side = QRectF(2, place.top(), 80, place.height()), Qt.AlignmentFlag.AlignLeft
            elif value == MOST:
                place = QRectF(self.width() - 82, place.top(), 80, place.height())
                side = Qt.AlignmentFlag.AlignRight
            painter.drawText(place, side | Qt.AlignmentFlag.AlignTop, text)
        painter.end()


__all__ = ["LEAST", "MOST", "HeatLegend", "heat"]
