"""Numbers with units: what people write is read, whatever else is refused in a sentence."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.errors import InputError
from studio_core.quantities import format_quantity, parse_quantity
from studio_core.units import FAMILIES, LENGTH_UNITS, factor, family_of

FOOT, INCH = 0.3048, 0.0254
READ = [
    ("80 cm", "m", 0.8),
    ("80cm", "m", 0.8),
    ("80 CM", "m", 0.8),
    ("800 mm", "cm", 80),
    ("0,8", "m", 0.8),
    ("0.8", "m", 0.8),
    (",5", "m", 0.5),
    ("5.", "m", 5),
    ("1.234", "m", 1.234),
    ("1,234", "m", 1.234),
    ("1.234,5", "m", 1234.5),
    ("1,234.5", "m", 1234.5),
    ("1.234.567", "m", 1234567),
    ("1\u202f234,5", "m", 1234.5),
    ("1\u00a0234,5", "m", 1234.5),
    ("1 234,5 mm", "m", 1.2345),
    ("1’234.5", "m", 1234.5),
    ("٣٫٥", "m", 3.5),
    ("١٬٢٣٤٫٥", "m", 1234.5),
    ("−3", "m", -3),
    ("--3", "m", 3),
    ("1e-3", "m", 0.001),
    ("2'6\"", "m", 2.5 * FOOT),
    ("2’6”", "m", 2.5 * FOOT),
    ("2'6''", "m", 2.5 * FOOT),
    ("2'6", "m", 2.5 * FOOT),
    ("2'-6\"", "m", 2.5 * FOOT),
    ("2' - 6\"", "m", 1.5 * FOOT),
    ("-2'6\"", "m", -2.5 * FOOT),
    ("2 ft 6 in", "m", 2.5 * FOOT),
    ("0'6\"", "m", 0.5 * FOOT),
    ("5' 6 1/2\"", "m", 66.5 * INCH),
    ("6 1/2 in", "m", 6.5 * INCH),
    ('6½"', "m", 6.5 * INCH),
    ("1/2 m", "m", 0.5),
    ("½ m", "m", 0.5),
    ("2 m 5 mm", "m", 2.005),
    ("0.8+12cm", "m", 0.92),
    ("12cm+0.8", "m", 0.92),
    ("(3+4) cm", "m", 0.07),
    ("-(3+4) cm * 2", "m", -0.14),
    ("2*80cm", "m", 1.6),
    ("2 × 80 cm ÷ 4", "m", 0.4),
    ("2 m * 50%", "m", 1.0),
    ("1 m / 2 cm", "", 50),
    ("1-2-3", "m", -4),
    ("45°", "°", 45),
    ("45", "°", 45),
    ("0.25 turn", "°", 90),
    ("3.141592653589793 rad", "°", 180),
    ("45°30'", "°", 45.5),
    ("50%", "", 0.5),
    ("50%", "%", 50),
    ("0.5", "%", 0.5),
    ("2700K", "K", 2700),
    ("2.7 kK", "K", 2700),
    ("-1.5 stops", "EV", -1.5),
    ("1,2 klm", "lm", 1200),
    ("300 cd/m2", "cd/m²", 300),
    ("1 GB", "MB", 1024),
    ("3", "sr", 3),
]


@pytest.mark.parametrize(("text", "unit", "value"), READ)
def test_what_people_write_is_read(text: str, unit: str, value: float) -> None:
    assert parse_quantity(text, unit) == pytest.approx(value, rel=1e-12)
    assert parse_quantity(f"  {text} ", unit) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "unit", "about"),
    [
        ("", "m", "missing"),
        ("  ", "m", "missing"),
        ("abc", "m", "abc"),
        ("1 foo", "m", "foo"),
        ("1.23.456", "m", "more than one way"),
        ("1,2,3", "m", "more than one way"),
        ("45°", "m", "an angle, where a length"),
        ("5%", "m", "a ratio, where a length"),
        ("1 m", "K", "a length, where a colour temperature"),
        ("45° + 1 m", "m", "cannot be added"),
        ("2cm*3cm", "m", "multiplied"),
        ("3/(2 cm)", "m", "divides by a quantity"),
        ("1/0", "m", "zero"),
        ("6 1/0 in", "m", "zero"),
        ("1 m 80", "m", "unit is missing"),
        ("6 in 2 ft", "m", "large to small"),
        ("2 5", "m", "5"),
        ("1 m cm", "m", "cm"),
        ("5)", "m", ")"),
        ("(5", "m", "too early"),
        ("1 m -", "m", "too early"),
        ("1e999", "m", "too large"),
        ("__import__('os')", "m", "not understood"),
        ("9**9**9", "m", "not understood"),
        ("(" * 150 + "1", "m", "too deeply"),
        ("-" * 150 + "1", "m", "too deeply"),
        ("1" * 201, "m", "200"),
    ],
)
def test_what_cannot_be_read_is_told_in_a_sentence(text: str, unit: str, about: str) -> None:
    with pytest.raises(InputError) as told:
        parse_quantity(text, unit)
    assert about in str(told.value)
    assert not str(told.value).endswith(".")


def test_numbers_without_a_unit_are_in_the_unit_that_is_shown() -> None:
    assert parse_quantity("80", "m", "cm") == pytest.approx(0.8)
    assert parse_quantity("80 + 1 m", "m", "cm") == pytest.approx(1.8)
    assert parse_quantity("2*3", "m", "cm") == pytest.approx(0.06)
    assert parse_quantity("6", "m", "ft-in") == pytest.approx(6 * INCH)
    assert parse_quantity("5'6", "m", "cm") == pytest.approx(5.5 * FOOT)


@given(st.text(max_size=60) | st.text("0123456789.,'\" /*-+()cm°%ftin½’\u202f", max_size=30))
def test_any_text_is_a_number_or_refused(text: str) -> None:
    try:
        value = parse_quantity(text, "m")
    except InputError:
        return
    assert math.isfinite(value)


@given(
    st.floats(-1e6, 1e6),
    st.sampled_from(sorted(LENGTH_UNITS)),
    st.integers(0, 6),
    st.sampled_from(".,"),
    st.booleans(),
)
def test_lengths_come_back_within_half_of_the_last_decimal(
    value: float, shown: str, decimals: int, mark: str, with_unit: bool
) -> None:
    text = format_quantity(value, "m", shown, decimals, mark=mark, with_unit=with_unit)
    again = parse_quantity(text, "m", shown)
    assert again == pytest.approx(value, abs=0.501 * 10.0**-decimals * factor(shown), rel=1e-12)
    assert format_quantity(again, "m", shown, decimals, mark=mark, with_unit=with_unit) == text or (
        abs(value) / factor(shown) * 10.0**decimals > 1e11  # beyond what floats tell apart
    )


UNITS = [unit for family in FAMILIES for unit in family.units]


@given(st.floats(allow_nan=False, allow_infinity=False, width=32), st.sampled_from(UNITS))
def test_every_unit_comes_back(value: float, unit: str) -> None:
    base = next(iter(family_of(unit).units))
    text = format_quantity(value, unit, unit, 12)
    back = parse_quantity(text, unit)
    assert back == pytest.approx(value, rel=1e-9, abs=1e-12)
    assert parse_quantity(text, base) == pytest.approx(
        value * factor(unit), rel=1e-9, abs=1e-12 * factor(unit)
    )


@given(st.integers(0, 10**6), st.integers(0, 999))
def test_groups_of_both_habits_mean_the_same(whole: int, part: int) -> None:
    english = f"{whole:,}.{part:03d}"
    german = english.translate(str.maketrans(",.", ".,"))
    french = german.replace(".", "\u202f")
    expected = pytest.approx(float(f"{whole}.{part:03d}"))
    assert parse_quantity(english, "m") == expected
    assert parse_quantity(german, "m") == expected
    assert parse_quantity(french, "m") == expected


def test_lengths_as_they_are_shown() -> None:
    shown = [format_quantity(0.762, "m", unit, 2) for unit in ("m", "cm", "mm", "in", "ft-in")]
    assert shown == ["0.76 m", "76.2 cm", "762 mm", "30 in", "2'6\""]
    assert format_quantity(6 * FOOT - 1e-5, "m", "ft-in", 2) == "6'"
    assert format_quantity(-1e-9, "m", "cm", 2) == "0 cm"
    assert format_quantity(-1e-9, "m", "ft-in", 2) == '0"'
    assert format_quantity(0.5, "m", "cm", 1, mark=",") == "50 cm"
    assert format_quantity(0.555, "m", "cm", 1, mark=",", with_unit=False) == "55,5"
    assert format_quantity(45.5, "°") == "45.5°"
    assert format_quantity(12.0, "") == "12"
