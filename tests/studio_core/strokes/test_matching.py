"""Rounds of a match: until it is met, no more than are allowed, and back to the best of them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import little_scene

from studio_core.edits import Compound, SetFields
from studio_core.shading.job import Job
from studio_core.strokes.marks import Marks
from studio_core.strokes.matching import IDLE, MET, Match
from studio_core.strokes.solution import Solution
from studio_core.strokes.stroke import Stroke

JOB = Job("test")
GOAL, SHOWN = 0.1, 0.3


def scene():
    """With a stroke that wants a third of the light on a cube."""
    none, at, up = np.zeros(3, np.int64), np.zeros((3, 3), np.float32), np.ones((3, 3), np.float32)
    light = [np.full((3, 3), value, np.float32) for value in (SHOWN, GOAL)]
    marks = Marks(none, at, up, none, at + 1, *light, np.ones(3, np.float32), at)
    return little_scene().with_nodes(Stroke(id="s", objects=("cube",), table=marks.table(), weight=1.0))


class World:
    """The stroke's `near` stands for a colour's share, of which light is a function."""

    def __init__(self, light) -> None:
        self.light, self.asked = light, []

    def shown(self, scene, strokes, lit, job):
        assert strokes == ("s",)
        return {"s": np.full((3, 3), SHOWN * self.light(1 / (1 + scene["s"].near)))}

    def solve(self, scene, strokes, lit, params, job):
        share = 1 / (1 + scene["s"].near)
        wanted = float(scene["s"].marks.wanted.mean())
        self.asked.append(wanted)
        then = max(wanted / (SHOWN * self.light(share) / share), 1e-3)
        return Solution(Compound("World", (SetFields("s", {"near": float(np.clip(1 / then - 1, 0, 99))}),)))


def play(world, first=1.0, **limits):
    """The match, and what is shown in the end."""
    start = scene()
    start = world.solve(start, ["s"], None, None, JOB).edit(start) if first else start
    match = Match("Match", start, ("s",), **limits)
    rounds = 0
    while match.round(world, match.edit(start), None, None, JOB):
        rounds += 1
        assert rounds < 100
    end = match.edit(start)
    return match, float(world.shown(end, ("s",), None, JOB)["s"].mean()), end


@given(st.floats(1.0, 5.0), st.floats(0.0, 1.0))
def test_light_that_follows_by_any_power_is_met(power, straight):
    match, shown, end = play(World(lambda share: straight * share + (1 - straight) * share**power))
    assert match.off <= MET
    assert abs(math.log(shown / GOAL)) == pytest.approx(match.off, abs=1e-6)
    np.testing.assert_array_equal(end["s"].marks.wanted, np.float32(GOAL))


def test_what_is_met_already_asks_for_nothing():
    world = World(lambda share: share)
    match, _, _ = play(world)
    assert (match.edit.edits, len(match.offs), len(world.asked)) == ((), 1, 1)


def test_the_best_is_kept_where_light_goes_to_and_fro():
    answers = iter([0.6, 0.45, 0.7, 0.8, 0.9, 0.7, 0.6, 0.8])
    world = World(lambda share: share)
    world.shown = lambda scene, strokes, lit, job: {"s": np.full((3, 3), SHOWN * next(answers))}
    start = scene()
    match = Match("Match", start, ("s",))
    edits = []
    while match.round(world, match.edit(start), None, None, JOB):
        edits.append(match.edit.edits)
    assert match.offs == pytest.approx([math.log(3 * a) for a in (0.6, 0.45, 0.7, 0.8)])
    assert len(match.offs) == 2 + IDLE
    assert match.edit.edits == edits[0], "that of the round before the best was seen"
    assert match.held is not None
    assert match.held.edit is match.edit.edits[-2], "what is told is what is kept"


def test_light_that_will_be_better_soon_asks_and_decides_nothing_once_it_is_near():
    world, start = World(lambda share: share), scene()
    match = Match("Match", start, ("s",))
    assert match.round(world, start, None, None, JOB, sure=False)
    assert (match.near, len(match.offs), len(match.edit.edits)) == (False, 1, 2)
    met = match.edit(start)
    assert match.round(world, met, None, None, JOB, sure=False)
    assert (match.near, len(match.offs), len(match.edit.edits)) == (True, 1, 2)
    assert not match.round(world, met, None, None, JOB)
    assert match.off <= MET


def test_one_stroke_that_cannot_be_met_keeps_no_other_from_it():
    start = scene().with_nodes(dataclasses.replace(scene()["s"], id="t"))
    world = World(lambda share: 0.5 * share + 0.5 * share**3)
    start = world.solve(start, ["s"], None, None, JOB).edit(start)
    follows, world.shown = world.shown, lambda scene, strokes, lit, job: {
        **follows(scene, ("s",), lit, job), "t": scene["t"].marks.shown
    }  # fmt: skip
    match = Match("Match", start, ("s", "t"))
    while match.round(world, match.edit(start), None, None, JOB):
        pass
    assert match.off == pytest.approx(math.log(SHOWN / GOAL))
    shown = follows(match.edit(start), ("s",), None, JOB)["s"].mean()
    assert abs(math.log(shown / GOAL)) < MET


def test_no_more_answers_than_are_allowed():
    match, _, _ = play(World(lambda share: 0.2 * share + 0.8 * share**5), most=1)
    assert len(match.offs) == 2


def test_strokes_that_want_nothing_are_over_at_once():
    plain = little_scene().with_nodes(Stroke(id="s"))
    match = Match("Match", plain, ("s",))
    assert not match.round(World(lambda share: share), plain, None, None, JOB)
    assert math.isinf(match.off)
