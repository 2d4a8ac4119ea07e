"""Stages: what depends on what, and what need not be done again.

A stage reruns when a change dirties it or when something it needs was rebuilt. Changes accumulate for a
stage until it succeeds, so cancelled work is not forgotten. A stage that returns its previous artifact
(the same object) counts as not rebuilt, and what follows is skipped. A partial artifact that a stage
publishes flows through the stages after it.

When all stages are through and the frame is at rest, a stage that can make the picture truer (`Refining`)
may ask for another round: what there is so far is published, the first before anybody is asked, and the
stages concerned run again.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol, TypeVar, runtime_checkable

from studio_core.scene.diff import Aspect, Changes, everything
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job

A = TypeVar("A")
MOST_ROUNDS = 12


@dataclass(frozen=True)
class Inputs:
    """What a stage gets: the artifacts it needs, what changed since it last succeeded, what it gave then.

    `round` is not 0 in what follows the first round of a frame at rest.
    """

    artifacts: Mapping[type, Any]
    changes: Changes
    previous: Any = None
    rebuilt: frozenset[type] = frozenset()
    round: int = 0

    def __getitem__(self, kind: type[A]) -> A:
        found: A = self.artifacts[kind]
        return found


class Stage(Protocol):
    """Pure: the same frame and inputs give the same artifact; `previous` and `changes` only save work."""

    @property
    def needs(self) -> tuple[type, ...]:
        """Artifacts that must be made first."""
        ...

    @property
    def gives(self) -> type:
        """The kind of artifact it makes."""
        ...

    @property
    def dirtied_by(self) -> Aspect:
        """Changes after which it must run again, even if all it needs stayed."""
        ...

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Any:
        """The artifact, or `inputs.previous` where nothing differs."""
        ...


@runtime_checkable
class Refining(Protocol):
    """A stage that may want another round after it has seen what became of its artifact."""

    def again(self, frame: Frame, made: Mapping[type, Any], rounds: int, job: Job) -> bool:
        """Whether to run again, differently; `made` are all artifacts, `rounds` how many there were.

        Asked once after every round, so that the stage also learns that its last one came through.
        """
        ...

    def abandon(self) -> None:
        """The round that was asked for did not come through: `run` gives again what it gave before it."""
        ...


@runtime_checkable
class Completing(Protocol):
    """A stage that can do in idle time what no picture needs yet, such as hidden places."""

    def complete(self, frame: Frame, job: Job) -> object:
        """Do it; cancelled, it keeps what is done. Called after `run` came through for `frame`."""
        ...


@dataclass
class _Record:
    pending: Changes
    again: bool = False
    seen: dict[type, int] = field(default_factory=dict)
    artifact: Any = None
    stamp: int = 0


@dataclass(frozen=True)
class StageRun:
    """One line of a report: which stage, whether it ran, whether it gave something new, seconds, round."""

    name: str
    ran: bool
    rebuilt: bool
    seconds: float
    round: int = 0


class Pipeline:
    """Runs stages in order over frames. Owned by the compute thread.

    Artifacts of the kinds `handed` are not made here: they are handed over with every frame, and count as
    rebuilt where they are other objects than before. `frame` is the newest whose changes are known.
    """

    def __init__(self, stages: Sequence[Stage], handed: Sequence[type] = ()) -> None:
        given: set[type] = set(handed)
        for stage in stages:
            missing = [need.__name__ for need in stage.needs if need not in given]
            if missing:
                raise ValueError(f"{type(stage).__name__} needs {', '.join(missing)} before it")
            if stage.gives in given:
                raise ValueError(f"two stages give {stage.gives.__name__}")
            given.add(stage.gives)
        self.stages = tuple(stages)
        self.current = 0
        self.rounds = 0
        self.frame: Frame | None = None
        self.report: list[StageRun] = []
        self._records: list[_Record] | None = None
        self._handed: dict[type, tuple[Any, int]] = dict.fromkeys(handed, (None, 0))
        self._asking: list[int] = []

    def artifact(self, kind: type[A]) -> A | None:
        """What the stage that gives `kind` last made, or None."""
        for stage, record in zip(self.stages, self._records or (), strict=False):
            if stage.gives is kind:
                found: A | None = record.artifact
                return found
        return None

    def settled(self, kind: type[A]) -> A | None:
        """What `artifact` gives where it belongs to `frame`: cancelled work has not left it behind."""
        return self.artifact(kind) if self.is_settled(kind) else None

    def pending(self, kind: type) -> Aspect:
        """What has changed since the stage that gives `kind` last ran."""
        for stage, record in zip(self.stages, self._records or (), strict=False):
            if stage.gives is kind:
                return record.pending.aspects
        return Aspect.NONE

    def is_settled(self, kind: type) -> bool:
        """Whether the stage that gives it would not run again, but to refine, nor one that it needs.

        What no stage gives is as settled as it gets.
        """
        if kind in self._handed:
            return True
        stamps = {stage.gives: r.stamp for stage, r in zip(self.stages, self._records or (), strict=False)}
        for stage, record in zip(self.stages, self._records or (), strict=False):
            if stage.gives is kind:
                fresh = record.stamp > 0 and not stage.dirtied_by & record.pending.aspects
                own = (need for need in stage.needs if need not in self._handed)
                return fresh and all(
                    record.seen.get(need) == stamps[need] and self.is_settled(need) for need in own
                )
        return all(stage.gives is not kind for stage in self.stages)

    def mark(self, frame: Frame, changes: Changes) -> None:
        """Remember what changed for every stage."""
        self.frame = frame
        if self._records is None:
            self._records = [_Record(everything(frame.scene)) for _ in self.stages]
        else:
            for record in self._records:
                record.pending |= changes

    def dirties(self, changes: Changes, upto: int) -> bool:
        """Whether a stage at or before index `upto` would rerun."""
        return any(stage.dirtied_by & changes.aspects for stage in self.stages[: upto + 1])

    def update(self, frame: Frame, changes: Changes, job: Job) -> Any:
        """Bring everything up to date; the last stage's artifact. Raises Cancelled between and in stages.

        While the frame is at rest, stages are asked for further rounds. What follows the first round is
        spare work: any change that concerns a stage disturbs it.
        """
        result = self.start(frame, changes, job)
        able = any(isinstance(stage, Refining) for stage in self.stages)
        while not frame.moving:
            self.current = len(self.stages) - 1
            first = able and not self.rounds and self.report[-1].rebuilt
            if first:
                job.publish(result)  # to ask can take longer than the edit itself
            if not self.wants_more(frame, job):
                break
            if not first:
                job.publish(result)
            result = self.refine(frame, job)
        return result

    def start(
        self, frame: Frame, changes: Changes, job: Job, handed: Mapping[type, Any] | None = None
    ) -> Any:
        """The first round of `update` alone, with what is handed over; the last stage's artifact."""
        self.mark(frame, changes)
        self._take(handed)
        self.report, self.rounds = [], 0
        return self._round(frame, job)

    def wants_more(self, frame: Frame, job: Job) -> bool:
        """Whether a stage asks for another round; no longer when there were too many."""
        assert self._records is not None
        made = {stage.gives: r.artifact for stage, r in zip(self.stages, self._records, strict=True)}
        made = {**{kind: artifact for kind, (artifact, _) in self._handed.items()}, **made}
        able = [index for index, stage in enumerate(self.stages) if isinstance(stage, Refining)]
        asking: list[int] = []
        try:
            for index in able:
                stage = self.stages[index]
                if isinstance(stage, Refining) and stage.again(frame, made, self.rounds, job):
                    asking.append(index)
                    self._records[index].again = True
        except BaseException:
            self._asking = able
            self.abandon()
            raise
        self._asking = asking
        if self.rounds == MOST_ROUNDS:
            self.abandon()
        return bool(self._asking)

    def refine(self, frame: Frame, job: Job, handed: Mapping[type, Any] | None = None) -> Any:
        """Another round: stages that asked for it run, and those to which something else is handed."""
        self._take(handed)
        self.rounds += 1
        try:
            with job.unheard():
                return self._round(frame, job)
        except BaseException:
            self.abandon()
            raise

    def abandon(self) -> None:
        """What was asked for did not come through: stages give again what they gave before."""
        assert self._records is not None
        for index in self._asking:
            stage = self.stages[index]
            if isinstance(stage, Refining):
                stage.abandon()
                self._records[index].again = True
        self._asking = []

    def _take(self, handed: Mapping[type, Any] | None) -> None:
        for kind, artifact in (handed or {}).items():
            before, stamp = self._handed[kind]
            if artifact is not before or not stamp:
                self._handed[kind] = (artifact, stamp + 1)

    def _round(self, frame: Frame, job: Job) -> Any:
        """All stages once."""
        assert self._records is not None
        made: dict[type, tuple[Any, int]] = dict(self._handed)
        for index, (stage, record) in enumerate(zip(self.stages, self._records, strict=True)):
            if not self.rounds:
                self.current = index
            job.checkpoint()
            rebuilt = frozenset(need for need in stage.needs if record.seen.get(need) != made[need][1])
            started = time.perf_counter()
            dirty = record.again or rebuilt or stage.dirtied_by & record.pending.aspects
            ran = record.stamp == 0 or bool(dirty)
            before = record.stamp
            if ran:
                artifacts = {need: made[need][0] for need in stage.needs}
                inputs = Inputs(artifacts, record.pending, record.artifact, rebuilt, self.rounds)
                so_far = {kind: artifact for kind, (artifact, _) in made.items()}
                with job.publishing(partial(self._flow, frame, index, so_far, job)):
                    result = stage.run(frame, inputs, job)
                if result is not record.artifact or record.stamp == 0:
                    record.artifact = result
                    record.stamp += 1
                record.seen = {need: made[need][1] for need in stage.needs}
            record.pending, record.again = Changes(), False
            made[stage.gives] = (record.artifact, record.stamp)
            seconds = time.perf_counter() - started
            line = StageRun(type(stage).__name__, ran, record.stamp != before, seconds, self.rounds)
            self.report.append(line)
        return self._records[-1].artifact

    def complete(self, frame: Frame, job: Job) -> None:
        """What stages can do in idle time, after `frame` was brought up to date."""
        for stage in self.stages:
            if isinstance(stage, Completing):
                stage.complete(frame, job)

    def _flow(self, frame: Frame, index: int, made: Mapping[type, Any], job: Job, artifact: Any) -> Any:
        """What the stages after `index` make of a partial artifact; nothing of it is kept."""
        artifacts = {**made, self.stages[index].gives: artifact}
        for after, stage in enumerate(self.stages[index + 1 :], index + 1):
            needed = {need: artifacts[need] for need in stage.needs}
            inputs = Inputs(needed, everything(frame.scene), None, frozenset(stage.needs))
            with job.publishing(partial(self._flow, frame, after, dict(artifacts), job)):
                artifacts[stage.gives] = stage.run(frame, inputs, job)
        return artifacts[self.stages[-1].gives]
