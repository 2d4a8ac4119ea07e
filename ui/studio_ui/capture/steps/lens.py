"""Third step: the lens' circle and curve, and how the back lens stands to the front lens."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from PySide6.QtWidgets import QLabel, QPushButton, QWidget

from studio_core.capturing.settings import FRONT, SIDES
from studio_core.errors import InputError
from studio_core.imaging.projection import KANNALA_BRANDT, OCAM, Circle, Lens
from studio_core.params import ParamInfo, Value
from studio_core.shading.job import Job
from studio_ui.ask import Ask, Filter
from studio_ui.capture.desk import CaptureDesk
from studio_ui.capture.preview.picture import Shown
from studio_ui.capture.steps.step import StepForm, circle_of, named
from studio_ui.capture.tools.circle_tool import CircleTool
from studio_ui.context import Context
from studio_ui.forms.fields import TextField
from studio_ui.forms.param_form import ParamForm, form_label, form_layout
from studio_ui.panels.panel import heading, note, row

_NUMBERS = {
    "x": ParamInfo("number", "Middle, right", "Of the circle, from the picture's left edge", "px", -1e5, 1e5),
    "y": ParamInfo("number", "Middle, down", "Of the circle, from the picture's upper edge", "px", -1e5, 1e5),
    "radius": ParamInfo("number", "Radius", "Of the circle", "px", 8.0, 1e5),
}
_COEFFICIENTS = ParamInfo(
    "text",
    "Coefficients",
    "k1, k2 … of Kannala and Brandt, or OCamCalib's polynomial in units of the circle's radius",
)
_FALLOFF = ParamInfo(
    "number",
    "Lost at edge",
    "Light that does not arrive at the edge; found by itself",
    "%",
    0.0,
    95.0,
)
_WITH_COEFFICIENTS = (KANNALA_BRANDT, OCAM)
_OCAM_FILES = Filter("OCamCalib calibration", (".txt",))


class LensStep(StepForm):
    """Circles are dragged in the picture or typed; the lens is the same on both sides."""

    id = "lens"

    def __init__(self, context: Context, desk: CaptureDesk, ask: Ask) -> None:
        super().__init__(context, desk)
        self._ask = ask
        self.side = FRONT
        self.tool = self.circle_tool = CircleTool()
        self.circle_tool.begin = lambda: desk.begin(self._label())
        self.circle_tool.preview = lambda circle: desk.preview("lens", self._label(), **{self.side: circle})
        self.circle_tool.commit, self.circle_tool.cancel = desk.commit, desk.cancel
        self.circle_tool.apply = self._set_circle
        self.heading = heading("Circle")
        self.column.addWidget(self.heading)
        self.numbers = ParamForm(_NUMBERS, _CircleSink(self))
        self.column.addWidget(self.numbers)
        self.found = note("")
        self.again = QPushButton("Find again")
        self.again.setToolTip("Let the program find the circle of this side")
        self.again.clicked.connect(self._find)
        self.column.addLayout(row(self.again))
        self.column.addWidget(self.found)
        self.column.addWidget(note(CircleTool.tip))
        self.column.addWidget(heading("Lens"))
        self.column.addWidget(self.form("lens"))
        self.coefficients = TextField("coefficients", _COEFFICIENTS, _CoefficientSink(self))
        self._row = QWidget()
        layout = form_layout(self._row)
        label: QLabel = form_label(_COEFFICIENTS.label, _COEFFICIENTS.doc, self.coefficients)
        layout.addRow(label, self.coefficients)
        self.column.addWidget(self._row)
        self.falloff = ParamForm({"falloff": _FALLOFF}, _FalloffSink(self))
        self.column.addWidget(self.falloff)
        self.found_falloff = QPushButton("Find the loss")
        self.found_falloff.setToolTip("Find how much light is lost at the edge from what both lenses see")
        self.found_falloff.clicked.connect(lambda: desk.apply("lens", "Find the loss of light", falloff=None))
        self.column.addLayout(row(self.found_falloff))
        load = QPushButton("Import OCamCalib…")
        load.setToolTip("The lens of a calibration file (calib_results.txt)")
        load.clicked.connect(self._import)
        self.column.addLayout(row(load))
        self.column.addWidget(heading("Front and back"))
        self.column.addWidget(self.form("registration"))
        self.told = note("")
        self.column.addWidget(self.told)

    def show_now(self) -> None:
        """Settings and what was found."""
        super().show_now()
        settings, registration = self.desk.settings, self.desk.state.registration
        circle = circle_of(self.desk, self.side)
        self.heading.setText(f"Circle of the {self.side}")
        self.numbers.setEnabled(circle is not None)
        if circle is not None:
            self.numbers.show_values(dataclasses.asdict(circle))
        found = self.desk.state.circles.get(self.side)
        by_hand = getattr(settings.lens, self.side) is not None
        self.again.setEnabled(by_hand)
        if by_hand:
            self.found.setText("Set by hand.")
        elif found is not None:
            self.found.setText(f"Found, {100 * found.confidence:.0f} % sure.")
        else:
            self.found.setText("")
        self._row.setVisible(settings.lens.model in _WITH_COEFFICIENTS)
        self.coefficients.show_value(", ".join(f"{k:g}" for k in settings.lens.coefficients))
        loss = settings.lens.falloff
        if loss is None:
            loss = registration.loss if registration is not None else 0.0
        self.falloff.show_values({"falloff": 100 * min(max(loss, 0.0), 1.0)})
        self.found_falloff.setEnabled(settings.lens.falloff is not None)
        for name in ("yaw", "pitch", "roll", "exposure"):
            self.forms["registration"].show_row(name, not settings.registration.automatic)
        if registration is None:
            self.told.setText("")
            return
        lines = [f"Field of view {registration.lens.fov:.2f}°."]
        if registration.matches:
            lines.append(f"{registration.matches:,} places seen by both, {registration.spread:.2f}° apart.")
        gain = ", ".join(f"{g:.3g}" for g in registration.gain)
        lines.append(f"Back times {gain} is front.")
        self.told.setText(" ".join(lines))

    def sync(self) -> None:
        """The circle."""
        found = self.desk.state.circles.get(self.side)
        by_hand = getattr(self.desk.settings.lens, self.side) is not None
        self.circle_tool.circle = circle_of(self.desk, self.side)
        self.circle_tool.sure = by_hand or found is None or found.confidence >= 0.5

    def pictures(self) -> list[str]:
        """Sides."""
        return named(self.desk.state.lights)

    def picture(self, name: str) -> Shown | None:
        """The light that the circle lies in."""
        return self.lens_shown(name.lower())

    def shown(self, name: str) -> None:
        """The circle of that side."""
        if name.lower() in SIDES:
            self.side = name.lower()
            self.show_now()

    def _label(self) -> str:
        return f"Circle of the {self.side}"

    def _set_circle(self, circle: Circle | None) -> None:
        self.desk.apply("lens", self._label(), **{self.side: circle})

    def _find(self) -> None:
        self._set_circle(None)

    def set_lens(self, lens: Lens, circle: Circle | None, size: tuple[int, int]) -> None:
        """A lens from a calibration; its circle where the pictures have the calibration's size."""
        values = {
            "model": lens.model,
            "fov": lens.fov,
            "coefficients": lens.coefficients,
            "affine": lens.affine,
            "fit_fov": False,
        }
        light = self.desk.state.lights.get(self.side)
        shown = light.light.shape[1::-1] if light is not None else size
        if circle is not None and shown[0] * size[1] == shown[1] * size[0]:
            values[self.side] = circle.scaled(shown[0] / size[0])
        self.desk.apply("lens", "Import OCamCalib", **values)

    def _import(self) -> None:
        chosen = self._ask.open_files("Import OCamCalib", [_OCAM_FILES])
        if chosen:
            self.load(chosen[0])

    def load(self, path: Path) -> None:
        """Read a calibration and take its lens."""

        def read(job: Job) -> tuple[Lens, Circle, tuple[int, int]]:
            from studio_core.imaging.ocam import read_ocam

            return read_ocam(path)

        self.context.tasks.run(f"Reading {path.name}", read, lambda found: self.set_lens(*found))


