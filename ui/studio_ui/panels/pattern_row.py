"""How a picture lies on a surface: how often, how large in metres, and how far it is turned."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

from PySide6.QtWidgets import QLabel, QToolButton, QVBoxLayout, QWidget

from studio_core.params import ParamInfo
from studio_core.scene.geometry import Texture
from studio_core.scene.pattern import PLAIN, UnitLengths, pattern_size, with_rotation, with_size
from studio_ui.forms.number_style import number_style
from studio_ui.forms.spin import Spin
from studio_ui.panels.panel import row

_REPEAT = ParamInfo(
    "number", "Repeat", "How often the picture is repeated over the surface's own unit", unit="×", low=0.01,
    high=1000.0, scale="log",
)  # fmt: skip
_WIDTH = ParamInfo("number", "Width", "Width of one picture on the surface", unit="m", low=1e-4, high=1e4)
_HEIGHT = ParamInfo("number", "Height", "Height of one picture on the surface", unit="m", low=1e-4, high=1e4)
_TURNED = ParamInfo(
    "number", "Turned", "How far the picture is turned counter-clockwise", unit="°", low=-3600.0, high=3600.0
)
_NEAR = 1e-6


class PatternRow(QWidget):
    """`lay(texture)` is an edit: the same picture, laid otherwise. Sizes are those on the scene's objects."""

    def __init__(self, tool: Callable[[str, str], QToolButton], lay: Callable[[Texture], object]) -> None:
        super().__init__()
        self._lay = lay
        self._texture: Texture | None = None
        self._lengths = PLAIN
        self.repeat = Spin(_REPEAT, decimals=2)
        self.width_field, self.height_field = Spin(_WIDTH), Spin(_HEIGHT)
        self.turned = Spin(_TURNED, decimals=1)
        for field in (self.repeat, self.width_field, self.height_field, self.turned):
            field.setToolTip(field.info.doc)
        self.turned.setSingleStep(15.0)
        self.keep = tool("lock", "Width and height keep their proportion")
        self.keep.setCheckable(True)
        self.keep.setChecked(True)
        self.told = _dim("")
        self.told.setWordWrap(True)
        self.repeat.valueChanged.connect(self._repeat)
        self.width_field.valueChanged.connect(lambda value: self._size(value, 0))
        self.height_field.valueChanged.connect(lambda value: self._size(value, 1))
        self.turned.valueChanged.connect(self._turn)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        column.addLayout(row(_dim("Size"), self.width_field, _dim("×"), self.height_field, self.keep))
        column.addLayout(row(_dim("Turned"), self.turned, _dim("Repeated"), self.repeat))
        column.addWidget(self.told)

    def show_texture(self, texture: Texture, lengths: UnitLengths | None) -> None:
        """How it lies now, on surfaces with these lengths (None: nothing with coordinates has it)."""
        self._texture, self._lengths = texture, lengths or PLAIN
        self.repeat.show_value(texture.scale[0])
        self.turned.show_value(texture.rotation)
        size = pattern_size(texture, self._lengths)
        told = math.isfinite(size[0]) and math.isfinite(size[1]) and lengths is not None
        for field, side in zip((self.width_field, self.height_field), size, strict=True):
            field.setEnabled(told)
            if math.isfinite(side):
                field.show_value(side)
        self.told.setText(self._note(lengths, size))
        self.told.setVisible(bool(self.told.text()))

    def _note(self, lengths: UnitLengths | None, size: tuple[float, float]) -> str:
        if lengths is None:
            return "No object with texture coordinates has this material."
        if lengths.even or not math.isfinite(size[0]):
            return ""
        style = number_style(self)
        ends = [style.text(size[0] * u / lengths.u, "m") for u in lengths.u_range]
        return f"Objects differ: from {ends[0]} to {ends[1]} wide."

    def _repeat(self, value: float) -> None:
        old = self._texture
        if old is not None and abs(value - old.scale[0]) > 1e-9:
            across, up = old.scale
            scale = (value, value * up / across if across else value)
            self._lay(dataclasses.replace(old, scale=scale))

    def _size(self, value: float, axis: int) -> None:
        if self._texture is None:
            return
        old = pattern_size(self._texture, self._lengths)
        if not math.isfinite(old[axis]) or abs(value - old[axis]) <= _NEAR * old[axis]:
            return
        grown = value / old[axis]
        size = (old[0] * grown, old[1] * grown) if self.keep.isChecked() else old
        made = (value, size[1]) if axis == 0 else (size[0], value)
        self._lay(with_size(self._texture, self._lengths, made))

    def _turn(self, value: float) -> None:
        if self._texture is not None and abs(value - self._texture.rotation) > 1e-9:
            self._lay(with_rotation(self._texture, self._lengths, value))


def _dim(text: str) -> QLabel:
    made = QLabel(text)
    made.setProperty("role", "dim")
    return made
