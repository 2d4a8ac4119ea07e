"""A small round sample of a material, until its ball is there: main colour, shiny where it is smooth."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QIcon, QPainter, QPixmap, QRadialGradient

from studio_core.scene.nodes import Material
from studio_ui.forms.colour_button import to_display

SIZE = 30
_COLOURS = ("base_color", "color", "diffuse", "albedo", "reflectance")


def main_colour(material: Material) -> QColor:
    """The first colour among the material's values; grey where it has the model's default."""
    names = [n for n in _COLOURS if n in material.values]
    names += [n for n, v in material.values.items() if isinstance(v, tuple)]
    for name in names:
        value = material.values[name]
        if isinstance(value, tuple):
            return to_display(value)
    return QColor("#b4b4b0")


def swatch(material: Material, ratio: float = 1.0, size: int = SIZE) -> QIcon:
    """The sample, so many pixels wide at a ratio of 1."""
    pixels = round(size * ratio)
    pixmap = QPixmap(pixels, pixels)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.scale(ratio * size / SIZE, ratio * size / SIZE)
    colour = main_colour(material)
    rough = material.values.get("roughness")
    exponent = material.values.get("exponent")
    shine = 0.25
    if isinstance(rough, float):
        shine = 1 - rough
    elif isinstance(exponent, float):
        shine = min(1.0, exponent / 200)
    elif material.model == "lambert":
        shine = 0.0
    ball = QRectF(2, 2, SIZE - 4, SIZE - 4)
    gradient = QRadialGradient(QPointF(SIZE * 0.38, SIZE * 0.34), SIZE * 0.62)
    gradient.setColorAt(0, colour.lighter(round(112 + 110 * shine)))
    gradient.setColorAt(0.35 - 0.2 * shine, colour.lighter(108))
    gradient.setColorAt(1, colour.darker(210))
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(gradient)
    painter.setOpacity(0.35 + 0.65 * material.opacity)
    painter.drawEllipse(ball)
    painter.end()
    pixmap.setDevicePixelRatio(ratio)
    return QIcon(pixmap)
