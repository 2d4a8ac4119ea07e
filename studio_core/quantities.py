"""Numbers with units as people write them, and back: `80 cm`, `0,8`, `2'6"`, `1/2 m + 3cm`, `0.25 turn`.

How a number is read, whatever the language of the computer:

- One comma or one point is the decimal mark: `0,8` and `0.8` are the same, and `1.234` is a little over one.
- Where both occur, the last kind is the decimal mark and the other separates groups of three: `1.234,5` and
  `1,234.5`. A mark that occurs more than once separates groups: `1.234.567`.
- Spaces (ordinary, thin or unbreakable) and `’` before three digits separate groups too: `1 234,5`.

How quantities are put together:

- A number without a unit is in the default unit; beside a product or quotient it is just a number.
- A unit belongs to the number, fraction or bracket before it: `1/2 m`, `(3+4) cm`.
- Quantities side by side are added: `2 ft 6 in`, `2'6"`, `45°30'`; after feet a last bare number means
  inches, and a hyphen as architects put it (`2'-6"`) means nothing. `6 1/2"` is six and a half inches.
- `+ - * /` and brackets work as usual; nothing else is evaluated.
"""

from __future__ import annotations

import math
import re
import unicodedata
from dataclasses import dataclass

from studio_core.errors import InputError
from studio_core.units import FEET_AND_INCHES, FOOT, INCH, LENGTH, RATIO, Family, factor, family_of, find

_LONGEST = 200  # characters
_DEEPEST = 30  # brackets and signs within each other
_SAME = str.maketrans(
    {
        **dict.fromkeys("−–‒﹣－", "-"),
        **dict.fromkeys("×·⋅∙", "*"),
        **dict.fromkeys("÷∕", "/"),
        **dict.fromkeys("′‘", "'"),
        **dict.fromkeys("″“”", '"'),
        **dict.fromkeys("º˚", "°"),
        **dict.fromkeys("\u200e\u200f\u061c\u2066\u2069\u202a\u202c", ""),
        **dict.fromkeys("\u00a0\u202f\u2009\u2007\t", "\u202f"),
        "μ": "µ",
        "٫": ",",
        "٬": "\u202f",
        "＋": "+",
    }
)
_NUMBER = r"(?:\d{1,3}(?:[ \u202f]\d{3})+(?!\d)|\d+)(?:[.,]\d+)*[.,]?|[.,]\d+"
_TOKEN = re.compile(
    rf"\s*(?:(?P<number>(?:{_NUMBER})(?:[eE][+-]?\d+)?)|(?P<sign>[-+*/()])|(?P<unit>cd/m[²2]|[^\W\d_]+|[°%‰'\"]))"
)


def parse_quantity(text: str, unit: str, default: str | None = None) -> float:
    """What `text` says, in `unit` (`m`, `°`, `K`, `EV`, ``, `%`, `lm`, …).

    Numbers without a unit are in `default` (`unit` unless given; `ft-in` takes them as inches). InputError
    says in one sentence what cannot be read.
    """
    if not text.strip():
        raise InputError("A number is missing")
    if len(text) > _LONGEST:
        raise InputError(f"A number is written in at most {_LONGEST} characters")
    expected = family_of(unit)
    bare = factor(unit if default is None else default)
    found = _Reader(text.strip(), expected, bare).read()
    value = found / factor(unit)
    if not math.isfinite(value):
        raise InputError(f"“{text.strip()}” is too large")
    return value


def format_quantity(
    value: float,
    unit: str,
    display_unit: str | None = None,
    decimals: int = 3,
    *,
    mark: str = ".",
    with_unit: bool = True,
) -> str:
    """`value` (in `unit`) as text in `display_unit`, without trailing zeros.

    `parse_quantity` reads it back to within half of the last decimal, with or without its unit. `ft-in`
    counts decimals of the inch; `mark` is the decimal mark.
    """
    shown = unit if display_unit is None else display_unit
    number = value * factor(unit) / factor(shown)
    if shown == FEET_AND_INCHES:
        return _feet(number, decimals, mark)
    text = _plain(number, decimals).replace(".", mark)
    if not with_unit or not shown:
        return text
    return f"{text}{shown}" if shown in ("°", "%", "‰") else f"{text} {shown}"


def _plain(number: float, decimals: int) -> str:
    if not abs(number) < 1e15:
        return f"{number:.15g}"
    text = f"{number:.{max(decimals, 0)}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text == "-0" else text


