"""Irradiance and nodes from the environment, kept while visibility and light stay as they are."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.kernels.light_tree import LightTree
from studio_core.parallel import Workers
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.job import Job
from studio_plugins.cuts.choose import MOST_NODES, Prefix
from studio_plugins.cuts.gather import gather_difference, gather_light
from studio_plugins.cuts.nodes import FLOATS, Detail, NodeBlock, NodeTable, starts
from studio_plugins.cuts.records import Records
from studio_plugins.cuts.store import Sources, VisibilityStore

I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

CHUNK = 128
MOVING = 8.0  # times as much is allowed of a node while a hand turns the light, or of what coarse records see
AT_ONCE = 4096  # vertices of which what stands still is summed in one picture
_FLOOR = 0.02  # of the irradiance of an open place: darker ones need no finer nodes
_ROOM, _RUNS = 384, 1024  # nodes and run ends a point that room is made for at first


class LightCache:
    """Sums the light of one environment over the records of a store; owned by the compute thread.

    `table` holds what exact records see; `difference` what coarse ones add to it or take away; `runs` the
    first and last leaves of all that vertices see, for the next light.
    """

    def __init__(self, workers: Workers) -> None:
        self.table = NodeTable(0)
        self.difference = NodeTable(0)
        self._differs = False
        self._workers = workers
        self._tree: LightTree | None = None
        self._tolerance = 0.0
        self._generation = 0
        self._store: VisibilityStore | None = None
        self._prefix: Prefix | None = None
        self._stamp = np.zeros(0, np.int64)
        self._glossy = np.zeros(0, np.bool_)
        self.runs = Records(15, 0)
        self._run_stamp = np.zeros(0, np.int64)
        self._standing = np.zeros((0, 3), np.float32)
        self._standing_stamp = np.zeros(0, np.int64)
        self._standing_state: tuple[object, ...] = ()

    @property
    def prefix(self) -> Prefix | None:
        """Sums of the light that is gathered."""
        return self._prefix

    def tolerance_for(self, tree: LightTree, wanted: float, moving: bool) -> float:
        """What to ask for: more is allowed under a light that turns, and what was finer stays."""
        if not moving:
            return wanted
        return max(self._tolerance, wanted) if tree is self._tree else MOVING * wanted

    def settled(self, store: VisibilityStore) -> Bools:
        """(V,) vertices whose irradiance is that of an exact record of what is now."""
        return np.asarray((self._stamp > 0) & (self._stamp == store.exact.stamp) & store.current)

    def follow(self, store: VisibilityStore, tree: LightTree | None, tolerance: float) -> None:
        """Turn to the vertices of a store and this light; what was summed under another is forgotten."""
        if tree is not self._tree:
            self._tree = tree
            self._prefix = Prefix.of(tree) if tree is not None else None
            self._stamp[:] = 0
        if tolerance < self._tolerance or not self._tolerance:
            self._stamp[:] = 0
        self._tolerance = tolerance
        count = len(store.exact)
        if store is not self._store or store.generation != self._generation or tree is None:
            stamp, glossy, run_stamp = self._stamp, self._glossy, self._run_stamp
            self._stamp, self._glossy = np.zeros(count, np.int64), np.zeros(count, np.bool_)
            self._run_stamp = np.zeros(count, np.int64)
            if store is self._store and store.generation == self._generation + 1 and tree is not None:
                kept = np.flatnonzero(store.gone_to >= 0)
                to = store.gone_to[kept]
                self._stamp[to], self._glossy[to] = stamp[kept], glossy[kept]
                self._run_stamp[to] = run_stamp[kept]
                self.table = self.table.renumbered(count, store.gone_to)
                self.runs.renumber(count, store.gone_to)
            else:
                self.table = self.table.resized(count)
                self.runs = Records(store.k, count)
            self._store, self._generation = store, store.generation
            self.difference = self.difference.resized(count)

    def gather(self, store: VisibilityStore, mesh: WorldMesh, points: I64, glossy: Bools, job: Job) -> int:
        """Sums the light of those of the points whose record is another one, or that need nodes now.

        glossy (V,) says which vertices need nodes. How many points were summed.
        """
        if self._prefix is None:
            return 0
        sources = store.sources()
        enough = self._glossy[points] | ~glossy[points]
        fresh = (self._stamp[points] == sources.stamp[points]) & enough
        changed = points[~fresh]
        partly = sources.row[changed] > 0
        partly &= (self._stamp[changed] == sources.exact_stamp[changed]) & enough[~fresh]
        partly &= (sources.exact_stamp[changed] > 0) & ~_mostly(sources, changed)
        whole, rest = changed[~partly], changed[partly]
        if len(whole):
            self._stamp[whole] = 0  # cancelled half way, nothing holds any more
            self._sum(sources, mesh, whole, glossy, True, job)
            self._stamp[whole] = sources.stamp[whole]
            self._glossy[whole] = glossy[whole]
        if len(rest) or self._differs:
            self.difference = self.difference.resized(len(self.table))
        self._differs = len(rest) > 0
        if len(rest):
            self._sum(sources, mesh, rest, glossy, False, job)
        return len(changed)

    def standing(
        self, store: VisibilityStore, mesh: WorldMesh, wanted: Bools, job: Job
    ) -> tuple[npt.NDArray[np.float32], Bools]:
        """Irradiance (V, 3) of the wanted vertices past what is not out of date, and where it is known.

        Where something is out of date only so many are summed at once: whoever begins to drag something
        should not wait for it. Else, under a light that turns, it is the irradiance itself.
        """
        points = np.flatnonzero(wanted & (store.exact.stamp > 0))
        sources = store.standing()
        state = (store, store.generation, self._tree, sources.skip.tobytes())
        if state != self._standing_state or len(self._standing) != len(store.exact):
            self._standing = np.zeros((len(store.exact), 3), np.float32)
            self._standing_stamp = np.zeros(len(store.exact), np.int64)
            self._standing_state = state
        fresh = points[self._standing_stamp[points] != store.exact.stamp[points]]
        if len(store.unknown(points)):
            fresh = fresh[:AT_ONCE]
        if len(fresh) and self._prefix is not None:
            self._irradiance(sources, mesh, fresh, self._standing, job)
            self._standing_stamp[fresh] = store.exact.stamp[fresh]
        return self._standing, (self._standing_stamp > 0) & (self._standing_stamp == store.exact.stamp)

    def _irradiance(
        self, sources: Sources, mesh: WorldMesh, points: I64, out: npt.NDArray[np.float32], job: Job
    ) -> None:
        """Nothing but the irradiance of the points."""
        prefix = self._prefix
        assert prefix is not None
        count = len(sources.start)
        unknown, flat = np.full(count, -1, np.int32), np.zeros(count, np.bool_)

        def body(begin: int, stop: int) -> None:
            while begin < stop:
                nodes = np.empty(FLOATS * (MOST_NODES + stop - begin), np.float32)
                runs = np.empty((2 << self.runs.k) + _RUNS * (stop - begin), self.runs.pool.dtype)
                begin += gather_light(
                    begin,
                    stop,
                    points,
                    mesh.normals,
                    mesh.tangents,
                    sources.owner,
                    flat,
                    sources.pool,
                    sources.start,
                    sources.length,
                    sources.coarse_pool,
                    sources.coarse_start,
                    sources.coarse_length,
                    sources.row,
                    sources.skip,
                    prefix.block,
                    prefix.leaf,
                    0.0,
                    0.0,
                    out,
                    nodes,
                    np.empty(len(points), np.int64),
                    np.empty(2 * (stop - begin), np.float32),
                    self.runs.pool,
                    self.runs.start,
                    unknown,
                    runs,
                    np.empty(len(points), np.int64),
                )

        self._workers.run(len(points), CHUNK, body, job)

    def _sum(
        self,
        sources: Sources,
        mesh: WorldMesh,
        points: I64,
        glossy: Bools,
        whole: bool,
        job: Job,
    ) -> None:
        prefix = self._prefix
        assert prefix is not None
        table = self.table if whole else self.difference
        passing = bool((sources.row[points] > 0).all())
        counts, run_counts = np.zeros(len(points), np.int64), np.zeros(len(points), np.int64)
        found: dict[int, NodeBlock] = {}
        exact = sources.pool, sources.start, sources.length
        coarse = sources.coarse_pool, sources.coarse_start, sources.coarse_length
        tolerance = MOVING * self._tolerance if passing else self._tolerance
        floor = _FLOOR * prefix.power / 4

        def body(begin: int, stop: int) -> None:
            while begin < stop:
                room = MOST_NODES + _ROOM * (stop - begin)
                out = np.empty(FLOATS * room, np.float32)
                if whole:
                    detail = np.empty(2 * room, np.float32)
                    runs = np.empty((2 << self.runs.k) + _RUNS * (stop - begin), self.runs.pool.dtype)
                    done = gather_light(
                        begin,
                        stop,
                        points,
                        mesh.normals,
                        mesh.tangents,
                        sources.owner,
                        glossy,
                        *exact,
                        *coarse,
                        sources.row,
                        sources.skip,
                        prefix.block,
                        prefix.leaf,
                        tolerance,
                        floor,
                        table.irradiance,
                        out,
                        counts,
                        detail,
                        self.runs.pool,
                        self.runs.start,
                        known,
                        runs,
                        run_counts,
                    )
                else:
                    done = gather_difference(
                        begin,
                        stop,
                        points,
                        mesh.normals,
                        mesh.tangents,
                        glossy,
                        *coarse,
                        prefix.block,
                        prefix.leaf,
                        tolerance,
                        floor,
                        self.table.irradiance,
                        table.irradiance,
                        out,
                        counts,
                    )
                first = starts(counts[begin : begin + done])
                data = out[: FLOATS * int(first[-1])].copy()
                more = None
                if whole:
                    own = detail[: 2 * int(first[-1])].reshape(-1, 2)
                    more = Detail(own[:, 0].copy(), own[:, 1].astype(np.int32))
                    seen[begin] = runs[: 2 * int(run_counts[begin : begin + done].sum())].copy()
                found[begin] = NodeBlock(points[begin : begin + done], first, data, more)
                begin += done

        known = np.where(self._run_stamp == sources.stamp, self.runs.length, -1).astype(np.int32)
        known[sources.stamp == 0] = -1
        seen: dict[int, npt.NDArray[Any]] = {}
        self._workers.run(len(points), CHUNK, body, job)
        table.replace([found[begin] for begin in sorted(found)])
        fresh = known[points] < 0
        if whole and fresh.any():
            length = (2 * run_counts[fresh]).astype(np.int32)
            self.runs.write(points[fresh], [seen[begin] for begin in sorted(seen)], length, 1)
            self.runs.tidy()
            self._run_stamp[points[fresh]] = sources.stamp[points[fresh]]


def _mostly(sources: Sources, points: I64) -> Bools:
    """Points of whose record so much is out of date that a difference saves nothing."""
    stale = (sources.skip & ~sources.skip[:1]).sum(axis=2)
    many = stale > np.maximum(sources.skip.shape[1] // 2, 1)
    return np.asarray(many[sources.row[points], sources.owner[points]])
