"""Settings of captures as files and on the command line."""

from __future__ import annotations

import dataclasses
import json
from typing import Any, get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.capturing.settings import (
    BracketSettings,
    CaptureSettings,
    LensSettings,
    Patch,
    ReflectionSettings,
    Shot,
)
from studio_core.capturing.settings_file import settings_from_json, settings_to_json, with_values
from studio_core.errors import InputError
from studio_core.imaging.projection import Circle
from studio_core.params import param_infos


def _step(cls: type) -> st.SearchStrategy[Any]:
    """Any values of a step's parameters."""
    drawn: dict[str, st.SearchStrategy[Any]] = {}
    for name, info in param_infos(cls).items():
        match info.kind:
            case "flag":
                drawn[name] = st.booleans()
            case "choice":
                drawn[name] = st.sampled_from(info.choices)
            case "integer":
                drawn[name] = st.integers(int(info.low), int(info.high))
            case _:
                drawn[name] = st.floats(info.low, info.high)
    return st.builds(cls, **drawn)


STEPS = st.builds(CaptureSettings, **{n: _step(c) for n, c in get_type_hints(CaptureSettings).items()})


@given(STEPS)
def test_what_is_written_is_read_again(settings: CaptureSettings) -> None:
    shot = Shot("ab12", "front", -2.0, False)
    patch = Patch("back", 350, 20, 88, 95, found=True, excess=0.5)
    full = dataclasses.replace(
        settings,
        bracket=dataclasses.replace(settings.bracket, shots=(shot,)),
        lens=dataclasses.replace(settings.lens, front=Circle(1, 2, 3), falloff=0.25, coefficients=(0.1, 0.2)),
        reflections=dataclasses.replace(settings.reflections, patches=(patch,)),
    )
    assert settings_from_json(settings_to_json(full)) == full


def test_a_file_says_only_what_differs() -> None:
    made = settings_from_json('{"lens": {"fov": 200, "front": {"x": 10, "y": 11, "radius": 9}}}')
    assert made == CaptureSettings(lens=LensSettings(fov=200.0, front=Circle(10.0, 11.0, 9.0)))
    assert settings_from_json("{}") == CaptureSettings()


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ({"lense": {}}, ("lense", "bracket, radiance, lens")),
        ({"lens": {"fow": 1}}, ("lens", "fow", "fov")),
        ({"lens": {"fov": 20}}, ("fov", "100 to 280")),
        ({"lens": {"fov": "wide"}}, ("fov", "number")),
        ({"lens": {"fov": None}}, ("fov", "number")),
        ({"lens": {"fov": True}}, ("fov", "number")),
        ({"lens": {"model": "pinhole"}}, ("model", "equidistant")),
        ({"lens": {"front": [1, 2]}}, ("front",)),
        ({"lens": 3}, ("lens",)),
        ({"bracket": {"shots": [{"side": "front"}]}}, ("shots", "photograph")),
        ({"stitch": {"level": 1}}, ("level", "true or false")),
        ({"stitch": {"width": 100.5}}, ("width", "whole number")),
        ({"calibration": {"card": [0.1]}}, ("card", "2")),
        ([], ("room.json",)),
    ],
)
def test_what_does_not_fit_is_named_in_a_sentence(value: Any, words: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as raised:
        settings_from_json(json.dumps(value), "room.json")
    said = str(raised.value)
    assert said.startswith("room.json")
    assert "\n" not in said
    for word in words:
        assert word in said


@pytest.mark.parametrize(
    "text", ["", "{", "nan", '{"lens": {"fov": NaN}}', "[" * 100_000, '{"lens":{},"lens":{}}']
)
def test_what_is_no_json_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"room\.json"):
        settings_from_json(text, "room.json")


def test_values_by_name() -> None:
    before = CaptureSettings(lens=LensSettings(front=Circle(1, 1, 1)), bracket=BracketSettings(step=1.0))
    made = with_values(
        before,
        [
            "lens.fov=195",
            "lens.model = equisolid",
            "lens.front=none",
            "lens.back=1503,998.5,930",
            "lens.coefficients=0.1",
            "stitch.level=no",
            "stitch.width=2048",
            "calibration.facing=0,0,1",
            "lens.falloff=0.2",
            "reflections.patches=[]",
        ],
    )
    assert made.lens == LensSettings(
        fov=195.0,
        model="equisolid",
        back=Circle(1503.0, 998.5, 930.0),
        coefficients=(0.1,),
        falloff=0.2,
    )
    assert (made.stitch.level, made.stitch.width) == (False, 2048)
    assert made.calibration.facing == (0.0, 0.0, 1.0)
    assert made.reflections == ReflectionSettings(patches=())
    assert made.bracket == before.bracket


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("lens.fov", "STEP.NAME=VALUE"),
        ("fov=195", "STEP.NAME=VALUE"),
        ("lense.fov=195", "known: bracket"),
        ("lens.fow=195", "known: model, fov"),
        ("lens.fov=1000", "100 to 280"),
        ("lens.back=1,2", "x, y, radius"),
        ("lens.back=left", "commas"),
        ("lens.falloff=much", "falloff"),
    ],
)
def test_values_that_do_not_fit(text: str, word: str) -> None:
    with pytest.raises(InputError) as raised:
        with_values(CaptureSettings(), [text])
    assert word in str(raised.value)
