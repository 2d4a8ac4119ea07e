"""`lucarne new --room`: texts to rooms, and what cannot be read said in one line."""

from __future__ import annotations

import argparse

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles.rooms import inside, solid

from studio.build_scene import build
from studio.cli import parser
from studio_core.errors import InputError
from studio_core.registry import PluginHost
from studio_core.scene.nodes import Camera, Scene
from studio_core.scene.room import Room
from studio_core.scene.room_plans import l_plan
from studio_core.scene.room_shape import Opening
from studio_plugins.brdfs import plugin as brdfs

HOST = PluginHost([brdfs])
texts = st.text(st.sampled_from("0123456789.x:@,-+backdleft"), max_size=24)


def made(*arguments: object) -> Scene:
    """What `lucarne new` makes of options."""
    options: argparse.Namespace = parser().parse_args(["new", "x.lucarne", *map(str, arguments)])
    return build(options, HOST)[0]


def room_of(scene: Scene) -> Room:
    (room,) = scene.of(Room)
    return room


def test_a_room_of_three_sizes() -> None:
    room = room_of(made("--room", "5x4x2.6"))
    assert (room.width, room.depth, room.height, room.ceiling) == (5, 4, 2.6, True)
    assert not room.openings
    assert not room.without


def test_a_room_with_everything() -> None:
    room = room_of(
        made(
            *("--room", "5x4x2.6", "--open-top", "--without", "front"),
            *("--window", "back:1.8x1.5", "--window", "LEFT:1.2x1.4@0.8,-0.5"),
            *("--door", "right:0.9x2.05@-1", "--passage", "back:0.8x2@2"),
        )
    )
    assert room.without == (2,)
    assert not room.ceiling
    assert room.openings == (
        Opening(wall=0, width=1.8, height=1.5),
        Opening(wall=3, width=1.2, height=1.4, sill=0.8, along=-0.5),
        Opening(kind="door", wall=1, width=0.9, height=2.05, sill=0, along=-1),
        Opening(kind="opening", wall=0, width=0.8, height=2, sill=0, along=2),
    )
    assert len(room.placed()) == 4


def test_an_l_shaped_room() -> None:
    room = room_of(made("--room", "6x5x2.6-2x1.5", "--window", "LEFT:1x1"))
    assert room.plan == l_plan(6, 5, 2, 1.5)
    assert room.openings[0].wall == 5


@pytest.mark.parametrize("size", ["5x4x2.6", "1x1x2", "6x5x2.6-4x3", "12x2x3", "0.6x0.6x0.6"])
def test_the_camera_stands_in_the_room_and_looks_across_it(size: str) -> None:
    scene = made("--room", size)
    room, (camera,) = room_of(scene), scene.of(Camera)
    eye = np.array([camera.transform.translation])
    assert inside(eye[:, [0, 2]], np.array(room.shape.corners)).all()
    assert not solid(room.shape, eye).any()
    ahead = -camera.transform.matrix()[:3, 2]
    assert ahead[2] < 0 < ahead[0]


def test_a_camera_of_one_s_own_is_the_only_one() -> None:
    (camera,) = made("--room", "5x4x2.6", "--camera", "from=0,1,9:to=0,1,0").of(Camera)
    assert camera.transform.translation == (0, 1, 9)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--room", "5x4"), "write WIDTHxDEPTHxHEIGHT in metres"),
        (("--room", "5x4x0"), r"height = 0.0 does not fit: expected 0.5 to 300 m"),
        (("--room", "5x4x1.2.3"), "'1.2.3' is no number"),
        (("--room", "5x4x2-5x1"), "must be smaller than the room"),
        (("--room", "5x4x2.6", "--floor", "3"), "a floor of its own"),
        (("--window", "back:1x1"), "--window needs a room"),
        (("--open-top",), "--open-top needs a room"),
        (("--room", "5x4x2.6", "--window", "roof:1x1"), "no wall 'roof'; known: back, right, front, left"),
        (("--room", "5x4x2.6", "--window", "back:1"), r"--window 'back:1': write WALL:WIDTHxHEIGHT\[@SILL"),
        (("--room", "5x4x2.6", "--window", "back:0x1"), "a window's width of 0.0 m does not fit"),
        (("--room", "5x4x2.6", "--door", "back:1x2@1,2"), r"--door 'back:1x2@1,2': write .*\[@ALONG\]"),
        (("--room", "5x4x2.6", "--without", "wall9"), "--without 'wall9': there is no wall 'wall9'"),
    ],
)
def test_what_cannot_be_read_is_said_in_one_line(arguments: tuple[str, ...], told: str) -> None:
    with pytest.raises(InputError, match=told) as caught:
        made(*arguments)
    assert "\n" not in str(caught.value)


@given(texts, texts)
def test_any_text_makes_a_room_or_one_line(size: str, window: str) -> None:
    for arguments in ((f"--room={size}",), ("--room=5x4x2.6", f"--window={window}")):
        try:
            scene = made(*arguments)
        except InputError as error:
            assert "\n" not in str(error)
        else:
            assert room_of(scene).geometry.faces.size
