"""The stages of the cuts: who is seen, what it sees, which light reaches it, what of that goes to the eye.

Each redoes only what its own inputs touch. What they know lies in tables that they own and change in
place; the artifacts handed on are small and new whenever something in those tables has changed.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.refinement import descend
from studio_core.kernels.suns import Sun
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import NodeId, Scene
from studio_core.scene.transform import Transform
from studio_core.shading.artifacts import (
    Casters,
    Hits,
    Lighting,
    Shapes,
    Surfaces,
)
from studio_core.shading.cache import DiskCache
from studio_core.shading.frame import Frame
from studio_core.shading.interpolation import parents
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_core.shading.primary import visible_vertices
from studio_plugins.cuts import keeping
from studio_plugins.cuts.choose import Prefix
from studio_plugins.cuts.fill import lean_on
from studio_plugins.cuts.forecast import Forecast
from studio_plugins.cuts.glimpse import Glow
from studio_plugins.cuts.lamps import LampCache, Source, lamp_source, sphere
from studio_plugins.cuts.light_cache import LightCache
from studio_plugins.cuts.lobes import LobeTable
from studio_plugins.cuts.nodes import NodeTable
from studio_plugins.cuts.occluders import Occluders, OccluderTable, occluder_keys
from studio_plugins.cuts.paper.height_cuts import HIGHEST_K
from studio_plugins.cuts.paper.settings import PaperParams
from studio_plugins.cuts.paper_light import PaperLight
from studio_plugins.cuts.quality import Quality, quality
from studio_plugins.cuts.records import Records
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


@dataclass(frozen=True, eq=False)
class Arriving:
    """The light of every layer at the vertices: tables of nodes, which change in place.

    `environment` is the table of what exact records see, made from `prefix` sums over `runs`; `settled` tells
    of each layer at which vertices (V,) its irradiance is that of now, also where it was not asked for;
    `standing` what it is past all that stands still (V, 3), and where that is known.
    """

    layers: tuple[tuple[NodeId, tuple[NodeTable, ...]], ...]
    newest: tuple[int, ...]
    environment: NodeTable | None
    prefix: Prefix | None
    runs: Records
    settled: Mapping[NodeId, Bools]
    standing: Mapping[NodeId, tuple[F32, Bools]]
    summed: int
    lamp_points: int


class LightStage:
    """Gathers the environment's light over what vertices see, and looks at lamps and suns."""

    needs: tuple[type, ...] = (Surfaces, Casters, Shapes, Lighting, Seen)
    gives = Arriving
    dirtied_by = Aspect.QUALITY | Aspect.VIEW

    def __init__(self, services: Services, lobes: LobeTable) -> None:
        self._workers = services.workers
        self._environment = LightCache(services.workers)
        self._paper = PaperLight(services.workers)
        self._lamps: dict[NodeId, LampCache] = {}
        self._lobes = lobes
        self._repeated: tuple[LightTree, LightTree] | None = None
        self._placed: dict[NodeId, tuple[object, Transform]] = {}
        self._spheres: dict[NodeId, tuple[npt.NDArray[np.float64], float]] = {}

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Arriving:
        """The previous where no vertex gets other light."""
        surfaces, lighting, seen = inputs[Surfaces], inputs[Lighting], inputs[Seen]
        mesh = surfaces.mesh
        wanted = quality(frame.params.quality)
        lobes = self._lobes(inputs[Shapes])
        by_material = np.array([not lobe.flat for lobe in lobes] + [False], np.bool_)
        glossy = by_material[mesh.material]
        summed = looked = 0
        if lighting.environment is not None and lighting.tree is not None:
            tree = self._fitted(lighting.tree, seen.store.k)
            if frame.params.method == PAPER:
                shells, k = frame.params.shells, min(tree.k, HIGHEST_K)
                paper = PaperParams(k=k, shells=shells, cells=shells)
                tree = tree.coarsened(k)
                summed = self._paper.gather(surfaces, inputs[Casters], tree, seen.points, paper, job)
            else:
                tolerance = self._environment.tolerance_for(tree, wanted.tolerance, frame.moving)
                self._environment.follow(seen.store, tree, tolerance)
                summed = self._environment.gather(seen.store, mesh, seen.points, glossy, job)
        shadows = self._moved(surfaces, inputs[Casters])
        sources = self._sources(lighting, frame, wanted)
        self._lamps = {node: self._lamps.get(node) or LampCache(self._workers) for node in sources}
        for node, (source, _) in sources.items():
            cache = self._lamps[node]
            cache.follow(source, seen.store)
            for index, spheres in shadows:
                if index is not None:
                    cache.forget(mesh.vertices_of(index))
                for middle, radius in spheres:
                    cache.forget(cache.shadowed_by(mesh.positions + mesh.origin, middle, radius))
        for node, (_, coarse) in sources.items():  # once all know what moved: this may be cancelled
            looked += self._lamps[node].gather(
                mesh,
                inputs[Casters].shadow,
                seen.points,
                glossy,
                coarse if frame.moving else None,
                job,
            )
        exact = frame.params.method == EXACT
        layers = tuple(self._tables(lighting, exact))
        newest = tuple(table.newest for _, tables in layers for table in tables)
        previous: Arriving | None = inputs.previous
        same = previous is not None and previous.newest == newest and _same(previous.layers, layers)
        if same and previous is not None and not previous.standing:  # of which there may be more by now
            return previous
        there = lighting.environment is not None and exact
        environment = self._environment.table if there else None
        settled = {node: self._lamps[node].settled for node in self._lamps}
        if lighting.environment is not None and exact:
            node, own = lighting.environment.id, self._environment.settled(seen.store)
            settled[node] = own & settled[node] if node in settled else own
        kept = self._environment
        standing: dict[NodeId, tuple[F32, Bools]] = {}
        if lighting.environment is not None and exact and seen.between is not None:
            node = lighting.environment.id
            needed = seen.mask & ~settled[node] & ~seen.summed
            lean_on(seen.between, seen.summed, needed)
            if needed.any():
                standing[node] = kept.standing(seen.store, mesh, needed, job)
        return Arriving(
            layers, newest, environment, kept.prefix, kept.runs, settled, standing, summed, looked
        )

    def _fitted(self, tree: LightTree, k: int) -> LightTree:
        """The tree over 2^k leaves; of a coarser one every leaf is repeated."""
        if tree.k >= k:
            return tree.coarsened(k)
        if self._repeated is None or self._repeated[0] is not tree or self._repeated[1].k != k:
            self._repeated = tree, LightTree.build(np.repeat(tree.radiance, 1 << (k - tree.k), axis=0))
        return self._repeated[1]

    def _tables(self, lighting: Lighting, exact: bool) -> list[tuple[NodeId, tuple[NodeTable, ...]]]:
        made: list[tuple[NodeId, tuple[NodeTable, ...]]] = []
        if lighting.environment is not None:
            node = lighting.environment.id
            suns = (self._lamps[node].table,) if node in self._lamps else ()
            own = (self._environment.table, self._environment.difference) if exact else (self._paper.table,)
            made.append((node, (*own, *suns)))
        made.extend((lamp.node, (self._lamps[lamp.node].table,)) for lamp in lighting.lamps)
        return made

    def _sources(
        self, lighting: Lighting, frame: Frame, wanted: Quality
    ) -> dict[NodeId, tuple[Source, Source | None]]:
        """Every lamp, and the suns under the environment's name, exact and as while something moves."""
        made: dict[NodeId, tuple[Source, Source | None]] = {}
        sun = lighting.sun
        if lighting.environment is not None and sun is not None and len(sun.directions):
            few = sun.coarsened(wanted.moving_lamp_samples)
            coarse = _sun_source(few) if len(few.directions) < len(sun.directions) else None
            made[lighting.environment.id] = (_sun_source(sun), coarse)
        for lamp in lighting.lamps:
            exact = lamp_source(lamp, frame.params.lamp_samples)
            rough = lamp_source(lamp, min(wanted.moving_lamp_samples, frame.params.lamp_samples))
            made[lamp.node] = (exact, rough if len(rough.targets) < len(exact.targets) else None)
        return made

    def _moved(
        self, surfaces: Surfaces, casters: Casters
    ) -> list[tuple[int | None, list[tuple[npt.NDArray[np.float64], float]]]]:
        """Objects that moved, came or went: index now (None: gone), and spheres they were and are in."""
        now: dict[NodeId, tuple[object, Transform]] = {}
        spheres: dict[NodeId, tuple[npt.NDArray[np.float64], float]] = {}
        made: list[tuple[int | None, list[tuple[npt.NDArray[np.float64], float]]]] = []
        keys = occluder_keys(surfaces, casters)
        for index, node in enumerate(surfaces.nodes):
            now[node] = keys[index], casters.transforms[index]
            if self._placed.get(node) == now[node]:
                spheres[node] = self._spheres[node]
                continue
            spheres[node] = sphere(surfaces.mesh, index)
            old = [self._spheres[node]] if node in self._spheres else []
            made.append((index, [*old, spheres[node]]))
        made.extend((None, [self._spheres[node]]) for node in self._placed if node not in now)
        if not self._placed:
            made = []  # nothing was looked at yet
        self._placed, self._spheres = now, spheres
        return made


def _sun_source(sun: Sun) -> Source:
    ends = np.column_stack([sun.directions, np.zeros(len(sun.directions))])
    return Source(ends, None, np.asarray(sun.irradiance, np.float32))


def _same(a: Sequence[tuple[NodeId, Any]], b: Sequence[tuple[NodeId, Any]]) -> bool:
    return [node for node, _ in a] == [node for node, _ in b] and all(
        one is other for (_, s), (_, t) in zip(a, b, strict=True) for one, other in zip(s, t, strict=True)
    )
