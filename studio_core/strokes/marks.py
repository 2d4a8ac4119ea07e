"""What a stroke says: at places of surfaces, seen from an eye, the light that is wanted."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.arrays import readonly
from studio_core.scene.geometry import Table

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Marks:
    """N places that a brush went over, all of radiance in scene units.

    object (N,) counts in the stroke's `objects`; place, normal (N, 3) in that object's frame; slot (N,) of
    its materials; eye (N, 3) the point it is seen from, in the world; shown, wanted (N, 3); weight (N,) of
    the brush, 0 … 1. offset (N, 3) is what a solver's model lacked of `shown` when the stroke was made:
    targets of a later solve are wanted − offset, whatever other strokes have changed since. NaN before the
    first solve.
    """

    object: I64
    place: F32
    normal: F32
    slot: I64
    eye: F32
    shown: F32
    wanted: F32
    weight: F32
    offset: F32

    def __len__(self) -> int:
        return len(self.weight)

    @property
    def painted(self) -> npt.NDArray[np.bool_]:
        """(N,) which want other light than there is."""
        return np.asarray(np.not_equal(self.wanted, self.shown).any(axis=1), np.bool_)

    def some(self, which: npt.NDArray[np.generic]) -> Marks:
        """These of them."""
        return Marks(*(getattr(self, field.name)[which] for field in dataclasses.fields(self)))

    def table(self) -> Table:
        """(1, 1, N, WIDTH), as a stroke keeps them."""
        parts = [np.asarray(getattr(self, field.name), np.float32) for field in dataclasses.fields(self)]
        rows = np.concatenate([part.reshape(len(self), -1) for part in parts], axis=1)
        rows = np.where(np.isnan(rows), UNKNOWN, rows)
        return Table(readonly(rows[None, None], np.float32, 1, 1, -1, -1))

    @staticmethod
    def of_table(table: Table) -> Marks:
        """From what `table` made. ValueError where it is not that."""
        values = table.values
        if values.shape[:2] != (1, 1) or values.shape[3] != WIDTH:
            raise ValueError(f"marks of strokes have {WIDTH} numbers each")
        parts = np.split(values[0, 0], np.cumsum(COLUMNS)[:-1], axis=1)
        number, place, normal, slot, eye, shown, wanted, weight, offset = parts
        offset = np.where(offset == UNKNOWN, np.nan, offset)
        counted = np.concatenate([number, slot], axis=1)
        if (counted != np.floor(counted)).any() or (counted < 0).any() or (counted > MOST).any():
            raise ValueError("marks of strokes count objects and slots from 0")
        objects, slots = counted.astype(np.int64).T
        return Marks(objects, place, normal, slots, eye, shown, wanted, weight[:, 0], offset)


COLUMNS = (1, 3, 3, 1, 3, 3, 3, 1, 3)
WIDTH = sum(COLUMNS)
MOST = 1 << 20
"""Objects, and slots of one."""
UNKNOWN = np.float32(-3e38)
"""Stands for NaN in files, which hold finite numbers alone."""

__all__ = ["COLUMNS", "UNKNOWN", "WIDTH", "Marks"]
