"""Lists of lights, file names, the mirror ball."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.errors import InputError
from studio_plugins.residual.lights import (
    from_mirror_ball,
    lights_for,
    read_lights,
    write_lp,
    write_table,
)
from studio_plugins.residual.names import told_by
from studio_plugins.residual.samples import Ball, Lights


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("az-30.png", (-30, 0)),
        ("jade_az+20_el15.exr", (20, 15)),
        ("a-10_h-5.tif", (-10, -5)),
        ("a_m40.png", (-40, 0)),
        ("cloth-60.jpg", (-60, 0)),
        ("40.exr", (40, 0)),
        ("DSC_1_of_2.jpg", None),
        ("az-300.png", None),
        ("cloth.png", None),
    ],
)
def test_file_names_tell_angles(name: str, told: tuple[float, float] | None) -> None:
    (one,) = told_by([name])
    assert (None if one.azimuth is None else (one.azimuth, one.height)) == told


@given(st.lists(st.tuples(st.floats(-170, 170), st.floats(-80, 80)), min_size=1, max_size=8))
def test_both_lists_are_read_as_written(tmp_path_factory: pytest.TempPathFactory, pairs: list) -> None:
    at = Lights.at([a for a, _ in pairs], [h for _, h in pairs])
    names = tuple(f"shot {i}.png" for i in range(len(pairs)))
    lights = Lights(at.directions, at.strengths, names)
    folder = tmp_path_factory.mktemp("lights")
    write_lp(folder / "a.lp", lights)
    write_table(folder / "a.csv", lights)
    for made in ("a.lp", "a.csv"):
        found = lights_for(names, read_lights(folder / made))
        assert np.abs(found.directions - lights.directions).max() < 1e-6


def test_a_list_fits_converted_pictures(tmp_path: Path) -> None:
    (tmp_path / "a.lp").write_text("2\r\nC:\\dome\\one.CR2 0 0 2\r\nimages/two.jpg 1 0 1\r\n")
    found = lights_for(["two.tif", "one.tif"], read_lights(tmp_path / "a.lp"))
    assert np.allclose(found.directions, [[np.sqrt(0.5), 0, np.sqrt(0.5)], [0, 0, 1]])


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("a.lp", "3\na 0 0 1\n", "announces 3"),
        ("a.lp", "1\na 0 0 0\n", "no direction"),
        ("a.lp", "1\na 0 zero 1\n", "line 2"),
        ("a.lp", "2\na 0 0 1\na 0 1 1\n", "twice"),
        ("a.csv", "picture,azimuth\n", "no lights"),
        ("a.csv", "picture,azimuth\na,3\nb,c\n", "line 3"),
        ("a.lp", "", "no lights"),
    ],
)
def test_what_is_wrong_with_a_list_is_said(tmp_path: Path, name: str, text: str, why: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=why):
        read_lights(tmp_path / name)


def test_a_picture_without_light_is_named() -> None:
    with pytest.raises(InputError, match=r"cloth\.png"):
        lights_for(["az10.png", "cloth.png"])
    with pytest.raises(InputError, match=r"b\.png"):
        lights_for(["a.png", "b.png"], {"a.png": np.array([0.0, 0, 1])})


@pytest.mark.parametrize("distance", [np.inf, 12.0])
def test_a_mirror_ball_tells_lights(distance: float) -> None:
    ball = Ball(60.3, 58.9, 50.2, distance)
    lights = Lights.at([-50, 10, 70], [5, -30, 40])
    x, y = np.meshgrid(np.arange(120) + 0.5, np.arange(118) + 0.5)
    n, v, inside = ball.normals(x, y)
    mirrored = 2 * (n * v).sum(axis=-1, keepdims=True) * n - v
    pictures = np.stack(
        [
            np.where(inside, np.exp(200 * (mirrored @ d - 1)), 0)[..., None].repeat(3, axis=-1)
            for d in lights.directions
        ]
    ).astype(np.float32)
    found = from_mirror_ball(pictures, ball)
    off = np.degrees(np.arccos(np.clip((found.directions * lights.directions).sum(axis=1), -1, 1)))
    assert off.max() < 0.6


def test_a_mirror_ball_that_shows_a_window_is_refused() -> None:
    with pytest.raises(InputError, match="picture 1"):
        from_mirror_ball(np.ones((1, 60, 60, 3), np.float32), Ball(30, 30, 28))
