"""Methods of light between surfaces that are easy to reckon with."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from studio_core.contract import API, Plugin
from studio_core.params import param
from studio_core.registry import PluginHost
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Light
from studio_core.shading.artifacts import (
    Casters,
    Indirect,
    LayerRadiance,
    Lighting,
    Receivers,
    Shapes,
    Surfaces,
)
from studio_core.shading.indirect import KIND


class Even(tuple):  # type: ignore[type-arg]
    """The summed gains of all lights."""


class EvenStage:
    """Gains, summed; counts its runs."""

    needs: tuple[type, ...] = ()
    gives = Even
    dirtied_by = Aspect.GAIN | Aspect.STRUCTURE

    def __init__(self) -> None:
        self.runs = 0

    def run(self, frame: Any, inputs: Any, job: Any) -> Even:
        self.runs += 1
        scene = frame.scene
        gains = [np.asarray(node.gain()) for node in scene.of(Light) if scene.shown(node.id)]
        made = Even(np.sum(gains, axis=0).tolist() if gains else (0.0, 0.0, 0.0))
        return inputs.previous if made == inputs.previous else made


class BounceStage:
    """A layer of `level` × gains × (1 + height of the vertex), in as many rounds as there are tiers.

    Round n gives (n + 1) / tiers of it. With `published`, every tier is published within one round.
    """

    needs: tuple[type, ...] = (Surfaces, Casters, Shapes, Lighting, Receivers, Even)
    gives = Indirect
    dirtied_by = Aspect.QUALITY | Aspect.VIEW

    def __init__(self) -> None:
        self.runs = 0
        self.asked: list[int] = []
        self.proven = 0
        self.proposed: int | None = None
        self.seen: list[np.ndarray] = []
        self.before: tuple[Any, ...] = ()

    def run(self, frame: Any, inputs: Any, job: Any) -> Indirect:
        self.runs += 1
        params = frame.indirect.params
        key = (*(inputs[kind] for kind in self.needs), params, frame.moving)
        if any(a is not b for a, b in zip(key, self.before or [None] * len(key), strict=True)):
            self.proven, self.proposed, self.before = 0, None, key
        tier = self.proven if self.proposed is None else self.proposed
        self.seen.append(inputs[Receivers].seen)
        if params.published:
            for step in range(params.tiers - 1):
                job.publish(self.made(inputs, params, step))
            return self.made(inputs, params, params.tiers - 1)
        job.checkpoint(tier, params.tiers)
        return self.made(inputs, params, tier)

    def made(self, inputs: Any, params: Any, tier: int) -> Indirect:
        surfaces, seen = inputs[Surfaces], inputs[Receivers].seen
        mesh, width = surfaces.mesh, inputs[Shapes].width
        share = (tier + 1) / params.tiers
        height = 1 + mesh.positions[:, 1].astype(np.float64) + mesh.origin[1]
        level = params.level * share * height[:, None] * np.asarray(inputs[Even])
        level = np.where(seen[:, None], level, np.nan).astype(
            np.float32
        )  # what is not valid is not looked at
        terms = np.repeat(level[:, None], width, axis=1)
        layer = LayerRadiance(terms, (np.pi * level).astype(np.float32))
        counts, facts = {"rays": 16 * (tier + 1)}, {"bytes": 1000.0}
        return Indirect(surfaces, layer, seen, tier == params.tiers - 1, counts, facts)

    def again(self, frame: Any, made: Any, rounds: int, job: Any) -> bool:
        self.asked.append(rounds)
        if self.proposed is not None:
            self.proven, self.proposed = self.proposed, None
        if frame.indirect.params.published or self.proven == frame.indirect.params.tiers - 1:
            return False
        self.proposed = self.proven + 1
        return True

    def abandon(self) -> None:
        self.proposed = None


@dataclass(frozen=True)
class BounceParams:
    """How much, and in how many tiers."""

    level: float = param(0.5, "Level", "How bright it is", low=0.0, high=10.0)
    tiers: int = param(1, "Tiers", "In how many steps it is made", low=1, high=8)
    published: bool = param(False, "Published", "Whether every step is shown at once", advanced=True)


class Bounce:
    """Satisfies `studio_core.contract.IndirectMethod`; `made` are all stages it gave."""

    id = "bounce"
    label = "Even light"
    Params = BounceParams

    def __init__(self) -> None:
        self.made: list[tuple[EvenStage, BounceStage]] = []

    def stages(self, services: Any) -> list[Any]:
        self.made.append((EvenStage(), BounceStage()))
        return list(self.made[-1])


@dataclass
class BouncingHost:
    """A plugin host with further methods."""

    host: PluginHost
    methods: dict[str, Any] = dataclasses.field(default_factory=dict)

    def get(self, kind: str, name: str) -> Any:
        return self.methods[name] if kind == KIND and name in self.methods else self.host.get(kind, name)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.host, name)


class Settling(Bounce):
    """One that can follow light until it settles."""

    id, label = "settling", "Until it settles"
    notes = "Nothing between two objects stops their light"

    @dataclass(frozen=True)
    class Params:
        """How often light goes on."""

        bounces: int = param(3, "Bounces", "How often light goes on", low=1, high=16)
        settle: bool = param(False, "Until it settles", "As many bounces as matter")
        rays: int = param(64, "Rays", "From every point", low=1, high=1024, advanced=True)


BOUNCE, SETTLING = Bounce(), Settling()
PLUGIN = Plugin(
    id="bouncing",
    api=API,
    provides={KIND: {"gather": "bouncing:SETTLING", "even": "bouncing:BOUNCE"}},
)
"""With the method that sessions begin with."""
