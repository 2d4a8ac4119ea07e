"""Asking again under the light of the last answer: it settles where the paper's iteration runs away."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scenes import little_scene

from studio_core.session import View
from studio_core.strokes.settling import Settling, as_found
from studio_core.strokes.solution import Finding, Reason, Solution
from studio_core.strokes.stroke import Stroke

WHITE = np.ones((2, 2), np.float32)


def even(light):
    return np.full((2, 2, 3), light, np.float32)


def asked(before, goal, rounds, answer):
    """What is shown after each round, where `answer` tells what comes of an albedo."""
    (one,) = Settling.of("s", View(), even(before), WHITE, even(goal)).values()
    albedo, made = 0.8, []
    scale = before / answer(albedo)
    for number in range(rounds):
        light = made[-1] if made else before
        albedo = albedo * float(one.asked[0]) / light
        made.append(scale * answer(albedo))
        if number < rounds - 1:
            one = one.after(even(made[-1]))
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


def test_a_stroke_that_says_nothing_has_nothing_to_settle():
    assert Settling.of("s", View(), even(0.3), WHITE, even(0.3)) == {}
    assert Settling.of("s", View(), even(0.3), WHITE, even(np.nan)) == {}


def test_under_other_light_a_stroke_still_means_what_was_found():
    stroke, chosen = Stroke(id="s"), Stroke(id="t", meaning="gloss")
    there = little_scene().with_nodes(stroke, chosen)
    reason = Reason("colour", 1.0, 0.0, {}, lambda scene: scene)
    found = Solution(lambda scene: scene, (Finding("cube", 0, ("s", "t"), (reason,)),))
    assert [one.meaning for one in as_found(there, found).of(Stroke)] == ["colour", "gloss"]
    nothing = dataclasses.replace(found, findings=(Finding("cube", 0, ("s",), ()),))
    assert as_found(there, nothing) is there
