"""How many rays and functions: while somebody moves something, then at rest step by step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from studio_core.scene.diff import EVERYTHING, Aspect
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs


@dataclass(frozen=True)
class Tier:
    """Rays of a vertex, of a receiver and of its lobes; functions of a lobe as a source, with what tolerance;
    samples of an area lamp and of the environment as sources.

    `most`: of `final`, tables are left out that would make more rays of all receivers together; the first
    two never are. `paths` are how many short rays are followed on by (`near`). Both count work, so that a
    small scene gets what a large one has no time for. `last`: nothing finer was asked for.
    """

    inner: tuple[int, ...]
    final: tuple[int, ...]
    lobes: int
    functions: int
    lobe_error: float
    lamp_samples: int
    environment_samples: int
    most: int = 0
    paths: int = 0
    last: bool = False

    def sends_as(self, other: Tier) -> bool:
        """Whether vertices send the same light: what receivers do with it may differ."""
        return self._of_senders == other._of_senders

    @property
    def _of_senders(self) -> tuple[object, ...]:
        samples = self.lamp_samples, self.environment_samples
        return self.inner, self.functions, self.lobe_error, samples

    def rays_for(self, receivers: int) -> tuple[int, ...]:
        """Of `final`, what so many receivers may have."""
        counts = self.final[:2]
        for more in self.final[2:]:
            if receivers * (sum(counts) + more) > self.most:
                break
            counts += (more,)
        return counts


@dataclass(frozen=True)
class Chosen:
    """The tier of this round; `level` counts from 0."""

    tier: Tier
    level: int


HAND = Tier((16,), (64,), 32, 16, 0.15, 4, 64)
REST = Tier((16, 48), (64, 192), 64, 36, 0.05, 16, 256)
CLOSE = replace(REST, final=(64, 192, 256, 512), most=5_000_000, paths=800_000)
FINE = replace(CLOSE, lobes=128, environment_samples=1024, most=40_000_000, paths=5_000_000)
ENOUGH_IN_HAND, ENOUGH_AT_REST = 6.0, 2.5
"""Errors of indirect light, %, that these have in most rooms (docs/interreflection.md)."""


def tiers(tolerance: float) -> tuple[Tier, ...]:
    """In hand, then at rest: `tolerance` is the relative error of indirect light that is aimed at, in %."""
    made = [HAND]
    if tolerance < ENOUGH_IN_HAND:
        made += [REST, CLOSE]
    if tolerance < ENOUGH_AT_REST:
        made.append(FINE)
    return (*made[:-1], replace(made[-1], last=True))


class TierStage:
    """The tier of this round: in hand after every change, the next after each round at rest."""

    needs: tuple[type, ...] = ()
    gives = Chosen
    dirtied_by: Aspect = EVERYTHING

    def __init__(self) -> None:
        self._level = 0
        self._before = 0

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Chosen:
        """The previous where the tier is the same."""
        if inputs.changes or inputs.previous is None:
            self._level = 0
        offered = tiers(frame.indirect.params.tolerance) if frame.indirect is not None else tiers(100.0)
        level = min(self._level, len(offered) - 1)
        made = Chosen(offered[level], level)
        previous: Chosen | None = inputs.previous
        return previous if previous == made and previous is not None else made

    def again(self, frame: Frame, made: Mapping[type, Any], rounds: int, job: Job) -> bool:
        """Whether there is a finer one."""
        self._before = self._level
        if made[Chosen].tier.last:
            return False
        self._level = made[Chosen].level + 1
        return True

    def abandon(self) -> None:
        """Back to the one before."""
        self._level = self._before
