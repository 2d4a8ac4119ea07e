"""Cuts of the tree of directions and the paper's way to write them: section V.A.2, figure 5 (a).

Every path from the root to a leaf meets exactly one node of a cut. So, written from left to right, nodes
need no numbers: a node of height h (edges to the leaves) covers the next 2^h leaves. Heights of 2^15
directions are 0 … 15, four bits. A *binary* cut (of a visibility cut field) adds one bit a node, a *valued*
cut (of self-visibility) a value in [0, 1], which we keep in 16 bits.

A written cut is a record of bytes: heights two a byte, the earlier in the low bits; then values, eight bits
a byte from the lowest (binary) or two bytes each, low byte first (valued).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

U8 = npt.NDArray[np.uint8]
U64 = npt.NDArray[np.uint64]
I64 = npt.NDArray[np.int64]
F32 = npt.NDArray[np.float32]
Values = npt.NDArray[Any]

HIGHEST_K = 15
"""A root of 2^15 leaves has the greatest height that four bits hold."""
STEPS = 65535
"""A value v of a valued cut is written as the whole number nearest to v · STEPS."""

_DE_BRUIJN = np.uint64(0x03F79D71B4CB0A89)
_INDEX_OF = np.zeros(64, np.uint8)
for _index in range(64):
    _INDEX_OF[((0x03F79D71B4CB0A89 << _index) & 0xFFFFFFFFFFFFFFFF) >> 58] = _index
_LOGARITHM = np.array([0, *(int(n).bit_length() - 1 for n in range(1, 256))], np.uint8)
_ALL = np.uint64(0xFFFFFFFFFFFFFFFF)


@dataclass(frozen=True)
class Cut:
    """A cut: heights (n,) uint8 from left to right and one value (n,) each.

    Values are uint8 0 or 1 in binary cuts, float32 in [0, 1] in valued ones.
    """

    k: int
    heights: U8
    values: Values

    def __len__(self) -> int:
        return len(self.heights)

    @property
    def first_leaves(self) -> I64:
        """(n,) the first leaf below each node."""
        spans = np.left_shift(1, self.heights.astype(np.int64))
        first: I64 = np.cumsum(spans) - spans
        return first

    @property
    def nodes(self) -> I64:
        """(n,) numbers in the heap of directions: root 1, leaf j at S + j."""
        heights = self.heights.astype(np.int64)
        numbers: I64 = np.left_shift(1, self.k - heights) + (self.first_leaves >> heights)
        return numbers

    def expanded(self) -> Values:
        """(S,) the value of every leaf."""
        spans = np.left_shift(1, self.heights.astype(np.int64))
        leaves: Values = np.repeat(self.values, spans)
        return leaves


@kernel
def trailing_zeros(word: np.uint64) -> int:
    """How many low bits of a word that is not 0 are 0."""
    lowest = word & (~word + np.uint64(1))
    return int(_INDEX_OF[(lowest * _DE_BRUIJN) >> np.uint64(58)])


@kernel
def aligned_height(start: int, stop: int) -> int:
    """Height of the greatest node that begins at leaf `start` and ends at `stop` or before."""
    span = stop - start
    room = int(_LOGARITHM[span]) if span < 256 else 8 + int(_LOGARITHM[span >> 8])
    return room if start == 0 else min(room, trailing_zeros(np.uint64(start)))


@kernel
def next_change(words: U64, start: int, bit: int) -> int:
    """The first leaf from `start` on whose bit is not `bit`, or 64 · len(words)."""
    flip = _ALL if bit else np.uint64(0)
    word = start >> 6
    left = (words[word] ^ flip) & (_ALL << np.uint64(start & 63))
    while left == 0:
        word += 1
        if word == len(words):
            return word << 6
        left = words[word] ^ flip
    return (word << 6) + trailing_zeros(left)


@kernel
def cut_of_bits(words: U64, heights: U8, values: U8) -> int:
    """The binary cut of visibility words (S / 64,): children merge only when they are equal (V.A.1).

    Fills heights and values and returns how many nodes there are; up to S fit.
    """
    size, count, start = len(words) << 6, 0, 0
    while start < size:
        bit = int((words[start >> 6] >> np.uint64(start & 63)) & np.uint64(1))
        stop = next_change(words, start, bit)
        while start < stop:
            height = aligned_height(start, stop)
            heights[count], values[count] = height, bit
            count += 1
            start += 1 << height
    return count


@kernel
def cut_of_leaves(
    leaves: F32, k: int, threshold: np.float32, means: F32, spreads: F32, heights: U8, values: F32
) -> int:
    """The valued cut of leaf values (S,): from the root down, the first nodes of small enough error.

    Inner nodes hold the average below them and the error of clustering, bottom-up (section V). The paper
    takes error and selection from Akerlund et al. 2007 without repeating them; here the error of a node is
    the L² norm of what its leaves differ by from their average, over that of 1 on the whole sphere:
    sqrt(Σ_{j below} (v_j − mean)² / S). `means` and `spreads` (2 S,) are scratch. Returns the count of
    nodes; up to S are written.
    """
    size = len(leaves)
    for j in range(size):
        means[size + j] = leaves[j]
        spreads[size + j] = np.float32(0)
    half = np.float32(0.5)
    first = size >> 1
    while first > 0:
        for node in range(first, 2 * first):
            left, right = means[2 * node], means[2 * node + 1]
            apart = left - right
            means[node] = np.float32(0.5) * (left + right)
            spreads[node] = spreads[2 * node] + spreads[2 * node + 1] + half * apart * apart
        half *= np.float32(2)  # half the leaves below a child: what makes their distance count
        first >>= 1
    limit = threshold * threshold * np.float32(size)
    count, node, height = 0, 1, k
    while True:
        if height == 0 or spreads[node] <= limit:
            heights[count], values[count] = height, means[node]
            count += 1
            node += 1
            climbed = trailing_zeros(np.uint64(node))
            node >>= climbed
            height += climbed
            if node == 1:
                return count
        else:
            node *= 2
            height -= 1


@kernel
def put_heights(heights: U8, count: int, out: U8, at: int) -> int:
    """Writes heights two a byte to out[at:]; returns where it ended."""
    for pair in range(count >> 1):
        out[at + pair] = heights[2 * pair] | (heights[2 * pair + 1] << 4)
    if count & 1:
        out[at + (count >> 1)] = heights[count - 1]
    return at + ((count + 1) >> 1)


@kernel
def put_bits(values: U8, count: int, out: U8, at: int) -> int:
    """Writes values 0 and 1 eight a byte to out[at:]; returns where it ended."""
    for byte in range((count + 7) >> 3):
        packed = 0
        for lane in range(min(8, count - 8 * byte)):
            packed |= (1 if values[8 * byte + lane] else 0) << lane
        out[at + byte] = packed
    return at + ((count + 7) >> 3)


@kernel
def put_values(values: F32, count: int, out: U8, at: int) -> int:
    """Writes values in [0, 1] in two bytes each to out[at:]; returns where it ended."""
    for item in range(count):
        step = int(values[item] * np.float32(STEPS) + np.float32(0.5))
        out[at + 2 * item], out[at + 2 * item + 1] = step & 255, step >> 8
    return at + 2 * count


@kernel
def height_at(record: U8, at: int, item: int) -> int:
    """Height of a node of the record that starts at record[at]."""
    return int(record[at + (item >> 1)] >> np.uint8((item & 1) << 2)) & 15


@kernel
def bit_at(record: U8, at: int, count: int, item: int) -> int:
    """Value of a node of a binary cut of `count` nodes."""
    return (int(record[at + ((count + 1) >> 1) + (item >> 3)]) >> (item & 7)) & 1


@kernel
def value_at(record: U8, at: int, count: int, item: int) -> np.float32:
    """Value of a node of a valued cut of `count` nodes."""
    place = at + ((count + 1) >> 1) + 2 * item
    return np.float32(int(record[place]) | (int(record[place + 1]) << 8)) / np.float32(STEPS)


def binary_cut(visible: npt.ArrayLike) -> Cut:
    """The cut of a binary function (S,) of the leaves, 2^6 ≤ S ≤ 2^15."""
    leaves = np.asarray(visible, np.bool_)
    k = _power_of(leaves.shape)
    words = np.packbits(leaves, bitorder="little").view(np.uint64)
    heights, values = np.empty(len(leaves), np.uint8), np.empty(len(leaves), np.uint8)
    count = cut_of_bits(words, heights, values)
    return Cut(k, heights[:count].copy(), values[:count].copy())


def valued_cut(leaves: npt.ArrayLike, threshold: float) -> Cut:
    """The cut of values (S,) in [0, 1]; with 0 only equal leaves are merged."""
    given = np.ascontiguousarray(leaves, np.float32)
    k = _power_of(given.shape)
    if not ((given >= 0) & (given <= 1)).all():
        raise ValueError("a valued cut holds values from 0 to 1")
    size = len(given)
    heights, values = np.empty(size, np.uint8), np.empty(size, np.float32)
    means, spreads = np.empty(2 * size, np.float32), np.empty(2 * size, np.float32)
    count = cut_of_leaves(given, k, np.float32(threshold), means, spreads, heights, values)
    return Cut(k, heights[:count].copy(), values[:count].copy())


def encode(cut: Cut) -> bytes:
    """The cut's record; see the module. Values of valued cuts are rounded to 1/65535."""
    out = np.zeros(3 * len(cut) + 2, np.uint8)
    end = put_heights(cut.heights, len(cut), out, 0)
    if cut.values.dtype == np.uint8:
        end = put_bits(cut.values.astype(np.uint8), len(cut), out, end)
    else:
        end = put_values(cut.values.astype(np.float32), len(cut), out, end)
    return out[:end].tobytes()


def decode(record: bytes, k: int, count: int, binary: bool) -> Cut:
    """The cut of `count` nodes that `encode` wrote."""
    data = np.frombuffer(record, np.uint8)
    heights = np.array([height_at(data, 0, i) for i in range(count)], np.uint8)
    if binary:
        return Cut(k, heights, np.array([bit_at(data, 0, count, i) for i in range(count)], np.uint8))
    return Cut(k, heights, np.array([value_at(data, 0, count, i) for i in range(count)], np.float32))


def _power_of(shape: tuple[int, ...]) -> int:
    k = int(shape[0]).bit_length() - 1 if len(shape) == 1 else 0
    if shape != (1 << k,) or not 6 <= k <= HIGHEST_K:
        raise ValueError(f"a cut needs the values of 2^6 to 2^{HIGHEST_K} leaves, not {shape}")
    return k
