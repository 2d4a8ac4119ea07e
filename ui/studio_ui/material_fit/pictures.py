"""The pictures of a fit: photograph against reconstruction, their difference, and any other lamp."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from PySide6.QtWidgets import (
    QButtonGroup,
    QLabel,
    QSizePolicy,
    QStackedWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from studio_core.fitting import Fitted, relative_error
from studio_core.params import ParamInfo
from studio_ui.capture.preview.picture import Shown
from studio_ui.capture.preview.picture_view import PictureView
from studio_ui.capture.preview.tone import natural_exposure
from studio_ui.capture.tools.tool import Tool
from studio_ui.context import Context
from studio_ui.forms.fields import NumberField
from studio_ui.forms.sinks import LiveSink
from studio_ui.look.theme import GAP, Theme
from studio_ui.material_fit.heat import HeatLegend, heat
from studio_ui.material_fit.lamp_tool import FURTHEST, LampTool
from studio_ui.material_fit.newest import Newest
from studio_ui.material_fit.words import lamp_place, lamp_told, percent
from studio_ui.panels.panel import note, row

COMPARE, DIFFERENCE, RELIGHT = "compare", "difference", "relight"
F32 = npt.NDArray[np.float32]
_MODES = (
    (COMPARE, "Compare", "Photograph at the left of the line, reconstruction at its right; drag the line"),
    (DIFFERENCE, "Difference", "Where the reconstruction is wrong under the chosen lamp"),
    (RELIGHT, "Own lamp", "The material under a lamp of your own; drag the lamp over the picture"),
)
_EXPOSURE = ParamInfo("number", "Exposure", "How bright pictures are shown", "EV", -8.0, 8.0)
_AZIMUTH = ParamInfo("number", "Azimuth", "Of your own lamp: 0 is the camera", "°", -FURTHEST, FURTHEST)
_HEIGHT = ParamInfo("number", "Height", "Of your own lamp: 0 as the camera", "°", -FURTHEST, FURTHEST)


class FitPictures(QWidget):
    """`show_lamp(index)` chooses the lamp; pictures are made beside the window, the newest wish alone."""

    def __init__(self, context: Context) -> None:
        super().__init__()
        self._context = context
        self.fitted: Fitted | None = None
        self.lamp, self.mode = 0, COMPARE
        self.exposure = 0.0
        self.asked = Newest(context, "Picture of the fit")
        self.tool = LampTool()
        self.tool.moved = self.relight
        self.view = PictureView(self._elsewhere)
        self.view.sides = ("photograph", "reconstruction")
        self.told = QLabel()
        self.told.setWordWrap(True)
        self.told.setProperty("role", "dim")
        self.told.setMinimumHeight(2 * self.told.fontMetrics().height() + 4)
        self.told.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.buttons: dict[str, QToolButton] = {}
        group = QButtonGroup(self)
        for mode, text, tip in _MODES:
            button = QToolButton()
            button.setText(text)
            button.setToolTip(tip)
            button.setCheckable(True)
            button.clicked.connect(lambda _, mode=mode: self.show_mode(mode))
            group.addButton(button)
            self.buttons[mode] = button
        self.exposure_field = _field("exposure", _EXPOSURE, self._expose, lambda: self.exposure)
        self.azimuth = _field("azimuth", _AZIMUTH, lambda v: self._slid(v, None), lambda: self.tool.place[0])
        self.height_ = _field("height", _HEIGHT, lambda v: self._slid(None, v), lambda: self.tool.place[1])
        self.legend = HeatLegend()
        self.below = QStackedWidget()
        self.below.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        for mode, part in (
            (COMPARE, note("Drag the line, or press [ and ]. The wheel zooms.")),
            (DIFFERENCE, self.legend),
            (RELIGHT, _lamp_controls(self.azimuth, self.height_)),
        ):
            part.setObjectName(mode)
            self.below.addWidget(part)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(GAP)
        name = QLabel("Exposure")
        name.setProperty("role", "dim")
        gap = QWidget()
        bar = row(*self.buttons.values(), gap, name, self.exposure_field, stretch=len(self.buttons))
        self.exposure_field.setMinimumWidth(180)
        column.addLayout(bar)
        column.addWidget(self.view, 1)
        column.addWidget(self.below)
        column.addWidget(self.told)
        self._error: F32 | None = None
        self.view.hovered.connect(self._read)
        self.show_mode(COMPARE)

    def set_theme(self, theme: Theme) -> None:
        """Other colours."""
        self.view.set_theme(theme)
        self.legend.set_theme(theme)

    def close_pictures(self) -> None:
        """Make nothing any more."""
        self.asked.close()

    def show_fit(self, fitted: Fitted, lamp: int) -> None:
        """Another fit, under one of its lamps; its exposure suits that photograph."""
        self.fitted = fitted
        self.exposure = natural_exposure(fitted.photograph(lamp))
        self.exposure_field.show_value(self.exposure)
        self.tool.place = fitted.lamps[lamp].azimuth, fitted.lamps[lamp].height
        self._show_place()
        self.show_lamp(lamp)

    def show_lamp(self, lamp: int) -> None:
        """Another lamp; from one's own back to the photographs."""
        self.lamp = lamp
        if self.mode == RELIGHT:
            self.mode = COMPARE
        self.show_mode(self.mode)

    def show_mode(self, mode: str) -> None:
        """Compare, difference, or one's own lamp."""
        self.mode = mode
        self.buttons[mode].setChecked(True)
        self.below.setCurrentIndex([m for m, _, _ in _MODES].index(mode))
        self.view.set_tool(self.tool if mode == RELIGHT else Tool())
        self.exposure_field.setEnabled(mode != DIFFERENCE)
        self._tell()
        if self.fitted is None:
            return
        if mode == RELIGHT:
            self.relight(*self.tool.place)
            return
        fitted, lamp = self.fitted, self.lamp

        def work() -> tuple[F32, F32, F32]:
            seen, made = fitted.photograph(lamp), fitted.reconstruction(lamp)
            return seen, made, relative_error(made, seen, fitted.trusted(lamp))

        def done(found: tuple[F32, F32, F32]) -> None:
            if (self.lamp, self.fitted) == (lamp, fitted) and self.mode != RELIGHT:
                self._show(*found)

        self.asked.ask(work, done)

    def relight(self, azimuth: float, height: float) -> None:
        """One's own lamp is there now."""
        self.tool.place = azimuth, height
        self._show_place()
        self._tell()
        fitted = self.fitted
        if fitted is None or self.mode != RELIGHT:
            return

        def done(made: F32) -> None:
            if self.fitted is fitted and self.mode == RELIGHT:
                self._put(Shown("relit", "Relit", made))

        self.asked.ask(lambda: fitted.relit(azimuth, height), done)

    def _show(self, seen: F32, made: F32, error: F32) -> None:
        self._error = error
        if self.mode == DIFFERENCE:
            self._put(Shown("map", "Difference", heat(error)))
        else:
            self._put(Shown("map", "Reconstruction", made, before=seen))

    def _put(self, shown: Shown) -> None:
        self.view.set_exposure(0.0 if shown.encoded else self.exposure)
        self.tool.size = shown.size
        self.view.show_picture(shown)

    def _tell(self) -> None:
        if self.fitted is None:
            text = ""
        elif self.mode == RELIGHT:
            text = f"Your own lamp: {lamp_place(*self.tool.place)}"
        else:
            text = lamp_told(self.fitted.lamps[self.lamp])
        self.told.setText(text)
        self.view.setAccessibleDescription(text)

    def _read(self, point: tuple[float, float] | None) -> None:
        """How wrong it is under the mouse."""
        if self.mode != DIFFERENCE or self._error is None or self.view.shown is None:
            return
        if point is None or self._error.shape != self.view.shown.pixels.shape[:2]:
            self._tell()
            return
        here = float(self._error[int(point[1]), int(point[0])])
        nothing = "Here nothing counts: not lit, clipped, or beside the sample"
        self.told.setText(nothing if math.isnan(here) else f"Here it is off by {percent(here)}")

    def _show_place(self) -> None:
        self.azimuth.show_value(self.tool.place[0])
        self.height_.show_value(self.tool.place[1])
        self.view.update()

    def _slid(self, azimuth: float | None, height: float | None) -> None:
        old = self.tool.place
        self.relight(old[0] if azimuth is None else azimuth, old[1] if height is None else height)

    def _expose(self, exposure: float) -> None:
        self.exposure = exposure
        self.exposure_field.show_value(exposure)
        if self.mode != DIFFERENCE:
            self.view.set_exposure(exposure)

    def _elsewhere(self, work: Callable[[], None], done: Callable[[], None]) -> None:
        self._context.tasks.run("Preview", lambda job: work(), lambda _: done(), quiet=True)


def _field(
    name: str, info: ParamInfo, told: Callable[[float], object], now: Callable[[], float]
) -> NumberField:
    made = NumberField(name, info, LiveSink(told, now))
    made.show_value(now())
    return made


def _lamp_controls(azimuth: NumberField, height: NumberField) -> QWidget:
    made = QWidget()
    parts: list[QWidget] = []
    for text, field in (("Azimuth", azimuth), ("Height", height)):
        name = QLabel(text)
        name.setProperty("role", "dim")
        parts += [name, field]
    line = row(*parts, stretch=1)
    line.setStretch(3, 1)
    made.setLayout(line)
    return made


__all__ = ["COMPARE", "DIFFERENCE", "RELIGHT", "FitPictures"]
