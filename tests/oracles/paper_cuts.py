"""Cuts by expanding everything to leaves, and the cube's samples one direction at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
Node = tuple[int, float]


def binary_nodes(leaves: Sequence[int]) -> list[Node]:
    """(height, value) from left to right; children merge when they are equal."""
    if len(set(leaves)) == 1:
        return [(len(leaves).bit_length() - 1, float(leaves[0]))]
    half = len(leaves) // 2
    return binary_nodes(leaves[:half]) + binary_nodes(leaves[half:])


def valued_nodes(leaves: F64, threshold: float, size: int) -> list[Node]:
    """The first nodes from the root down whose share of the function's L² error is small."""
    if len(leaves) == 1 or np.sqrt(((leaves - leaves.mean()) ** 2).sum() / size) <= threshold:
        return [(len(leaves).bit_length() - 1, float(leaves.mean()))]
    half = len(leaves) // 2
    return valued_nodes(leaves[:half], threshold, size) + valued_nodes(leaves[half:], threshold, size)


def expanded(nodes: Sequence[Node]) -> F64:
    """The value of every leaf."""
    return np.concatenate([np.full(1 << height, value) for height, value in nodes])


def heights_of_leaves(nodes: Sequence[Node]) -> npt.NDArray[np.int64]:
    """For every leaf the height of the node above it."""
    return np.concatenate([np.full(1 << height, height) for height, _ in nodes])


def common_heights(cuts: Sequence[Sequence[Node]]) -> list[int]:
    """Heights of the cut at the minimum heights of all cuts."""
    lowest = np.min([heights_of_leaves(cut) for cut in cuts], axis=0)
    found, leaf = [], 0
    while leaf < len(lowest):
        found.append(int(lowest[leaf]))
        leaf += 1 << int(lowest[leaf])
    return found
