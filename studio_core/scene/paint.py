"""What strokes changed of an object's material, point by point.

A stroke's result is no picture: it lies on objects without texture coordinates as well, moves and turns with
them, and pictures keep their detail under it. An object's paint is a cloud of points on its surface with the
changes of its material's parameters there; between them they are interpolated along the surface.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map, readonly
from studio_core.scene.geometry import Table

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
NEAREST = 8
"""Points between which is interpolated."""
POINT = 7
"""Numbers of a point: place, normal, slot."""


@dataclass(frozen=True)
class Paint:
    """Changes of material parameters at N points of an object, added to what its materials have.

    points (1, 1, N, 7): place and unit normal in the object's own frame, and the slot of its material;
    changes by parameter (1, 1, N, C), C = 1 for numbers and 3 for colours. Parameters that a slot's model
    does not have change nothing there. ValueError where shapes do not fit.
    """

    points: Table
    changes: Mapping[str, Table]

    def __post_init__(self) -> None:
        count = self.points.values.shape[2]
        if self.points.values.shape != (1, 1, count, POINT):
            raise ValueError("paint lies on points with a place, a normal and a slot")
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
    ) -> Paint:
        """From arrays (N, 3), (N, 3), (N,), and by parameter (N,) or (N, 3)."""
        slot = np.asarray(slots, np.float32)[:, None]
        points = np.concatenate(
            [np.asarray(places, np.float32), np.asarray(normals, np.float32), slot], axis=1
        )
        made = {name: _table(np.asarray(change, np.float32)) for name, change in changes.items()}
        return Paint(_table(points), frozen_map(made))

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

    @cached_property
    def key(self) -> str:
        """Content hash."""
        parts = (f"{name}:{table.key}" for name, table in sorted(self.changes.items()))
        return "-".join((self.points.key, *parts))

    def weights(self, places: npt.ArrayLike, normals: npt.ArrayLike, slots: npt.ArrayLike) -> Weights:
        """How much each of the nearest points counts at places (P, 3) with normals (P, 3) and slots (P,)."""
        from scipy.spatial import cKDTree  # heavy: whoever reads a scene shall not wait for it

        where, facing = np.asarray(places, np.float64), np.asarray(normals, np.float64)
        slot = np.asarray(slots, np.int64)
        near = min(NEAREST, len(self.places))
        which = np.zeros((len(where), near), np.int64)
        share = np.zeros((len(where), near), np.float32)
        for number in np.unique(slot).tolist():
            own, points = np.flatnonzero(slot == number), np.flatnonzero(self.slots == number)
            if not len(points):
                continue
            count = min(near, len(points))
            found = cKDTree(self.places[points]).query(where[own], k=count)
            distance, index = (one.reshape(len(own), count) for one in found)
            reach = np.maximum(distance[:, -1:], 1e-9) * (1 + 1e-6)
            alike = np.maximum((self.normals[points][index] * facing[own, None]).sum(axis=2), 0)
            weight = np.maximum(1 - distance / reach, 1e-6) ** 2 * np.maximum(alike, 1e-3) ** 2
            which[own, :count] = points[index]
            share[own, :count] = weight / weight.sum(axis=1, keepdims=True)
        return Weights(which, share)


@dataclass(frozen=True, eq=False)
class Weights:
    """Of P places: the numbers of the nearest points (P, K), and their shares (P, K); all 0: no paint."""

    which: I64
    share: F32

    def __call__(self, values: F32) -> F32:
        """(P, C) between values (N, C) of points."""
        return np.asarray(np.einsum("pk,pkc->pc", self.share, values[self.which]), np.float32)


def _table(values: F32) -> Table:
    columns = values.reshape(len(values), -1)
    return Table(readonly(columns[None, None], np.float32, 1, 1, -1, -1))


__all__ = ["NEAREST", "Paint", "Weights"]
