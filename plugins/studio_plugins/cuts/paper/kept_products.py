"""The cuts of v_k that receivers have, in the blocks they were made in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

U16 = npt.NDArray[np.uint16]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
F32 = npt.NDArray[np.float32]


@dataclass(eq=False)
class _Block:
    numbers: U16
    values: F32
    live: int


class KeptProducts:
    """Heap numbers and values of the nodes of each of `count` receivers that has a product.

    A block of receivers goes when none of them needs it any more.
    """

    def __init__(self, count: int) -> None:
        self._blocks: dict[int, _Block] = {}
        self._next = 0
        self._block_of: I64 = np.full(count, -1, np.int64)
        self._first: I64 = np.zeros(count, np.int64)
        self._size: I64 = np.zeros(count, np.int64)

    @property
    def known(self) -> I64:
        """Receivers that have a product."""
        return np.flatnonzero(self._block_of >= 0).astype(np.int64)

    @property
    def nodes(self) -> int:
        """Nodes of all products."""
        return int(self._size[self._block_of >= 0].sum())

    @property
    def nbytes(self) -> int:
        """Bytes of all blocks."""
        return sum(block.numbers.nbytes + block.values.nbytes for block in self._blocks.values())

    def without(self, points: I64) -> I64:
        """Those of `points` that have none, each once."""
        return np.unique(points[self._block_of[points] < 0])

    def put(self, points: I64, sizes: I32, numbers: U16, values: F32) -> None:
        """The products of `points`, which had none, one behind the other."""
        ends = np.cumsum(sizes, dtype=np.int64)
        self._first[points], self._size[points] = ends - sizes, sizes
        self._block_of[points] = self._next
        self._blocks[self._next] = _Block(numbers, values, len(points))
        self._next += 1

    def drop(self, points: I64) -> None:
        """Forgets the products of `points`."""
        blocks = self._block_of[points]
        self._block_of[points] = -1
        found, lost = np.unique(blocks[blocks >= 0], return_counts=True)
        for number, gone in zip(found.tolist(), lost.tolist(), strict=True):
            self._blocks[number].live -= gone
            if not self._blocks[number].live:
                del self._blocks[number]

    def addresses(self, points: I64) -> tuple[I64, I64, I64]:
        """For each of `points`, which all have a product: addresses of its numbers and values, and its size.

        Valid until the next `put` or `drop`.
        """
        blocks, first = self._block_of[points], self._first[points]
        found, where = np.unique(blocks, return_inverse=True)
        numbers = np.array([self._blocks[b].numbers.ctypes.data for b in found.tolist()], np.int64)
        values = np.array([self._blocks[b].values.ctypes.data for b in found.tolist()], np.int64)
        return numbers[where] + 2 * first, values[where] + 4 * first, self._size[points]

    def cut(self, point: int) -> tuple[I64, F32]:
        """Heap numbers and values of one receiver."""
        block = self._blocks[int(self._block_of[point])]
        part = slice(int(self._first[point]), int(self._first[point] + self._size[point]))
        return block.numbers[part].astype(np.int64), block.values[part]
