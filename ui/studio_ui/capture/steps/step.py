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
        self._marks: tuple[tuple[object, ...], tuple[Mark, ...]] = ((), ())
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

    def marks(self, key: tuple[object, ...], make: Callable[[], tuple[Mark, ...]]) -> tuple[Mark, ...]:
        """Masks that are made from results, once for each."""
        old, marks = self._marks
        if len(old) != len(key) or any(a is not b for a, b in zip(old, key, strict=True)):
            self._marks = key, marks = key, make()
        return marks

    def lens_shown(
        self,
        side: str,
        pixels: npt.NDArray[Any] | None = None,
        before: npt.NDArray[Any] | None = None,
    ) -> Shown | None:
        """The light of one side (or other pixels of it), with the lens' angles at every point."""
        light = self.desk.state.lights.get(side)
        if light is None:
            return None
        found = self.desk.state.circles.get(side)
        marks = self.marks((light, found), lambda: light_marks(light, found.circle if found else None))
        shown = light.light if pixels is None else pixels
        return Shown(side, side.capitalize(), shown, marks, before, angles(self.desk, side))

    def pictures(self) -> list[str]:
        """Names of what can be looked at now."""
        return []

    def first(self) -> str:
        """The one that is looked at before another one is chosen."""
        return next(iter(self.pictures()), "")

    def picture(self, name: str) -> Shown | None:
        """One of them."""
        return None

    def shown(self, name: str) -> None:
        """The preview shows it now: the tool is for that one."""


def light_marks(light: LensLight, circle: Circle | None) -> tuple[Mark, ...]:
    """What no exposure resolves, and what moved, inside the lens' circle."""
    inside: npt.NDArray[np.bool_] | np.bool_ = np.bool_(True)
    if circle is not None:
        height, width = light.light.shape[:2]
        x, y = np.arange(width) + 0.5 - circle.x, np.arange(height) + 0.5 - circle.y
        inside = x * x + (y * y)[:, None] < circle.radius**2
    return (
        Mark("Clipped", light.clipped & inside, CLIPPED, "Brighter than any exposure resolves"),
        Mark("Dark", light.dark & inside, DARK_COLOUR, "Darker than any exposure resolves", shown=False),
        Mark("Moved", light.moved & inside, MOVED, "Exposures were left out, because something moved"),
    )


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


def fitted_circle(desk: CaptureDesk, side: str) -> Circle | None:
    """The circle that the lens is looked through: moved so that both lenses fit together."""
    registration = desk.state.registration
    moved: Circle | None = getattr(registration, side, None) if registration is not None else None
    return moved if moved is not None else circle_of(desk, side)


def angles(desk: CaptureDesk, side: str) -> Callable[[float, float], str]:
    """Words for a point of a lens' picture."""
    lens, circle = lens_of(desk), fitted_circle(desk, side)

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


def direction_text(shape: tuple[int, ...]) -> Callable[[float, float], str]:
    """Words for a point of an equirectangular picture of that shape: compass and height."""
    height, width = shape[:2]

    def say(x: float, y: float) -> str:
        turn, up = 360 * (x / width - 0.5), 90 - 180 * y / height
        return f"{abs(turn):.1f}° {'right' if turn >= 0 else 'left'}, {up:+.1f}° up"

    return say
