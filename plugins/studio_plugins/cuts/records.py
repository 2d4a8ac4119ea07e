"""Tables of records: one pool of numbers, and for each vertex where its record lies in it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_plugins.cuts.intervals import Pool, gather_records, record_type

I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

NEVER = -1
LEAST_GARBAGE = 4 << 20  # numbers
ROW_BYTES = 24


class Records:
    """Records of V vertices over 2^k leaves.

    start, length (V,) say where each lies in `pool`; epoch (V,) of which poses it tells (NEVER: it was never
    made); stamp (V,) when it was written, growing.
    """

    def __init__(self, k: int, count: int) -> None:
        self.k = k
        self.pool: npt.NDArray[Any] = np.zeros(1 << 12, record_type(k))
        self.used = 0
        self.start: I64 = np.zeros(count, np.int64)
        self.length: I32 = np.zeros(count, np.int32)
        self.epoch: I32 = np.full(count, NEVER, np.int32)
        self.stamp: I64 = np.zeros(count, np.int64)

    def __len__(self) -> int:
        return len(self.start)

    @property
    def nbytes(self) -> int:
        """Of the records that are in use, and the tables."""
        return int(self.length.sum()) * self.pool.itemsize + ROW_BYTES * len(self)

    def renumber(self, count: int, to: I64) -> None:
        """For another numbering of the vertices: `to` (V,) is where each has gone, -1: it is no more."""
        kept = np.flatnonzero(to >= 0)
        blank = Records(self.k, count)
        for name in ("start", "length", "epoch", "stamp"):
            rows = getattr(blank, name)
            rows[to[kept]] = getattr(self, name)[kept]
            setattr(self, name, rows)

    def forget(self) -> None:
        """There is no record any more."""
        self.epoch[:] = NEVER
        self.length[:] = 0
        self.used = 0

    def write(self, points: I64, pieces: Sequence[npt.NDArray[Any]], length: I32, stamp: int) -> None:
        """Records of the points, one after the other in the pieces."""
        total = sum(len(piece) for piece in pieces)
        if self.used + total > len(self.pool):
            grown = np.empty(max(2 * len(self.pool), self.used + total), self.pool.dtype)
            grown[: self.used] = self.pool[: self.used]
            self.pool = grown
        place = self.used
        for piece in pieces:
            self.pool[place : place + len(piece)] = piece
            place += len(piece)
        ends = self.used + np.cumsum(length, dtype=np.int64)
        self.start[points], self.length[points] = ends - length, length
        self.stamp[points] = stamp
        self.used = place

    def tidy(self) -> None:
        """Closes the gaps that rewritten records left, when they are more than half of the pool."""
        live = int(self.length.sum())
        if self.used - live < max(live, LEAST_GARBAGE):
            return
        pool = np.empty(live + (live >> 2) + 1024, self.pool.dtype)
        target = np.concatenate([[0], np.cumsum(self.length, dtype=np.int64)])
        gather_records(self.pool, self.start, self.length, target[:-1], pool)
        self.start = target[:-1].copy()
        self.pool, self.used = pool, live


@kernel
def mentioning(pool: Pool, start: I64, length: I32, slots: Bools) -> Bools:
    """(V,) whether a record has a segment of one of the slots (n,)."""
    made = np.zeros(len(start), np.bool_)
    for row in range(len(start)):
        at, end = start[row], start[row] + length[row]
        while at < end:
            if slots[pool[at]]:
                made[row] = True
                break
            at += 2 + 2 * int(pool[at + 1])
    return made


@kernel
def readable(pool: Pool, length: I32, slots: int, leaves: int) -> bool:
    """Whether these are records, one after the other, of so many slots and leaves."""
    at = 0
    for row in range(len(length)):
        end = at + length[row]
        if length[row] < 2 or end > len(pool):
            return False
        while at < end:
            if at + 2 > end or pool[at] >= slots or at + 2 + 2 * int(pool[at + 1]) > end:
                return False
            after = at + 2 + 2 * int(pool[at + 1])
            for pair in range(at + 2, after, 2):
                if pool[pair] > pool[pair + 1] or pool[pair + 1] >= leaves:
                    return False
            at = after
    return at == len(pool)
