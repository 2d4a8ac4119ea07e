"""What two vertices tell of one that refinement put between them.

Where both see all or nothing of a packet of eight leaves, and of those around it, so most likely does the
vertex between: an outline that passes between the two makes them disagree, or lies in a packet that one of
them sees in part. One ray checks the guess, since what is near may stand between the two unseen by either;
only the packets left over are traced.
"""

from __future__ import annotations

import functools

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.directions import cell_of_leaf, leaf_of_cell
from studio_plugins.cuts.intervals import ONES, U64, Pool, set_bits

I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

_NONE = np.uint64(0)
_BYTE = np.uint64(0xFF)


@functools.lru_cache(maxsize=8)
def packets_around(k: int) -> I32:
    """(S/8, 8) the packets of eight leaves around each, over the horizon into the other hemisphere too."""
    made = np.empty((1 << (k - 3), 8), np.int32)
    _around(k - 3, made)
    made.flags.writeable = False
    return made


@kernel
def _around(k: int, out: I32) -> None:
    columns, rows = 1 << (k // 2), 1 << ((k - 1) // 2)
    for packet in range(len(out)):
        hemisphere, column, row = cell_of_leaf(packet, k)
        place = 0
        for dc in range(-1, 2):
            for dr in range(-1, 2):
                if dc == 0 and dr == 0:
                    continue
                c, r, h = column + dc, row + dr, hemisphere
                if c < 0 or c >= columns or r < 0 or r >= rows:
                    h = 1 - hemisphere  # both squares have the horizon for their border
                    c, r = min(max(c, 0), columns - 1), min(max(r, 0), rows - 1)
                out[packet, place] = leaf_of_cell(h, c, r, k)
                place += 1


@kernel
def index_record(pool: Pool, start: int, length: int, where: I64) -> None:
    """where[slot] becomes the place of each segment of a record."""
    at = start
    while at < start + length:
        where[pool[at]] = at
        at += 2 + 2 * int(pool[at + 1])


@kernel
def segment_bits(pool: Pool, at: int, words: U64) -> None:
    """Sets the bits of what a segment blocks and no others; at < 0: there is none."""
    words[:] = _NONE
    if at >= 0:
        for pair in range(at + 2, at + 2 + 2 * int(pool[at + 1]), 2):
            set_bits(words, int(pool[pair]), int(pool[pair + 1]))


@kernel
def guess(a: U64, b: U64, around: I32, open_: U64, sure: U64) -> None:
    """What two vertices agree on for one between them.

    sure gets the bits of all packets of eight leaves of which both see all or nothing, as do those around
    them; a keeps what is blocked there. `around` (S/8, 8) names the packets around each; open_ is scratch.
    """
    open_[:] = _NONE
    for w in range(len(a)):
        differs = a[w] ^ b[w]
        if differs == _NONE and (a[w] == _NONE or a[w] == ONES):
            continue
        for part in range(8):
            shift = np.uint64(8 * part)
            byte = (a[w] >> shift) & _BYTE
            other = (differs >> shift) & _BYTE
            if other != _NONE or (byte != _NONE and byte != _BYTE):
                packet = 8 * w + part
                open_[w] |= _BYTE << shift
                for i in range(8):
                    near = around[packet, i]
                    open_[near >> 3] |= _BYTE << np.uint64(8 * (near & 7))
    for w in range(len(a)):
        sure[w] = ~open_[w]
        a[w] &= sure[w]
