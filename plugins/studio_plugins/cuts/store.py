"""The visibility of all shading vertices: exact records, and coarse ones while a hand moves something.

Owned by the compute thread and changed in place; what was traced stays when a job is cancelled. Stages
tell by `stamp` which vertices have another record than before.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from studio_core.parallel import Workers
from studio_core.scene.shading_mesh import ShadingMesh
from studio_core.shading.artifacts import Casters, Surfaces
from studio_core.shading.job import Job
from studio_plugins.cuts.beams import BeamTable, parts_of
from studio_plugins.cuts.intervals import gather_records, record_type
from studio_plugins.cuts.poses import Poses, stale
from studio_plugins.cuts.tracer import COUNTS, HORIZON, PACKETS, RAYS, SKIPPED, TRACED, trace_records

I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Points = I64

CHUNK = 32
BATCH = 4096
LEAST_GARBAGE = 4 << 20  # numbers
NEVER = -1


class Records:
    """Where each vertex' record lies in the pool, of which poses it tells, and when it was written."""

    def __init__(self, count: int) -> None:
        self.start = np.zeros(count, np.int64)
        self.length = np.zeros(count, np.int32)
        self.epoch = np.full(count, NEVER, np.int32)
        self.stamp = np.zeros(count, np.int64)

    def carried(self, count: int, pieces: list[tuple[slice, slice]]) -> Records:
        """For another numbering: rows [to] come from [from]."""
        made = Records(count)
        for to, source in pieces:
            for name in ("start", "length", "epoch", "stamp"):
                getattr(made, name)[to] = getattr(self, name)[source]
        return made


