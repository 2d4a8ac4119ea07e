"""What elements make of the environment's light, kept while the eye moves (section 6.4).

Of each element the matte light, and for each term with a lobe a whole lumitexel; made when they are first
asked for.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.parallel import Workers
from studio_plugins.slf.lumitexels import LightField
from studio_plugins.slf.series import convolve, half_kernels, half_level, light_of, matte_of
from studio_plugins.slf.splatting import blocks
from studio_plugins.slf.whole import CHUNK, Whole

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _Lobes:
    """What one term sends; place (E / CHUNK,) where a chunk of elements begins in the field, −1: nowhere."""

    field: LightField
    place: I64

    @staticmethod
    def of(shine: F64) -> _Lobes:
        """Of elements with so much of it (E,)."""
        has = np.logical_or.reduceat(shine != 0, np.arange(0, len(shine), CHUNK))
        return _Lobes(LightField(int(has.sum()) * CHUNK), np.where(has, (np.cumsum(has) - 1) * CHUNK, -1))


class Preconvolved:
    """See the module. matte (E, 3) is what elements send that are white and matte. Owned by one thread."""

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._state: tuple[object, ...] = ()
        self._own: F64 = np.zeros((0, 0, 3))
        self._made: Bools = np.zeros(0, np.bool_)
        self._lobes: list[_Lobes] = []
        self.matte: F64 = np.zeros((0, 3))

    @property
    def nbytes(self) -> int:
        """Memory of what is kept."""
        return self.matte.nbytes + sum(one.field.nbytes for one in self._lobes)

    def update(self, whole: Whole, own: F64, used: Bools) -> int:
        """Brings elements that are used (E,) up to date, and says how many of all were made.

        own (E, T, 3) are matte part, shine and level of terms.
        """
        state = whole.state
        same = len(state) == len(self._state) and all(map(operator.is_, state, self._state))
        if not same or not np.array_equal(own, self._own):
            self._state, self._own = state, own
            self._made, self.matte = np.zeros(len(own), np.bool_), np.zeros((len(own), 3))
            self._lobes = [_Lobes.of(own[:, term, 1]) for term in range(own.shape[1] if len(own) else 0)]
        todo = blocks(used & ~self._made, CHUNK)
        if not todo:
            return 0
        dark = whole.dark()

        def body(first: int, last: int) -> None:
            for start, stop in todo[first:last]:
                self._make(whole, dark, start, stop)

        self._workers.run(len(todo), 4, body)
        for start, stop in todo:
            self._made[start:stop] = True
        return sum(stop - start for start, stop in todo)

    def _make(self, whole: Whole, dark: LightField, start: int, stop: int) -> None:
        places = [int(one.place[start // CHUNK]) for one in self._lobes]
        if max(places) < 0:
            self.matte[start:stop] = whole.matte(dark, start, stop)
            return
        series = whole.incident(dark, start, stop)
        self.matte[start:stop] = matte_of(series)
        sent = np.empty_like(series)
        for term, (lobes, place) in enumerate(zip(self._lobes, places, strict=True)):
            if place >= 0:
                convolve(series, half_kernels(), half_level(self._own[start:stop, term, 2]), sent)
                lobes.field.keep(place, light_of(sent))

    def sent(self, term: int, start: int, stop: int) -> F32:
        """(N, 3, RINGS, PARTS) what a term that shines sends from elements of one chunk."""
        lobes = self._lobes[term]
        place = int(lobes.place[start // CHUNK])
        return lobes.field.of(place, place + stop - start)


__all__ = ["Preconvolved"]
