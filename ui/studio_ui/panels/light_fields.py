"""Controls that show a number in two ways: intensity also in EV, a view's angle also as a lens, kelvin as a
colour, a direction as a dial."""

from __future__ import annotations

import math
from typing import Any

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QLinearGradient, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QHBoxLayout, QLabel

from studio_core.colour import kelvin
from studio_core.params import ParamInfo
from studio_ui.forms.colour_button import to_display
from studio_ui.forms.fields import Field, NumberField, Slider
from studio_ui.forms.hold import Hold
from studio_ui.forms.sinks import Sink
from studio_ui.forms.spin import MIXED, Spin
from studio_ui.look.theme import GAP
from studio_ui.panels.dial import Dial
from studio_ui.panels.light_hints import kelvin_words, to_ev

_EV = ParamInfo("number", "Intensity in EV", "One more is twice the light", unit="EV", low=-32, high=32)
_LENS = ParamInfo(
    "number", "Lens", "Focal length with a picture of 36 × 24 mm", unit="mm", low=1.0, high=1400.0
)
_SENSOR = 24.0  # mm, the height of a full-frame picture
_WARMEST, _COLDEST = 1700.0, 12000.0
_NONE = "none"
_WIDTH = 76  # pixels


def to_lens(fov: float) -> float:
    """Focal length in mm of a vertical angle in degrees, on full frame."""
    return _SENSOR / 2 / math.tan(math.radians(fov) / 2)


def to_fov(lens: float) -> float:
    """Vertical angle in degrees of a focal length in mm, on full frame."""
    return math.degrees(2 * math.atan(_SENSOR / 2 / lens))


class _SecondLine(NumberField):
    """A number with a line below it: words, and the same number in another unit."""

    other_info: ParamInfo

    def __init__(self, name: str, info: ParamInfo, sink: Sink) -> None:
        super().__init__(name, info, sink)
        self.caption, self.hint = QLabel(), QLabel()
        for label in (self.caption, self.hint):
            label.setProperty("role", "dim")
            label.setWordWrap(True)
        self.other = Spin(self.other_info, decimals=1)
        self.other.setFixedWidth(_WIDTH)
        self.other.setToolTip(self.other_info.doc)
        self.other.setAccessibleName(self.other_info.label)
        self.other.valueChanged.connect(self._other_typed)
        self._hold.follow(self.other)
        self._other_value = math.inf
        line = QHBoxLayout()
        line.setSpacing(GAP)
        line.addWidget(self.caption, 1)
        line.addWidget(self.other, 0, Qt.AlignmentFlag.AlignTop)
        self.column.addLayout(line)
        self.column.addWidget(self.hint)
        self.hint.hide()

    def tell(self, hint: str) -> None:
        """A line below the numbers, or none."""
        self.hint.setText(hint)
        self.hint.setVisible(bool(hint))

    def to_other(self, value: float) -> float:
        """The number in the other unit."""
        raise NotImplementedError

    def from_other(self, value: float) -> float:
        """Back again."""
        raise NotImplementedError

    def show_value(self, value: Any) -> None:
        """What the scene has."""
        super().show_value(value)
        self._other_value = self.to_other(float(value))
        self.other.show_value(self._other_value)

    def show_mixed(self, value: Any) -> None:
        """Dashes."""
        super().show_mixed(value)
        self._other_value = math.inf
        self.other.show_mixed(self.to_other(float(value)))

    def _other_typed(self, value: float) -> None:
        if abs(value - self._other_value) >= 1e-6:
            self.other.mixed = False
            self._other_value = value
            made = min(max(self.from_other(value), self.info.low), self.info.high)
            self._hold.give(float(f"{made:.6g}"))


class IntensityField(_SecondLine):
    """A factor, and the same in EV."""

    other_info = _EV

    def to_other(self, value: float) -> float:
        """EV; the lowest for darkness."""
        return max(to_ev(value), _EV.low)

    def from_other(self, value: float) -> float:
        """The factor; darkness for the lowest."""
        return 2.0**value if value > _EV.low else 0.0


