"""Kept rays of all vertices: many of those that stand for much of the scene, few of those that crowd.

How much light of a vertex counts elsewhere goes with its area, and so does what the noise of its rays costs
(of a sum Σ A L with the variance Σ A² σ² / n, least for n ∝ A). Where a mesh is finer than the scene's others
by far, a quarter of the rays is still more than its share.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.scene.diff import Aspect
from studio_core.shading.artifacts import Casters, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_core.transport.operator import Transport
from studio_core.transport.patterns import cosine_pattern
from studio_plugins.interreflection.gather.tiers import Chosen

F32 = npt.NDArray[np.float32]
Bools = npt.NDArray[np.bool_]

KEPT = "rays of all vertices"
INNER_SEED, CROWDED_SEED, FINAL_SEED = 1000, 1500, 2000
"""Apart: what receivers meet must not be what chose the sources' light."""
FEWER = 4
"""Vertices that stand for less than a part of the mean area have as many times fewer rays."""


@dataclass(frozen=True, eq=False)
class Meetings:
    """Kept rays, one table a tier, coarser ones first; `number` grows whenever one changed."""

    tables: tuple[Transport, ...]
    number: int
    rays: int


class MeetingsStage:
    """What the rays of all vertices meet; after a move only what it touches is traced."""

    needs: tuple[type, ...] = (Surfaces, Casters, Chosen)
    gives = Meetings
    dirtied_by = Aspect.NONE

    def __init__(self, services: Services) -> None:
        self._cache = services.cache
        self._wide, self._crowded = Tables(services, INNER_SEED), Tables(services, CROWDED_SEED)
        self._made: tuple[Meetings | None, ...] = (None, None)
        self._casters: Casters | None = None
        self._on_disk: tuple[object, ...] = ()

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Meetings:
        """Tables brought up to date; the first time what is kept on disk is taken over."""
        surfaces, casters, counts = inputs[Surfaces], inputs[Casters], inputs[Chosen].tier.inner
        if self._casters is None:
            self._restore(surfaces, casters, counts[0])
        self._casters = casters
        few = crowded(surfaces.mesh.area)
        kinds = (self._wide, counts, ~few), (self._crowded, fewer(counts), few)
        made = tuple(
            tables(own, surfaces, casters, wanted, known, job)
            for (tables, own, wanted), known in zip(kinds, self._made, strict=True)
        )
        for (_, _, wanted), part in zip(kinds, made, strict=True):
            for table in part.tables:
                table.keep_only(wanted)  # whose size is another now has rows in both
        previous: Meetings | None = inputs.previous
        if previous is not None and all(a is b for a, b in zip(made, self._made, strict=True)):
            return previous
        self._made = made
        wide, crowd = made
        return Meetings((*wide.tables, *crowd.tables), wide.number + crowd.number, wide.rays + crowd.rays)

    def _restore(self, surfaces: Surfaces, casters: Casters, count: int) -> None:
        if self._cache is None:
            return
        for tables, (rays,) in ((self._wide, (count,)), (self._crowded, fewer((count,)))):
            table = tables.of(0, rays)
            kept = self._cache.get(KEPT, *table.key(casters))
            if kept is not None and table.from_arrays(surfaces, casters, kept):
                self._on_disk = casters.meshes

    def complete(self, frame: Frame, job: Job) -> None:
        """Keeps the rays of the first tier on disk, for the next time this scene is opened.

        Once for the same meshes: not every pose of a long day.
        """
        if self._cache is None or self._casters is None or self._on_disk == self._casters.meshes:
            return
        for table in (self._wide.of(0), self._crowded.of(0)):
            if len(table.rows):
                self._cache.put(table.to_arrays(), KEPT, *table.key(self._casters))
                self._on_disk = self._casters.meshes


def crowded(area: F32) -> Bools:
    """(V,) which stand for little of the area (V,); in steps, so that a new thing does not change all."""
    mean = float(area.mean()) if len(area) else 0.0
    limit = 2.0 ** math.floor(math.log2(mean / FEWER)) if mean > 0 else 0.0
    return np.asarray(area < limit)


def fewer(counts: tuple[int, ...]) -> tuple[int, ...]:
    """Rays of those that crowd."""
    return tuple(max(count // FEWER, 1) for count in counts)


class Tables:
    """One `Transport` for each number of rays, of independent patterns."""

    def __init__(self, services: Services, seed: int) -> None:
        self._workers = services.workers
        self._seed = seed
        self._held: dict[int, Transport] = {}

    def __call__(
        self,
        counts: tuple[int, ...],
        surfaces: Surfaces,
        casters: Casters,
        wanted: Bools,
        previous: Meetings | None,
        job: Job,
    ) -> Meetings:
        """Those of a tier; finer ones wait for theirs."""
        tables, rays, changed = [], 0, False
        for index, count in enumerate(counts):
            table = self.of(index, count)
            done = table.update(surfaces, casters, wanted, job)
            rays += done.rays
            changed |= done.rays > 0 or bool(table.touched.any())
            tables.append(table)
        if previous is not None and not changed and previous.tables == tuple(tables):
            return previous
        return Meetings(tuple(tables), previous.number + 1 if previous is not None else 1, rays)

    def of(self, index: int, count: int = 0) -> Transport:
        """The table of a tier, made with `count` rays where there is none."""
        if index not in self._held:
            pattern = cosine_pattern(count, seed=self._seed + index)
            self._held[index] = Transport(self._workers, pattern)
        return self._held[index]

    @property
    def nbytes(self) -> int:
        """Bytes of all tables."""
        return sum(table.nbytes for table in self._held.values())


__all__ = ["FINAL_SEED", "Meetings", "MeetingsStage", "Tables", "crowded", "fewer"]
