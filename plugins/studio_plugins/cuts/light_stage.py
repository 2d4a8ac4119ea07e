"""The second own stage of the cuts: which light reaches the vertices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.suns import Sun
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import NodeId
from studio_core.scene.transform import Transform
from studio_core.shading.artifacts import (
    Casters,
    Lighting,
    Shapes,
    Surfaces,
)
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_plugins.cuts.choose import Prefix
from studio_plugins.cuts.fill import lean_on
from studio_plugins.cuts.lamps import LampCache, Source, lamp_source, sphere
from studio_plugins.cuts.light_cache import LightCache
from studio_plugins.cuts.lobes import LobeTable
from studio_plugins.cuts.nodes import NodeTable
from studio_plugins.cuts.occluders import occluder_keys
from studio_plugins.cuts.paper.height_cuts import HIGHEST_K
from studio_plugins.cuts.paper.settings import PaperParams
from studio_plugins.cuts.paper_light import PaperLight
from studio_plugins.cuts.quality import Quality, quality
from studio_plugins.cuts.records import Records
from studio_plugins.cuts.visibility_stage import EXACT, PAPER, Seen

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


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
        shapes = inputs[Shapes]
        by_row = np.array([not lobe.flat for lobe in self._lobes(shapes)] + [False], np.bool_)
        if shapes.tilt is not None:  # leaning normals ask where light is from
            by_row[:-1] |= shapes.tilt > 0
        glossy = by_row[shapes.rows(mesh)]
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
