"""A piece of work as a part of a larger one: one bar from 0 to 1 for everything together."""

from __future__ import annotations

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
