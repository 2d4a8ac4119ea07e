"""Which visibility is out of date after objects have moved."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from oracles import cuts as oracle

from studio_core.scene.transform import Transform, axis_angle
from studio_plugins.cuts.poses import Poses, stale

TURNS = [axis_angle((0, 1, 0), 0), axis_angle((0, 1, 0), 40), axis_angle((1, 1, 0), -70)]
transforms = st.builds(
    Transform,
    st.tuples(*[st.sampled_from([-2.0, 0.0, 0.5, 1.25])] * 3),
    st.sampled_from(TURNS),
    st.sampled_from([0.5, 1.0]),
)
slots_of = st.permutations(range(5))


def table(then, now, slots, count):
    """By the poses of objects that were there (None: was not) and are."""
    known = [number for number, one in enumerate(then) if one is not None]
    before = Poses.of(tuple(then[n] for n in known), slots[known], count)
    return stale(before, Poses.of(tuple(now), slots, count), slots)


@given(st.lists(st.tuples(transforms | st.none(), transforms), min_size=1, max_size=5), slots_of)
def test_what_is_out_of_date(pairs, slots):
    then, now = zip(*pairs, strict=True)
    slots = np.array(slots[: len(now)], np.int64)
    found = table(then, now, slots, 5)
    for r in range(len(now)):
        for j in range(len(now)):
            assert found[r, j] == oracle.out_of_date(then, now, r, j)


@given(st.lists(transforms, min_size=1, max_size=4), st.sampled_from([0.0, 0.25]), slots_of, st.data())
def test_what_holds_for_one_holds_for_all(before, by, slots, data):
    now = [Transform((by, 0.0, 0.0)) @ one for one in before]
    for _ in range(data.draw(st.integers(0, 1))):
        now[data.draw(st.integers(0, len(now) - 1))] = data.draw(transforms)
    then = list(before)
    if data.draw(st.booleans()):
        then[data.draw(st.integers(0, len(now) - 1))] = None
    slots = np.array(slots[: len(now)], np.int64)
    found = table(then, now, slots, 5)
    known = [number for number, one in enumerate(then) if one is not None]
    poses = Poses.of(tuple(then[n] for n in known), slots[known], 5)
    assert Poses.of(tuple(now), slots, 5).hold(poses, slots) == (not found.any())
    assert found.any(axis=1).all() or not found.any()


@given(st.lists(transforms, min_size=2, max_size=4), st.tuples(*[st.floats(-50, 50)] * 3))
def test_furniture_that_moves_together_keeps_what_it_knows_of_itself(group, by):
    still = Transform((9.0, 0.0, 0.0))
    now = [Transform(by) @ one for one in group]
    found = table([still, *group], [still, *now], np.arange(len(group) + 1), len(group) + 1)
    assert not found[1:, 1:].any()
    assert not found[0, 0]
    moved = max(abs(x) for x in by) > 1e-6
    assert (found[0, 1:] | (not moved)).all()
    assert (found[1:, 0] | (not moved)).all()


def test_turning_all_keeps_nothing_and_scaling_one_keeps_its_view_of_itself():
    pair = [Transform((1.0, 0, 0)), Transform((-1.0, 0, 0))]
    turn = Transform(rotation=TURNS[1])
    assert table(pair, [turn @ one for one in pair], np.arange(2), 2).all()
    larger = [dataclasses.replace(pair[0], scale=2.0), pair[1]]
    np.testing.assert_array_equal(table(pair, larger, np.arange(2), 2), [[False, True], [True, False]])


def test_the_same_poses():
    places = (Transform((1.0, 0, 0)), Transform((-1.0, 0, 0)))
    a, b = Poses.of(places, np.array([0, 1]), 2), Poses.of(places, np.array([0, 1]), 2)
    assert a.same(b, np.array([0, 1]))
    moved = Poses.of((places[0], Transform((-1.0, 0.1, 0))), np.array([0, 1]), 2)
    assert not moved.same(a, np.array([0, 1]))


def test_another_object_in_the_place_of_one_is_not_the_same():
    places = (Transform((1.0, 0, 0)), Transform((1.0, 0, 0)))
    before = Poses.of(places, np.array([0, 1]), 2)
    after = Poses.of(places, np.array([0, 2]), 3)
    assert not after.same(before, np.array([0, 2]))
    again = Poses.of(places, np.array([0, 1]), 3)
    assert not again.same(after, np.array([0, 1]))


def test_nothing_is_the_same_as_nothing():
    none = Poses.of((), np.zeros(0, np.int64), 1)
    assert none.same(Poses.of((), np.zeros(0, np.int64), 1), np.zeros(0, np.int64))
    assert stale(none, none, np.zeros(0, np.int64)).shape == (0, 0)
