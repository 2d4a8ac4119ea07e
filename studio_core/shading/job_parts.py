"""A piece of work as a part of a larger one, which it stops with and reports to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from studio_core.shading.job import Job

STEPS = 10_000  # of the whole


class JobPart(Job):
    """The stretch `low` … `high` (shares of the whole) of another job: it stops with it and reports to it.

    What reports several times from 0 on, as stages do one after another, never moves the bar back.
    """

    def __init__(self, whole: Job, low: float, high: float, label: str = "") -> None:
        super().__init__(label or whole.label)
        self.whole, self.low, self.high = whole, low, high

    @property
    def cancelled(self) -> bool:
        """Whether the whole was asked to stop."""
        return self.whole.cancelled

    def cancel(self) -> None:
        """Stops the whole."""
        self.whole.cancel()

    def at(self, share: float) -> None:
        """Report how much of this part is done, 0 … 1, and stop here when cancelled."""
        place = round(STEPS * (self.low + (self.high - self.low) * min(max(share, 0.0), 1.0)))
        self.whole.label = self.label
        self.whole.checkpoint(max(place, self.whole.done if self.whole.total == STEPS else 0), STEPS)

    def checkpoint(self, done: int = 0, total: int = 0) -> None:
        """See `Job.checkpoint`."""
        self.checkpoints += 1
        self.done, self.total = done, total
        self.at(done / total if total else 0.0)


class InnerJob(Job):
    """Work of stages inside a stage: it stops with its job, and publishes `turned` what they publish."""

    def __init__(self, whole: Job, turned: Callable[[Any], Any] = lambda artifact: artifact) -> None:
        super().__init__(whole.label, on_publish=lambda artifact: whole.publish(turned(artifact)))
        self.whole = whole

    @property
    def cancelled(self) -> bool:
        """Whether the whole was asked to stop."""
        return self.whole.cancelled

    def cancel(self) -> None:
        """Stops the whole."""
        self.whole.cancel()

    def checkpoint(self, done: int = 0, total: int = 0) -> None:
        """Reports to the whole, and stops with it."""
        self.checkpoints += 1
        self.done, self.total = done, total
        self.whole.checkpoint(done, total)

    @property
    def listened_to(self) -> bool:
        """Whether somebody wants partial results, of this and of the whole."""
        return super().listened_to and self.whole.listened_to

    def publish(self, artifact: Any) -> None:
        """By way of the whole; nothing is turned where nobody listens."""
        if self.listened_to:
            super().publish(artifact)