def _feet(inches: float, decimals: int, mark: str) -> str:
    """`2'6"`; whole feet and less than a foot are short."""
    if not abs(inches) < 1e12:
        return f'{inches:.15g}"'
    rounded = round(abs(inches), max(decimals, 0))
    feet, rest = divmod(rounded, FOOT / INCH)
    feet, rest = int(feet), float(_plain(rest, decimals))
    if rest >= 12:
        feet, rest = feet + 1, 0.0
    sign = "-" if inches < 0 and (feet or rest) else ""
    last = _plain(rest, decimals).replace(".", mark)
    if not feet:
        return f'{sign}{last}"'
    return f"{sign}{feet}'{last}\"" if rest else f"{sign}{feet}'"


@dataclass(frozen=True)
class _Value:
    """A number; `family` None while it has no unit. With one, it is in the family's first unit."""

    number: float
    family: Family | None = None


@dataclass(frozen=True)
class _Token:
    kind: str  # number, sign, unit, end
    text: str
    spaced: bool = False  # white space stands before it


class _Reader:
    """Recursive descent over sums of products of signed quantities."""

    def __init__(self, text: str, expected: Family, bare: float) -> None:
        self._text, self._expected, self._bare = text, expected, bare
        self._tokens = _tokens(text)
        self._at = 0
        self._depth = 0

    def read(self) -> float:
        """The whole text, in the first unit of the expected family."""
        value = self._sum()
        if self._next.kind != "end":
            raise self._odd()
        if value.family is None:
            return value.number * self._bare
        self._check(value.family)
        return value.number

    @property
    def _next(self) -> _Token:
        return self._tokens[self._at]

    def _take(self) -> _Token:
        token = self._tokens[self._at]
        self._at += 1
        return token

    def _is(self, signs: str) -> bool:
        return self._next.kind == "sign" and self._next.text in signs

    def _odd(self) -> InputError:
        token = self._next
        if token.kind == "end":
            return InputError(f"“{self._text}” ends too early")
        return InputError(f"“{token.text}” is not understood in “{self._text}”")

    def _check(self, family: Family) -> None:
        if family is not self._expected and family.units != self._expected.units:
            raise InputError(f"“{self._text}” is {family.label}, where {self._expected.label} is expected")

    def _sum(self) -> _Value:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise InputError("Brackets and signs are nested too deeply")
        value = self._product()
        while self._is("+-"):
            sign = 1 if self._take().text == "+" else -1
            value = self._add(value, self._product(), sign)
        self._depth -= 1
        return value

    def _add(self, one: _Value, other: _Value, sign: int) -> _Value:
        if one.family is None and other.family is None:
            return _Value(one.number + sign * other.number)
        family = one.family or other.family
        for value in (one, other):
            if value.family is None:
                self._check(family or self._expected)
            elif family is not None and value.family is not family:
                raise InputError(f"{value.family.label.capitalize()} cannot be added to {family.label}")
        first, second = (v.number * (self._bare if v.family is None else 1) for v in (one, other))
        return _Value(first + sign * second, family)

    def _product(self) -> _Value:
        value = self._compound()
        while self._is("*/"):
            divide = self._take().text == "/"
            if divide and value.family is None and self._next.kind == "number":
                other = _Value(_number(self._take().text))  # 1/2 m: the unit belongs to the fraction
            else:
                other = self._compound()
            value = self._divided(value, other) if divide else self._times(value, other)
            if value.family is None and self._next.kind == "unit":
                value = self._with_unit(value)
        return value

    def _times(self, one: _Value, other: _Value) -> _Value:
        plain = [value for value in (one, other) if value.family in (None, RATIO)]
        if not plain:
            raise InputError(f"Two quantities are multiplied in “{self._text}”")
        family = other.family if one.family is None else one.family
        if one.family is RATIO and other.family is not None:
            family = other.family
        return _Value(one.number * other.number, family)

    def _divided(self, one: _Value, other: _Value) -> _Value:
        if other.number == 0:
            raise InputError(f"“{self._text}” divides by zero")
        if one.family is other.family:
            return _Value(one.number / other.number)
        if other.family not in (None, RATIO):
            raise InputError(f"“{self._text}” divides by a quantity")
        return _Value(one.number / other.number, one.family)

    def _compound(self) -> _Value:
        """A signed quantity: feet and inches, degrees and minutes, or one number."""
        if self._is("+-"):
            self._depth += 1
            if self._depth > _DEEPEST:
                raise InputError("Brackets and signs are nested too deeply")
            negative = self._take().text == "-"
            inner = self._compound()
            self._depth -= 1
            return _Value(-inner.number, inner.family) if negative else inner
        if self._is("("):
            self._take()
            value = self._sum()
            if not self._is(")"):
                raise self._odd()
            self._take()
            return self._with_unit(value)
        value, unit = self._single()
        while value.family is not None and self._next.kind == "number":
            more, last = self._single()
            if more.family is None:
                if value.family is not LENGTH or unit != FOOT:
                    raise InputError(f"A unit is missing in “{self._text}”")
                more, last = _Value(more.number * INCH, LENGTH), INCH
            if more.family is not value.family or last >= unit:
                raise InputError(f"The units of “{self._text}” do not go from large to small")
            value, unit = _Value(value.number + more.number, value.family), last
        return value

    def _single(self) -> tuple[_Value, float]:
        """A number, mixed fraction or neither, with its unit's factor (0 without one)."""
        if self._next.kind != "number":
            raise self._odd()
        first = self._take().text
        number = _number(first)
        if first.isdigit() and self._fraction():
            number += self._quotient()
        value = _Value(number)
        if self._next.kind != "unit":
            return value, 0.0
        made = self._with_unit(value)
        return made, made.number / number if number else self._size(self._tokens[self._at - 1].text)

    def _fraction(self) -> bool:
        """Whether `a/b` follows after a space, in whole numbers."""
        one, slash, other = (*self._tokens[self._at :], *(3 * [_Token("end", "")]))[:3]
        return one.spaced and slash.text == "/" and one.text.isdigit() and other.text.isdigit()

    def _quotient(self) -> float:
        above, _, below = float(self._take().text), self._take(), float(self._take().text)
        if below == 0:
            raise InputError(f"“{self._text}” divides by zero")
        return above / below

    def _with_unit(self, value: _Value) -> _Value:
        if self._next.kind != "unit":
            return value
        if value.family is not None:
            raise self._odd()
        word = self._take().text
        found = find(word, self._expected)
        if found is None:
            known = [name for name in self._expected.units if name]
            raise InputError(
                f"The unit “{word}” is not known" + (f"; try {' or '.join(known[:2])}" if known else "")
            )
        return _Value(value.number * found[1], found[0])

    def _size(self, word: str) -> float:
        found = find(word, self._expected)
        return found[1] if found is not None else 0.0


