"""Irradiance and nodes from the environment, kept while visibility and light stay as they are."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.colour import LUMINANCE
from studio_core.kernels.light_tree import LightTree
from studio_core.parallel import Workers
from studio_core.shading.artifacts import ShadingPoints
from studio_core.shading.job import Job
from studio_plugins.cuts.gather import MOST_NODES, gather_light, prefix_table
from studio_plugins.cuts.nodes import FLOATS, NodeBlock, NodeTable
from studio_plugins.cuts.store import VisibilityStore

I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

CHUNK = 128
_FLOOR = 0.02  # of the irradiance of an open place: darker ones need no finer nodes


class LightCache:
    """Sums the light of one environment over the records of a store; owned by the compute thread."""

    def __init__(self, workers: Workers) -> None:
        self.table = NodeTable(0)
        self.gathered = 0
        self._workers = workers
        self._tree: LightTree | None = None
        self._tolerance = 0.0
        self._generation = 0
        self._prefix: npt.NDArray[np.float64] | None = None
        self._stamp = np.zeros(0, np.int64)
        self._glossy = np.zeros(0, np.bool_)

    def follow(self, store: VisibilityStore, tree: LightTree | None, tolerance: float) -> None:
        """Turn to the vertices of a store and this light; what was summed under another is forgotten."""
        if tree is not self._tree:
            self._tree = tree
            self._prefix = prefix_table(tree) if tree is not None else None
            self._stamp[:] = 0
        if tolerance < self._tolerance or not self._tolerance:
            self._stamp[:] = 0
        self._tolerance = tolerance
        count = len(store.exact.start)
        if store.generation != self._generation or tree is None:
            stamp, glossy = self._stamp, self._glossy
            self._stamp, self._glossy = np.zeros(count, np.int64), np.zeros(count, np.bool_)
            if store.generation == self._generation + 1 and tree is not None:
                kept = np.flatnonzero(store.gone_to >= 0)
                to = store.gone_to[kept]
                self._stamp[to], self._glossy[to] = stamp[kept], glossy[kept]
                self.table = self.table.renumbered(count, store.gone_to)
            else:
                self.table = self.table.resized(count)
            self._generation = store.generation

    def gather(
        self, store: VisibilityStore, mesh: ShadingPoints, points: I64, glossy: Bools, job: Job
    ) -> int:
        """Sums the light of those of the points whose record is another one, or that need nodes now.

        glossy (V,) says which vertices need nodes. How many points were summed.
        """
        if self._prefix is None:
            return 0
        start, length, stamp = store.sources()
        fresh = (self._stamp[points] == stamp[points]) & (self._glossy[points] | ~glossy[points])
        todo = points[~fresh]
        if not len(todo):
            return 0
        prefix, tolerance = self._prefix, self._tolerance
        floor = _FLOOR * float(prefix[-1, :3] @ np.array(LUMINANCE)) / 4
        counts = np.zeros(len(todo), np.int64)
        found: dict[int, NodeBlock] = {}

        def body(begin: int, stop: int) -> None:
            while begin < stop:
                out = np.empty(FLOATS * (MOST_NODES + 384 * (stop - begin)), np.float32)
                done = gather_light(
                    begin,
                    stop,
                    todo,
                    mesh.normals,
                    glossy,
                    store.alive,
                    store.pool,
                    start,
                    length,
                    prefix,
                    tolerance,
                    floor,
                    self.table.irradiance,
                    out,
                    counts,
                )
                first = np.concatenate([[0], np.cumsum(counts[begin : begin + done])]).astype(np.int64)
                data = out[: FLOATS * int(first[-1])].copy()
                found[begin] = NodeBlock(todo[begin : begin + done], first, data)
                begin += done

        self._workers.run(len(todo), CHUNK, body, job)
        self.table.replace([found[begin] for begin in sorted(found)])
        self._stamp[todo] = stamp[todo]
        self._glossy[todo] = glossy[todo]
        self.gathered += len(todo)
        return len(todo)
