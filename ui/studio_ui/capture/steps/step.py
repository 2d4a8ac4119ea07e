"""What the steps have in common: a column of controls, and the pictures that belong to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from PySide6.QtWidgets import QSizePolicy, QVBoxLayout, QWidget

from studio_core.capturing.artifacts import LensLight
from studio_core.imaging.projection import Circle, Lens
from studio_core.params import defaults
from studio_ui.capture.desk import CaptureDesk
from studio_ui.capture.preview.picture import Mark, Shown
from studio_ui.capture.setting_sink import SettingSink
from studio_ui.capture.tools.ring import at_ring
from studio_ui.capture.tools.tool import Tool
from studio_ui.context import Context
from studio_ui.forms.param_form import ParamForm
from studio_ui.look.theme import GAP, Theme

CLIPPED, DARK_COLOUR, MOVED, UNSEEN = (255, 64, 64), (70, 110, 255), (240, 200, 40), (190, 90, 220)


class StepForm(QWidget):
    """One step's controls. `show_now` follows settings and results, `pictures` names what can be looked at.

    `look` is called when another picture or tool is wanted.
    """

    id = ""

    def __init__(self, context: Context, desk: CaptureDesk) -> None:
        super().__init__()
        self.context, self.desk = context, desk
        self.look: Callable[[str], object] = lambda name: None
        self.redraw: Callable[[], object] = lambda: None
        self.tool = Tool()
        self.forms: dict[str, ParamForm] = {}
        self._marks: tuple[object, tuple[Mark, ...]] = (None, ())
        self.column = QVBoxLayout(self)
        self.column.setContentsMargins(0, 0, 0, 0)
        self.column.setSpacing(GAP)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Maximum)

    def form(self, section: str, skip: tuple[str, ...] = ()) -> ParamForm:
        """The parameters of a section of the settings."""
        sink = SettingSink(self.desk, section)
        kind = type(getattr(self.desk.settings, section))
        made = ParamForm(sink.infos, sink, skip, defaults=defaults(kind))
        self.forms[section] = made
        return made

    def show_now(self) -> None:
        """Settings and results as they are."""
        for section, form in self.forms.items():
            form.show_values(vars(getattr(self.desk.settings, section)))
        self.sync()

    def sync(self) -> None:
        """What the tool draws, at once after every edit: the next key or press counts from there."""

    def set_theme(self, theme: Theme) -> None:
        """Another theme."""

    def marks(self, source: object, make: Callable[[], tuple[Mark, ...]]) -> tuple[Mark, ...]:
        """Masks that are made from a result, once for each."""
        if self._marks[0] is not source:
            self._marks = (source, make())
        return self._marks[1]

    def pictures(self) -> list[str]:
        """Names of what can be looked at now."""
        return []

    def picture(self, name: str) -> Shown | None:
        """One of them."""
        return None

    def shown(self, name: str) -> None:
        """The preview shows it now: the tool is for that one."""


def light_marks(light: LensLight) -> tuple[Mark, ...]:
    """What no exposure resolves, and what moved."""
    return (
        Mark("Clipped", light.clipped, CLIPPED, "Brighter than any exposure resolves"),
        Mark("Dark", light.dark, DARK_COLOUR, "Darker than any exposure resolves", shown=False),
        Mark("Moved", light.moved, MOVED, "Taken from one exposure alone, because something moved"),
    )


def lens_shown(
    desk: CaptureDesk,
    side: str,
    pixels: npt.NDArray[Any] | None = None,
    before: npt.NDArray[Any] | None = None,
) -> Shown | None:
    """The light of one side, with the lens' angles at every point."""
    light = desk.state.lights.get(side)
    if light is None:
        return None
    shown = light.light if pixels is None else pixels
    return Shown(side, side.capitalize(), shown, light_marks(light), before, angles(desk, side))


def lens_of(desk: CaptureDesk) -> Lens | None:
    """The lens that was found or is set; None where the settings make none."""
    registration = desk.state.registration
    if registration is not None:
        return registration.lens
    settings = desk.settings.lens
    try:
        return Lens(settings.model, settings.fov, settings.coefficients, settings.affine)
    except ValueError:
        return None


def circle_of(desk: CaptureDesk, side: str) -> Circle | None:
    """The circle that was set by hand, or else found."""
    by_hand: Circle | None = getattr(desk.settings.lens, side, None)
    if by_hand is not None:
        return by_hand
    found = desk.state.circles.get(side)
    return found.circle if found is not None else None


def angles(desk: CaptureDesk, side: str) -> Callable[[float, float], str]:
    """Words for a point of a lens' picture."""
    lens, circle = lens_of(desk), circle_of(desk, side)

    def say(x: float, y: float) -> str:
        if lens is None or circle is None:
            return ""
        azimuth, theta = at_ring(lens, circle, x, y)
        if theta > np.degrees(lens.half):
            return "outside the lens"
        return f"{theta:.1f}° from the axis at {azimuth:.0f}°"

    return say


def named(sides: Mapping[str, Any]) -> list[str]:
    """Sides as they are chosen: Front, Back."""
    return [side.capitalize() for side in sides]
