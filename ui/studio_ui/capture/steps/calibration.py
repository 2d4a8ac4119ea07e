"""Sixth step: what is white, how bright it is in cd/m², and lamps that were too bright for every exposure."""

from __future__ import annotations

from functools import partial

import numpy as np
from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QButtonGroup, QPushButton, QWidget

from studio_core.capturing.artifacts import Captured
from studio_core.capturing.settings import GREY_CARD, KELVIN, LUMINANCE, LUX
from studio_core.imaging.latlong import direction_to_uv, equirect_direction
from studio_ui.capture.desk import CaptureDesk
from studio_ui.capture.preview.picture import Mark, Shown
from studio_ui.capture.steps.step import CLIPPED, DARK_COLOUR, UNSEEN, StepForm, direction_text
from studio_ui.capture.telling import percent
from studio_ui.capture.tools.place_tool import Pin, Place, PlaceTool
from studio_ui.context import Context
from studio_ui.forms.fields import Combo
from studio_ui.forms.param_form import form_label, form_layout
from studio_ui.panels.panel import note

FACINGS = {
    "up (meter lying on a table)": (0.0, 1.0, 0.0),
    "down": (0.0, -1.0, 0.0),
    "the front": (0.0, 0.0, 1.0),
    "the back": (0.0, 0.0, -1.0),
    "the left": (1.0, 0.0, 0.0),
    "the right": (-1.0, 0.0, 0.0),
}
_ELSEWHERE = "a place in the picture"
_BEFORE = "as before, where the lamp was off"
_FACING_TIP = "Where the lux meter's dome looked"
_PICKS = {
    "card": ("Pick the card", "Grey card"),
    "place": ("Pick the surface", "Measured"),
    "facing": ("Pick where it faced", "Meter faces"),
    "sun_facing": ("Pick where it faced then", "Meter faces with the lamp"),
}


