"""The counter algorithm and the interval variant against expansion to leaves."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st
from oracles import paper_cuts as oracle

from studio_plugins.cuts.paper.height_cuts import Cut, aligned_height, binary_cut, encode, valued_cut
from studio_plugins.cuts.paper.operations import (
    INTERPOLATION,
    ONE,
    PRODUCT,
    add_changes,
    by_counters,
    multiply_sums,
    next_boundary,
)

Nodes = list[tuple[int, float]]


def counted(operation: int, cuts: list[Cut], weights: list[int] | None = None) -> Nodes:
    heights = np.concatenate([cut.heights for cut in cuts])
    values = np.concatenate([cut.values for cut in cuts]).astype(np.float32)
    first = np.cumsum([0, *(len(cut) for cut in cuts)]).astype(np.int64)
    size, m = 1 << cuts[0].k, len(cuts)
    out_heights, out_values = np.empty(size, np.uint8), np.empty(size, np.float32)
    scratch = np.empty((2, m), np.int64)
    share = np.array(weights or [0] * m, np.int32)
    count = by_counters(
        operation, heights, values, first, share, scratch[0], scratch[1], out_heights, out_values
    )
    return list(zip(out_heights[:count].tolist(), out_values[:count].tolist(), strict=True))


def nodes_of(cut: Cut) -> Nodes:
    return list(zip(cut.heights.tolist(), cut.values.tolist(), strict=True))


def leaves_of(nodes: Nodes) -> npt.NDArray[np.float64]:
    return oracle.expanded(nodes)


@st.composite
def binary_cuts(draw: st.DrawFn, k: int, most: int = 5) -> list[Cut]:
    cuts = []
    for _ in range(draw(st.integers(1, most))):
        leaves = np.zeros(1 << k, np.bool_)
        for edge in draw(st.lists(st.integers(0, 1 << k), max_size=20)):
            leaves[edge:] ^= True
        cuts.append(binary_cut(leaves))
    return cuts


@st.composite
def fields(draw: st.DrawFn) -> tuple[Cut, list[tuple[list[Cut], list[int]]]]:
    """A valued cut, and groups of binary cuts with weights of at most 1 in all."""
    k = draw(st.integers(6, 8))
    seed = draw(st.integers(0, 99))
    smooth = np.clip(np.sin(np.arange(1 << k) / 9 + seed), 0, 1)
    groups = []
    for _ in range(draw(st.integers(0, 3))):
        cuts = draw(binary_cuts(k, 8))
        marks = sorted(draw(st.lists(st.integers(0, ONE), min_size=len(cuts), max_size=len(cuts))))
        groups.append((cuts, [b - a for a, b in pairwise([0, *marks])]))
    return valued_cut(smooth, draw(st.sampled_from([0.0, 0.01, 0.1]))), groups


@given(fields())
def test_products_and_interpolations_by_counters(made: tuple[Cut, list[tuple[list[Cut], list[int]]]]) -> None:
    valued, groups = made
    factors = [valued]
    expected = leaves_of(nodes_of(valued))
    for cuts, weights in groups:
        between = counted(INTERPOLATION, cuts, weights)
        hidden = sum(w * (1 - leaves_of(nodes_of(c))) for c, w in zip(cuts, weights, strict=True))
        assert [h for h, _ in between] == oracle.common_heights([nodes_of(c) for c in cuts])
        assert np.abs(leaves_of(between) - (1 - hidden / ONE)).max() < 1e-6
        expected = expected * (1 - hidden / ONE)
        heights, values = zip(*between, strict=True)
        factors.append(Cut(valued.k, np.array(heights, np.uint8), np.array(values, np.float32)))
    product = counted(PRODUCT, factors)
    assert [h for h, _ in product] == oracle.common_heights([nodes_of(f) for f in factors])
    assert np.abs(leaves_of(product) - expected).max() < 1e-5


@given(fields())
def test_intervals_give_the_same_cut(made: tuple[Cut, list[tuple[list[Cut], list[int]]]]) -> None:
    valued, groups = made
    size = 1 << valued.k
    product = np.ones(size, np.float32)
    differences = np.zeros(size + 64, np.int32)
    changed, boundaries = np.zeros(size // 64 + 1, np.uint64), np.zeros(size // 64 + 1, np.uint64)
    factors = [valued]
    for cuts, weights in groups:
        for cut, weight in zip(cuts, weights, strict=True):
            record = np.frombuffer(b"\0\0\0" + encode(cut), np.uint8)
            add_changes(record, 3, len(cut), weight, differences, changed)
        multiply_sums(differences, changed, product, boundaries)
        assert not differences.any()
        assert not changed.any()
        between = counted(INTERPOLATION, cuts, weights)
        heights, values = zip(*between, strict=True)
        factors.append(Cut(valued.k, np.array(heights, np.uint8), np.array(values, np.float32)))
    found: Nodes = []
    for first, height, value in zip(valued.first_leaves, valued.heights, valued.values, strict=True):
        start, stop = int(first), int(first) + (1 << int(height))
        while start < stop:
            end = next_boundary(boundaries, start, stop)
            while start < end:
                span = aligned_height(start, end)
                found.append((span, float(np.float32(value) * product[start])))
                start += 1 << span
    expected = counted(PRODUCT, factors)
    assert [h for h, _ in found] == [h for h, _ in expected]
    assert np.abs(leaves_of(found) - leaves_of(expected)).max() < 1e-6


def test_changes_that_cancel_leave_no_node() -> None:
    left = binary_cut(np.arange(64) < 32)
    right = binary_cut(np.arange(64) >= 32)
    assert counted(INTERPOLATION, [left, right], [ONE // 2, ONE // 2]) == [(5, 0.5), (5, 0.5)]
    assert counted(PRODUCT, [left, right]) == [(5, 0.0), (5, 0.0)]


def test_figure_6() -> None:
    """The product of figure 6: nodes of heights 0, 0, 1 with nodes of heights 1, 0, 0."""
    first = Cut(2, np.array([0, 0, 1], np.uint8), np.array([0.2, 0.4, 0.5], np.float32))
    second = Cut(2, np.array([1, 0, 0], np.uint8), np.array([0.5, 1.0, 0.0], np.float32))
    heights, values = zip(*counted(PRODUCT, [first, second]), strict=True)
    assert heights == (0, 0, 0, 0)
    assert np.allclose(values, [0.1, 0.2, 0.5, 0.0])
