"""Irradiance and nodes from records are those of sums over the leaves that are seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import cuts as oracle

from studio_core.kernels.directions import direction_set
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.radiance import frame
from studio_core.scene.tangents import arbitrary_tangents
from studio_plugins.cuts.choose import MOST_NODES, Prefix
from studio_plugins.cuts.gather import gather_difference, gather_light
from studio_plugins.cuts.glimpse import BEFORE, NOW

K = 10
S = 1 << K
DIRECTIONS = direction_set(K)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
OWN, OTHER, THIRD, DEAD = 0, 1, 2, 3


def light(seed, contrast=0.3):
    return np.random.default_rng(seed).gamma(contrast, 1, (S, 3)).astype(np.float32)


def unit(seed):
    normal = np.random.default_rng(seed).normal(size=3)
    return (normal / np.linalg.norm(normal)).astype(np.float32)


def below(normal):
    return ~(DIRECTIONS.directions @ normal > 0)


def patches(seed, share=0.15):
    return np.repeat(np.random.default_rng(seed).random(S // 8) < share, 8)


@dataclass
class Point:
    """A vertex: its normal, and the leaves that slots block in its exact and in its coarse record."""

    normal: np.ndarray
    exact: dict
    coarse: dict | None = None
    stale: tuple = ()
    glossy: bool = True


@dataclass
class Gathered:
    irradiance: np.ndarray
    nodes: list
    """Of each point (N, 6): direction in the world, irradiance."""
    spread: list
    cells: list
    runs: list


def gathered(points, leaves, tolerance=0.0, known=None, kind=np.uint16, room=MOST_NODES * 4, runs_of=None):
    """By `gather_light`, or by `gather_difference` where irradiance is known; runs of points, if kept."""
    count = len(points)
    prefix = Prefix.of(LightTree.build(leaves))

    def pooled(named):
        records = [oracle.record({s: oracle.runs(b) for s, b in own.items()}) for own in named]
        length = np.array([len(own) for own in records], np.int32)
        pool = np.array([n for own in records for n in own] + [0], kind)
        return pool, np.cumsum(length, dtype=np.int64) - length, length

    skip = np.zeros((count + 1, 1, 4), np.bool_)
    skip[:, :, DEAD] = True
    row = np.zeros(count, np.int32)
    for number, point in enumerate(points):
        if point.coarse is not None:
            row[number] = number + 1
            skip[number + 1, 0, list(point.stale)] = True
    numbers = np.arange(count, dtype=np.int64)
    normals = np.array([point.normal for point in points], np.float32)
    tangents = arbitrary_tangents(normals)
    glossy = np.array([point.glossy for point in points], np.bool_)
    exact, coarse = pooled([point.exact for point in points]), pooled([glimpsed(point) for point in points])
    light_ = prefix.block, prefix.leaf, tolerance, 0.02 * prefix.power / 4
    owner = np.zeros(count, np.int32)
    given_ = numbers, normals, tangents, owner, glossy, *exact, *coarse, row, skip, *light_
    differing = numbers, normals, tangents, glossy, *coarse, *light_
    irradiance, nodes = np.zeros((count, 3), np.float32), np.zeros(count, np.int64)
    runs_of = runs_of or [None] * count
    kept_runs = [[] if own is None else np.ravel(own).tolist() for own in runs_of]
    kept_pool = np.array([n for own in kept_runs for n in own] + [0], kind)
    kept_length = np.array([-1 if own is None else 2 * len(own) for own in runs_of], np.int32)
    kept_start = np.cumsum([0, *map(len, kept_runs)])[:-1].astype(np.int64)
    made = Gathered(irradiance, [], [], [], [])
    begin = 0
    while begin < count:
        out = np.full(6 * room, np.nan, np.float32)
        detail, runs = np.full(2 * room, np.nan, np.float32), np.zeros(2 * S * 4, kind)
        run_count = np.zeros(count, np.int64)
        if known is None:
            stop = begin + gather_light(
                begin, count, *given_, irradiance, out, nodes, detail,
                kept_pool, kept_start, kept_length, runs, run_count,
            )  # fmt: skip
        else:
            stop = begin + gather_difference(begin, count, *differing, known, irradiance, out, nodes)
        assert stop > begin
        place = ran = 0
        for number in range(begin, stop):
            n = nodes[number]
            rows = out[6 * place : 6 * (place + n)].reshape(6, n).T.astype(np.float64)
            rows[:, :3] = rows[:, :3] @ duff(points[number].normal)
            made.nodes.append(rows)
            if points[number].glossy and known is None:
                own = detail[2 * place : 2 * (place + n)].reshape(n, 2)
                made.spread.append(own[:, 0])
                made.cells.append(own[:, 1].astype(int))
            if known is None:
                made.runs.append(runs[ran : ran + 2 * run_count[number]].reshape(-1, 2).tolist())
                ran += 2 * run_count[number]
            place += n
        begin = stop
    return made


def glimpsed(point):
    """The record of a glimpse: what its coarse slots hide, and what the stale ones did, without the rest."""
    if point.coarse is None:
        return {}
    rest, before, now = np.zeros(S, bool), np.zeros(S, bool), np.zeros(S, bool)
    for slot, blocked in point.exact.items():
        if slot in point.stale:
            before |= blocked
        elif slot != DEAD:
            rest |= blocked
    for blocked in point.coarse.values():
        now |= blocked
    return {NOW: now & ~rest, BEFORE: before & ~rest}


def duff(normal):
    """Rows t, b, n as kernels choose them."""
    axes = np.zeros((3, 3))
    frame(*np.asarray(normal, np.float64), axes)
    return axes


def sums(points, leaves):
    """Irradiance (P, 3) by the leaves; where there is a coarse record, of what it makes of the exact one."""
    made = []
    for point in points:
        free = np.ones(S, bool)
        for slot, blocked in point.exact.items():
            if slot != DEAD and slot not in point.stale:
                free &= ~blocked
        for blocked in (point.coarse or {}).values():
            free &= ~blocked
        made.append(oracle.irradiance(free, point.normal, leaves, DIRECTIONS))
    return np.array(made)


def points_of(seed, count=4, **options):
    made = []
    for number in range(count):
        normal = unit(100 * seed + number)
        own = below(normal) | patches(seed + number, 0.05)
        exact = {OWN: own, OTHER: patches(7 * seed + number), DEAD: patches(9 * seed + number)}
        made.append(Point(normal, exact, **options))
    return made


@given(st.integers(0, 999), st.sampled_from([1e-4, 1.0, 1e6]), st.sampled_from([np.uint16, np.uint32]))
def test_irradiance_is_the_sum_over_leaves(seed, scale, kind):
    points, leaves = points_of(seed), light(seed) * np.float32(scale)
    found = gathered(points, leaves, 1e-2, kind=kind)
    np.testing.assert_allclose(found.irradiance, sums(points, leaves), rtol=1e-5, atol=1e-7 * scale)
    for rows, total in zip(found.nodes, found.irradiance, strict=True):
        np.testing.assert_allclose(rows[:, 3:].sum(axis=0), total, rtol=1e-4)
        assert np.isfinite(rows).all()
        assert (np.abs(np.linalg.norm(rows[:, :3], axis=1) - 1) < 1e-3).all()


def test_bright_leaves_next_to_the_seen_ones_cost_little_precision():
    """A leaf with a hundredth of all light, as much as may be left in an environment, is hidden."""
    leaves = light(3, 5.0)
    leaves[100] = leaves.sum(axis=0) / 100
    normal = DIRECTIONS.directions[100]
    only = below(normal) | (np.abs(np.arange(S) - 100) > 20)
    only[100] = True
    points = [Point(normal, {OWN: only})]
    np.testing.assert_allclose(gathered(points, leaves).irradiance, sums(points, leaves), rtol=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_runs_cells_and_spreads_are_kept_for_splitting(seed):
    points, leaves = points_of(seed), light(seed)
    found = gathered(points, leaves, 1e-2)
    for point, runs, cells, spread in zip(points, found.runs, found.cells, found.spread, strict=True):
        free = ~(point.exact[OWN] | point.exact[OTHER])
        assert runs == [list(pair) for pair in oracle.runs(free)]
        for cell, own in zip(cells, spread, strict=True):
            expected = oracle.node(free, point.normal, leaves, DIRECTIONS, int(cell))[3]
            assert own == pytest.approx(2 * expected, abs=1e-4)


def test_without_tolerance_nodes_are_leaves():
    points, leaves = points_of(2, 2), light(2, 3.0)
    found = gathered(points, leaves)
    for point, rows in zip(points, found.nodes, strict=True):
        free = ~(point.exact[OWN] | point.exact[OTHER])
        assert len(rows) == free.sum()
        nearest = DIRECTIONS.leaf_of(rows[:, :3].astype(np.float32))
        np.testing.assert_array_equal(np.sort(nearest), np.flatnonzero(free))


def test_finer_tolerances_give_more_nodes():
    points, leaves = points_of(4), light(4)
    counts = [sum(map(len, gathered(points, leaves, share).nodes)) for share in (1e-1, 1e-2, 1e-3, 0.0)]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1] / 4


def test_a_matt_surface_gets_one_node():
    points, leaves = points_of(1, glossy=False), light(1)
    found = gathered(points, leaves)
    for point, rows, total in zip(points, found.nodes, found.irradiance, strict=True):
        assert len(rows) == 1
        np.testing.assert_allclose(rows[0, :3], point.normal, atol=1e-6)
        np.testing.assert_allclose(rows[0, 3:], total)


def test_in_the_dark_there_is_nothing():
    black = np.zeros((S, 3), np.float32)
    for points in (points_of(1), points_of(1, glossy=False)):
        assert not gathered(points, black).irradiance.any()
        assert not any(map(len, gathered(points, black).nodes))
    closed = [Point(unit(1), {OWN: np.ones(S, bool)}), Point(unit(1), {})]
    found = gathered(closed, light(1))
    assert not found.irradiance.any()
    assert not any(map(len, found.nodes))


@given(st.integers(0, 999), st.booleans())
def test_the_difference_leads_to_the_new_irradiance(seed, turned):
    """What became visible and what was hidden, where other things still hide some of it."""
    leaves = light(seed)
    before = points_of(seed)
    for number, point in enumerate(before):
        point.exact[THIRD] = patches(11 * seed + number)
    known = gathered(before, leaves)
    stale = (OTHER, OWN) if turned else (OTHER,)
    after = []
    for number, point in enumerate(before):
        coarse = {OTHER: patches(13 * seed + number)}
        if turned:
            coarse[OWN] = below(point.normal) | patches(17 * seed + number, 0.05)
        after.append(Point(point.normal, point.exact, coarse, stale))
    expected = sums(after, leaves)
    whole = gathered(after, leaves)
    np.testing.assert_allclose(whole.irradiance, expected, rtol=1e-5, atol=1e-6)
    found = gathered(after, leaves, known=known.irradiance)
    bound = 1e-5 * float(known.irradiance.max())
    np.testing.assert_allclose(known.irradiance + found.irradiance, expected, atol=bound)
    for p in range(len(after)):
        together = np.concatenate([known.nodes[p], found.nodes[p]])
        for moment in (1, 2, 5):  # of the light, about all axes
            both, new = (
                np.einsum("nx,nc->xc", rows[:, :3] ** moment, rows[:, 3:])
                for rows in (together, whole.nodes[p])
            )
            np.testing.assert_allclose(both, new, atol=10 * bound)


def test_a_difference_with_tolerance_keeps_the_irradiance():
    leaves, points = light(6), points_of(6)
    known = gathered(points, leaves, 1e-2)
    after = [Point(p.normal, p.exact, {OTHER: patches(90 + i)}, (OTHER,)) for i, p in enumerate(points)]
    found = gathered(after, leaves, 1e-2, known=known.irradiance)
    exact = gathered(after, leaves, 0.0, known=known.irradiance)
    for rows, fine, total in zip(found.nodes, exact.nodes, found.irradiance, strict=True):
        assert 0 < len(rows) < len(fine)
        np.testing.assert_allclose(rows[:, 3:].sum(axis=0), total, atol=1e-4)


def test_a_matt_difference_is_one_node_and_none_where_nothing_is_other():
    leaves, points = light(6), points_of(6, glossy=False)
    known = gathered(points, leaves)
    same = Point(points[0].normal, points[0].exact, {OTHER: points[0].exact[OTHER]}, (OTHER,), False)
    other = Point(points[1].normal, points[1].exact, {OTHER: patches(3)}, (OTHER,), False)
    far = Point(points[2].normal, {OWN: points[2].exact[OWN]}, {}, (OTHER,), False)
    found = gathered([same, other, far], leaves, known=known.irradiance[:3].copy())
    assert not found.nodes[0][:, 3:].any()
    np.testing.assert_allclose(found.nodes[1][0, 3:], found.irradiance[1])
    assert len(found.nodes[2]) == 0
    assert not found.irradiance[[0, 2]].any()


def test_points_that_do_not_fit_are_done_the_next_time():
    points, leaves = points_of(3, 6), light(3)
    tight = gathered(points, leaves, room=MOST_NODES)
    wide = gathered(points, leaves, room=8 * MOST_NODES)
    for a, b in zip(tight.nodes, wide.nodes, strict=True):
        np.testing.assert_array_equal(a, b)


def test_kept_runs_stand_in_for_records():
    """Under another light nothing has to be read but runs; those of the rest are found and handed back."""
    points, leaves = points_of(8), light(8)
    first = gathered(points, light(9), 1e-2)
    lost = [first.runs[0], None, first.runs[2], None]
    found, whole = gathered(points, leaves, 1e-2, runs_of=lost), gathered(points, leaves, 1e-2)
    assert found.runs == [[], first.runs[1], [], first.runs[3]]
    np.testing.assert_array_equal(found.irradiance, whole.irradiance)
    for a, b in zip(found.nodes, whole.nodes, strict=True):
        np.testing.assert_array_equal(a, b)
