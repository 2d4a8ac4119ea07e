"""Where objects stood when something was traced, and which of it has to be traced again.

What an object blocks at another's vertices holds as long as neither turns or changes its size and the way
from one to the other stays: furniture that is moved as a group keeps what it knows of itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.scene.transform import Transform, rotation_matrix

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of the objects of some slots: turn (n, 3, 3), scale (n,), place (n, 3); row[slot] or -1."""

    row: I64
    turn: F64
    scale: F64
    place: F64

    @staticmethod
    def of(transforms: tuple[Transform, ...], slots: I64, count: int) -> Poses:
        """The poses of objects that have these of `count` slots."""
        row = np.full(count, -1, np.int64)
        row[slots] = np.arange(len(slots))
        turn = np.array([rotation_matrix(t.rotation) for t in transforms], np.float64).reshape(-1, 3, 3)
        scale = np.array([t.scale for t in transforms], np.float64)
        place = np.array([t.translation for t in transforms], np.float64).reshape(-1, 3)
        return Poses(row, turn, scale, place)

    def same(self, then: Poses, slots: I64) -> bool:
        """Whether the objects, those of `slots`, are the same as then and nothing is stale."""
        return len(self.scale) == len(then.scale) and self.hold(then, slots)

    def hold(self, then: Poses, slots: I64) -> bool:
        """Whether nothing is `stale`: all objects of `slots` were there, and have moved as one if at all."""
        if not len(slots):
            return True
        there = slots[slots < len(then.row)]
        rows = then.row[there]
        if len(there) < len(slots) or (rows < 0).any():
            return False
        mine = self.row[slots]
        moved = self.place[mine] - then.place[rows]
        apart = (moved.max(axis=0) - moved.min(axis=0)).max()
        if apart > _SAME * (1 + np.abs(moved).max()):
            return False
        turned = np.abs(then.turn[rows] - self.turn[mine]).max() > _SAME
        sized = np.abs(then.scale[rows] / self.scale[mine] - 1).max() > _SAME
        return not turned and (not sized or len(slots) == 1)


def stale(then: Poses, now: Poses, slots: I64) -> Bools:
    """(n, n): whether what object r's vertices knew of object j does not hold any more; n = len(slots).

    Objects that were not there then are stale for all. The diagonal is an object's view of itself.
    """
    count = len(slots)
    rows = np.full(count, -1, np.int64)
    there = slots < len(then.row)
    rows[there] = then.row[slots[there]]
    known = rows >= 0
    rows = np.maximum(rows, 0)
    if not count or not len(then.scale):
        return np.ones((count, count), np.bool_)
    mine = now.row[slots]
    turned = np.abs(then.turn[rows] - now.turn[mine]).max(axis=(1, 2)) > _SAME
    sized = np.abs(then.scale[rows] / now.scale[mine] - 1) > _SAME
    changed = turned | sized | ~known
    moved = now.place[mine] - then.place[rows]
    apart = np.abs(moved[:, None] - moved[None]).max(axis=2)
    made = (apart > _SAME * (1 + np.abs(moved).max())) | changed[:, None] | changed[None]
    np.fill_diagonal(made, turned | ~known)
    return np.asarray(made)
