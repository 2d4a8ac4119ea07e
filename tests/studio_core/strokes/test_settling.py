"""Asking again under the light of the last answer: it settles where the paper's iteration runs away."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import little_scene

from studio_core.strokes.marks import Marks
from studio_core.strokes.settling import Settling, as_found, asking, wishes_of
from studio_core.strokes.solution import Finding, Reason, Solution
from studio_core.strokes.stroke import FIXATE, Stroke


def even(light, count=4):
    return np.full((count, 3), light, np.float32)


def stroke(before, goal, **fields):
    """On four marks, of which the last wants what it has."""
    none, wanted = np.zeros(4, np.int64), even(goal)
    wanted[3] = before
    at, up = even(0.0), np.tile(np.float32([0, 1, 0]), (4, 1))
    marks = Marks(none, at, up, none, at + 1, even(before), wanted, np.float32([1, 1, 0.5, 1]), at)
    return Stroke(id="s", objects=("cube",), table=marks.table(), **fields)


def asked(before, goal, rounds, answer):
    """What is shown after each round, where `answer` tells what comes of an albedo."""
    one = Settling.of(stroke(before, goal))
    albedo, made = 0.8, []
    scale = before / answer(albedo)
    for number in range(rounds):
        light = made[-1] if made else before
        albedo = albedo * float(one.asked[0]) / light
        made.append(scale * answer(albedo))
        if number < rounds - 1:
            one = one.after(even(made[-1]))
            assert one.off == pytest.approx(abs(np.log(made[-1] / goal)), abs=1e-5)
    return made


@given(st.floats(0.1, 0.9))
def test_a_room_that_lights_itself_settles(share):
    def room(albedo):
        return albedo**2 / (1 - min(albedo, 0.99))

    made = asked(0.3, 0.3 * share, 6, room)
    assert abs(made[-1] / (0.3 * share) - 1) < 0.02


def test_light_that_does_not_answer_is_asked_for_once():
    made = asked(0.3, 0.1, 3, lambda albedo: albedo)
    np.testing.assert_allclose(made, 0.1, rtol=1e-5)


def test_strokes_that_count_and_want_something_have_something_to_settle():
    others = (
        stroke(0.3, 0.3),
        stroke(0.3, 0.1, tool=FIXATE),
        stroke(0.3, 0.1, indirect=True),
        Stroke(id="s"),
    )
    idle = (stroke(0.3, 0.1, hidden=True), stroke(0.3, 0.1, weight=0.0))
    assert wishes_of((Stroke(id="s"), *others, *idle)) == {}
    assert wishes_of((stroke(0.3, 0.1),)).keys() == {"s"}


def test_marks_that_nobody_sees_do_not_count():
    one, light = Settling.of(stroke(0.3, 0.1)), even(0.2)
    light[0] = np.nan
    np.testing.assert_allclose(one.after(light).was, 0.2, rtol=1e-6)
    assert one.after(even(np.nan)) is one


def test_what_is_to_stay_is_asked_for_as_it_is():
    there = little_scene().with_nodes(stroke(0.3, 0.1))
    wishes = {"s": Settling.of(there["s"]).after(even(0.2))}
    wanted = asking(there, wishes)["s"].marks.wanted
    np.testing.assert_allclose(wanted[:3], wishes["s"].asked[0], rtol=1e-5)
    np.testing.assert_allclose(wanted[3], 0.3)


def test_under_other_light_a_stroke_still_means_what_was_found():
    plain, chosen = Stroke(id="s"), Stroke(id="t", meaning="gloss")
    there = little_scene().with_nodes(plain, chosen)
    reason = Reason("colour", 1.0, 0.0, {}, lambda scene: scene)
    found = Solution(lambda scene: scene, (Finding("cube", 0, ("s", "t"), (reason,)),))
    assert [one.meaning for one in as_found(there, found).of(Stroke)] == ["colour", "gloss"]
    nothing = dataclasses.replace(found, findings=(Finding("cube", 0, ("s",), ()),))
    assert as_found(there, nothing) is there
