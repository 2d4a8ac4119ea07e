"""Colours one need not mix: those of metals, and of light by its temperature."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtGui import QAction, QColor, QIcon, QPainter, QPixmap
from PySide6.QtWidgets import QLabel, QMenu, QWidget, QWidgetAction

from studio_core.colour import kelvin, luminance
from studio_core.metals import METALS, Metal
from studio_core.params import Colour, ParamInfo
from studio_ui.forms.colour_button import to_display
from studio_ui.forms.spin import Spin
from studio_ui.panels.panel import row

_TEMPERATURES = (
    (1900, "Candle"),
    (2700, "Warm white"),
    (3000, "Halogen"),
    (4000, "Neutral white"),
    (5000, "Horizon daylight"),
    (6500, "Daylight"),
    (8000, "Shade"),
    (12000, "Blue sky"),
)
_ANY = ParamInfo("number", "Temperature", "Of a black body", unit="K", low=1667.0, high=25000.0)
_ICON = 16


class ColourMenu(QMenu):
    """`gave(colour)`: a colour was chosen; `metal(metal)`: a metal, which may mean more than its colour."""

    def __init__(self, parent: QWidget, now: Callable[[], Colour]) -> None:
        super().__init__(parent)
        self.gave: Callable[[Colour], object] = lambda colour: None
        self.metal: Callable[[Metal], object] = lambda metal: self.gave(metal.colour)
        self.high = 1.0
        self._now = now
        self.setToolTipsVisible(True)
        self.metals = self.addMenu("Metal")
        self.temperatures = self.addMenu("Temperature")
        self.temperature = Spin(_ANY)
        self._filled = False
        self.aboutToShow.connect(self.fill)

    def fill(self) -> None:
        """The entries; made when they are first wanted."""
        if self._filled:
            return
        self._filled = True
        self.metals.setToolTipsVisible(True)
        for metal in METALS:
            numbers = " / ".join(f"{c:.3f}" for c in metal.colour)
            tip = f"Reflects {numbers} head-on\n{metal.source}"
            self._entry(self.metals, metal.name, metal.colour, tip, lambda m=metal: self.metal(m))
        for degrees, name in _TEMPERATURES:
            colour = tempered(self._now(), degrees, self.high)
            self._entry(
                self.temperatures, f"{degrees} K  {name}", colour, "", lambda k=degrees: self._heat(float(k))
            )
        self.temperatures.addSeparator()
        line = QWidget()
        line.setLayout(row(QLabel("  Other"), self.temperature))
        typed = QWidgetAction(self.temperatures)
        typed.setDefaultWidget(line)
        self.temperatures.addAction(typed)
        self.temperature.show_value(5500.0)
        self.temperature.valueChanged.connect(self._heat)

    def _heat(self, degrees: float) -> None:
        self.gave(tempered(self._now(), degrees, self.high))

    @staticmethod
    def _entry(menu: QMenu, text: str, colour: Colour, tip: str, chosen: Callable[[], object]) -> QAction:
        action = menu.addAction(_dot(to_display(colour)), text)
        action.setToolTip(tip)
        action.triggered.connect(lambda checked=False: chosen())
        return action


def tempered(colour: Colour, degrees: float, high: float = 1.0) -> Colour:
    """The colour of a black body, as light as `colour` where `high` allows; black is taken for half grey."""
    light = luminance(colour) or 0.5
    warm = kelvin(degrees)
    scale = min(light, high / max(warm))
    red, green, blue = (c * scale for c in warm)
    return (red, green, blue)


def _dot(colour: QColor) -> QIcon:
    pixmap = QPixmap(_ICON, _ICON)
    pixmap.fill(QColor(0, 0, 0, 0))
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(QColor(0, 0, 0, 90))
    painter.setBrush(colour)
    painter.drawEllipse(1, 1, _ICON - 2, _ICON - 2)
    painter.end()
    return QIcon(pixmap)


__all__ = ["ColourMenu", "tempered"]