class _CircleSink:
    """The numbers of the circle that is shown."""

    def __init__(self, step: LensStep) -> None:
        self._step = step

    def _with(self, name: str, value: Value) -> Circle | None:
        circle = circle_of(self._step.desk, self._step.side)
        return None if circle is None else dataclasses.replace(circle, **{name: float(value)})  # type: ignore[arg-type]

    def begin(self, name: str) -> bool:
        """A drag starts."""
        return self._step.circle_tool.begin()

    def preview(self, name: str, value: Value) -> None:
        """The drag goes on."""
        circle = self._with(name, value)
        if circle is not None:
            self._step.circle_tool.preview(circle)

    def commit(self) -> None:
        """One step."""
        self._step.desk.commit()

    def cancel(self) -> None:
        """Never was."""
        self._step.desk.cancel()

    def apply(self, name: str, value: Value) -> None:
        """One step."""
        circle = self._with(name, value)
        if circle is not None:
            self._step.circle_tool.apply(circle)


class _FalloffSink(_CircleSink):
    """Percent, kept as a share."""

    def begin(self, name: str) -> bool:
        """A drag starts."""
        return self._step.desk.begin("Light lost at the edge")

    def preview(self, name: str, value: Value) -> None:
        """The drag goes on."""
        self._step.desk.preview("lens", "Light lost at the edge", falloff=_share(value))

    def apply(self, name: str, value: Value) -> None:
        """One step."""
        self._step.desk.apply("lens", "Light lost at the edge", falloff=_share(value))


class _CoefficientSink(_CircleSink):
    """Numbers with commas between them."""

    def apply(self, name: str, value: Value) -> None:
        """One step, or a sentence why not."""
        step = self._step
        try:
            found = numbers_of(str(value))
        except InputError as error:
            step.context.journal.problem("Coefficients", error)
            step.show_now()
            return
        step.desk.apply("lens", "Coefficients of the lens", coefficients=found)


def _share(percent: Value) -> float:
    assert isinstance(percent, int | float)
    return round(percent / 100, 4)


def numbers_of(text: str) -> tuple[float, ...]:
    """Numbers with commas, semicolons or blanks between them; InputError naming what is none."""
    words = text.replace(";", " ").replace(",", " ").split()
    made = []
    for word in words:
        try:
            made.append(float(word))
        except ValueError:
            raise InputError(f"{word!r} is no number") from None
    return tuple(made)
