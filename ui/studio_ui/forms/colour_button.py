"""Choosing a colour: shown and picked as the display has it, kept scene-linear Rec.709."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QAbstractButton, QColorDialog, QSizePolicy

from studio_core.params import Colour


def to_display(colour: Colour) -> QColor:
    """sRGB of a linear colour; brighter ones are scaled down to the display's white."""
    peak = max(1.0, *colour)
    encoded = [_encode(max(c, 0.0) / peak) for c in colour]
    return QColor.fromRgbF(*encoded)


def to_linear(colour: QColor) -> Colour:
    """Linear Rec.709 of an sRGB colour."""
    seen = colour.toRgb()
    return (_decode(seen.redF()), _decode(seen.greenF()), _decode(seen.blueF()))


def _encode(x: float) -> float:
    return min(12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055, 1.0)


def _decode(y: float) -> float:
    return y / 12.92 if y <= 0.04045 else ((y + 0.055) / 1.055) ** 2.4


class ColourButton(QAbstractButton):
    """A swatch that opens the colour dialog; while that is open the scene follows, Cancel rolls it back."""

    def __init__(self, title: str, *, reflectance: bool = True) -> None:
        super().__init__()
        self.began: Callable[[], bool] = lambda: True
        self.previewed: Callable[[Colour], object] = lambda colour: None
        self.committed: Callable[[], object] = lambda: None
        self.cancelled: Callable[[], object] = lambda: None
        self.dialog: QColorDialog | None = None
        self._title, self._reflectance = title, reflectance
        self._colour: Colour = (0.0, 0.0, 0.0)
        self._peak = 1.0
        self._mixed = False
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.clicked.connect(self.choose)

    @property
    def colour(self) -> Colour:
        """What is shown, linear."""
        return self._colour

    def show_colour(self, colour: Colour, *, mixed: bool = False) -> None:
        """Another colour; `mixed`: one of several."""
        self._mixed = mixed
        red, green, blue = (float(c) for c in colour)
        self._colour = (red, green, blue)
        what = "Reflects" if self._reflectance else "Factor"
        numbers = " / ".join(f"{c:.3f}" for c in self._colour) if not mixed else "—"
        if mixed:
            self.setToolTip("Several colours; a click gives all of them one")
        else:
            self.setToolTip(f"{what} {numbers} (linear)\nShown as {to_display(self._colour).name()} (sRGB)")
        self.setAccessibleName(f"{self._title} {numbers}")
        self.update()

    def choose(self) -> None:
        """Open the dialog; nothing waits for it."""
        if self.dialog is not None or not self.began():
            return
        self._peak = max(1.0, *self._colour)
        dialog = self.dialog = QColorDialog(to_display(self._colour), self.window())
        dialog.setWindowTitle(self._title)
        dialog.setOption(QColorDialog.ColorDialogOption.DontUseNativeDialog)
        dialog.currentColorChanged.connect(self._preview)
        dialog.finished.connect(self._finish)
        dialog.open()

    def _preview(self, colour: QColor) -> None:
        red, green, blue = (c * self._peak for c in to_linear(colour))
        self.previewed((red, green, blue))

    def _finish(self, result: int) -> None:
        dialog, self.dialog = self.dialog, None
        if dialog is not None:
            dialog.deleteLater()
        (self.committed if result else self.cancelled)()

    def sizeHint(self) -> QSize:
        """As high as the other controls."""
        return QSize(80, 26)

    def paintEvent(self, event: QPaintEvent) -> None:
        """The colour, and its numbers in what can be read on it."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        colour = to_display(self._colour)
        border = self.palette().highlight().color() if self.hasFocus() else QColor(0, 0, 0, 90)
        painter.setPen(QPen(border, 1))
        shown = self.isEnabled() and not self._mixed
        painter.setBrush(colour if shown else self.palette().window())
        painter.drawRoundedRect(QRectF(self.rect()).adjusted(0.5, 1.5, -0.5, -1.5), 4, 4)
        if self._mixed:
            painter.setPen(self.palette().text().color())
            painter.drawText(self.rect(), int(Qt.AlignmentFlag.AlignCenter), "—")
        elif self.width() > 110:
            painter.setPen(QColor("#1c1c1c" if colour.lightnessF() > 0.5 else "#f2f2f0"))
            text = " ".join(f"{c:.2f}" for c in self._colour)
            painter.drawText(self.rect(), int(Qt.AlignmentFlag.AlignCenter), text)
        painter.end()