def _tokens(text: str) -> list[_Token]:
    plain = _normal(text)
    made: list[_Token] = []
    at = 0
    while at < len(plain.rstrip()):
        match = _TOKEN.match(plain, at)
        if match is None or match.lastgroup is None:
            raise InputError(f"“{plain[at:].strip()[:1]}” is not understood in “{text}”")
        made.append(_Token(match.lastgroup, match[match.lastgroup], match[0][:1].isspace()))
        at = match.end()
    return [*made, _Token("end", "")]


def _normal(text: str) -> str:
    """Digits, marks, signs and quotes of all scripts as the few that are read here."""
    made = []
    for letter in text:
        if letter.isdecimal():
            made.append(str(unicodedata.decimal(letter)))
        elif unicodedata.category(letter) == "No" and "⁄" in unicodedata.normalize("NFKC", letter):
            above, _, below = unicodedata.normalize("NFKC", letter).partition("⁄")
            made.append(f" {above}/{below} ")
        else:
            made.append(letter)
    plain = "".join(made).translate(_SAME).replace("⁄", "/").replace("''", '"')
    plain = re.sub(r"(?<=\d)’(?=\d{3}(?!\d))", "\u202f", plain).replace("’", "'")
    return re.sub(r"'-(?=\d)", "'", plain)


def _number(text: str) -> float:
    """A number with marks, as the module's rules say."""
    digits, mark, power = text.replace(" ", "").replace("\u202f", ""), "", ""
    found = re.search("[eE]", digits)
    if found:
        digits, power = digits[: found.start()], digits[found.start() :]
    kinds = [letter for letter in digits if letter in ".,"]
    if kinds:
        mark = kinds[-1] if kinds.count(kinds[-1]) == 1 else ""
        groups = set(kinds) - {mark}
        whole, _, rest = digits.rpartition(mark) if mark else (digits, "", "")
        if len(groups) > 1 or (groups and not _grouped(whole, groups.pop())):
            raise InputError(f"“{text}” can be read in more than one way")
        digits = f"{re.sub('[.,]', '', whole) or '0'}.{rest or '0'}"
    return float(digits + power)


def _grouped(text: str, mark: str) -> bool:
    return re.fullmatch(rf"\d{{1,3}}(?:{re.escape(mark)}\d{{3}})+", text) is not None
