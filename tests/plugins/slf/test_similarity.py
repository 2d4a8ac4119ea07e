"""Likeness: what an obvious loop says, 1 at the stroke, and what each weight asks for."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_plugins.slf.similarity import ELSEWHERE, FARTHEST, MOST, Reach, _thinned, likeness_of
from studio_plugins.slf.spots import SLOTS, Spots


def spots(rng, count, looks=4, parts=(0,), models=(0,)):
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    which = rng.integers(0, len(parts), count)
    return Spots(
        rng.uniform(-1, 1, (count, 3)).astype(np.float32),
        normal.astype(np.float32),
        rng.uniform(0, 1, (count, looks)).astype(np.float32),
        np.asarray(parts, np.int64)[which],
        np.resize(np.asarray(models, np.int32), len(parts))[which],
    )


def by_loop(spots, marks, reach):
    marks, gap = _thinned(marks)
    made = np.zeros(len(spots))
    for v in range(len(spots)):
        own = spots.part[v] in marks.part
        if not own and not reach.alike:
            continue
        strict = reach.alike if own else max(reach.alike, ELSEWHERE)
        best = FARTHEST
        for m in range(len(marks)):
            if marks.model[m] != spots.model[v]:
                continue
            cosine = float(spots.normal[v] @ marks.normal[m])
            apart = np.linalg.norm(spots.place[v] - marks.place[m])
            if reach.facing and cosine <= 0:
                continue
            cost = reach.near * max(apart - gap[m], 0)
            cost += reach.facing * (1 / cosine - 1) if reach.facing else 0
            cost += strict * np.sqrt(((spots.look[v] - marks.look[m]) ** 2).sum() / 3)
            best = min(best, cost)
        least = np.exp(-FARTHEST)
        made[v] = (np.exp(-best) - least) / (1 - least)
    return made


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 1000),
    st.sampled_from([0.0, 0.3, 4.0, 60.0]),
    st.sampled_from([0.0, 0.5, 20.0]),
    st.sampled_from([0.0, 1.0, 30.0]),
)
def test_likeness_is_what_a_loop_over_all_pairs_says(seed, near, facing, alike):
    rng = np.random.default_rng(seed)
    parts, models = (0, 1, SLOTS, 2 * SLOTS), (0, 0, 0, 1)
    all_spots = spots(rng, 60, parts=parts, models=models)
    marks = spots(rng, int(rng.integers(1, 50)), parts=(0,))
    reach = Reach(near, facing, alike)
    made = likeness_of(all_spots, marks, reach)
    np.testing.assert_allclose(made, by_loop(all_spots, marks, reach), atol=2e-5)
    assert (made >= 0).all()
    assert (made <= 1 + 1e-6).all()
    assert not made[all_spots.part == 2 * SLOTS].any()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000), st.floats(0, 100), st.floats(0, 100), st.floats(0, 100))
def test_the_stroke_itself_is_alike_whatever_is_asked_for(seed, near, facing, alike):
    marks = spots(np.random.default_rng(seed), 40)
    np.testing.assert_allclose(likeness_of(marks, marks, Reach(near, facing, alike)), 1, atol=1e-4)


def test_without_weights_the_whole_part_is_alike_and_nothing_else():
    rng = np.random.default_rng(1)
    everything = spots(rng, 200, parts=(0, 1, SLOTS))
    made = likeness_of(everything, spots(rng, 5), Reach())
    np.testing.assert_array_equal(made, everything.part == 0)


@pytest.mark.parametrize("name", ["near", "facing", "alike"])
def test_more_weight_never_makes_more_alike(name):
    rng = np.random.default_rng(2)
    everything, marks = spots(rng, 300), spots(rng, 10)
    marks = dataclasses.replace(marks, place=marks.place / 10)
    before = np.ones(300)
    for weight in (0.0, 0.5, 2.0, 10.0, 100.0):
        now = likeness_of(everything, marks, dataclasses.replace(Reach(), **{name: weight}))
        assert (now <= before + 1e-6).all()
        before = now
    assert before.mean() < 0.2


def test_what_looks_the_same_elsewhere_takes_part_only_by_its_look():
    rng = np.random.default_rng(3)
    marks = dataclasses.replace(spots(rng, 10), look=np.full((10, 4), 0.5, np.float32))
    other = spots(rng, 3, parts=(SLOTS,))
    look = np.full((3, 4), 0.5, np.float32)
    look[1] += 0.05
    look[2] += 0.5
    other = dataclasses.replace(other, look=look)
    assert not likeness_of(other, marks, Reach(near=0.1)).any()
    made = likeness_of(other, marks, Reach(alike=0.01))
    assert made[0] == pytest.approx(1)
    assert 0.2 < made[1] < 0.6
    assert made[2] == 0


def test_many_marks_are_thinned_without_holes():
    side = np.stack(np.meshgrid(np.linspace(0, 1, 60), np.linspace(0, 1, 60)), axis=-1).reshape(-1, 2)
    count = len(side)
    flat = Spots(
        np.concatenate([side, np.zeros((count, 1))], axis=1).astype(np.float32),
        np.broadcast_to(np.array([0, 0, 1], np.float32), (count, 3)),
        np.zeros((count, 1), np.float32),
        np.zeros(count, np.int64),
        np.zeros(count, np.int32),
    )
    assert len(_thinned(flat)[0]) == MOST
    assert likeness_of(flat, flat, Reach(near=20)).min() > 0.98


def test_threads_change_nothing(workers):
    rng = np.random.default_rng(4)
    everything, marks = spots(rng, 5000), spots(rng, 100)
    reach = Reach(1.0, 1.0, 1.0)
    alone, together = (likeness_of(everything, marks, reach, w) for w in (None, workers))
    np.testing.assert_allclose(alone, together, atol=1e-6)


def test_nothing_is_alike_to_no_stroke():
    rng = np.random.default_rng(5)
    assert not likeness_of(spots(rng, 10), spots(rng, 0), Reach()).any()
    assert not len(likeness_of(spots(rng, 0), spots(rng, 4), Reach(1, 1, 1)))