class CalibrationStep(StepForm):
    """Places are clicked in the finished picture."""

    id = "calibration"

    def __init__(self, context: Context, desk: CaptureDesk) -> None:
        super().__init__(context, desk)
        self.tool = self.place_tool = PlaceTool()
        self.place_tool.begin = lambda: desk.begin(self._label())
        self.place_tool.preview = lambda place: desk.preview("calibration", self._label(), **self._at(place))
        self.place_tool.commit, self.place_tool.cancel = desk.commit, desk.cancel
        self.column.addWidget(self.form("calibration"))
        self.facing = _choice("Facing", [*FACINGS, _ELSEWHERE])
        self.facing.activated.connect(lambda i: self._faced("facing", self.facing.itemText(i)))
        self._row = _labelled("Facing", self.facing)
        self.sun_facing = _choice("Facing with the lamp", [_BEFORE, *FACINGS, _ELSEWHERE])
        self.sun_facing.activated.connect(lambda i: self._faced("sun_facing", self.sun_facing.itemText(i)))
        self._sun_row = _labelled("Facing then", self.sun_facing)
        for widget in (self._row, self._sun_row):
            self.column.addWidget(widget)
        self.picks: dict[str, QPushButton] = {}
        group = QButtonGroup(self)
        group.setExclusive(False)
        for name, (text, _) in _PICKS.items():
            button = QPushButton(text)
            button.setCheckable(True)
            button.setToolTip("Then click it in the picture, or drag its mark")
            button.toggled.connect(partial(self._pick, name))
            group.addButton(button)
            self.column.addWidget(button)
            self.picks[name] = button
        self.tip = note(PlaceTool.tip)
        self.column.addWidget(self.tip)
        self.told = note("")
        self.column.addWidget(self.told)

    def show_now(self) -> None:
        """What belongs to what was chosen, and what came of it."""
        super().show_now()
        settings = self.desk.settings.calibration
        rows = {
            "kelvin": settings.white == KELVIN,
            "card_size": settings.white == GREY_CARD,
            "lux": settings.scale == LUX,
            "luminance": settings.scale == LUMINANCE,
            "sun_lux": settings.sun,
        }
        for name, there in rows.items():
            self.forms["calibration"].show_row(name, there)
        faces = settings.scale == LUX or settings.sun
        self._row.setVisible(faces)
        known = {facing: text for text, facing in FACINGS.items()}
        self._sun_row.setVisible(settings.sun)
        with QSignalBlocker(self.facing), QSignalBlocker(self.sun_facing):
            self.facing.setCurrentText(known.get(settings.facing, _ELSEWHERE))
            then = settings.sun_facing
            self.sun_facing.setCurrentText(_BEFORE if then is None else known.get(then, _ELSEWHERE))
        wanted = self._wanted()
        for name, button in self.picks.items():
            button.setVisible(wanted[name])
            if not wanted[name] and button.isChecked():
                button.setChecked(False)
        self.sync()
        self.tip.setVisible(any(wanted.values()))
        only = [name for name, there in wanted.items() if there]
        if len(only) == 1 and not self.place_tool.picking:
            self.picks[only[0]].setChecked(True)
        captured = self.desk.state.captured
        if captured is None:
            self.told.setText("")
            return
        found = captured.calibration
        lines = [
            f"White: red × {found.white[0]:.3f}, green × {found.white[1]:.3f}, blue × {found.white[2]:.3f}."
        ]
        if found.luminance_scale is not None:
            lines.append(f"One is {found.luminance_scale:.4g} cd/m² ± {percent(found.scale_uncertainty)}.")
        if found.sun != 1:
            lines.append(
                f"Clipped light was raised {found.sun:.3g} times ± {percent(found.sun_uncertainty)}."
            )
        self.told.setText(" ".join([*lines, *found.notes]))

    def sync(self) -> None:
        """The places that count."""
        settings = self.desk.settings.calibration
        self.place_tool.pins = tuple(
            Pin(_PICKS[name][1], self._place(name), settings.card_size if name == "card" else 0.0)
            for name, there in self._wanted().items()
            if there
        )

    def _wanted(self) -> dict[str, bool]:
        settings = self.desk.settings.calibration
        faces = settings.scale == LUX or settings.sun
        return {
            "card": settings.white == GREY_CARD,
            "place": settings.scale == LUMINANCE,
            "facing": faces and settings.facing not in FACINGS.values(),
            "sun_facing": settings.sun and settings.sun_facing not in (None, *FACINGS.values()),
        }

    def pictures(self) -> list[str]:
        """The finished one."""
        return ["All around"] if self.desk.state.captured is not None else []

    def picture(self, name: str) -> Shown | None:
        """Calibrated light."""
        captured = self.desk.state.captured
        if captured is None:
            return None
        pixels = captured.environment.pixels
        self.place_tool.size = (pixels.shape[1], pixels.shape[0])
        marks = self.marks((captured,), lambda: unresolved_marks(captured))
        return Shown("finished", "All around", pixels, marks, say=direction_text(pixels.shape))

    def _place(self, name: str) -> Place:
        settings = self.desk.settings.calibration
        if name.endswith("facing"):
            u, v = direction_to_uv(np.array(getattr(settings, name)))
            return float(u) % 1, float(v)
        found: Place = getattr(settings, name)
        return found

    def _label(self) -> str:
        return _PICKS[self.place_tool.picking][0] if self.place_tool.picking else "Pick a place"

    def _at(self, place: Place) -> dict[str, object]:
        name = self.place_tool.picking
        if name.endswith("facing"):
            x, y, z = (round(float(c), 6) for c in equirect_direction(*place))
            return {name: (x, y, z)}
        return {name: (round(place[0], 6), round(place[1], 6))}

    def _pick(self, name: str, on: bool) -> None:
        if on:
            self.place_tool.picking = name
            for other, button in self.picks.items():
                if other != name:
                    button.setChecked(False)
        elif self.place_tool.picking == name:
            self.place_tool.picking = ""
        self.redraw()

    def _faced(self, name: str, text: str) -> None:
        facing = FACINGS.get(text)
        if facing is None and text == _ELSEWHERE:
            x, y, z = equirect_direction(0.4, 0.4)
            facing = (round(float(x), 6), round(float(y), 6), round(float(z), 6))
        self.desk.apply("calibration", "Where the meter faced", **{name: facing})


def _choice(name: str, texts: list[str]) -> Combo:
    made = Combo()
    made.setAccessibleName(name)
    made.setToolTip(_FACING_TIP)
    made.addItems(texts)
    return made


def _labelled(name: str, field: QWidget) -> QWidget:
    made = QWidget()
    form_layout(made).addRow(form_label(name, _FACING_TIP), field)
    return made


def unresolved_marks(captured: Captured) -> tuple[Mark, ...]:
    """What no exposure resolved, and why."""
    found = captured.unresolved
    return (
        Mark("Clipped", found == 1, CLIPPED, "Brighter than any exposure resolves"),
        Mark("Dark", found == 2, DARK_COLOUR, "Darker than any exposure resolves", shown=False),
        Mark("Never seen", found == 3, UNSEEN, "Outside both lenses: filled smoothly"),
    )