class LensField(_SecondLine):
    """A camera's vertical angle, and the focal length that has it."""

    other_info = _LENS

    def __init__(self, name: str, info: ParamInfo, sink: Sink) -> None:
        super().__init__(name, info, sink)
        self.caption.setText("Full-frame lens")

    def to_other(self, value: float) -> float:
        """Millimetres."""
        return to_lens(value)

    def from_other(self, value: float) -> float:
        """Degrees."""
        return to_fov(value)


class KelvinSlider(Slider):
    """Its groove has the colours that it chooses from."""

    def paintEvent(self, event: QPaintEvent) -> None:
        """The colours, and a handle that can be seen on all of them."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        room = QRectF(self.rect()).adjusted(5.5, 0, -5.5, 0)
        groove = QRectF(room.left() - 5, self.height() / 2 - 4, room.width() + 10, 8)
        gradient = QLinearGradient(room.topLeft(), room.topRight())
        for step in range(13):
            gradient.setColorAt(step / 12, kelvin_colour(_WARMEST + step / 12 * (_COLDEST - _WARMEST)))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(gradient)
        painter.drawRoundedRect(groove, 4, 4)
        share = self.value() / max(self.maximum(), 1)
        painter.setPen(QPen(self.palette().base().color(), 1.5))
        painter.setBrush(self.palette().text())
        at = room.left() + share * room.width()
        painter.drawRoundedRect(QRectF(at - 4, self.height() / 2 - 8, 8, 16), 3, 3)
        painter.end()


class KelvinField(NumberField):
    """A colour temperature; 0 leaves the colour to the tint."""

    def __init__(self, name: str, info: ParamInfo, sink: Sink) -> None:
        super().__init__(name, info, sink)
        self._low, self._high = _WARMEST, _COLDEST
        self.spin.setSpecialValueText(_NONE)
        self.spin.setSingleStep(100)
        self.hint = QLabel()
        self.hint.setProperty("role", "dim")
        self.column.addWidget(self.hint)

    def make_slider(self) -> Slider:
        """In the colours of light."""
        return KelvinSlider(Qt.Orientation.Horizontal)

    def show_value(self, value: Any) -> None:
        """What the scene has, and what has such a colour."""
        self.spin.setSpecialValueText(_NONE)
        super().show_value(value)
        self.hint.setText(kelvin_words(float(value)).capitalize())

    def show_mixed(self, value: Any) -> None:
        """A dash."""
        super().show_mixed(value)
        self.spin.setSpecialValueText(MIXED)  # also where the last one has none
        self.hint.setText("Several")


class DirectionField(Field):
    """An angle about the vertical: a dial and a number."""

    def __init__(self, name: str, info: ParamInfo, sink: Sink) -> None:
        super().__init__(name, info, sink)
        self.dial = Dial(info.label)
        self.spin = Spin(info, decimals=1)
        self._value = math.inf
        self._hold = Hold(sink, name, self.spin)
        self.dial.began = lambda: self.sink.begin(self.name)
        self.dial.turned = lambda degrees: self.sink.preview(self.name, degrees)
        self.dial.ended = self.sink.commit
        self.dial.set_to = lambda degrees: self.sink.apply(self.name, degrees)
        self.spin.valueChanged.connect(self._typed)
        self.row.addWidget(self.dial)
        self.row.addStretch(1)
        self.row.addWidget(self.spin)
        self.spin.setFixedWidth(_WIDTH)

    def show_value(self, value: Any) -> None:
        """What the scene has."""
        self._value = float(value)
        self.spin.show_value(self._value)
        self.dial.show_degrees(self._value)

    def show_mixed(self, value: Any) -> None:
        """A dash."""
        self.show_value(value)
        self._value = math.inf
        self.spin.show_mixed(float(value))

    def _typed(self, value: float) -> None:
        if abs(value - self._value) >= 1e-6:
            self._value, self.spin.mixed = value, False
            self._hold.give(value)


def kelvin_colour(temperature: float) -> QColor:
    """A black body's colour as the display shows it, as bright as it can be."""
    red, green, blue = kelvin(temperature)
    peak = max(red, green, blue)
    return to_display((red / peak, green / peak, blue / peak))
