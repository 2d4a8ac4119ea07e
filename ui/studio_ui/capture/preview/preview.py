"""The preview with what belongs to it: choice of pictures, zoom, exposure, marks, pixel, histogram."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from PySide6.QtGui import QAction, QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QMenu, QSizePolicy, QToolButton, QVBoxLayout, QWidget

from studio_core.colour import LUMINANCE
from studio_core.params import ParamInfo
from studio_ui.capture.preview.histogram import Histogram, HistogramView, histogram
from studio_ui.capture.preview.picture import Shown
from studio_ui.capture.preview.picture_view import PictureView
from studio_ui.capture.preview.tone import linear, natural_exposure, numbers
from studio_ui.context import Context
from studio_ui.forms.fields import Combo, NumberField
from studio_ui.forms.sinks import LiveSink
from studio_ui.look.theme import GAP, Theme

_EXPOSURE = ParamInfo(
    "number", "Exposure", "How bright the preview is; changes nothing but what is shown", "EV", -16.0, 16.0
)
_NARROW, _LOW = 520, 360  # pixels of the preview, under which there is no room for the histogram


class Preview(QWidget):
    """`chosen(name)`: another picture is wanted. Nothing here changes a picture."""

    def __init__(self, context: Context) -> None:
        super().__init__()
        self._context = context
        self._exposures: dict[bool, float | None] = {True: 0.0, False: None}  # of numbers, of light
        self._counted: object = None
        self.chosen: Callable[[str], object] = lambda name: None
        self.scale: float | None = None  # cd/m² of one
        self.view = PictureView(self._elsewhere)
        self.choice = Combo()
        self.choice.setAccessibleName("Picture")
        self.choice.setToolTip("Which picture is shown")
        self.choice.activated.connect(lambda i: self.chosen(self.choice.itemText(i)))
        self.exposure = NumberField("exposure", _EXPOSURE, LiveSink(self._expose, lambda: self.view.exposure))
        self.marks = QToolButton()
        self.marks.setText("Marks")
        self.marks.setToolTip("What is laid over the picture")
        self.marks.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self._menu = QMenu(self.marks)
        self.marks.setMenu(self._menu)
        self.wipe = _button("Compare", "Before at the left of the line, after at its right; drag the line")
        self.wipe.setCheckable(True)
        self.wipe.setChecked(True)
        self.wipe.toggled.connect(self._wipe)
        fit = _button("Fit", "The whole picture (0, or a double click)")
        fit.clicked.connect(self.view.fit)
        actual = _button("1:1", "One of the display's pixels for one of the picture's (1)")
        actual.clicked.connect(self.view.actual)
        auto = _button("Auto", "An exposure that shows most of the light")
        auto.clicked.connect(self.expose_naturally)
        self.readout = QLabel()
        self.readout.setProperty("role", "dim")
        self.readout.setWordWrap(True)
        self.readout.setMinimumHeight(2 * self.readout.fontMetrics().height() + 4)
        self.readout.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.histogram = HistogramView()
        bar = QHBoxLayout()
        bar.setSpacing(2)
        bar.addWidget(self.choice, 1)
        for widget in (self.wipe, self.marks, fit, actual):
            bar.addWidget(widget)
        below = QHBoxLayout()
        below.setSpacing(GAP)
        name = QLabel("Exposure")
        name.setProperty("role", "dim")
        name.setToolTip(_EXPOSURE.doc)
        below.addWidget(name)
        below.addWidget(self.exposure, 1)
        below.addWidget(auto)
        foot = QHBoxLayout()
        foot.setSpacing(GAP)
        foot.addWidget(self.readout, 1)
        foot.addWidget(self.histogram, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(4)
        column.addLayout(bar)
        column.addWidget(self.view, 1)
        column.addLayout(below)
        column.addLayout(foot)
        self.view.hovered.connect(self._read)
        self.offer((), "")
        self.show_picture(None)

    def set_theme(self, theme: Theme) -> None:
        """Another theme."""
        self.view.set_theme(theme)
        self.histogram.theme = theme
        self.histogram.update()

    def offer(self, names: Sequence[str], now: str) -> None:
        """The pictures that can be chosen."""
        if [self.choice.itemText(i) for i in range(self.choice.count())] != list(names):
            self.choice.clear()
            self.choice.addItems(list(names))
        self.choice.setCurrentText(now)
        self.choice.setEnabled(len(names) > 1)

    def show_picture(self, shown: Shown | None) -> None:
        """Another picture, or none."""
        self.view.show_picture(shown)
        self.wipe.setVisible(shown is not None and shown.before is not None)
        self._fill_marks(shown)
        if shown is None:
            self.histogram.show_histogram(None)
            self.readout.clear()
            self._counted = None
            return
        self.view.setAccessibleDescription(shown.title)
        kept = self._exposures[shown.encoded]
        if kept is None:
            kept = self._exposures[shown.encoded] = natural_exposure(shown.pixels)
        self._show_exposure(kept)
        self._count(shown)
        self._read(None)

    def follow(self, shown: Shown) -> None:
        """The same pixels; what is told of them may be new."""
        self.view.shown = shown

    def expose_naturally(self) -> None:
        """An exposure that shows most of the light."""
        shown = self.view.shown
        if shown is not None:
            self._exposures[shown.encoded] = natural_exposure(shown.pixels)
            self._show_exposure(self._exposures[shown.encoded] or 0.0)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Where it is small the histogram goes."""
        self.histogram.setVisible(self.width() >= _NARROW and self.height() >= _LOW)

    def _elsewhere(self, work: Callable[[], None], done: Callable[[], None]) -> None:
        self._context.tasks.run("Preview", lambda job: work(), lambda _: done(), quiet=True)

    def _expose(self, exposure: float) -> None:
        shown = self.view.shown
        if shown is not None:
            self._exposures[shown.encoded] = exposure
        self._show_exposure(exposure)

    def _show_exposure(self, exposure: float) -> None:
        self.exposure.show_value(exposure)
        self.view.set_exposure(exposure)
        self.histogram.set_exposure(exposure)

    def _wipe(self, on: bool) -> None:
        self.view.wiping = on
        self.view.update()

    def _fill_marks(self, shown: Shown | None) -> None:
        marks = shown.marks if shown is not None else ()
        self.marks.setVisible(bool(marks))
        names = [mark.name for mark in marks]
        if names == [action.text() for action in self._menu.actions()]:
            return
        self._menu.clear()
        hidden = {mark.name for mark in marks if not mark.shown}
        self.view.show_marks(hidden)
        for mark in marks:
            action = self._menu.addAction(mark.name)
            action.setCheckable(True)
            action.setChecked(mark.shown)
            action.setToolTip(mark.tip)
            action.toggled.connect(partial(self._mark, action))
        self._menu.setToolTipsVisible(True)

    def _mark(self, action: QAction, on: bool) -> None:
        hidden = set(self.view.hidden)
        (hidden.discard if on else hidden.add)(action.text())
        self.view.show_marks(hidden)

    def _count(self, shown: Shown) -> None:
        if self._counted is shown.pixels:
            return
        self._counted = pixels = shown.pixels
        self.histogram.show_histogram(None)
        found: list[Histogram] = []
        shares: list[tuple[str, float]] = []

        def work() -> None:
            found.append(histogram(pixels))
            shares.extend((mark.name.lower(), float(mark.mask.mean())) for mark in shown.marks)

        def done() -> None:
            if self._counted is pixels and found:
                self.histogram.show_histogram(found[0], tuple(shares))
                self._read(None)

        self._elsewhere(work, done)

    def _read(self, point: tuple[float, float] | None) -> None:
        """The pixel under the mouse, or else what the picture is."""
        shown = self.view.shown
        if shown is None:
            return
        if point is None:
            told = "".join(f", {name} {100 * share:.2g} %" for name, share in self.histogram.shares)
            self.readout.setText(f"{shown.title}: {shown.size[0]} × {shown.size[1]}{told}")
            return
        x, y = int(point[0]), int(point[1])
        values = shown.pixels[y, x]
        parts = [f"{x}, {y}", f"RGB {numbers(values)}"]
        if not shown.encoded:
            luminance = float(linear(values) @ np.array(LUMINANCE))
            if self.scale is not None:
                parts.append(f"{luminance * self.scale:.4g} cd/m²")
            else:
                parts.append(f"luminance {luminance:.3g}")
        parts += [f"{mark.name.lower()}" for mark in shown.marks if mark.mask[y, x]]
        more = shown.say(*point)
        self.readout.setText(" · ".join([*parts, *([more] if more else [])]))


def _button(text: str, tip: str) -> QToolButton:
    made = QToolButton()
    made.setText(text)
    made.setToolTip(tip)
    made.setAccessibleName(tip)
    return made
