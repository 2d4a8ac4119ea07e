"""One job's progress over stages of different length, and what stages made before."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from studio_core.shading.job import Job

T = TypeVar("T")
_PARTS = 1000


class StageJob(Job):
    """A stage's view of the job it belongs to: its checkpoints fill the stage's share of the whole."""

    def __init__(self, whole: Job, start: float, share: float) -> None:
        super().__init__(whole.label)
        self._whole, self._start, self._share = whole, start, share

    def cancel(self) -> None:
        """Cancels the whole."""
        self._whole.cancel()

    @property
    def cancelled(self) -> bool:
        """Whether the whole was asked to stop."""
        return self._whole.cancelled

    def checkpoint(self, done: int = 0, total: int = 0) -> None:
        """Report `done` of `total` of this stage."""
        part = min(max(done / total, 0.0), 1.0) if total > 0 else 0.0
        at = round(_PARTS * (self._start + self._share * part))
        self._whole.checkpoint(max(at, self._whole.done), _PARTS)  # it never goes back
        self.checkpoints += 1


class Kept:
    """The last result of every stage; made again where what it was made from is no longer the same.

    Inputs are compared by `==`: settings by value; pictures, without equality of their own, by identity.
    """

    def __init__(self) -> None:
        self._kept: dict[str, tuple[tuple[Any, ...], Any]] = {}
        self.made: list[str] = []

    def get(self, stage: str, inputs: tuple[Any, ...], make: Callable[[], T]) -> T:
        """The result for these inputs."""
        found = self._kept.get(stage)
        if found is not None and found[0] == inputs:
            made: T = found[1]
            return made
        self._kept.pop(stage, None)  # frees memory before the stage needs it
        self.made.append(stage)
        made = make()
        self._kept[stage] = (inputs, made)
        return made
