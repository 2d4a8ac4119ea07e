"""The stages before the last: separated BRDFs, coefficients, what all vertices send."""

from __future__ import annotations

from dataclasses import dataclass, replace
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
from studio_core.transport.exchange import Exchange
from studio_core.transport.light_samples import SampleCounts
from studio_core.transport.reflectance import VertexCoefficients
from studio_core.transport.separable import Separated, Separator
from studio_core.transport.source_light import SourceLight
from studio_plugins.interreflection.gather.meetings import FINAL_SEED, Meetings, MeetingsStage, Tables
from studio_plugins.interreflection.gather.smooth import Neighbours
from studio_plugins.interreflection.gather.tiers import Chosen, Tier

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
CHUNK = 1 << 9
COVERED = 0.5  # share of rays that meet insides, above which a vertex counts as covered


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
class Sent:
    """What all vertices send, and how they send it; in hand without what near rays start from.

    worth (2^10,): of directions of the sky to the scene; None where there is no sky.
    """

    exchange: Exchange
    rays: int
    nbytes: int
    tier: Tier
    worth: npt.NDArray[np.float64] | None = None

    @property
    def sources(self) -> Sources:
        """What is sent."""
        return self.exchange.sources

    @property
    def surface(self) -> Surface:
        """How."""
        return self.exchange.surface


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
        """All bounces that were asked for; the previous while somebody only looks around, and where a tier
        only follows more rays.

        What is seen tells where the sky is looked at from; at rest it may be looked at anew.
        """
        previous: Sent | None = inputs.previous
        tier, params = inputs[Chosen].tier, method_params(frame)
        if previous is not None and not inputs.changes.aspects & self.dirtied_by:
            looked = inputs.rebuilt == {Receivers} and frame.moving
            if looked or (inputs.rebuilt == {Chosen} and previous.tier.sends_as(tier)):
                return previous
        surfaces, shapes, separated = inputs[Surfaces], inputs[Shapes], inputs[Separated]
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
        if not inputs[Chosen].level:
            made = replace(made, before=None)
        nbytes = self._light.nbytes + made.light.matte.nbytes + made.light.functions.nbytes
        how = tier.lobe_error, tier.functions
        known = Exchange(made, surface, shapes, met.tables, bounces, self._light, lights, how)
        return Sent(known, counted.rays, nbytes, tier, self._light.sky.worth)


def _covered(met: Meetings, surfaces: Surfaces, neighbours: npt.NDArray[np.int32]) -> Covered:
    """Vertices most of whose rays meet insides, by each one's coarsest table."""
    share = np.zeros(len(surfaces.mesh.positions), np.float32)
    for table in reversed(met.tables):
        share[table.rows] = table.share_back
    return Covered.of(share > COVERED, surfaces.mesh.positions, neighbours)


def method_params(frame: Frame) -> Any:
    """The parameters of this method."""
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
    "method_params",
]
