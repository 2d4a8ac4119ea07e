"""The first own stage of the cuts: who is seen, and what it sees.

Visibility, light (`light_stage`), focus and radiance each redo only what their own inputs touch. What they
know lies in tables that they own and change in place; the artifacts handed on are small and new whenever
something in those tables has changed.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.refinement import descend
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Scene
from studio_core.shading.artifacts import (
    Casters,
    Hits,
    Lighting,
    Surfaces,
)
from studio_core.shading.cache import DiskCache
from studio_core.shading.frame import Frame
from studio_core.shading.interpolation import parents
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_core.shading.primary import visible_vertices
from studio_plugins.cuts import keeping
from studio_plugins.cuts.forecast import Forecast
from studio_plugins.cuts.glimpse import Glow
from studio_plugins.cuts.occluders import Occluders, OccluderTable
from studio_plugins.cuts.store import VisibilityStore

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

EXACT, PAPER = "exact", "svc-vcf"
FIRST_LEVELS = (5, 7)
"""Fineness of the first pictures of a scene of which nothing is known."""
COARSEST, FINEST, STEP = 6.5, 9.0, 0.5
EVEN = 6.5
"""A preview of fineness n errs about as 2^(n + EVEN) directions do that are spread evenly."""
SLOW, QUICK = 0.065, 0.03
"""Fineness of previews, and seconds of one after which the next is coarser, or finer."""
LONG = 0.6
"""Seconds of exact tracing that somebody who has let go of something is not left waiting for."""


@dataclass(frozen=True, eq=False)
class Seen:
    """Which vertices are to be lit, and the store of what they see, at one moment.

    mask (V,) marks all that the picture needs, points those that light is summed at: while somebody moves
    something, refined vertices take theirs from the two they lie between, given by `between` (V, 2).
    """

    store: VisibilityStore
    points: I64
    mask: Bools
    exact: bool
    level: int
    between: I64 | None = None

    @property
    def summed(self) -> Bools:
        """(V,) the points as a mask."""
        made = np.zeros(len(self.mask), np.bool_)
        made[self.points] = True
        return made


class VisibilityStage:
    """Traces what is not known, coarsely while somebody moves something."""

    needs: tuple[type, ...] = (Surfaces, Casters, Hits, Lighting)
    gives = Seen
    dirtied_by = Aspect.VIEW | Aspect.QUALITY

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._cache: DiskCache | None = services.cache
        self._store: VisibilityStore | None = None
        self._preview = COARSEST + STEP
        self._forecast = Forecast()
        self._occluders = OccluderTable()
        self._casters: Casters | None = None
        self._asked: tuple[Surfaces, Occluders] | None = None
        self._mask: tuple[Surfaces, Hits, bool, Bools] | None = None
        self._glow: tuple[LightTree, Glow] | None = None

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Seen:
        """The previous where nobody sees anything else; publishes coarse steps of what is new."""
        surfaces, hits = inputs[Surfaces], inputs[Hits]
        k = int(frame.params.directions).bit_length() - 1
        if self._store is None or self._store.k != k or self._store.full:
            self._store = VisibilityStore(k, self._workers)
        store = self._store
        generation, before = store.generation, store.stamp
        occluders = self._occluders(frame.scene, surfaces, inputs[Casters])
        store.follow(surfaces, occluders)
        mask = self._wanted(surfaces, hits, frame.params.everywhere)
        points = np.flatnonzero(mask)
        self._asked = surfaces, occluders
        if frame.params.method != EXACT:
            return self._unless_same(inputs.previous, Seen(store, points, mask, True, k), generation, before)
        if self._cache is not None and not frame.moving and store.stamp == 0:
            keeping.load(self._cache, store, *self._asked)
        between = None
        if frame.moving:
            if surfaces.base is not None:
                between, core = parents(surfaces.mesh), mask.copy()
                descend(between, core)
                points = np.flatnonzero(core)
            if len(store.unknown(points)):
                self._look(points, self._glowing(inputs[Lighting], k), job)
        else:
            glow = self._glowing(inputs[Lighting], k)
            for level in self._steps(points, job):
                store.preview(points, level, job, glow)
                job.publish(Seen(store, points, mask, False, int(level + EVEN)))
            self._trace(points, job)
        exact = not len(store.unknown(points))
        exact = exact and between is None
        made = Seen(store, points, mask, exact, k if exact else min(int(self._preview + EVEN), k), between)
        return self._unless_same(inputs.previous, made, generation, before)

    def _unless_same(self, previous: Seen | None, made: Seen, generation: int, before: int) -> Seen:
        """The previous where it says the same of the same records."""
        same = (
            previous is not None
            and made.store.generation == generation
            and made.store.stamp == before
            and previous.store is made.store
            and previous.exact == made.exact
            and (previous.between is None) == (made.between is None)
            and np.array_equal(previous.mask, made.mask)
        )
        return previous if same and previous is not None else made

    def complete(self, frame: Frame, job: Job) -> Mapping[str, int]:
        """What no picture needs yet: hidden vertices are traced too, and all is kept on disk.

        Returns how many vertices were traced, and bytes that were kept.
        """
        store = self._store
        if store is None or self._asked is None or frame.params.method != EXACT:
            return {}
        surfaces, occluders = self._asked
        rows = keeping.unrefined_rows(surfaces)
        missing = len(store.unknown(rows))
        if not missing:
            return {"vertices_traced": 0, "bytes": 0}
        store.trace(rows, job)
        kept = keeping.save(self._cache, store, surfaces, occluders) if self._cache is not None else 0
        return {"vertices_traced": missing, "bytes": kept}

    def _steps(self, points: I64, job: Job) -> tuple[float, ...]:
        """Finenesses to show first, where somebody waits for it and exact tracing would take long."""
        store = self._store
        assert store is not None
        unknown = store.unknown(points)
        if not len(unknown) or not job.listened_to:
            return ()
        new = store.never(unknown)
        if store.unseen(unknown):
            levels: tuple[float, ...] = FIRST_LEVELS
        else:
            levels = (self._preview,) if self._forecast(new, len(unknown) - new) > LONG else ()
        return tuple(level for level in levels if level + EVEN < store.k)

    def _trace(self, points: I64, job: Job) -> None:
        store = self._store
        assert store is not None
        unknown = store.unknown(points)
        new, started = store.never(unknown), time.perf_counter()
        store.trace(points, job)
        self._forecast.learn(new, len(unknown) - new, time.perf_counter() - started)

    def _blocking(self, scene: Scene, surfaces: Surfaces, casters: Casters) -> Occluders:
        """The occluders, asked anew only where something stands elsewhere or is another."""
        if self._asked is None or self._asked[0] is not surfaces or self._casters is not casters:
            self._casters = casters
            return self._occluders(scene, surfaces, casters)
        return self._asked[1]

    def _wanted(self, surfaces: Surfaces, hits: Hits, everywhere: bool) -> Bools:
        """(V,) the vertices to be lit."""
        known = self._mask
        if known is None or known[0] is not surfaces or known[1] is not hits or known[2] != everywhere:
            count = len(surfaces.mesh.positions)
            mask = np.ones(count, np.bool_) if everywhere else visible_vertices(surfaces, hits)
            known = self._mask = surfaces, hits, everywhere, mask
        return known[3]

    def _glowing(self, lighting: Lighting, k: int) -> Glow | None:
        tree = lighting.tree
        if tree is None:
            return None
        if self._glow is None or self._glow[0] is not tree or self._glow[1].k != k:
            self._glow = tree, Glow.of(tree, k)
        return self._glow[1]

    def _look(self, points: I64, glow: Glow | None, job: Job) -> None:
        assert self._store is not None
        started = time.perf_counter()
        self._store.preview(points, self._preview, job, glow)
        taken = time.perf_counter() - started
        if taken > SLOW:
            self._preview = max(self._preview - STEP, COARSEST)
        elif taken < QUICK:
            self._preview = min(self._preview + STEP, FINEST)
