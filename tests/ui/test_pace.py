"""Pixels while somebody drags: more where there is time, fewer where that helps."""

from __future__ import annotations

from collections.abc import Callable

from hypothesis import given
from hypothesis import strategies as st

from studio_ui.pace import ALIKE, KEPT, LEVELS, QUICK, SLOW, Pace


def drag(pace: Pace, seconds: Callable[[int], float], pictures: int = 30) -> list[int]:
    """Pixels of each picture of one motion, whose time follows from its pixels."""
    made = []
    for _ in range(pictures):
        made.append(pace.pixels)
        pace.took(seconds(pace.pixels))
    pace.rest()
    return made


def test_quick_pictures_grow_and_slow_ones_shrink() -> None:
    assert drag(Pace(), lambda pixels: 0.02)[-1] == LEVELS[-1]
    assert drag(Pace(), lambda pixels: 1e-6 * pixels)[-1] == LEVELS[0]
    assert drag(Pace(2), lambda pixels: 5e-7 * pixels)[-1] == LEVELS[0], "130 ms would be more than SLOW"
    assert set(drag(Pace(), lambda pixels: (SLOW + QUICK) / 2)) == {LEVELS[1]}


def test_pixels_that_are_not_to_blame_come_back_and_are_left_alone() -> None:
    pace = Pace()
    first = drag(pace, lambda pixels: 0.3 + 1e-8 * pixels)
    assert min(first) == LEVELS[0], "it was tried"
    assert first[-1] == LEVELS[1], "and did not help"
    assert set(drag(pace, lambda pixels: 0.3)) == {LEVELS[1]}
    drag(pace, lambda pixels: 0.05)
    assert min(drag(pace, lambda pixels: 1e-6 * pixels)) == LEVELS[0], "other times, tried again"


@given(st.floats(1e-9, 2e-6), st.floats(0.0, 1.0))
def test_it_settles(per_pixel: float, fixed: float) -> None:
    made = drag(Pace(), lambda pixels: fixed + per_pixel * pixels, 60)
    assert len(set(made[30:])) == 1


def test_one_odd_picture_changes_nothing() -> None:
    pace = Pace()
    for _ in range(10):
        for seconds in (0.05, 0.5, *[0.05] * ALIKE, 0.01):
            pace.took(seconds)
    assert pace.pixels == LEVELS[1]


def test_the_first_picture_of_a_motion_does_not_count() -> None:
    pace = Pace()
    for _ in range(10):
        pace.took(0.5)
        pace.took(0.05)
        pace.rest()
    assert pace.pixels == LEVELS[1]


def gesture(pace: Pace, kept: float, other: float, pictures: int = 12) -> list[bool]:
    """Whether each picture of one motion was kept as at rest; how long both kinds take."""
    made = []
    for _ in range(pictures):
        made.append(pace.keeps)
        pace.took(kept if pace.keeps else other, kept=pace.keeps)
    pace.rest()
    return made


def test_quick_pictures_stay_as_at_rest_and_slow_ones_do_not() -> None:
    pace = Pace()
    assert all(gesture(pace, KEPT / 2, 0.01))
    for _ in range(3):
        assert gesture(pace, 2 * KEPT, 0.01) == [True] * ALIKE + [False] * (12 - ALIKE)
    assert pace.pixels == LEVELS[-1], "those that were not kept were quick"


def test_where_fewer_pixels_do_not_help_they_are_kept_until_that_may_have_changed() -> None:
    pace = Pace()
    assert not all(gesture(pace, 0.2, 0.19))
    assert all(gesture(pace, 0.2, 0.19))
    assert all(gesture(pace, KEPT / 2, 0.01))
    assert not all(gesture(pace, 0.2, 0.01)), "tried again"


def test_one_slow_picture_that_was_kept_changes_nothing() -> None:
    pace = Pace()
    for _ in range(10):
        for seconds in (*[KEPT / 2] * (ALIKE - 1), 1.0):
            pace.took(seconds, kept=True)
    assert pace.keeps
    assert pace.pixels == LEVELS[1]
