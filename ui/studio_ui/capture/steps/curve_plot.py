"""The response curve as a plot: how much light makes which number, for red, green and blue."""

from __future__ import annotations

from typing import Any

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from studio_core.capturing.artifacts import Response
from studio_ui.look.theme import DARK, Theme

_COLOURS = ("#e0564a", "#5fae5a", "#5a86e0")
_POINTS = 256


class CurvePlot(QWidget):
    """pyqtgraph's plot, loaded when there is a first curve to show."""

    def __init__(self) -> None:
        super().__init__()
        self.theme = DARK
        self.response: Response | None = None
        self._plot: Any = None
        self._empty = QLabel("The curve is shown once it is measured.")
        self._empty.setProperty("role", "dim")
        self._empty.setWordWrap(True)
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.addWidget(self._empty)
        self.setMinimumHeight(170)
        self.setMaximumHeight(220)
        self.setAccessibleName("Response curve")

    def set_theme(self, theme: Theme) -> None:
        """Colours of the axes."""
        self.theme = theme
        if self._plot is not None:
            self._dress()
            self._draw()

    def show_response(self, response: Response | None) -> None:
        """Another curve."""
        if response is self.response:
            return
        self.response = response
        if response is not None and self._plot is None:
            self._make()
        self._empty.setVisible(response is None)
        if self._plot is not None:
            self._plot.setVisible(response is not None)
            self._draw()
        if response is not None:
            kind = "measured" if response.measured else "assumed"
            self.setAccessibleDescription(f"{kind}, {response.rms:.3f} stops RMS unexplained")

    def _make(self) -> None:
        import pyqtgraph as pg

        self._plot = pg.PlotWidget()
        self._plot.setMenuEnabled(False)
        self._plot.setMouseEnabled(False, False)
        self._plot.hideButtons()
        self._plot.setLabel("bottom", "number in the photograph")
        self._plot.setLabel("left", "light (stops)")
        for widget in (self._plot, self._plot.viewport()):
            widget.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._column.addWidget(self._plot)
        self._dress()

    def _dress(self) -> None:
        self._plot.setBackground(self.theme.base)
        for side in ("left", "bottom"):
            self._plot.getAxis(side).setPen(self.theme.dim)
            self._plot.getAxis(side).setTextPen(self.theme.dim)
        self._plot.showGrid(x=True, y=True, alpha=0.2)

    def _draw(self) -> None:
        import pyqtgraph as pg

        self._plot.clear()
        found = self.response
        if found is None:
            return
        levels = found.curve.shape[1]
        numbers = np.linspace(0, found.top, levels)
        for channel, colour in enumerate(_COLOURS):
            curve = found.curve[channel]
            there = np.isfinite(curve) & (numbers >= found.black[channel]) & (numbers <= found.white[channel])
            skip = max(1, int(there.sum()) // _POINTS)
            pen = pg.mkPen(colour, width=2)
            self._plot.plot(numbers[there][::skip], curve[there][::skip], pen=pen)
