"""What strokes changed of an object's material, point by point.

A stroke's result is no picture: it lies on objects without texture coordinates as well, moves and turns with
them, and pictures keep their detail under it. An object's paint is a cloud of points on its surface with the
changes of its material's parameters there; between them they are interpolated along the surface.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map, readonly
from studio_core.scene.geometry import Table

if TYPE_CHECKING:
    from studio_core.scene.between import Cloud, Weights

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
POINT, LOOK = 7, 3
"""Numbers of a point: place, normal, slot; and of its look."""


@dataclass(frozen=True)
class Paint:
    """Changes of material parameters at N points of an object, added to what its materials have.

    points (1, 1, N, 7): place and unit normal in the object's own frame, and the slot of its material;
    changes by parameter (1, 1, N, C), C = 1 for numbers and 3 for colours. Parameters that a slot's model
    does not have change nothing there. looks (1, 1, N, 3), where they vary: how the slot's picture looked
    there (`shading.looks`), so that changes stay on what looks alike. ValueError where shapes do not fit.
    """

    points: Table
    changes: Mapping[str, Table]
    looks: Table | None = None

    def __post_init__(self) -> None:
        count = self.points.values.shape[2]
        if self.points.values.shape != (1, 1, count, POINT):
            raise ValueError("paint lies on points with a place, a normal and a slot")
        if self.looks is not None and self.looks.values.shape != (1, 1, count, LOOK):
            raise ValueError("the looks do not fit the points")
        for name, table in self.changes.items():
            shape = table.values.shape
            if shape[:3] != (1, 1, count) or shape[3] not in (1, 3):
                raise ValueError(f"the changes of {name!r} do not fit the points")

    @staticmethod
    def of(
        places: npt.ArrayLike,
        normals: npt.ArrayLike,
        slots: npt.ArrayLike,
        changes: Mapping[str, npt.ArrayLike],
        looks: npt.ArrayLike | None = None,
    ) -> Paint:
        """From arrays (N, 3), (N, 3), (N,), by parameter (N,) or (N, 3), and looks (N, 3)."""
        slot = np.asarray(slots, np.float32)[:, None]
        points = np.concatenate(
            [np.asarray(places, np.float32), np.asarray(normals, np.float32), slot], axis=1
        )
        made = {name: _table(np.asarray(change, np.float32)) for name, change in changes.items()}
        known = None if looks is None else _table(np.asarray(looks, np.float32))
        return Paint(_table(points), frozen_map(made), known)

    @property
    def places(self) -> F32:
        """(N, 3) in the object's frame."""
        return self.points.values[0, 0, :, :3]

    @property
    def normals(self) -> F32:
        """(N, 3) in the object's frame."""
        return self.points.values[0, 0, :, 3:6]

    @property
    def slots(self) -> I64:
        """(N,)."""
        return self.points.values[0, 0, :, 6].astype(np.int64)

    def change(self, name: str) -> F32:
        """(N, C) of a parameter."""
        values: F32 = self.changes[name].values[0, 0]
        return values

    def only(self, names: Mapping[str, str]) -> Paint | None:
        """The changes of some parameters alone, by what they shall be called; without slots they leave.

        None if they change nothing.
        """
        changed = np.zeros(len(self.places), np.bool_)
        for name in names.values():
            changed |= self.change(name).any(axis=1)
        if not changed.any():
            return None
        there = np.isin(self.slots, self.slots[changed])
        tables = {new: self.changes[name] for new, name in names.items() if self.change(name).any()}
        if there.all():
            return Paint(self.points, frozen_map(tables), self.looks)
        some = {name: table.values[0, 0, there] for name, table in tables.items()}
        looks = None if self.looks is None else self.looks.values[0, 0, there]
        return Paint.of(self.places[there], self.normals[there], self.slots[there], some, looks)

    @cached_property
    def key(self) -> str:
        """Content hash."""
        parts = (f"{name}:{table.key}" for name, table in sorted(self.changes.items()))
        looks = () if self.looks is None else (self.looks.key,)
        return "-".join((self.points.key, *looks, *parts))

    @property
    def tables(self) -> tuple[Table, ...]:
        """All that it holds."""
        return (self.points, *self.changes.values(), *(() if self.looks is None else (self.looks,)))

    @property
    def cloud(self) -> Cloud:
        """The points, between which is interpolated."""
        from studio_core.scene.between import Cloud  # heavy: whoever reads a scene shall not wait for it

        looks = None if self.looks is None else self.looks.values[0, 0]
        return Cloud(self.places, self.normals, self.slots, looks)

    def weights(
        self,
        places: npt.ArrayLike,
        normals: npt.ArrayLike,
        slots: npt.ArrayLike,
        looks: npt.ArrayLike | None = None,
    ) -> Weights:
        """How much each of the nearest points counts at places (P, 3) with normals (P, 3) and slots (P,).

        With looks (P, 3), and if the points have them, what looks alike counts more.
        """
        from studio_core.scene.between import Cloud, weigh

        known = None if looks is None else np.asarray(looks, np.float32)
        slot = np.asarray(slots, np.int64)
        return weigh(self.cloud, Cloud(np.asarray(places), np.asarray(normals), slot, known))


def _table(values: F32) -> Table:
    columns = values.reshape(len(values), -1)
    return Table(readonly(columns[None, None], np.float32, 1, 1, -1, -1))


__all__ = ["Paint"]
