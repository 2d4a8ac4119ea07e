"""A camera's lens in one line: focal length on full frame, and the vertical angle that it has."""

from __future__ import annotations

from PySide6.QtWidgets import QHBoxLayout, QWidget

from studio_core.params import ParamInfo, param_infos
from studio_core.scene.nodes import Camera
from studio_ui.forms.hold import Hold
from studio_ui.forms.sinks import Sink
from studio_ui.forms.spin import ScrubLabel, Spin
from studio_ui.look.theme import GAP
from studio_ui.panels.light_fields import to_fov, to_lens

_ANGLE = param_infos(Camera)["fov"]
_LENS = ParamInfo(
    "number",
    "Lens",
    "Focal length of a 36 × 24 mm camera that sees as much; less is wider",
    unit="mm",
    low=round(to_lens(_ANGLE.high), 2),
    high=round(to_lens(_ANGLE.low)),
)
_ALIKE = 1e-6


class LensRow(QWidget):
    """Two numbers for the parameter `fov`; either may be typed, stepped or pulled at the label."""

    def __init__(self, sink: Sink) -> None:
        super().__init__()
        self._fov = 0.0
        self.lens, self.angle = Spin(_LENS, decimals=1), Spin(_ANGLE, decimals=1)
        self._hold = Hold(sink, "fov", self.lens, self.angle)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(GAP)
        for spin in (self.lens, self.angle):
            spin.setToolTip(spin.info.doc)
        label = ScrubLabel("Lens", self.lens)
        label.setToolTip(_LENS.doc)
        layout.addWidget(label)
        layout.addWidget(self.lens, 1)
        layout.addWidget(self.angle, 1)
        self.lens.valueChanged.connect(lambda value: self._typed(to_fov(value), self.lens))
        self.angle.valueChanged.connect(lambda value: self._typed(value, self.angle))

    def show_fov(self, fov: float) -> None:
        """What the scene has, without telling."""
        self._fov = fov
        self.lens.show_value(to_lens(fov))
        self.angle.show_value(fov)

    def _typed(self, fov: float, spin: Spin) -> None:
        fov = float(f"{min(max(fov, _ANGLE.low), _ANGLE.high):.6g}")
        if abs(fov - self._fov) < _ALIKE:
            return
        self._fov = fov
        if spin is self.lens:
            self.angle.show_value(fov)
        else:
            self.lens.show_value(to_lens(fov))
        self._hold.give(fov)
