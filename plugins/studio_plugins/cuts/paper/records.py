"""Many cuts behind one another, written as heights and values, that grow as cuts are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_plugins.cuts.paper.codes import HEIGHT_BITS, INDEX_BITS

U8 = npt.NDArray[np.uint8]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

BINARY_BITS, VALUE_BITS = 1, 16


@dataclass(frozen=True)
class CutSizes:
    """How many cuts there are, of how many nodes, and how many of these are leaves of the tree."""

    cuts: int = 0
    nodes: int = 0
    leaves: int = 0

    def __add__(self, other: CutSizes) -> CutSizes:
        return CutSizes(self.cuts + other.cuts, self.nodes + other.nodes, self.leaves + other.leaves)

    @property
    def average(self) -> float:
        """Nodes a cut."""
        return self.nodes / self.cuts if self.cuts else 0.0

    def height_bytes(self, value_bits: int) -> float:
        """Bytes with four bits of height a node (figure 5 (a))."""
        return self.nodes * (HEIGHT_BITS + value_bits) / 8

    def index_bytes(self, value_bits: int) -> float:
        """Bytes with two bytes of index a node (figure 5 (b))."""
        return self.nodes * (INDEX_BITS + value_bits) / 8

    def split_bytes(self, value_bits: int) -> float:
        """Bytes with the splits above the cut in pre-order."""
        return (2 * self.nodes - self.cuts - self.leaves + self.nodes * value_bits) / 8


class Records:
    """Records of cuts: cut i is `data[starts[i]:]`, of counts[i] nodes.

    Arrays are longer than what they hold; kernels get them through `addresses` and must run before the
    next `append`.
    """

    def __init__(self) -> None:
        self.starts: I64 = np.zeros(64, np.int64)
        self.counts: I32 = np.zeros(64, np.int32)
        self.data: U8 = np.zeros(4096, np.uint8)
        self.used = 0
        self.sizes = CutSizes()

    def __len__(self) -> int:
        return self.sizes.cuts

    @property
    def nbytes(self) -> int:
        """Bytes in use: the records, and 12 a cut to find them."""
        return self.used + 12 * len(self)

    def append(self, lengths: I64, counts: I32, leaves: int, data: U8) -> None:
        """Adds cuts whose records are `lengths` bytes long in `data`; `leaves` counts nodes of height 0."""
        have, more = len(self), len(counts)
        self.starts = _with_room(self.starts, have, more)
        self.counts = _with_room(self.counts, have, more)
        self.data = _with_room(self.data, self.used, len(data))
        ends = self.used + np.cumsum(lengths)
        self.starts[have : have + more] = ends - lengths
        self.counts[have : have + more] = counts
        self.data[self.used : self.used + len(data)] = data
        self.used += len(data)
        self.sizes += CutSizes(more, int(counts.sum(dtype=np.int64)), leaves)

    @property
    def addresses(self) -> tuple[int, int, int]:
        """Of starts, counts and data."""
        return self.starts.ctypes.data, self.counts.ctypes.data, self.data.ctypes.data


def _with_room(array: npt.NDArray[Any], have: int, more: int) -> npt.NDArray[Any]:
    if have + more <= len(array):
        return array
    grown = np.empty(max(have + more, len(array) * 3 // 2), array.dtype)
    grown[:have] = array[:have]
    return grown
