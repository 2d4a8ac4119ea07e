"""Binary visibility as intervals of leaves: how a record of a vertex is written, read and combined.

A record is what is known of one shading vertex: segments [slot, count, a₀, b₀, a₁, b₁, …], each the
leaves aₙ … bₙ (both included) that one object blocks; a slot names an object for as long as the store
lives. The vertex' own object also blocks what is below the horizon. Leaves that no segment blocks are
visible. Records are uint16 up to 2^16 leaves, uint32 above.

Scratch bits: word w, bit i stands for leaf 64·w + i.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

U64 = npt.NDArray[np.uint64]
I64 = npt.NDArray[np.int64]
Pool = npt.NDArray[np.unsignedinteger[npt.NBitBase]]

ONES = np.uint64(0xFFFFFFFFFFFFFFFF)
_ONE = np.uint64(1)


def record_type(k: int) -> type[np.uint16] | type[np.uint32]:
    """What records over 2^k leaves are made of."""
    return np.uint16 if k <= 16 else np.uint32


@kernel
def lowest_bit(word: np.uint64) -> int:
    """Place of the lowest set bit of a word that has one: a power of two is exact as a float."""
    power = np.float64(word & (~word + _ONE))
    return int(np.int64(power.view(np.int64) >> 52) - 1023)


@kernel
def clear(words: U64, first: int, last: int) -> None:
    """Clears the bits of leaves first … last."""
    w, end = first >> 6, last >> 6
    head = ONES << np.uint64(first & 63)
    tail = ONES >> np.uint64(63 - (last & 63))
    if w == end:
        words[w] &= ~(head & tail)
        return
    words[w] &= ~head
    for between in range(w + 1, end):
        words[between] = np.uint64(0)
    words[end] &= ~tail


@kernel
def runs_of(words: U64, count: int, out: Pool, place: int) -> int:
    """Writes the runs of set bits of the first `count` words as pairs from `place`; the place after."""
    start = -1
    for w in range(count):
        word = words[w]
        if start < 0 and word == np.uint64(0):
            continue
        if start >= 0 and word == ONES:
            continue
        at = 0
        while at < 64:
            rest = word >> np.uint64(at)
            if start < 0:
                if rest == np.uint64(0):
                    break
                at += lowest_bit(rest)
                start = 64 * w + at
            else:
                rest = (~word) >> np.uint64(at)
                if rest == np.uint64(0):
                    break
                at += lowest_bit(rest)
                out[place] = start
                out[place + 1] = 64 * w + at - 1
                place += 2
                start = -1
    if start >= 0:
        out[place] = start
        out[place + 1] = 64 * count - 1
        place += 2
    return place


@kernel
def hide(pool: Pool, start: int, length: int, skip: npt.NDArray[np.bool_], words: U64) -> None:
    """Clears the bits of all leaves that a record blocks, but for the slots to skip."""
    place, end = start, start + length
    while place < end:
        slot, count = int(pool[place]), int(pool[place + 1])
        place += 2
        if not skip[slot]:
            for pair in range(place, place + 2 * count, 2):
                clear(words, int(pool[pair]), int(pool[pair + 1]))
        place += 2 * count


@kernel
def set_bits(words: U64, first: int, last: int) -> None:
    """Sets the bits of leaves first … last."""
    w, end = first >> 6, last >> 6
    head = ONES << np.uint64(first & 63)
    tail = ONES >> np.uint64(63 - (last & 63))
    if w == end:
        words[w] |= head & tail
        return
    words[w] |= head
    for between in range(w + 1, end):
        words[between] = ONES
    words[end] |= tail


@kernel
def gather_records(pool: Pool, start: I64, length: npt.NDArray[np.int32], target: I64, out: Pool) -> None:
    """Copies records to their new places."""
    for row in range(len(start)):
        out[target[row] : target[row] + length[row]] = pool[start[row] : start[row] + length[row]]


@kernel
def relabel(pool: Pool, length: npt.NDArray[np.int32], names: I64) -> int:
    """Renames the slots of records that lie one after the other: slot s becomes names[s], in place.

    Segments of slots without a name (−1) are left out, and records that had one get shorter. Returns how
    many numbers are left.
    """
    place = target = 0
    for row in range(len(length)):
        end = place + length[row]
        first = target
        while place < end:
            size = 2 + 2 * int(pool[place + 1])
            name = names[pool[place]]
            if name >= 0:
                for i in range(size):
                    pool[target + i] = pool[place + i]
                pool[target] = name
                target += size
            place += size
        length[row] = target - first
    return target
