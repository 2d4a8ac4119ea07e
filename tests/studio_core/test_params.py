"""Parameters as data: kinds, ranges, text from a command line."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.errors import InputError
from studio_core.params import (
    ParamInfo,
    build,
    check,
    defaults,
    nearest,
    param,
    param_infos,
    parse,
    parse_colour,
)


@dataclasses.dataclass(frozen=True)
class Params:
    gloss: float = param(0.5, "Gloss", "How shiny", unit="%", low=0.0, high=1.0)
    count: int = param(4, "Count", low=1, high=2**20)
    fine: bool = param(False, "Fine")
    mode: str = param("fast", "Mode", choices=("fast", "exact"))
    colour: tuple[float, float, float] = param((0.1, 0.2, 0.3), "Colour", low=0.0, high=1.0)
    note: str = param("", "Note")
    hidden: int = 7


INFOS = param_infos(Params)
ANYTHING: st.SearchStrategy[Any] = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.just(10**400),
    st.floats(),
    st.complex_numbers(),
    st.text(),
    st.binary(),
    st.lists(st.floats() | st.integers() | st.text(), max_size=4),
    st.tuples(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1)),
    st.dictionaries(st.text(), st.integers(), max_size=2),
)


def test_kinds_follow_from_defaults() -> None:
    assert {name: info.kind for name, info in INFOS.items()} == {
        "gloss": "number",
        "count": "integer",
        "fine": "flag",
        "mode": "choice",
        "colour": "colour",
        "note": "text",
    }
    assert defaults(Params) == {name: getattr(Params(), name) for name in INFOS}


@given(st.sampled_from(sorted(INFOS)), ANYTHING)
def test_a_value_fits_or_is_refused_by_name(name: str, value: object) -> None:
    info = INFOS[name]
    try:
        made = check(name, info, value)
    except InputError as error:
        assert str(error).startswith(f"{name} = ")
        return
    assert type(made) is type(defaults(Params)[name])
    numbers = made if isinstance(made, tuple) else (made,)
    if info.kind in ("number", "integer", "colour"):
        assert all(info.low <= n <= info.high and math.isfinite(n) for n in numbers)  # type: ignore[operator]
    if info.kind == "choice":
        assert made in info.choices
    assert check(name, info, made) == made


@given(st.sampled_from(sorted(INFOS)), st.text() | st.from_regex(r"#[0-9a-f+_]{6}|[-0-9./einfa]{1,9}"))
def test_any_text_parses_to_what_fits_or_is_refused(name: str, text: str) -> None:
    try:
        made = parse(name, INFOS[name], text)
    except InputError as error:
        assert name in str(error)
        return
    assert check(name, INFOS[name], made) == made


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("gloss", "0.25", 0.25),
        ("gloss", "1e-3", 1e-3),
        ("count", "1024", 1024),
        ("fine", "Yes", True),
        ("fine", "off", False),
        ("mode", "exact", "exact"),
        ("colour", "0.1/0.2/0.3", (0.1, 0.2, 0.3)),
        ("colour", "0.5", (0.5, 0.5, 0.5)),
        ("colour", "#ffffff", (1.0, 1.0, 1.0)),
        ("note", "0.5", "0.5"),
    ],
)
def test_text_of_the_command_line(name: str, text: str, value: object) -> None:
    assert parse(name, INFOS[name], text) == value


def test_hexadecimal_colours_are_srgb() -> None:
    red, green, blue = parse_colour("c", "#80000a")
    assert red == pytest.approx(0.21586, abs=1e-5)  # ((128/255 + 0.055) / 1.055)^2.4
    assert green == 0.0
    assert blue == pytest.approx(10 / 255 / 12.92, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("gloss", "1.5", "expected 0 to 1 %"),
        ("gloss", "nan", "not a finite number"),
        ("count", "2.5", "expected a whole number"),
        ("fine", "perhaps", "expected true or false"),
        ("mode", "slow", "choose one of fast, exact"),
        ("colour", "red", "r/g/b"),
        ("colour", "0.1/0.2", "r/g/b"),
        ("colour", "2/0/0", "expected 0 to 1"),
    ],
)
def test_a_refusal_says_what_would_fit(name: str, text: str, why: str) -> None:
    with pytest.raises(InputError) as caught:
        parse(name, INFOS[name], text)
    assert why in str(caught.value)
    assert str(caught.value).startswith(f"{name} = ")


def test_building_checks_every_name_and_value() -> None:
    assert build(Params, {"gloss": 1, "mode": "exact"}) == Params(gloss=1.0, mode="exact")
    with pytest.raises(InputError, match="no parameter 'glos'; known: gloss, count"):
        build(Params, {"glos": 1})
    with pytest.raises(InputError, match="no parameter 'hidden'"):
        build(Params, {"hidden": 1})
    with pytest.raises(InputError, match="count = 0 does not fit"):
        build(Params, {"count": 0})


def test_metadata_reaches_forms() -> None:
    assert INFOS["gloss"] == ParamInfo("number", "Gloss", "How shiny", unit="%", low=0.0, high=1.0)


@given(st.floats(allow_nan=False), st.floats(-10, 10), st.floats(0, 10))
def test_the_nearest_value_fits(value: float, low: float, width: float) -> None:
    info = ParamInfo("number", "x", low=low, high=low + width)
    made = nearest(info, value)
    assert check("x", info, made) == made
    assert made == value or not low <= value <= low + width
    colour = ParamInfo("colour", "x", low=low, high=low + width)
    assert nearest(colour, (value, low, value)) == (made, low, made)
