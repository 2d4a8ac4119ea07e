"""The stages: separated BRDFs, coefficients, kept rays, what all vertices send, what receivers get of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Light as LightNode
from studio_core.shading.artifacts import (
    Casters,
    Lighting,
    Receivers,
    Shapes,
    Surfaces,
)
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.kept import Kept
from studio_core.shading.pipeline import Inputs
from studio_core.transport.bounces import Covered, Light, Sources, Surface, bounced, reflected
from studio_core.transport.light_samples import SampleCounts
from studio_core.transport.operator import Transport
from studio_core.transport.patterns import cosine_pattern
from studio_core.transport.reflectance import VertexCoefficients
from studio_core.transport.separable import Separated, Separator
from studio_core.transport.source_light import SourceLight
from studio_plugins.interreflection.gather.smooth import Neighbours
from studio_plugins.interreflection.gather.tiers import Chosen

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
CHUNK = 1 << 9
COVERED = 0.5  # share of rays that meet insides, above which a vertex counts as covered
KEPT = "rays of all vertices"
INNER_SEED, FINAL_SEED = 1000, 2000  # apart: what receivers meet must not be what chose the sources' light


class SeparateStage:
    """Separated BRDFs; as many functions as the tier allows."""

    needs: tuple[type, ...] = (Shapes, Chosen)
    gives = Separated
    dirtied_by = Aspect.NONE

    def __init__(self) -> None:
        self._separator = Separator()

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Separated:
        """The previous where neither shapes nor what is asked for differ."""
        tier = inputs[Chosen].tier
        return self._separator(inputs[Shapes], tier.lobe_error, tier.functions, job)


@dataclass(frozen=True, eq=False)
class Reflecting:
    """Coefficients (V, T, 3) of the materials' terms at vertices."""

    coefficients: F32


class ReflectingStage:
    """What materials are at vertices."""

    needs: tuple[type, ...] = (Surfaces, Shapes)
    gives = Reflecting
    dirtied_by = Aspect.MATERIAL

    def __init__(self, services: Services) -> None:
        self._coefficients = VertexCoefficients(services)

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Reflecting:
        """The previous where nothing differs."""
        made = self._coefficients(frame.scene, inputs[Surfaces])
        previous: Reflecting | None = inputs.previous
        return previous if previous is not None and previous.coefficients is made else Reflecting(made)


@dataclass(frozen=True, eq=False)
class Meetings:
    """Kept rays of all vertices, one table a tier; `number` grows whenever one changed."""

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
        self._tables = Tables(services, INNER_SEED)
        self._casters: Casters | None = None
        self._on_disk: tuple[object, ...] = ()

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Meetings:
        """Tables brought up to date; the first time what is kept on disk is taken over."""
        surfaces, casters, counts = inputs[Surfaces], inputs[Casters], inputs[Chosen].tier.inner
        if self._casters is None and self._cache is not None:
            table = self._tables.of(0, counts[0])
            kept = self._cache.get(KEPT, *table.key(casters))
            if kept is not None and table.from_arrays(surfaces, casters, kept):
                self._on_disk = casters.meshes
        self._casters = casters
        every = np.ones(len(surfaces.mesh.positions), np.bool_)
        return self._tables(counts, surfaces, casters, every, inputs.previous, job)

    def complete(self, frame: Frame, job: Job) -> None:
        """Keeps the rays of the first tier on disk, for the next time this scene is opened.

        Once for the same meshes: not every pose of a long day.
        """
        if self._cache is None or self._casters is None or not len(self._tables.of(0).rows):
            return
        table = self._tables.of(0)
        if self._on_disk != self._casters.meshes:
            self._cache.put(table.to_arrays(), KEPT, *table.key(self._casters))
            self._on_disk = self._casters.meshes


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


@dataclass(frozen=True, eq=False)
class Sent:
    """What all vertices send, and how they send it."""

    sources: Sources
    surface: Surface
    rays: int
    nbytes: int


class SentStage:
    """Light straight from lamps and environment, and its bounces."""

    needs: tuple[type, ...] = (
        Surfaces,
        Casters,
        Shapes,
        Lighting,
        Receivers,
        Chosen,
        Separated,
        Reflecting,
        Meetings,
    )
    gives = Sent
    dirtied_by = Aspect.GAIN | Aspect.LIGHT | Aspect.QUALITY

    def __init__(self, services: Services, neighbours: Neighbours) -> None:
        self._workers = services.workers
        self._light = SourceLight(services.workers)
        self._neighbours = neighbours
        self._covered: Kept[Covered] = Kept()

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Sent:
        """All bounces that were asked for; the previous while somebody only looks around.

        What is seen tells where the sky is looked at from; at rest it may be looked at anew.
        """
        previous: Sent | None = inputs.previous
        looked = inputs.rebuilt == {Receivers} and not inputs.changes.aspects & self.dirtied_by
        if previous is not None and looked and frame.moving:
            return previous
        surfaces, shapes, separated = inputs[Surfaces], inputs[Shapes], inputs[Separated]
        tier, params = inputs[Chosen].tier, _params(frame)
        samples = SampleCounts(tier.lamp_samples, tier.environment_samples)
        seen = inputs[Receivers].seen
        counted = self._light.update(surfaces, inputs[Casters], inputs[Lighting], samples, job, seen)
        lights = {n.id: n for n in frame.scene.of(LightNode) if frame.scene.shown(n.id)}
        irradiance, slot, functions = self._light.sums(surfaces, shapes, separated, lights, None, job)
        met = inputs[Meetings]
        covered = self._covered(lambda: _covered(met, surfaces, self._neighbours(surfaces.mesh)), met)
        surface = Surface(
            shapes.rows(surfaces.mesh),
            slot,
            len(functions),
            inputs[Reflecting].coefficients,
            separated,
            covered,
        )
        straight = reflected(Light(irradiance, functions), surface, self._workers, job)
        bounces = None if params.settle else params.bounces
        made = bounced(straight, bounces, met.tables, surface, self._workers, job)
        nbytes = self._light.nbytes + made.light.matte.nbytes + made.light.functions.nbytes
        return Sent(made, surface, counted.rays, nbytes)


def _covered(met: Meetings, surfaces: Surfaces, neighbours: npt.NDArray[np.int32]) -> Covered:
    """Vertices most of whose rays meet insides; those without a ray are free."""
    first, mesh = met.tables[0], surfaces.mesh
    inside = np.zeros(len(mesh.positions), np.bool_)
    inside[first.rows] = first.share_back > COVERED
    return Covered.of(inside, mesh.positions, neighbours)


def _params(frame: Frame) -> Any:
    assert frame.indirect is not None  # or nobody would run these stages
    return frame.indirect.params


__all__ = [
    "FINAL_SEED",
    "Meetings",
    "MeetingsStage",
    "Reflecting",
    "ReflectingStage",
    "Sent",
    "SentStage",
    "SeparateStage",
    "Tables",
]
