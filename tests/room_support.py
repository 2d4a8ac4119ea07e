"""Rooms of every shape for the tests."""

from __future__ import annotations

import math

from hypothesis import strategies as st

from studio_core.scene.room_plans import l_plan
from studio_core.scene.room_shape import KINDS, Opening, Point, RoomShape, rectangle


@st.composite
def openings(draw: st.DrawFn, walls: int) -> Opening:
    return Opening(
        kind=draw(st.sampled_from(KINDS)),  # type: ignore[arg-type]
        wall=draw(st.integers(0, walls - 1)),
        along=draw(st.floats(-4, 4)),
        sill=draw(st.sampled_from((0.0, 0.01, 0.05, 0.9)) | st.floats(0, 3)),
        width=draw(st.floats(0.1, 5)),
        height=draw(st.floats(0.1, 4)),
    )


@st.composite
def plans(draw: st.DrawFn) -> tuple[Point, ...]:
    """A rectangle, an L, or points around the middle: some too thin or too sharp for walls."""
    width, depth = draw(st.floats(0.5, 12)), draw(st.floats(0.5, 12))
    kind = draw(st.sampled_from(("rectangle", "l", "round")))
    if kind == "rectangle":
        return rectangle(width, depth)
    if kind == "l":
        cut = draw(st.floats(0.1, 0.9)), draw(st.floats(0.1, 0.9))
        return l_plan(width, depth, cut[0] * width, cut[1] * depth)
    count = draw(st.integers(3, 9))
    turns = [2 * math.pi * (k + draw(st.floats(-0.4, 0.4))) / count for k in range(count)]
    far = [draw(st.floats(1, 6)) for _ in range(count)]
    return tuple((r * math.cos(a), r * math.sin(a)) for r, a in zip(far, turns, strict=True))


@st.composite
def shapes(draw: st.DrawFn) -> RoomShape:
    """Any numbers that a room can be asked for; not every one can be built."""
    corners = draw(plans())
    walls = len(corners)
    return RoomShape(
        corners,
        draw(st.floats(0.5, 5)),
        draw(st.floats(0.02, 0.6)),
        draw(st.booleans()),
        draw(st.sampled_from((0.0, 0.08)) | st.floats(0, 1)),
        draw(st.frozensets(st.integers(0, walls - 1))),
        tuple(draw(st.lists(openings(walls), max_size=4))),
    )
