"""The surface light field of all elements, kept in half precision: what each sends to each of its cells.

Rows (E · CELLS + SKY + 1): elements' cells, then the environment's rows (`skylight`), then one that is black.
So the light that arrives is one indirect read, wherever it comes from. Blocks of CELLS rows share a power of
two, so that neither a sun's image nor a dark corner leaves the range of 16 bits. What sends the same to all
its cells has one row beyond these, among others of its kind: matte surface, and what no light has reached.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.transport.cells import CELLS, PARTS, RINGS
from studio_plugins.slf.skylight import SKY

F32 = npt.NDArray[np.float32]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]

_SMALLER, _LARGER = np.float32(2.0**-112), 2.0**112
_MOST = 2.0**15  # what a block's largest value is brought below


class LightField:
    """Radiance (rows, 3) ≥ 0 of E elements and of an environment; black when made."""

    def __init__(self, elements: int) -> None:
        self.elements = elements
        rows = self.rows_of(elements)
        self.bits: U16 = np.zeros((rows + elements, 3), np.uint16)
        self.scale: F32 = np.ones(-(-rows // CELLS), np.float32)
        self._first: U32 = np.arange(0, rows, CELLS, dtype=np.uint32)
        """Where each block begins in `bits`."""
        self._cells: U32 = np.full(len(self.scale), CELLS - 1, np.uint32)
        """Bits of a row's number that tell the cells of its block apart: none where all are alike."""
        self._turn_even(0, elements)

    @property
    def nbytes(self) -> int:
        """Memory of what is kept."""
        return self.bits.nbytes + self.scale.nbytes + self._first.nbytes + self._cells.nbytes

    @staticmethod
    def rows_of(elements: int) -> int:
        """How many rows a field has; the last one is black."""
        return elements * CELLS + SKY + 1

    def keep(self, start: int, light: F32) -> None:
        """Light (N, 3, RINGS, PARTS) of elements start … start + N − 1; what is below 0 is 0."""
        scale = _scales(light.reshape(len(light), -1).max(axis=1))
        self.scale[start : start + len(light)] = scale
        scaled = np.maximum(light.reshape(len(light), 3, CELLS), 0)
        scaled *= (_SMALLER / scale)[:, None, None]
        _pack(scaled.view(np.uint32), start * CELLS, self.bits)
        stop = start + len(light)
        self._first[start:stop] = np.arange(start * CELLS, stop * CELLS, CELLS)
        self._cells[start:stop] = CELLS - 1

    def keep_even(self, start: int, light: F32) -> None:
        """Light (N, 3) ≥ 0 that elements start … start + N − 1 send to all their cells."""
        stop = start + len(light)
        scale = _scales(light.max(axis=1))
        halves = (light / scale[:, None]).astype(np.float16)
        self._turn_even(start, stop)
        self.scale[start:stop] = scale
        self.bits[self._first[start:stop]] = halves.view(np.uint16)

    def _turn_even(self, start: int, stop: int) -> None:
        beyond = self.rows_of(self.elements)
        self._first[start:stop], self._cells[start:stop] = np.arange(beyond + start, beyond + stop), 0

    def keep_sky(self, light: F32) -> None:
        """The environment's rows (SKY, 3)."""
        blocks = light.reshape(-1, CELLS, 3)
        scale = _scales(blocks.reshape(len(blocks), -1).max(axis=1))
        self.scale[self.elements : self.elements + len(blocks)] = scale
        scaled = np.ascontiguousarray(blocks.transpose(0, 2, 1)) * (_SMALLER / scale)[:, None, None]
        _pack(scaled.astype(np.float32).view(np.uint32), self.elements * CELLS, self.bits)

    def copy_sky(self, other: LightField) -> None:
        """The environment of another field of as many elements."""
        first = self.elements
        sky = slice(first * CELLS, self.rows_of(first))
        self.bits[sky], self.scale[first:] = other.bits[sky], other.scale[first:]

    def read(self, rows: U32, out: F32) -> None:
        """out (N, 3, RINGS, PARTS), of rows (N, CELLS)."""
        made = out.reshape(-1, 3, CELLS)
        gather(rows, self.bits, self.scale, self._first, self._cells, made.view(np.uint32), made)

    def of(self, start: int, stop: int) -> F32:
        """(N, 3, RINGS, PARTS) of some elements."""
        own = np.arange(start * CELLS, stop * CELLS, dtype=np.uint32)
        made = np.empty((stop - start, 3, RINGS, PARTS), np.float32)
        self.read(own.reshape(-1, CELLS), made)
        return made


def _scales(most: F32) -> F32:
    """Powers of two that bring `most` to at most `_MOST`."""
    _, exponent = np.frexp(np.clip(np.nan_to_num(most), 1e-20, 1e20) / _MOST)
    return np.asarray(np.ldexp(np.float32(1), exponent), np.float32)


@kernel
def _pack(words: U32, first: int, bits: U16) -> None:
    """Floats (N, 3, CELLS), times 2^−112, as words: their halves, to rows `first` and after."""
    cells = words.shape[2]
    for n in range(len(words)):
        out = bits[first + n * cells : first + (n + 1) * cells]
        for i in range(cells):
            for c in range(3):
                word = words[n, c, i]
                rounded = word + np.uint32(0xFFF) + ((word >> np.uint32(13)) & np.uint32(1))
                out[i, c] = np.uint16(min(rounded >> np.uint32(13), np.uint32(0x7BFF)))


@kernel
def gather(rows: U32, bits: U16, scale: F32, first: U32, own: U32, words: U32, light: F32) -> None:
    """light (N, 3, CELLS), whose memory `words` is, of rows (N, CELLS)."""
    cells = rows.shape[1]
    larger = np.float32(_LARGER)
    share = np.empty(cells, np.float32)
    for n in range(len(rows)):
        for i in range(cells):
            block = rows[n, i] >> np.uint32(10)
            share[i] = scale[block] * larger
            row = first[block] + (rows[n, i] & own[block])
            words[n, 0, i] = np.uint32(bits[row, 0]) << np.uint32(13)
            words[n, 1, i] = np.uint32(bits[row, 1]) << np.uint32(13)
            words[n, 2, i] = np.uint32(bits[row, 2]) << np.uint32(13)
        for c in range(3):
            for i in range(cells):
                light[n, c, i] *= share[i]


__all__ = ["LightField"]
