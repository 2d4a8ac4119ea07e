"""Prefix sums over runs of leaves, and the nodes that are chosen for them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import cuts as oracle
from oracles.radiance import shading_frame

from studio_core.kernels.directions import direction_set
from studio_core.kernels.light_tree import LightTree
from studio_plugins.cuts.choose import (
    BLOCK,
    MOST_NODES,
    NODE,
    SUMS,
    Prefix,
    accumulate,
    choose_nodes,
    index_runs,
    sums_until,
)

K = 10
S = 1 << K
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
DIRECTIONS = direction_set(K)


def light(seed, contrast=0.3):
    """Leaf radiance with bright and dark places."""
    return np.random.default_rng(seed).gamma(contrast, 1, (S, 3)).astype(np.float32)


def visible(seed, normal):
    """Random intervals of leaves above the horizon."""
    rng = np.random.default_rng(seed)
    free = np.repeat(rng.random(S // 8) < 0.7, 8) & (rng.random(S) < 0.97)
    return free & (DIRECTIONS.directions @ normal.astype(np.float32) > 0)


def unit(seed):
    normal = np.random.default_rng(seed).normal(size=3)
    return normal / np.linalg.norm(normal)


def sums_of(leaves, mask):
    """(16,) power and vector of luminance, red, green, blue."""
    towards = DIRECTIONS.directions[mask].astype(np.float64)
    given_ = leaves[mask].astype(np.float64) * DIRECTIONS.solid_angle
    channels = np.column_stack([given_ @ LUMINANCE, given_])
    return np.concatenate([[c.sum(), *(c @ towards)] for c in channels.T])


class Chosen:
    """The nodes of one vertex."""

    def __init__(self, leaves, free, normal, allowed, sign=1.0):
        self.prefix = Prefix.of(LightTree.build(leaves))
        pairs = oracle.runs(free)
        self.runs = np.array([leaf for pair in pairs for leaf in pair] + [0, 0], np.uint16)
        self.before = np.zeros((len(pairs) + 1, SUMS), np.float32)
        self.index = np.zeros(S // BLOCK + 1, np.int64)
        accumulate(self.runs, len(pairs), self.prefix.block, self.prefix.leaf, self.before)
        index_runs(self.runs, len(pairs), self.index)
        made = np.zeros((MOST_NODES, NODE), np.float32)
        self.axes = shading_frame(normal)
        found = choose_nodes(
            self.runs,
            len(pairs),
            self.index,
            self.prefix.block,
            self.prefix.leaf,
            self.before,
            *normal.astype(np.float32),
            self.axes,
            np.float32(allowed),
            np.float32(sign),
            made,
            0,
        )
        self.nodes = made[:found].astype(np.float64)
        self.cells = made[:found, 7].astype(int).tolist()


def test_prefix_sums_are_those_of_the_leaves():
    leaves = light(1)
    prefix = Prefix.of(LightTree.build(leaves))
    assert prefix.power == pytest.approx(sums_of(leaves, np.ones(S, bool))[0], rel=1e-6)
    for place in (0, 1, 63, 64, 65, 500, S - 1, S):
        found = prefix.block[place // BLOCK] + prefix.leaf[place]
        np.testing.assert_allclose(found, sums_of(leaves, np.arange(S) < place), rtol=1e-6, atol=1e-7)


@given(st.integers(0, 99), st.integers(0, S), st.integers(0, 3))
def test_sums_over_runs(seed, place, density):
    free = np.random.default_rng(seed).random(S) < (0.0, 0.02, 0.5, 1.0)[density]
    leaves = light(seed)
    one = Chosen(leaves, free, unit(0), 1.0)
    count = len(oracle.runs(free))
    np.testing.assert_allclose(one.before[count], sums_of(leaves, free), rtol=1e-5, atol=1e-5)
    out = np.zeros((2, SUMS), np.float32)
    run = sums_until(place, one.runs, one.index, count, one.before, one.prefix.block, one.prefix.leaf, out, 1)
    expected = sums_of(leaves, free & (np.arange(S) < place))
    np.testing.assert_allclose(out[1], expected, rtol=1e-5, atol=1e-5)
    ends = [last for _, last in oracle.runs(free)]
    assert run == next((i for i, last in enumerate(ends) if last >= place), count)
    assert not out[0].any()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("share", [1e-1, 1e-2, 1e-3])
def test_nodes_are_the_first_from_the_root_that_are_good_enough(seed, share):
    leaves, normal = light(seed), unit(seed)
    free = visible(seed, normal)
    total = oracle.irradiance(free, normal, leaves, DIRECTIONS) @ LUMINANCE
    one = Chosen(leaves, free, normal, share * total)
    assert one.cells == oracle.chosen(free, normal, leaves, DIRECTIONS, share * total)
    for row in one.nodes:
        towards, arrives, _, spread = oracle.node(free, normal, leaves, DIRECTIONS, int(row[7]))
        np.testing.assert_allclose(row[:3], one.axes @ towards, atol=2e-4)
        np.testing.assert_allclose(row[3:6], arrives, rtol=2e-4, atol=1e-6 * total)
        assert row[6] == pytest.approx(2 * spread, abs=1e-4)


@given(st.integers(0, 999), st.sampled_from([0.0, 1e-4, 1e-2, 0.3]))
def test_irradiance_adds_up_for_any_cut(seed, share):
    leaves, normal = light(seed), unit(seed)
    free = visible(seed, normal)
    total = oracle.irradiance(free, normal, leaves, DIRECTIONS)
    one = Chosen(leaves, free, normal, share * (total @ LUMINANCE))
    np.testing.assert_allclose(one.nodes[:, 3:6].sum(axis=0), total, rtol=1e-4)
    covered = np.zeros(S, int)
    for cell in one.cells:
        width = S >> (cell.bit_length() - 1)
        covered[cell * width - S : (cell + 1) * width - S] += 1
    assert covered.max() == 1
    arriving = (leaves @ LUMINANCE) * (DIRECTIONS.directions @ normal) / leaves.sum()
    assert (covered[free & (arriving > 1e-5)] == 1).all()


@pytest.mark.parametrize("seed", range(3))
def test_without_tolerance_every_leaf_is_a_node(seed):
    leaves, normal = light(seed, 3.0), unit(seed)
    free = visible(seed, normal)
    one = Chosen(leaves, free, normal, 0.0)
    expected = DIRECTIONS.directions[free] @ one.axes.T
    order = np.lexsort(np.round(expected.T, 3))
    mine = np.lexsort(np.round(one.nodes[:, :3].T, 3))
    assert len(one.nodes) == free.sum()
    np.testing.assert_allclose(one.nodes[mine, :3], expected[order], atol=2e-3)


def test_light_that_is_taken_away_is_negative():
    leaves, normal = light(5), unit(5)
    free = visible(5, normal)
    plus, minus = (Chosen(leaves, free, normal, 1e-3, sign).nodes for sign in (1.0, -1.0))
    np.testing.assert_array_equal(plus[:, 3:6], -minus[:, 3:6])
    np.testing.assert_array_equal(plus[:, :3], minus[:, :3])


def test_in_the_dark_there_are_no_nodes():
    normal = unit(0)
    assert not len(Chosen(np.zeros((S, 3), np.float32), visible(0, normal), normal, 0.0).nodes)
    assert not len(Chosen(light(0), np.zeros(S, bool), normal, 0.0).nodes)


@pytest.mark.parametrize("leaf", [0, 63, 64, S // 2, S - 1])
def test_one_leaf_that_is_lit(leaf):
    leaves = np.zeros((S, 3), np.float32)
    leaves[leaf] = 3.0, 2.0, 1.0
    normal = DIRECTIONS.directions[leaf].astype(np.float64)
    one = Chosen(leaves, DIRECTIONS.directions @ normal.astype(np.float32) > 0, normal, 0.0)
    assert len(one.nodes) == 1
    np.testing.assert_allclose(one.nodes[0, :3], [0, 0, 1], atol=1e-3)
    np.testing.assert_allclose(one.nodes[0, 3:6], leaves[leaf] * DIRECTIONS.solid_angle, rtol=1e-5)
    hidden = DIRECTIONS.directions @ normal.astype(np.float32) > 0
    hidden[leaf] = False
    assert not len(Chosen(leaves, hidden, normal, 0.0).nodes)
