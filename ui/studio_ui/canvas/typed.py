"""What is typed while something is held: `80`, `1.2 m`, `2'6"`, `45°`; read as it is typed."""

from __future__ import annotations

from studio_core.errors import InputError
from studio_core.quantities import parse_quantity

LETTERS = frozenset("0123456789.,+-*/()'\"°%′″ abcdefghijklmnopqrstuvwzµ")
"""What can be typed; x, y and z choose an axis."""
STARTS = frozenset("0123456789.,+-(")
"""What typing begins with."""
_LONGEST = 40


class Typed:
    """Letters, and the amount they make in a unit. Lengths without a unit are in `default`."""

    def __init__(self, unit: str, default: str | None = None) -> None:
        self.text = ""
        self._unit, self._default = unit, default

    def take(self, letter: str) -> bool:
        """Type a letter, or `backspace`; False for what has no place there."""
        if letter == "backspace":
            self.text = self.text[:-1]
            return True
        fits = letter in (LETTERS if self.text else STARTS) and len(self.text) < _LONGEST
        self.text += letter if fits else ""
        return fits

    @property
    def amount(self) -> float | None:
        """What it says; None while it cannot be read."""
        try:
            return parse_quantity(self.text, self._unit, self._default)
        except InputError:
            return None

    @property
    def problem(self) -> str:
        """Why it cannot be read, in a sentence; empty when it can."""
        try:
            parse_quantity(self.text, self._unit, self._default)
        except InputError as error:
            return str(error)
        return ""
