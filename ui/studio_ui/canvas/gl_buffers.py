"""Vertex buffers that are told what changed, and how much went to the GPU for it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from vispy import gloo

F32 = npt.NDArray[np.float32]
Bools = npt.NDArray[np.bool_]

GAP = 8
"""Unchanged vertices between changed ones that are uploaded with them, rather than in two pieces."""
PIECES = 64
"""With more of them larger gaps are filled."""
GROWTH = 1.25


@dataclass
class Tally:
    """What went to the GPU: bytes of vertices' colours, of everything else, uploads and draw calls."""

    colours: int = 0
    shapes: int = 0
    maps: int = 0
    uploads: int = 0
    draws: int = 0

    def copy(self) -> Tally:
        """As it is now."""
        return Tally(self.colours, self.shapes, self.maps, self.uploads, self.draws)

    def since(self, before: Tally) -> Tally:
        """What came after `before`."""
        pairs = zip(vars(self).items(), vars(before).values(), strict=True)
        return Tally(**{name: now - then for (name, now), then in pairs})


class Attribute:
    """Floats (N, width ≤ 4) on the GPU with room for more; `host` is what is there."""

    def __init__(self, width: int, tally: Tally, what: str) -> None:
        self.width, self._tally, self._what = width, tally, what
        self.host: F32 = np.zeros((0, width), np.float32)
        self._seen = False  # whether anything was ever known
        self.buffer: Any = None
        self.room = 0

    def resize(self, room: int) -> None:
        """A buffer for so many vertices, as all that are drawn together must be; another one is empty."""
        if room != self.room:
            self.delete()
            self.room = room

    def replace_tail(self, values: F32) -> None:
        """Hold `values`; what begins alike is not uploaded again. `values` are not copied."""
        common = min(len(values), len(self.host))
        differs = (values[:common] != self.host[:common]).any(axis=1)
        first = int(differs.argmax()) if differs.any() else common
        if first < len(values):
            self._upload(values, first, len(values))
        if first < common or len(values) >= len(self.host):
            self.host = values

    def update(self, values: F32, known: Bools, typical: F32 | None = None) -> None:
        """Hold `values` (N, width) where they are `known`; those that were other ones are uploaded.

        New vertices of which nothing is known get the mean of the others, or `typical` (width,).
        """
        values = np.ascontiguousarray(values, np.float32)
        if not self._seen and known.any():
            self._seen, self.host = True, self.host[:0]  # what was there were guesses
        count, held = len(values), len(self.host)
        if held < count:
            self.host = np.concatenate([self.host, self._unknown(values[held:], known[held:], typical)])
        part = self.host[:count]
        different = values != part
        changed = different[:, 0].copy()
        for column in range(1, self.width):
            changed |= different[:, column]
        changed &= known
        part[changed] = values[changed]
        changed[held:] = True
        self._pieces(changed)

    def _unknown(self, values: F32, known: Bools, typical: F32 | None) -> F32:
        """What vertices that nothing is known of are shown with: see `update`."""
        made = np.zeros_like(values)
        if known.any():
            made[:] = values[known].mean(axis=0)
        elif len(self.host):
            made[:] = self.host.mean(axis=0)
        elif typical is not None:
            made[:] = typical
        return made

    def _pieces(self, changed: Bools) -> None:
        """Upload what changed, in as few pieces as make sense."""
        own = np.flatnonzero(changed)
        if not len(own):
            return
        steps, gap = np.diff(own), GAP
        while np.count_nonzero(steps > gap) > PIECES:
            gap *= 2
        ends = np.flatnonzero(steps > gap)
        starts = own[np.concatenate([[0], ends + 1])]
        stops = own[np.concatenate([ends, [len(own) - 1]])] + 1
        for start, stop in zip(starts.tolist(), stops.tolist(), strict=True):
            self._upload(self.host, start, stop)

    def _upload(self, values: F32, start: int, stop: int) -> None:
        if self.buffer is None:
            self.room = max(self.room, len(values))
            whole = np.zeros((self.room, self.width), np.float32)
            whole[: len(values)] = values
            self.buffer = gloo.VertexBuffer(whole)
            moved = whole.nbytes
        else:
            piece = np.ascontiguousarray(values[start:stop], np.float32)
            self.buffer.set_subdata(piece, start)
            moved = piece.nbytes
        setattr(self._tally, self._what, getattr(self._tally, self._what) + moved)
        self._tally.uploads += 1

    def delete(self) -> None:
        """Give it back."""
        if self.buffer is not None:
            self.buffer.delete()
        self.buffer, self.host = None, np.zeros((0, self.width), np.float32)
        self._seen = False