class VisibilityStore:
    """Visibility over 2^k leaves; see the module.

    `generation` grows when vertices get other numbers; `gone_to` (V before,) says which, -1 for none.
    """

    def __init__(self, k: int, workers: Workers) -> None:
        self.k = k
        self.counts = np.zeros(COUNTS, np.int64)
        self.alive: Bools = np.zeros(0, np.bool_)
        self.exact = Records(0)
        self.coarse = Records(0)
        self.pool: npt.NDArray[Any] = np.zeros(1 << 16, record_type(k))
        self.used = 0
        self.generation = 0
        self.gone_to: I64 = np.zeros(0, np.int64)
        self._workers = workers
        self._beams = BeamTable()
        self._slot_of: dict[object, int] = {}
        self._slots: I64 = np.zeros(0, np.int64)
        self._poses: dict[int, Poses] = {}
        self._now = 0
        self._stamp = 0
        self._meshes: dict[int, tuple[ShadingMesh, slice]] = {}
        self._coarse_level = 0
        self._surfaces: Surfaces | None = None
        self._casters: Casters | None = None

    # -- what is shaded ------------------------------------------------------------------------------

    def follow(self, surfaces: Surfaces, casters: Casters) -> None:
        """Turn to another state of the scene; what holds in it too is kept."""
        if surfaces is self._surfaces and casters is self._casters:
            return
        keys = [
            (node, mesh_key) for node, mesh_key in zip(surfaces.nodes, _keys(surfaces, casters), strict=True)
        ]
        slots = np.array([self._slot_of.setdefault(key, len(self._slot_of)) for key in keys], np.int64)
        self._renumber(surfaces, slots)
        if not np.isin(self._slots, slots).all():  # what is gone hides nothing any more
            self._stamp += 1
            self.exact.stamp[self.exact.stamp > 0] = self._stamp
            self.coarse.epoch[:] = NEVER
        self._slots = slots
        self.alive = np.zeros(max(len(self._slot_of), 1), np.bool_)
        self.alive[slots] = True
        poses = Poses.of(casters.transforms, slots, len(self.alive))
        known = self._poses.get(self._now)
        if known is None or not poses.same(known, slots) or len(known.row) != len(poses.row):
            self._now = max(self._poses, default=0) + 1
            self._poses[self._now] = poses
        in_use = {int(epoch) for epoch in np.unique(self.exact.epoch)} | {self._now}
        self._poses = {epoch: kept for epoch, kept in self._poses.items() if epoch in in_use}
        self._surfaces, self._casters = surfaces, casters

    def _renumber(self, surfaces: Surfaces, slots: I64) -> None:
        mesh = surfaces.mesh
        meshes = {
            int(slot): (placed.mesh, mesh.vertices_of(index))
            for index, (slot, placed) in enumerate(zip(slots, mesh.objects, strict=True))
        }
        same = self._meshes.keys() == meshes.keys() and all(
            self._meshes[slot] == there for slot, there in meshes.items()
        )
        if same and len(self.exact.start) == len(mesh):
            return
        pieces = []
        for slot, (shape, there) in meshes.items():
            if slot in self._meshes:
                before, old = self._meshes[slot]
                kept = _common(before, shape)
                pieces.append((slice(there.start, there.start + kept), slice(old.start, old.start + kept)))
        self.gone_to = np.full(len(self.exact.start), -1, np.int64)
        for to, source in pieces:
            self.gone_to[source] = np.arange(to.start, to.stop)
        self.generation += 1
        self.exact = self.exact.carried(len(mesh), pieces)
        self.coarse = self.coarse.carried(len(mesh), pieces)
        self._meshes = meshes

    # -- what is known -------------------------------------------------------------------------------

    def _stale(self, records: Records, points: Points) -> tuple[I64, Bools]:
        """Row of each point in (E, n, n) tables of what is stale."""
        epochs, row = np.unique(records.epoch[points], return_inverse=True)
        now, count = self._poses[self._now], len(self._slots)
        tables = [
            stale(self._poses[int(e)], now, self._slots)
            if int(e) in self._poses
            else np.ones((count, count), np.bool_)
            for e in epochs
        ]
        return row.astype(np.int64), np.array(tables, np.bool_).reshape(-1, count, count)

    def unknown(self, points: Points) -> Points:
        """Those of the points whose exact record has to be traced, wholly or in part."""
        assert self._surfaces is not None
        behind: Points = points[self.exact.epoch[points] != self._now]
        if not len(behind):
            return behind
        row, table = self._stale(self.exact, behind)
        object_of = self._surfaces.mesh.object[behind]
        stale_rows = np.asarray(table.any(axis=2))
        needed = np.asarray(stale_rows[row, object_of])
        self.exact.epoch[behind[~needed]] = self._now
        made: Points = behind[needed]
        return made

    def sources(self) -> tuple[I64, I32, I64]:
        """Start, length and stamp (V,) of the best record of each vertex; stamp 0: none."""
        usable = self._coarse_usable()
        start = np.where(usable, self.coarse.start, self.exact.start)
        length = np.where(usable, self.coarse.length, self.exact.length)
        stamp = np.where(usable, self.coarse.stamp, self.exact.stamp)
        return start, length, stamp

    def _coarse_usable(self) -> Bools:
        return np.asarray((self.coarse.epoch == self._now) & (self.exact.epoch != self._now))

    @property
    def nbytes(self) -> int:
        """Bytes of exact records and their tables."""
        live = int(self.exact.length.sum()) * self.pool.itemsize
        return live + 16 * len(self.exact.start)

    @property
    def stamp(self) -> int:
        """Grows with every record that is written."""
        return self._stamp

    def seen(self, points: Points) -> Bools:
        """Which of the points have a record, exact or coarse, of what is now or was."""
        return np.asarray((self.exact.epoch[points] != NEVER) | (self.coarse.epoch[points] == self._now))

    @property
    def known(self) -> int:
        """How many vertices have an exact record of what is now."""
        return int((self.exact.epoch == self._now).sum())

    def summary(self) -> Mapping[str, int]:
        """Counts of work done and skipped since the store was made."""
        names = {
            "rays": RAYS,
            "objects_traced": TRACED,
            "skipped_objects_below_horizon": HORIZON,
            "packets": PACKETS,
            "skipped_packets": SKIPPED,
        }
        return {name: int(self.counts[column]) for name, column in names.items()}

    # -- tracing -------------------------------------------------------------------------------------

    def trace(self, points: Points, job: Job) -> None:
        """Exact records for those of the points that need one. Cancelled, it keeps what is done."""
        todo = self.unknown(points)
        for first in range(0, len(todo), BATCH):
            block = todo[first : first + BATCH]
            offset, total = first, len(todo)
            pieces, length, changed = self._run(self.exact, block, self.k, job, (offset, total))
            fresh = changed | (self.exact.epoch[block] == NEVER)
            self._write(self.exact, block[fresh], pieces, length, fresh)
            self.exact.epoch[block] = self._now
        self._tidy()

    def preview(self, points: Points, level: int, job: Job) -> None:
        """Records with one ray for 2^(k − level) leaves for the points whose exact one is out of date.

        Vertices that nothing stale touches keep their exact record.
        """
        level = min(level, self.k)
        todo = self.unknown(points)
        if level > self._coarse_level:
            self.coarse.epoch[:] = NEVER
        self._coarse_level = level
        todo = todo[self.coarse.epoch[todo] != self._now]
        if not len(todo):
            return
        pieces, length, changed = self._run(self.exact, todo, level, job, (0, len(todo)))
        touched = changed | (self.exact.epoch[todo] == NEVER)
        self._write(self.coarse, todo[touched], pieces, length, touched)
        self.coarse.epoch[todo] = self._now
        still = todo[~touched]
        for name in ("start", "length", "stamp"):
            getattr(self.coarse, name)[still] = getattr(self.exact, name)[still]
        self._tidy()

    def _run(
        self, records: Records, points: Points, level: int, job: Job, progress: tuple[int, int]
    ) -> tuple[list[npt.NDArray[Any]], I32, Bools]:
        surfaces, casters = self._surfaces, self._casters
        assert surfaces is not None
        assert casters is not None
        mesh = surfaces.mesh
        row, table = self._stale(records, points)
        parts = parts_of(casters.shadow, mesh.origin)
        beams, which = self._beams(level, parts.turn)
        length = np.zeros(len(points), np.int32)
        changed = np.zeros(len(points), np.bool_)
        found: dict[int, list[npt.NDArray[Any]]] = {}
        counts: dict[int, I64] = {}
        room = len(self._slots) * 64 + (2 << self.k)

        def body(begin: int, stop: int) -> None:
            mine, tally = [], np.zeros(COUNTS, np.int64)
            start = begin
            while start < stop:
                out = np.empty(room + 4096 * (stop - start), self.pool.dtype)
                done = trace_records(
                    start,
                    stop,
                    points,
                    row,
                    table,
                    mesh.positions,
                    mesh.normals,
                    mesh.geometric,
                    mesh.inset,
                    mesh.object,
                    self._slots,
                    self.alive,
                    self.pool,
                    records.start,
                    records.length,
                    parts.occluded8,
                    parts.scene,
                    parts.from_mesh,
                    parts.turn,
                    parts.half,
                    parts.radius,
                    parts.epsilon,
                    which,
                    beams.rows,
                    beams.axis,
                    beams.sine,
                    beams.offset,
                    self.k - level,
                    out,
                    length,
                    changed,
                    tally,
                )
                mine.append(out[: int(length[start : start + done].sum())].copy())
                start += done
            found[begin], counts[begin] = mine, tally

        self._workers.run(len(points), CHUNK, body, job)
        self.counts += sum(counts.values(), np.zeros(COUNTS, np.int64))
        casters.shadow.count(int(sum(tally[RAYS] for tally in counts.values())))
        return [piece for begin in sorted(found) for piece in found[begin]], length, changed

    # -- the pool ------------------------------------------------------------------------------------

    def _write(
        self, records: Records, points: Points, pieces: list[npt.NDArray[Any]], length: I32, kept: Bools
    ) -> None:
        """Appends the pieces and points the kept ones of their records at them."""
        total = sum(len(piece) for piece in pieces)
        self._reserve(total)
        place = self.used
        for piece in pieces:
            self.pool[place : place + len(piece)] = piece
            place += len(piece)
        starts = self.used + np.concatenate([[0], np.cumsum(length[:-1], dtype=np.int64)])[: len(length)]
        records.start[points], records.length[points] = starts[kept], length[kept]
        self._stamp += 1
        records.stamp[points] = self._stamp
        self.used = place

    def _reserve(self, more: int) -> None:
        if self.used + more > len(self.pool):
            grown = np.empty(max(2 * len(self.pool), self.used + more), self.pool.dtype)
            grown[: self.used] = self.pool[: self.used]
            self.pool = grown

    def _tidy(self) -> None:
        """Drops records that nothing points at when they are more than half of the pool."""
        usable = self._coarse_usable()
        shared = usable & (self.coarse.start == self.exact.start)
        own = np.flatnonzero(usable & ~shared)
        live = int(self.exact.length.sum()) + int(self.coarse.length[own].sum())
        if self.used - live < max(live, LEAST_GARBAGE):
            return
        pool = np.empty(live + (live >> 2) + 1024, self.pool.dtype)
        place = 0
        for records, rows in ((self.exact, np.arange(len(self.exact.start))), (self.coarse, own)):
            lengths = records.length[rows]
            target = place + np.concatenate([[0], np.cumsum(lengths, dtype=np.int64)])
            gather_records(self.pool, records.start[rows], lengths, target[:-1], pool)
            records.start[rows] = target[:-1]
            place = int(target[-1])
        lost = np.ones(len(self.coarse.start), np.bool_)
        lost[own] = False
        self.coarse.epoch[lost] = NEVER
        self.pool, self.used = pool, place


def _keys(surfaces: Surfaces, casters: Casters) -> list[object]:
    """What makes an object another one: its mesh, and which of its faces stop light."""
    opaque = [stops for _, stops in cast(Iterable[tuple[str, object]], casters.meshes)]
    return [(source[1].key, stops) for source, stops in zip(surfaces.sources, opaque, strict=True)]


def _common(before: ShadingMesh, after: ShadingMesh) -> int:
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
