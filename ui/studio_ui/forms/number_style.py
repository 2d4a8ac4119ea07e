"""How numbers are shown in a window: the unit of lengths and the decimal mark. Widgets ask their window."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import QLocale
from PySide6.QtWidgets import QWidget

from studio_core.quantities import format_quantity, parse_quantity
from studio_core.units import LENGTH_UNITS, LengthUnit

_PROPERTY = "number_style"


@dataclass(frozen=True)
class NumberStyle:
    """`length` is a name of `LENGTH_UNITS`; `mark` a point, a comma, or empty: as the system writes."""

    length: str = "m"
    mark: str = ""

    @property
    def length_unit(self) -> LengthUnit:
        """The unit in which lengths are shown."""
        return LENGTH_UNITS[self.length]

    @property
    def decimal_mark(self) -> str:
        """A point or a comma."""
        mark = self.mark or QLocale().decimalPoint()
        return mark if mark in (".", ",") else "."

    def unit_of(self, unit: str) -> str:
        """In which unit a number whose unit is `unit` is shown."""
        return self.length if unit == "m" else unit

    def text(self, value: float, unit: str, decimals: int = 3, *, with_unit: bool = True) -> str:
        """A number as it is shown; lengths have the decimals of their unit."""
        if unit == "m":
            decimals = self.length_unit.decimals
        return format_quantity(
            value, unit, self.unit_of(unit), decimals, mark=self.decimal_mark, with_unit=with_unit
        )

    def read(self, text: str, unit: str) -> float:
        """What a person wrote, in `unit`; InputError in one sentence."""
        return parse_quantity(text, unit, self.unit_of(unit))


def set_number_style(window: QWidget, style: NumberStyle) -> None:
    """The style of a window and all that belongs to it; what shows numbers has `follow_style`."""
    window.setProperty(_PROPERTY, style)
    for widget in window.findChildren(QWidget):
        follow = getattr(widget, "follow_style", None)
        if follow is not None:
            follow()


def number_style(widget: QWidget) -> NumberStyle:
    """The style of the window that a widget belongs to."""
    at: QWidget | None = widget
    while at is not None:
        found = at.property(_PROPERTY)
        if isinstance(found, NumberStyle):
            return found
        at = at.parentWidget()
    return NumberStyle()
