"""Three codes of a cut and what they cost: figure 5 (a) and (b) of the paper, and one of ours.

- *heights*: four bits a node (figure 5 (a)); `height_cuts.encode`.
- *indices*: two bytes a node, its number in the heap (figure 5 (b), the previous methods [5] and [6]).
- *splits*: the tree above the cut in pre-order, one bit a node of it: 1 where it splits, 0 where the cut
  is; leaves of the tree need none. A cut of n nodes has n − 1 splits, so at most 2 n − 1 bits.

Values are added alike: one bit a node for binary cuts, so that splits cost three bits a node.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_plugins.cuts.paper.height_cuts import Cut

U8 = npt.NDArray[np.uint8]

HEIGHT_BITS = 4
INDEX_BITS = 16


def split_bits(nodes: int, leaves: int) -> int:
    """Bits of the splits of a cut of `nodes` nodes of which `leaves` are leaves of the tree."""
    return 2 * nodes - 1 - leaves


def encode_indices(cut: Cut) -> bytes:
    """Two bytes a node, low byte first."""
    return cut.nodes.astype("<u2").tobytes()


def decode_indices(record: bytes, k: int) -> U8:
    """Heights (n,) of the nodes that `encode_indices` wrote."""
    nodes = np.frombuffer(record, "<u2").astype(np.int64)
    level = np.frexp(nodes)[1] - 1
    heights: U8 = (k - level).astype(np.uint8)
    return heights


def encode_splits(cut: Cut) -> U8:
    """(bits,) 0 and 1, in pre-order."""
    bits: list[int] = []
    above = cut.k  # the height of the subtree that begins at the next node of the cut
    at = 0
    for height in cut.heights.tolist():
        bits.extend([1] * (above - height))
        if height > 0:
            bits.append(0)
        at += 1 << height
        above = _subtree(at, cut.k)
    return np.array(bits, np.uint8)


def decode_splits(bits: U8, k: int) -> U8:
    """Heights (n,) of the cut that `encode_splits` wrote."""
    heights: list[int] = []
    at, above, place = 0, k, 0
    while at < 1 << k:
        height = above
        while height > 0 and bits[place]:
            height -= 1
            place += 1
        if height > 0:
            place += 1
        heights.append(height)
        at += 1 << height
        above = _subtree(at, k)
    return np.array(heights, np.uint8)


def _subtree(at: int, k: int) -> int:
    """Height of the right subtree that pre-order enters at leaf `at`."""
    return k if at == 0 else (at & -at).bit_length() - 1
