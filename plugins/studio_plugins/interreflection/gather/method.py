"""`gather`: see the package."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from studio_core.contract import Services
from studio_core.params import param
from studio_plugins.interreflection.gather.final_stage import FinalStage
from studio_plugins.interreflection.gather.smooth import Neighbours
from studio_plugins.interreflection.gather.stages import (
    MeetingsStage,
    ReflectingStage,
    SentStage,
    SeparateStage,
)
from studio_plugins.interreflection.gather.tiers import TierStage


@dataclass(frozen=True)
class Params:
    """Parameters of the gather."""

    bounces: int = param(3, "Bounces", "How often light goes on from surface to surface", low=1, high=16)
    settle: bool = param(False, "Until it settles", "As many bounces as matter: for closed, bright rooms")
    tolerance: float = param(
        3.0,
        "Accuracy",
        "Error of the light between surfaces that is aimed at when nothing moves",
        unit="%",
        low=1.5,
        high=10.0,
        scale="log",
    )


class Gather:
    """See the module; satisfies `studio_core.contract.IndirectMethod`."""

    id = "gather"
    label = "Kept rays (fast)"
    Params = Params

    def stages(self, services: Services) -> Sequence[Any]:
        """Fresh stages, the last gives Indirect."""
        neighbours = Neighbours()
        return [
            TierStage(),
            SeparateStage(),
            ReflectingStage(services),
            MeetingsStage(services),
            SentStage(services, neighbours),
            FinalStage(services, neighbours),
        ]


METHOD = Gather()
