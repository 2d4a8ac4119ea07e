"""The controls of one parameter each: number, flag, choice, text, colour."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtGui import QKeyEvent, QWheelEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QHBoxLayout,
    QLineEdit,
    QSizePolicy,
    QSlider,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from studio_core.params import ParamInfo
from studio_ui.forms.colour_button import ColourButton
from studio_ui.forms.colour_menu import ColourMenu
from studio_ui.forms.hold import Hold
from studio_ui.forms.sinks import Sink
from studio_ui.forms.spin import MIXED, Spin
from studio_ui.look.theme import GAP

_STEPS = 1000


class Combo(QComboBox):
    """A choice that leaves the wheel to the panel."""

    def __init__(self) -> None:
        super().__init__()
        self.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.setMinimumContentsLength(8)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Never turns the choice by accident."""
        event.ignore()


class Slider(QSlider):
    """A slider that leaves the wheel to the panel."""

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Ignored."""
        event.ignore()


class Field(QWidget):
    """One parameter's controls."""

    def __init__(self, name: str, info: ParamInfo, sink: Sink) -> None:
        super().__init__()
        self.name, self.info, self.sink = name, info, sink
        self.setToolTip(tip(info))
        self.column = QVBoxLayout(self)
        self.column.setContentsMargins(0, 0, 0, 0)
        self.column.setSpacing(2)
        self.row = QHBoxLayout()
        self.row.setSpacing(GAP)
        self.column.addLayout(self.row)

    def show_value(self, value: Any) -> None:
        """What the scene has."""
        raise NotImplementedError

    def show_mixed(self, value: Any) -> None:
        """Several things have several values, the last of them `value`."""
        raise NotImplementedError


class NumberField(Field):
    """A number, with a slider where the range is one that a hand can use."""

    def __init__(self, name: str, info: ParamInfo, sink: Sink) -> None:
        super().__init__(name, info, sink)
        self.spin = Spin(info)
        self.slider: Slider | None = None
        self._value = 0.0
        self._hold = Hold(sink, name, self.spin)
        low, high = slider_range(info)
        self._low, self._high = low, high
        if high > low:
            self.slider = self.make_slider()
            self.slider.setRange(0, _STEPS)
            self.slider.setMinimumWidth(30)
            self.slider.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            self.slider.setAccessibleName(info.label)
            self.slider.sliderPressed.connect(self._hold.begin)
            self.slider.sliderReleased.connect(self._hold.end)
            self.slider.valueChanged.connect(self._slid)
            self.row.addWidget(self.slider, 1)
            self.spin.setFixedWidth(76)
        self.row.addWidget(self.spin, 0 if self.slider else 1)
        self.spin.valueChanged.connect(self._typed)

    def make_slider(self) -> Slider:
        """The slider, where there is one."""
        return Slider(Qt.Orientation.Horizontal)

    def show_value(self, value: Any) -> None:
        """What the scene has."""
        self._value = float(value)
        self.spin.show_value(self._value)
        if self.slider is not None and not self.slider.isSliderDown():
            with QSignalBlocker(self.slider):
                self.slider.setValue(round(_STEPS * self._share(self._value)))

    def show_mixed(self, value: Any) -> None:
        """A dash; the slider is where the last one is."""
        self.show_value(value)
        self._value = math.inf  # whatever is typed is another value
        self.spin.show_mixed(float(value))

    def _share(self, value: float) -> float:
        value = min(max(value, self._low), self._high)
        if self.info.scale == "log":
            return math.log(value / self._low) / math.log(self._high / self._low)
        return (value - self._low) / (self._high - self._low)

    def _at(self, share: float) -> float | int:
        if self.info.scale == "log":
            value = (
                0.0 if share == 0 and self.info.low == 0 else self._low * (self._high / self._low) ** share
            )
            value = float(f"{value:.3g}")
        else:
            value = self._low + share * (self._high - self._low)
        value = min(max(value, self.info.low), self.info.high)
        return round(value) if self.info.kind == "integer" else value

    def _slid(self, step: int) -> None:
        value = self._at(step / _STEPS)
        self.spin.show_value(value)
        if self._hold.active or (self.slider is not None and not self.slider.isSliderDown()):
            self._hold.give(value)

    def _typed(self, value: float) -> None:
        if abs(value - self._value) < 0.5 * 10.0 ** -self.spin.decimals():
            return  # only rounded
        self._value, self.spin.mixed = value, False
        self._hold.give(round(value) if self.info.kind == "integer" else value)


class FlagField(Field):
    """Yes or no."""

    def __init__(self, name: str, info: ParamInfo, sink: Sink) -> None:
        super().__init__(name, info, sink)
        self.box = QCheckBox()
        self.box.setAccessibleName(info.label)
        self.row.addWidget(self.box)
        self.row.addStretch(1)
        self.box.checkStateChanged.connect(self._turned)

    def show_value(self, value: Any) -> None:
        """What the scene has."""
        with QSignalBlocker(self.box):
            self.box.setTristate(False)
            self.box.setChecked(bool(value))

    def show_mixed(self, value: Any) -> None:
        """Half checked."""
        with QSignalBlocker(self.box):
            self.box.setCheckState(Qt.CheckState.PartiallyChecked)

    def _turned(self, state: Qt.CheckState) -> None:
        self.box.setTristate(False)
        self.sink.apply(self.name, state is Qt.CheckState.Checked)


