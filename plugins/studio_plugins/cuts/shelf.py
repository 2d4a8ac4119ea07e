"""Records of vertices that are gone, put by: what undo brings back needs no ray."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import NodeId
from studio_core.scene.shading_mesh import ShadingMesh
from studio_plugins.cuts.intervals import gather_records
from studio_plugins.cuts.records import NEVER, Records

I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

MOST = 1 << 25
"""Numbers that are kept at most: 64 MiB up to 2^16 leaves."""


@dataclass(frozen=True, eq=False)
class PutBy:
    """Records of the first vertices of a mesh, one after the other; epoch (n,) of which poses each tells."""

    mesh: ShadingMesh
    pool: npt.NDArray[Any]
    length: I32
    epoch: I32


class Shelf:
    """What was put by last, by object and how finely it was split; the longest unused goes first."""

    def __init__(self) -> None:
        self._held: OrderedDict[tuple[NodeId, float], PutBy] = OrderedDict()

    @property
    def epochs(self) -> set[int]:
        """Poses that something here tells of."""
        return {int(epoch) for held in self._held.values() for epoch in np.unique(held.epoch)} - {NEVER}

    def put(self, node: NodeId, mesh: ShadingMesh, records: Records, rows: slice) -> None:
        """Keeps these rows of the records, those of `mesh`, if anything is known of them."""
        epoch = records.epoch[rows].copy()
        if not (epoch != NEVER).any():
            return
        start, length = (
            records.start[rows],
            np.where(epoch != NEVER, records.length[rows], 0).astype(np.int32),
        )
        ends = np.cumsum(length, dtype=np.int64)
        pool = np.empty(int(ends[-1]), records.pool.dtype)
        gather_records(records.pool, start, length, ends - length, pool)
        self._held[node, mesh.edge] = PutBy(mesh, pool, length, epoch)
        self._held.move_to_end((node, mesh.edge))
        while len(self._held) > 1 and sum(len(held.pool) for held in self._held.values()) > MOST:
            self._held.popitem(last=False)

    def take(self, node: NodeId, mesh: ShadingMesh, records: Records, first: int, stamp: int) -> bool:
        """Gives back what is known of vertices of `mesh`, from row `first`; whether there was anything."""
        held = self._held.pop((node, mesh.edge), None)
        count = common(held.mesh, mesh) if held is not None else 0
        if held is None or not count:
            return False
        rows = first + np.arange(count)
        pool = held.pool[: int(held.length[:count].sum())]
        known = held.epoch[:count] != NEVER
        records.write(rows[known], [pool], held.length[:count][known], stamp)
        records.epoch[rows] = held.epoch[:count]
        return True


def common(before: ShadingMesh, after: ShadingMesh) -> int:
    """How many first vertices two meshes share: all of the shorter where one is the other refined."""
    if before is after:
        return len(after)
    count = min(len(before), len(after))
    same = (
        before.edge == after.edge
        and np.array_equal(before.positions[:count], after.positions[:count])
        and np.array_equal(before.normals[:count], after.normals[:count])
    )
    return count if same else 0
