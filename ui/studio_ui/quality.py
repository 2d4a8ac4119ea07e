"""The one control from faster to truer: in the status bar beside the error, and in the shading panel."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QWidget

from studio_core.errors import PluginError
from studio_core.params import ParamInfo, defaults, param_infos
from studio_ui.context import Context, Subscriptions
from studio_ui.forms.fields import Slider
from studio_ui.look.theme import GAP

NAME = "quality"
"""The parameter by which a backend offers this control: a number from 0 (faster) to 1 (truer)."""
_STEPS = 20
_TIP = (
    "Faster: pictures come sooner and stay coarser.\n"
    "Truer: light is summed more finely, and at rest the picture is refined until its error is small.\n"
    "The error beside it says how far the picture is from the truth."
)


class QualityControl(QWidget):
    """A slider between two words; hidden where the session's backend has no such parameter."""

    def __init__(self, context: Context, *, width: int | None = None) -> None:
        super().__init__()
        self._context = context
        self.slider = Slider(Qt.Orientation.Horizontal)
        self.slider.setRange(0, _STEPS)
        self.slider.setPageStep(_STEPS // 10)
        self.slider.setAccessibleName("Quality, from faster to truer")
        if width is not None:
            self.slider.setFixedWidth(width)
            self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Preferred)
        self.setToolTip(_TIP)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(GAP)
        for widget in (_word("faster"), self.slider, _word("truer")):
            layout.addWidget(widget, 1 if widget is self.slider else 0)
        self.slider.valueChanged.connect(self._slid)
        self.slider.sliderReleased.connect(self._chosen)
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            context.warmed.connect(self.refresh), context.session.changed.connect(lambda _: self.refresh())
        )
        self.refresh()

    def close_panel(self) -> None:
        """Stop listening."""
        self._subscriptions.close()

    def refresh(self) -> None:
        """What the session has now."""
        default = self._default()
        self.setVisible(default is not None)
        if default is not None and not self.slider.isSliderDown():
            value = float(self._context.session.params.get(NAME, default))
            with QSignalBlocker(self.slider):
                self.slider.setValue(round(_STEPS * value))

    def start_with(self, value: float) -> None:
        """Where it stands in projects that say nothing of it."""
        session, default = self._context.session, self._default()
        if default is not None and NAME not in session.params and value != default:
            session.shade_with(session.backend, {**session.params, NAME: value})

    def _default(self) -> float | None:
        context = self._context
        if not context.warm:
            return None
        try:
            params = context.host.get("backend", context.session.backend).Params
        except PluginError:
            return None
        if not offers_quality(param_infos(params)):
            return None
        return float(defaults(params)[NAME])  # type: ignore[arg-type]

    def _slid(self, step: int) -> None:
        if not self.slider.isSliderDown():
            self._chosen()

    def _chosen(self) -> None:
        session, value = self._context.session, self.slider.value() / _STEPS
        if session.params.get(NAME, self._default()) != value:
            session.shade_with(session.backend, {**session.params, NAME: value})


def offers_quality(infos: dict[str, ParamInfo]) -> bool:
    """Whether parameters have one that this control can move."""
    info = infos.get(NAME)
    return info is not None and info.kind == "number" and (info.low, info.high) == (0.0, 1.0)


def _word(text: str) -> QLabel:
    label = QLabel(text)
    label.setProperty("role", "dim")
    return label