class ChoiceField(Field):
    """One of several texts."""

    def __init__(self, name: str, info: ParamInfo, sink: Sink) -> None:
        super().__init__(name, info, sink)
        self.combo = Combo()
        self.combo.setAccessibleName(info.label)
        self.combo.addItems(list(info.choices))
        self.row.addWidget(self.combo, 1)
        self.combo.activated.connect(lambda i: self.sink.apply(self.name, self.info.choices[i]))

    def show_value(self, value: Any) -> None:
        """What the scene has."""
        with QSignalBlocker(self.combo):
            self.combo.setCurrentText(str(value))

    def show_mixed(self, value: Any) -> None:
        """A dash."""
        with QSignalBlocker(self.combo):
            self.combo.setPlaceholderText(MIXED)
            self.combo.setCurrentIndex(-1)


class Line(QLineEdit):
    """A line of text; Esc puts back `before()`."""

    def __init__(self, before: Callable[[], str]) -> None:
        super().__init__()
        self._before = before

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Esc takes back what was typed, then it is the window's."""
        if event.key() == Qt.Key.Key_Escape and self.text() != self._before():
            self.setText(self._before())
            self.selectAll()
            event.accept()
        else:
            super().keyPressEvent(event)


class TextField(Field):
    """A line of text."""

    def __init__(self, name: str, info: ParamInfo, sink: Sink) -> None:
        super().__init__(name, info, sink)
        self.edit = Line(lambda: self._value)
        self.edit.setAccessibleName(info.label)
        self.row.addWidget(self.edit, 1)
        self._value = ""
        self.edit.editingFinished.connect(self._typed)

    def show_value(self, value: Any) -> None:
        """What the scene has."""
        if str(value) != self._value or not self.edit.hasFocus():
            self._value = str(value)
            self.edit.setPlaceholderText("")
            self.edit.setText(self._value)
            self.edit.setCursorPosition(0)  # long names are told from their beginning

    def show_mixed(self, value: Any) -> None:
        """A dash; nothing typed leaves all as they are."""
        if not self.edit.hasFocus() or self._value:
            self._value = ""
            self.edit.clear()
            self.edit.setPlaceholderText(MIXED)

    def _typed(self) -> None:
        if self.edit.text() != self._value:
            self._value = self.edit.text()
            self.sink.apply(self.name, self._value)


class ColourField(Field):
    """A colour, chosen as the display shows it and kept scene-linear."""

    def __init__(self, name: str, info: ParamInfo, sink: Sink) -> None:
        super().__init__(name, info, sink)
        self.button = ColourButton(info.label, reflectance=info.high <= 1)
        self.button.began = lambda: sink.begin(name)
        self.button.previewed = lambda colour: sink.preview(name, colour)
        self.button.committed = sink.commit
        self.button.cancelled = sink.cancel
        self.row.addWidget(self.button, 1)
        self.menu: ColourMenu | None = None
        if info.high <= 1:
            self.menu = ColourMenu(self, lambda: self.button.colour)
            self.menu.gave = lambda colour: sink.apply(name, colour)
            self.row.addWidget(self._opener(self.menu))

    def _opener(self, menu: ColourMenu) -> QToolButton:
        opener = QToolButton()
        opener.setToolTip("Metals, and colours by temperature")
        opener.setAccessibleName(f"Known colours for {self.info.label}")
        opener.setProperty("role", "small")
        opener.setAutoRaise(True)
        opener.setArrowType(Qt.ArrowType.DownArrow)
        opener.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        opener.setMenu(menu)
        return opener

    def show_value(self, value: Any) -> None:
        """What the scene has."""
        self.button.show_colour(value)

    def show_mixed(self, value: Any) -> None:
        """A dash; the dialog starts from the last."""
        self.button.show_colour(value, mixed=True)


FIELDS: dict[str, type[Field]] = {
    "number": NumberField,
    "integer": NumberField,
    "flag": FlagField,
    "choice": ChoiceField,
    "text": TextField,
    "colour": ColourField,
}
"""The control of every kind of parameter."""


def tip(info: ParamInfo) -> str:
    """What it means, its unit and range."""
    parts = [info.doc or info.label]
    if info.kind in ("number", "integer") and math.isfinite(info.low) and info.high < 1e8:
        parts.append(f"{info.low:g} to {info.high:g}{' ' + info.unit if info.unit else ''}")
    return "\n".join(parts)


def slider_range(info: ParamInfo) -> tuple[float, float]:
    """What a slider spans; an empty range where none makes sense."""
    if info.scale == "log":
        return (info.low, info.high) if info.low > 0 and info.high <= 1e7 else (0.01, min(info.high, 1000.0))
    if info.unit == "°" and info.high - info.low > 360:
        return -180.0, 180.0
    if info.high - info.low <= 200 or info.unit == "K":
        return info.low, min(info.high, 12000.0) if info.unit == "K" else info.high
    return 0.0, 0.0
