"""The visibility of all shading vertices: exact records, and coarse ones while a hand moves something.

Owned by the compute thread and changed in place; what was traced stays when a job is cancelled. Stages
tell by stamps which vertices have another record than before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.parallel import Workers
from studio_core.scene.nodes import NodeId
from studio_core.scene.shading_mesh import ShadingMesh
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.interpolation import parents
from studio_core.shading.job import Job
from studio_plugins.cuts.beams import BeamTable, parts_of
from studio_plugins.cuts.glimpse import Glow, glimpse_records
from studio_plugins.cuts.guides import packets_around
from studio_plugins.cuts.intervals import gather_records, relabel
from studio_plugins.cuts.occluders import Occluders
from studio_plugins.cuts.poses import Poses, stale
from studio_plugins.cuts.records import NEVER, Records, mentioning, readable
from studio_plugins.cuts.shelf import Shelf, common
from studio_plugins.cuts.tracer import (
    COUNTS,
    GUESSED,
    HORIZON,
    PACKETS,
    RAYS,
    SKIPPED,
    TRACED,
    trace_records,
)

I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Points = I64

CHUNK = {True: 32, False: 160}  # of whole records, and of coarse ones
BATCH = 4096
MOST_SLOTS = 60_000
_NUMBERS_A_RECORD = {True: 4096, False: 512}  # room that is made at first


@dataclass(frozen=True, eq=False)
class Sources:
    """Where the visibility of each vertex is to be read: an exact record and a coarse one.

    The exact one counts but for the slots skip[row, owner] (E, occluders, slots), the coarse one wholly;
    owner (V,) is the occluder that a vertex belongs to.
    `stamp` (V,) tells when either was written (0: there is none), `exact_stamp` when the exact one was.
    Row 0 skips only what is gone: no coarse record is needed.
    """

    pool: npt.NDArray[Any]
    start: I64
    length: I32
    coarse_pool: npt.NDArray[Any]
    coarse_start: I64
    coarse_length: I32
    row: I32
    owner: I32
    skip: Bools
    stamp: I64
    exact_stamp: I64


class VisibilityStore:
    """Visibility over 2^k leaves; see the module.

    `generation` grows when vertices get other numbers; `gone_to` (V before,) says which, -1 for none.
    """

    def __init__(self, k: int, workers: Workers) -> None:
        self.k = k
        self.counts = np.zeros(COUNTS, np.int64)
        self.generation = 0
        self.gone_to: I64 = np.zeros(0, np.int64)
        self.stamp = 0
        self.exact = Records(k, 0)
        self._coarse = Records(k, 0)
        self._coarse_level = 0.0
        self._coarse_row: I32 = np.zeros(0, np.int32)
        self._coarse_stale: list[Bools] = []
        self._workers = workers
        self._beams = BeamTable()
        self._slot_of: dict[object, int] = {}
        self._slots: I64 = np.zeros(0, np.int64)
        self._alive: Bools = np.zeros(1, np.bool_)
        self._poses: dict[int, Poses] = {}
        self._holds: Bools = np.zeros(2, np.bool_)  # by epoch: whether all that it tells is as now
        self._shelf = Shelf()
        self._now = 0
        self._meshes: dict[NodeId, tuple[ShadingMesh, slice]] = {}
        self._surfaces: Surfaces | None = None
        self._occluders: Occluders | None = None
        self._owner: I32 = np.zeros(0, np.int32)

    # -- what is shaded ------------------------------------------------------------------------------

    def follow(self, surfaces: Surfaces, occluders: Occluders) -> None:
        """Turn to another state of the scene; what holds in it too is kept."""
        if surfaces is self._surfaces and occluders is self._occluders:
            return
        keys = occluders.keys
        slots = np.array([self._slot_of.setdefault(key, len(self._slot_of)) for key in keys], np.int64)
        self._renumber(surfaces)
        alive = np.zeros(max(len(self._slot_of), 1), np.bool_)
        alive[slots] = True
        other = alive.copy()
        other[: len(self._alive)] ^= self._alive
        if other[: len(self._alive)].any():  # what is gone hides nothing any more, what is back does again
            told = mentioning(self.exact.pool, self.exact.start, self.exact.length, other)
            self.stamp += bool(told.any())
            self.exact.stamp[told] = self.stamp
        self._slots, self._alive = slots, alive
        poses = Poses.of(occluders.transforms, slots, len(self._alive))
        known = self._poses.get(self._now)
        if known is None or not poses.same(known, slots):
            self._now = max(self._poses, default=0) + 1
            self._poses[self._now] = poses
            self._forget_coarse()
        in_use = {int(epoch) for epoch in np.unique(self.exact.epoch)} | self._shelf.epochs | {self._now}
        self._poses = {epoch: kept for epoch, kept in self._poses.items() if epoch in in_use}
        self._holds = np.zeros(self._now + 2, np.bool_)  # the last is that of NEVER
        for epoch, kept in self._poses.items():
            self._holds[epoch] = poses.hold(kept, slots)
        self._surfaces, self._occluders = surfaces, occluders
        self._owner = occluders.of[surfaces.mesh.object]

    def _renumber(self, surfaces: Surfaces) -> None:
        mesh = surfaces.mesh
        meshes = {
            placed.node: (placed.mesh, mesh.vertices_of(index)) for index, placed in enumerate(mesh.objects)
        }
        same = self._meshes.keys() == meshes.keys() and all(
            self._meshes[node][0] is shape and self._meshes[node][1] == there
            for node, (shape, there) in meshes.items()
        )
        if same and len(self.exact) == len(mesh):
            return
        self.gone_to = np.full(len(self.exact), -1, np.int64)
        stay = set()
        for node, (before, old) in self._meshes.items():
            shape, there = meshes.get(node, (None, old))
            kept = common(before, shape) if shape is not None else 0
            if kept:
                self.gone_to[old.start : old.start + kept] = np.arange(there.start, there.start + kept)
                stay.add(node)
            else:
                self._shelf.put(node, before, self.exact, old)
        self.generation += 1
        self.exact.renumber(len(mesh), self.gone_to)
        for node, (shape, there) in meshes.items():
            if node not in stay and self._shelf.take(node, shape, self.exact, there.start, self.stamp + 1):
                self.stamp += 1
        self._coarse = Records(self.k, len(mesh))
        self._forget_coarse()
        self._meshes = meshes

    def _forget_coarse(self) -> None:
        self._coarse.forget()
        self._coarse_level = 0.0
        self._coarse_row = np.zeros(len(self._coarse), np.int32)
        self._coarse_stale = []

    # -- what is known -------------------------------------------------------------------------------

    def _stale(self, points: Points) -> tuple[I64, Bools]:
        """For each point a row of (E, n, n) tables of which object's occlusion is out of date for which."""
        epochs, row = np.unique(self.exact.epoch[points], return_inverse=True)
        now, count = self._poses[self._now], len(self._slots)
        tables = [
            stale(self._poses[int(epoch)], now, self._slots)
            if int(epoch) in self._poses
            else np.ones((count, count), np.bool_)
            for epoch in epochs
        ]
        return row.astype(np.int64), np.array(tables, np.bool_).reshape(-1, count, count)

    def unknown(self, points: Points) -> Points:
        """Those of the points whose exact record has to be traced, wholly or in part.

        What holds of one thing's vertices holds of all: where any moved by itself, all see it elsewhere.
        """
        made: Points = points[~self._holds[self.exact.epoch[points]]]
        return made

    def unseen(self, points: Points) -> bool:
        """Whether of none of the points anything is known."""
        return not ((self.exact.epoch[points] != NEVER) | (self._coarse.epoch[points] != NEVER)).any()

    def never(self, points: Points) -> int:
        """Of how many of the points there is no exact record of any time."""
        return int((self.exact.epoch[points] == NEVER).sum())

    def sources(self) -> Sources:
        """What to read for each vertex."""
        usable = (self._coarse.epoch == self._now) & ~self.current
        skip = np.empty((1 + len(self._coarse_stale), len(self._slots), len(self._alive)), np.bool_)
        skip[:] = ~self._alive
        for row, table in enumerate(self._coarse_stale, 1):
            skip[row][:, self._slots] |= table
        return Sources(
            self.exact.pool,
            self.exact.start,
            self.exact.length,
            self._coarse.pool,
            self._coarse.start,
            np.where(usable, self._coarse.length, 0).astype(np.int32),
            np.where(usable, self._coarse_row, 0).astype(np.int32),
            self._owner,
            skip,
            np.where(usable, self._coarse.stamp, self.exact.stamp),
            self.exact.stamp,
        )

    def standing(self) -> Sources:
        """What vertices see past everything that is not out of date: nothing else hides anything."""
        row, table = self._stale(np.arange(len(self.exact)))
        skip = np.empty((len(table), len(self._slots), len(self._alive)), np.bool_)
        skip[:] = ~self._alive
        skip[:, :, self._slots] |= table
        nothing = np.zeros(len(self.exact), np.int32)
        start, stamp = self.exact.start, self.exact.stamp
        exact = self.exact.pool, start, self.exact.length
        return Sources(
            *exact, self.exact.pool, start, nothing, row.astype(np.int32), self._owner, skip, stamp, stamp
        )

    @property
    def full(self) -> bool:
        """Whether slots, which are never used again, will soon have no number left in a record."""
        return len(self._slot_of) > MOST_SLOTS

    @property
    def known(self) -> int:
        """How many vertices have an exact record of what is now."""
        return int(self.current.sum())

    @property
    def current(self) -> Bools:
        """(V,) which vertices have an exact record of what is now."""
        return np.asarray(self._holds[self.exact.epoch])

    def summary(self) -> Mapping[str, int]:
        """Counts of work done and skipped since the store was made."""
        names = {
            "rays": RAYS,
            "objects_traced": TRACED,
            "skipped_objects_below_horizon": HORIZON,
            "packets": PACKETS,
            "skipped_packets": SKIPPED,
            "skipped_packets_as_neighbours": GUESSED,
        }
        return {name: int(self.counts[column]) for name, column in names.items()}

    # -- to keep elsewhere ---------------------------------------------------------------------------

    def packed(self, rows: Points) -> tuple[npt.NDArray[Any], I32]:
        """Records of these vertices one after the other, and their lengths; objects by their number.

        Raises ValueError where one of them is not known. What objects blocked that are gone is left out.
        """
        if len(self.unknown(rows)):
            raise ValueError("there are vertices whose visibility is not known")
        length = self.exact.length[rows]
        ends = np.cumsum(length, dtype=np.int64)
        pool = np.empty(int(ends[-1]) if len(ends) else 0, self.exact.pool.dtype)
        gather_records(self.exact.pool, self.exact.start[rows], length, ends - length, pool)
        names = np.full(len(self._alive), -1, np.int64)
        names[self._slots] = np.arange(len(self._slots))
        return pool[: relabel(pool, length, names)].copy(), length

    def unpack(self, rows: Points, pool: npt.NDArray[Any], length: I32) -> bool:
        """Takes over records that were packed for the same objects; False where they cannot be that."""
        types = pool.dtype == self.exact.pool.dtype and length.dtype == np.int32
        if not types or pool.ndim != 1 or length.shape != rows.shape:
            return False
        if not readable(pool, length, len(self._slots), 1 << self.k):
            return False
        own = pool.copy()
        relabel(own, length.copy(), self._slots)
        self.stamp += 1
        self.exact.write(rows, [own], length, self.stamp)
        self.exact.epoch[rows] = self._now
        return True

    # -- tracing -------------------------------------------------------------------------------------

    def trace(self, points: Points, job: Job) -> None:
        """Exact records for those of the points that need one. Cancelled, it keeps what is done."""
        todo = self.unknown(points)
        for first in range(0, len(todo), BATCH):
            job.checkpoint(first, len(todo))
            block = todo[first : first + BATCH]
            row, table = self._stale(block)
            pieces, length, changed = self._run(block, row, table, job)
            self.stamp += 1
            self.exact.write(block[changed], pieces, length[changed], self.stamp)
            self.exact.epoch[block] = self._now
        self.exact.tidy()

    def preview(self, points: Points, level: float, job: Job, glow: Glow | None = None) -> None:
        """Coarse records of what is out of date for the points: rays for 2^-level of a vertex' light each."""
        if level > self._coarse_level:
            self._forget_coarse()
        todo = self.unknown(points)
        todo = todo[self._coarse.epoch[todo] != self._now]
        if not len(todo):
            return
        self._coarse_level = level
        row, table = self._stale(todo)
        if glow is None or glow.k != self.k:
            glow = Glow.even(self.k)
        pieces, length, changed = self._run(todo, row, table, job, (glow, 0.5**level))
        touched, rest = todo[changed], todo[~changed]
        self.stamp += 1
        self._coarse.write(touched, pieces, length[changed], self.stamp)
        self._coarse.length[rest], self._coarse.stamp[rest] = 0, self.exact.stamp[rest]
        self._coarse.epoch[todo] = self._now
        self._coarse_row[todo] = np.where(changed, len(self._coarse_stale) + 1 + row, 0)
        self._coarse_stale.extend(table)

    def _guides(self, points: Points) -> I64:
        """(P, 2) vertices with records of what is now that refinement put each point between, or -1."""
        made = np.full((len(points), 2), -1, np.int64)
        if self._surfaces is None or self._surfaces.base is None:
            return made
        between = parents(self._surfaces.mesh)[points]
        known = self.current[between].all(axis=1) & (between[:, 0] != between[:, 1])
        made[known] = between[known]
        return made

    def _run(
        self, points: Points, row: I64, table: Bools, job: Job, glimpse: tuple[Glow, float] | None = None
    ) -> tuple[list[npt.NDArray[Any]], I32, Bools]:
        """Records (those that changed, one after the other), their lengths, and which changed."""
        surfaces, occluders = self._surfaces, self._occluders
        assert surfaces is not None
        assert occluders is not None
        mesh, exact = surfaces.mesh, self.exact
        parts = parts_of(occluders.caster, mesh.origin)
        beams, which = self._beams(self.k, parts.turn)
        length, changed = np.zeros(len(points), np.int32), np.zeros(len(points), np.bool_)
        kernel: Callable[..., int] = trace_records if glimpse is None else glimpse_records
        if glimpse is None:
            names = self._slots
            rest: tuple[Any, ...] = self._guides(points), packets_around(self.k), len(self._alive)
        else:
            names = np.full(len(self._alive), -1, np.int64)
            names[self._slots] = np.arange(len(self._slots))
            rest = glimpse[0].power, glimpse[0].peak, glimpse[1]
        asked: tuple[Any, ...] = (
            *(points, row, table),
            *(mesh.positions, mesh.normals, mesh.geometric, mesh.inset, self._owner, names),
            *(exact.pool, exact.start, exact.length),
            *(parts.occluded8, parts.scene, parts.from_mesh, parts.turn, parts.half, parts.radius),
            *(parts.epsilon, which, beams.rows, beams.axis, beams.sine, beams.offset),
            *rest,
        )
        found: dict[int, list[npt.NDArray[Any]]] = {}
        counts: dict[int, I64] = {}
        room = (4 << self.k) + 64
        each = _NUMBERS_A_RECORD[glimpse is None]

        def body(begin: int, stop: int) -> None:
            mine, tally = [], np.zeros(COUNTS, np.int64)
            start, size = begin, room + each * (stop - begin)
            while start < stop:
                out = np.empty(size, exact.pool.dtype)
                used = np.zeros(1, np.int64)
                done = kernel(start, stop, *asked, out, length, changed, used, tally)
                mine.append(out[: int(used[0])].copy())
                start += done
                size = size if done else 2 * size
            found[begin], counts[begin] = mine, tally

        self._workers.run(len(points), CHUNK[glimpse is None], body, job)
        self.counts += sum(counts.values(), np.zeros(COUNTS, np.int64))
        occluders.caster.count(int(sum(tally[RAYS] for tally in counts.values())))
        return [piece for begin in sorted(found) for piece in found[begin]], length, changed
