"""Products and interpolations of several cuts: section V.A.3, figure 6, and the same from intervals.

`by_counters` are the paper's steps 1 to 4, for cuts written one after the other; their result is a cut at
the minimum heights. The cost is the number of nodes of the result times the number of cuts. `Events` does
the same to *binary* cuts from the leaves where their values change: a change is entered once, at any
order, in a table of differences with a map of bits, and one pass over the map finds the sum of all cuts
between changes. Both give the same nodes: a node of the result is the largest node that no cut changes
in. Weights are whole numbers in units of 1 / `ONE`, so that sums are exact and never depend on order.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_plugins.cuts.paper.height_cuts import bit_at, height_at, trailing_zeros

U8 = npt.NDArray[np.uint8]
U64 = npt.NDArray[np.uint64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
F32 = npt.NDArray[np.float32]

ONE = 1 << 20
"""The weight 1."""
PRODUCT, INTERPOLATION = 0, 1


@kernel
def by_counters(
    operation: int,
    heights: U8,
    values: F32,
    first: I64,
    weights: I32,
    pointers: I64,
    counters: I64,
    out_heights: U8,
    out_values: F32,
) -> int:
    """The counter algorithm of V.A.3 for m cuts; returns how many nodes the result has.

    Cut j has heights and values first[j] … first[j + 1] − 1. The operation is their product, or for
    binary cuts 1 − Σ_j weights[j] / ONE · (1 − value_j): their interpolation, free where weights leave
    something to 1. `pointers` and `counters` (m,) are scratch.
    """
    cuts = len(first) - 1
    for j in range(cuts):  # step 1
        pointers[j] = first[j]
        counters[j] = 0
    count = 0
    while pointers[0] < first[1]:
        lowest = 15
        for j in range(cuts):
            lowest = min(lowest, int(heights[pointers[j]]))
        if operation == PRODUCT:  # step 2
            value = np.float32(1)
            for j in range(cuts):
                value *= values[pointers[j]]
        else:
            hidden = 0
            for j in range(cuts):
                if values[pointers[j]] == 0:
                    hidden += weights[j]
            value = np.float32(1) - np.float32(hidden) / np.float32(ONE)
        out_heights[count], out_values[count] = lowest, value
        count += 1
        for j in range(cuts):
            height = int(heights[pointers[j]])
            if height == lowest:  # step 3 (a)
                pointers[j] += 1
                counters[j] = 0
            else:  # step 3 (b)
                counters[j] += 1 << lowest
                if counters[j] >= 1 << height:
                    pointers[j] += 1
                    counters[j] = 0
    return count


@kernel
def add_changes(record: U8, at: int, count: int, weight: int, differences: I32, changed: U64) -> None:
    """Enters a binary cut's record: `weight` where leaves begin to be hidden, −weight where they end to.

    differences (S + 64,) and changed (S / 64 + 1,), a bit a leaf, are all zero before the first cut.
    """
    leaf, before = 0, 0
    for item in range(count):  # without branches: runs are too short to predict
        hidden = 1 - bit_at(record, at, count, item)
        differences[leaf] += weight * (hidden - before)
        changed[leaf >> 6] |= np.uint64(hidden ^ before) << np.uint64(leaf & 63)
        before = hidden
        leaf += 1 << height_at(record, at, item)
    if before:
        differences[leaf] -= weight
        changed[leaf >> 6] |= np.uint64(1)


@kernel
def multiply_sums(differences: I32, changed: U64, product: F32, boundaries: U64) -> None:
    """Multiplies product (S,) by 1 − hidden / ONE of what was entered, and clears the tables.

    Changes are added to `boundaries` (S / 64 + 1,).
    """
    hidden, start = 0, 0
    for word in range(len(changed)):
        left = changed[word]
        if left == 0:
            continue
        boundaries[word] |= left
        changed[word] = np.uint64(0)
        while left != 0:
            leaf = (word << 6) + trailing_zeros(left)
            left &= left - np.uint64(1)
            if hidden != 0:
                factor = np.float32(1) - np.float32(hidden) / np.float32(ONE)
                for j in range(start, leaf):
                    product[j] *= factor
            hidden += differences[leaf]
            differences[leaf] = 0
            start = leaf


@kernel
def next_boundary(boundaries: U64, start: int, stop: int) -> int:
    """The first boundary after leaf `start`, or `stop`."""
    word = (start + 1) >> 6
    left = boundaries[word] & (np.uint64(0xFFFFFFFFFFFFFFFF) << np.uint64((start + 1) & 63))
    last = (stop - 1) >> 6
    while left == 0:
        word += 1
        if word > last:
            return stop
        left = boundaries[word]
    return min(stop, (word << 6) + trailing_zeros(left))
