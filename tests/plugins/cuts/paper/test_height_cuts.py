"""Height-based cuts and their codes against recursion over all leaves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import paper_cuts as oracle

from studio_plugins.cuts.paper import codes
from studio_plugins.cuts.paper.height_cuts import STEPS, Cut, binary_cut, decode, encode, valued_cut


@st.composite
def step_functions(draw: st.DrawFn) -> list[int]:
    """0 or 1 per leaf of 2^6 … 2^10, with runs of any length."""
    size = 1 << draw(st.integers(6, 10))
    edges = draw(st.lists(st.integers(0, size), max_size=40))
    leaves = np.zeros(size, np.int64)
    for edge in edges:
        leaves[edge:] ^= 1
    if draw(st.booleans()):
        leaves ^= 1
    return [int(leaf) for leaf in leaves]


@st.composite
def valued_functions(draw: st.DrawFn) -> np.ndarray:
    """Values in [0, 1] per leaf, in steps of any width."""
    size = 1 << draw(st.integers(6, 9))
    leaves = np.full(size, draw(st.floats(0, 1, width=32)), np.float32)
    for _ in range(draw(st.integers(0, 20))):
        leaves[draw(st.integers(0, size - 1)) :] = draw(st.floats(0, 1, width=32))
    return leaves


def meets_every_path_once(cut: Cut) -> bool:
    """Whether each leaf has exactly one ancestor, or itself, in the cut."""
    size = 1 << cut.k
    nodes = set(cut.nodes.tolist())
    paths = [sum(((size + leaf) >> up) in nodes for up in range(cut.k + 1)) for leaf in range(size)]
    return len(nodes) == len(cut) and paths == [1] * size


@given(step_functions())
def test_binary_cuts(leaves: list[int]) -> None:
    cut = binary_cut(leaves)
    assert list(zip(cut.heights.tolist(), cut.values.tolist(), strict=True)) == oracle.binary_nodes(leaves)
    assert cut.expanded().tolist() == leaves
    assert meets_every_path_once(cut)
    assert sum(1 << height for height in cut.heights.tolist()) == len(leaves)


@given(valued_functions(), st.sampled_from([0.0, 0.003, 0.02, 0.2]))
def test_valued_cuts(leaves: np.ndarray, threshold: float) -> None:
    cut = valued_cut(leaves, threshold)
    exact = oracle.valued_nodes(leaves.astype(np.float64), threshold, len(leaves))
    assert meets_every_path_once(cut)
    assert np.allclose(cut.values, np.add.reduceat(leaves, cut.first_leaves) / 2.0**cut.heights, atol=1e-6)
    near = oracle.valued_nodes(leaves.astype(np.float64), threshold * 1.001 + 1e-7, len(leaves))
    assert len(near) <= len(cut) <= len(exact)  # rounding may decide at the threshold itself
    error = np.sqrt(((cut.expanded() - leaves) ** 2).mean())
    assert error <= threshold * 1.001 * np.sqrt(len(cut)) + 1e-6


@given(step_functions())
def test_codes_of_binary_cuts(leaves: list[int]) -> None:
    cut = binary_cut(leaves)
    record = encode(cut)
    assert len(record) == (len(cut) + 1) // 2 + (len(cut) + 7) // 8
    back = decode(record, cut.k, len(cut), binary=True)
    assert back.heights.tolist() == cut.heights.tolist()
    assert back.values.tolist() == cut.values.tolist()
    assert codes.decode_indices(codes.encode_indices(cut), cut.k).tolist() == cut.heights.tolist()
    splits = codes.encode_splits(cut)
    assert codes.decode_splits(splits, cut.k).tolist() == cut.heights.tolist()
    assert len(splits) == codes.split_bits(len(cut), int((cut.heights == 0).sum()))


@given(valued_functions())
def test_codes_of_valued_cuts(leaves: np.ndarray) -> None:
    cut = valued_cut(leaves, 0.01)
    record = encode(cut)
    back = decode(record, cut.k, len(cut), binary=False)
    assert back.heights.tolist() == cut.heights.tolist()
    assert encode(back) == record
    assert np.abs(back.values - cut.values).max() < 0.51 / STEPS


def test_the_largest_tree_fits_four_bits() -> None:
    whole = binary_cut(np.ones(1 << 15, np.bool_))
    assert whole.heights.tolist() == [15]
    assert encode(whole) == bytes([15, 1])
    finest = binary_cut(np.arange(1 << 15) % 2 == 0)
    assert len(finest) == 1 << 15
    assert codes.decode_indices(codes.encode_indices(finest), 15).tolist() == finest.heights.tolist()


def test_functions_that_are_no_trees_are_refused() -> None:
    for wrong in (np.ones(63), np.ones(32), np.ones(1 << 16), np.ones((8, 8))):
        with pytest.raises(ValueError, match="a cut needs"):
            binary_cut(wrong)
    with pytest.raises(ValueError, match="from 0 to 1"):
        valued_cut(np.full(64, 1.5), 0.1)
