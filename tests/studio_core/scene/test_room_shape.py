"""What a room may be asked for, and how openings are made to fit."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from room_support import shapes

from studio_core.scene.polygon import area
from studio_core.scene.room_plans import l_plan
from studio_core.scene.room_shape import (
    LEAST,
    MARGIN,
    Opening,
    RoomShape,
    rectangle,
    stretched,
)

PLAIN = RoomShape(rectangle(5, 4), 2.6, 0.2)


def with_openings(*openings: Opening) -> RoomShape:
    return dataclasses.replace(PLAIN, openings=openings)


@given(shapes())
@settings(max_examples=60)
def test_openings_fit_their_walls_and_keep_apart(shape: RoomShape) -> None:
    try:
        shape.check()
    except ValueError:
        assume(False)
    plan = np.array(shape.corners)
    placed = shape.placed()
    for one in placed:
        long = float(np.hypot(*(plan[(one.wall + 1) % len(plan)] - plan[one.wall])))
        assert one.start >= MARGIN - 1e-9
        assert one.end <= long - MARGIN + 1e-9
        assert one.end - one.start >= LEAST - 1e-9
        assert one.high - one.low >= LEAST - 1e-9
        assert one.high <= shape.height - MARGIN + 1e-9
        assert one.wall not in shape.without
        asked = shape.openings[one.opening]
        assert one.end - one.start <= asked.width + 1e-9
    for k, one in enumerate(placed):
        for other in placed[k + 1 :]:
            apart = one.end + MARGIN <= other.start or other.end + MARGIN <= one.start
            assert one.wall != other.wall or apart


def test_an_opening_stands_where_it_was_asked_for() -> None:
    (one,) = with_openings(Opening(wall=1, along=0.5, sill=0.9, width=1.2, height=1.4)).placed()
    assert (one.start, one.end) == pytest.approx((2 + 0.5 - 0.6, 2 + 0.5 + 0.6))
    assert (one.low, one.high) == pytest.approx((0.9, 2.3))


def test_openings_are_moved_and_cut_to_fit_and_left_out_without_room() -> None:
    (moved,) = with_openings(Opening(along=4.0)).placed()
    assert moved.end == pytest.approx(5 - MARGIN)
    assert moved.end - moved.start == pytest.approx(1.2)
    (cut,) = with_openings(Opening(width=9.0, height=9.0)).placed()
    assert (cut.start, cut.end) == pytest.approx((MARGIN, 5 - MARGIN))
    assert cut.high == pytest.approx(2.6 - MARGIN)
    assert not with_openings(Opening(sill=2.55)).placed()
    first, _ = with_openings(Opening(), Opening(along=0.3), Opening(along=1.5)).placed()
    assert first.opening == 0
    assert not dataclasses.replace(with_openings(Opening()), without=frozenset({0})).placed()


def test_a_door_stands_on_the_floor() -> None:
    (door,) = with_openings(Opening(kind="door", sill=0.01, width=0.9, height=2.05)).placed()
    assert door.low == 0


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"corners": ((0, 0), (1, 0))}, "3 to 64 corners"),
        ({"corners": rectangle(5, 4)[::-1]}, "clockwise"),
        ({"corners": ((0, 0), (4, 4), (4, 0), (0, 4), (-1, 2))}, "cross or touch"),
        ({"corners": ((0, 0), (2, 0), (4, 0), (4, 3), (0, 3))}, "corner 2 .* turns too little"),
        ({"corners": ((0, 0), (float("nan"), 0), (4, 3))}, "finite"),
        ({"corners": l_plan(5, 4, 0.1, 0.1)}, "wall 3 is too short for walls 0.2 m"),
        ({"without": frozenset({4})}, "no wall 5"),
        ({"openings": (Opening(wall=4),)}, "no wall 5 for a window"),
        ({"openings": (Opening(),) * 101}, "at most 100 openings"),
    ],
)
def test_what_cannot_be_built_is_refused_in_a_sentence(change: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        dataclasses.replace(PLAIN, **change).check()


def test_a_narrow_yard_has_no_place_for_thick_walls() -> None:
    u = ((0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (1.7, 3.0), (1.7, 1.0), (1.3, 1.0), (1.3, 3.0), (0.0, 3.0))
    RoomShape(u, 2.5, 0.15).check()
    with pytest.raises(ValueError, match="walls 0\\.2 m thick"):
        RoomShape(u, 2.5, 0.2).check()


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"kind": "hatch"}, "no kind of opening"),
        ({"wall": -1}, "a number from 0"),
        ({"wall": True}, "a number from 0"),
        ({"width": 0.0}, "window's width of 0.0 m"),
        ({"height": float("nan")}, "window's height of nan m"),
        ({"sill": "low"}, "window's sill of 'low' m"),
    ],
)
def test_openings_that_cannot_be_are_refused_in_a_sentence(given: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        Opening(**given)


def test_plans_are_stretched_to_the_room() -> None:
    plan = l_plan(6, 5, 2, 1.5)
    made = stretched(tuple((x + 7, z - 3) for x, z in plan), 3, 10)
    assert np.ptp(np.array(made), axis=0) == pytest.approx((3, 10))
    assert area(made) == pytest.approx(area(plan))
    with pytest.raises(ValueError, match="width and depth"):
        stretched(((0, 0), (1, 0), (2, 0)), 5, 4)
