"""Ls, and walls carried from one plan to another."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.scene.polygon import area
from studio_core.scene.room_plans import CORNERS, Cut, carried, l_cut, l_plan
from studio_core.scene.room_shape import Opening, RoomShape, outward, rectangle

sides = st.floats(1.0, 20.0)
shares = st.floats(0.1, 0.9)


@given(sides, sides, shares, shares, st.sampled_from(sorted(CORNERS)))
def test_an_l_lacks_what_was_cut_and_says_so(
    width: float, depth: float, across: float, deep: float, corner: str
) -> None:
    plan = l_plan(width, depth, across * width, deep * depth, corner)
    RoomShape(plan, 2.5, 0.02).check()
    assert area(plan) == pytest.approx(width * depth * (1 - across * deep))
    assert np.ptp(np.array(plan), axis=0) == pytest.approx((width, depth))
    cut = l_cut(plan)
    assert cut is not None
    assert cut.corner == corner
    assert (cut.width, cut.depth) == pytest.approx((across * width, deep * depth))
    signs = CORNERS[corner]
    missing = np.array(signs) * (width, depth) / 2
    assert np.hypot(*(np.array(plan) - missing).T).min() > 0.05
    assert outward(np.array(plan))[0] == pytest.approx((0, -1)), "its first wall is at the back"


def test_what_is_no_l_has_no_cut() -> None:
    assert l_cut(rectangle(5, 4)) is None
    askew = list(l_plan(5, 4, 2, 1))
    askew[3] = (askew[3][0] + 0.2, askew[3][1])
    assert l_cut(askew) is None
    t = ((-3, -2), (3, -2), (3, 0), (1, 0), (1, 2), (-1, 2), (-1, 0), (-3, 0))
    assert l_cut(t) is None
    assert l_cut([(0, 0), (1, 0), (1, 1)]) is None


def test_a_cut_must_leave_something() -> None:
    with pytest.raises(ValueError, match="smaller than the room"):
        l_plan(5, 4, 5, 1)
    with pytest.raises(ValueError, match="no corner 'middle'"):
        l_plan(5, 4, 1, 1, "middle")


@pytest.mark.parametrize("corner", sorted(CORNERS))
def test_openings_stay_on_walls_that_look_the_same_way(corner: str) -> None:
    flat, bent = rectangle(6, 5), l_plan(6, 5, 2, 1.5, corner)
    openings = tuple(Opening(wall=wall, along=0.1 * wall) for wall in range(4))
    moved, without = carried(openings, (1,), flat, bent)
    one, other = outward(np.array(flat)), outward(np.array(bent))
    for before, after in zip(openings, moved, strict=True):
        assert other[after.wall] == pytest.approx(one[before.wall])
        assert after.along == before.along
    assert without == (moved[1].wall,)
    back, again = carried(moved, without, bent, flat)
    assert back == openings
    assert again == (1,)


def test_walls_that_look_another_way_go_to_the_nearest() -> None:
    triangle = ((0.0, -3.0), (3.0, 2.0), (-3.0, 3.0))
    moved, _ = carried((Opening(wall=0),), (), rectangle(6, 5), triangle)
    assert moved[0].wall in range(3)


def test_an_l_of_sizes_keeps_its_cut() -> None:
    assert l_cut(l_plan(6, 5, 2, 1.5, "back left")) == Cut("back left", 2, 1.5)
