"""Work away from the window's thread that is no shading: reading, writing, importing."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from studio_core.errors import Cancelled
from studio_core.shading.job import Job
from studio_core.shading.scheduler import Executor
from studio_core.signal import Signal
from studio_ui.journal import Journal

T = TypeVar("T")
_KEPT = 12


@dataclass
class Task:
    """One entry of the jobs panel."""

    job: Job
    state: str = "waiting"  # running, done, failed, cancelled
    ended: float | None = None
    on_end: list[Callable[[], object]] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        """Since the start, or how long it took."""
        return (self.ended if self.ended is not None else time.monotonic()) - self.job.started


class Tasks:
    """Runs work on an executor and brings the result back to the window's thread.

    `changed()` when a task starts, moves on or ends.
    """

    def __init__(
        self, executor: Executor, post: Callable[[Callable[[], None]], None], journal: Journal
    ) -> None:
        self.running: list[Task] = []
        self.finished: deque[Task] = deque(maxlen=_KEPT)  # the last of them; quiet ones are left out
        self.changed: Signal[[]] = Signal()
        self._executor, self._post, self._journal = executor, post, journal

    def run(
        self,
        label: str,
        work: Callable[[Job], T],
        done: Callable[[T], object],
        failed: Callable[[Exception], object] | None = None,
        *,
        quiet: bool = False,
        executor: Executor | None = None,
        published: Callable[[Any], object] | None = None,
    ) -> Task:
        """Do `work(job)`; then `done(result)` here. Errors go to the journal, and to `failed`.

        `quiet` keeps it out of the jobs panel (autosave). What takes minutes brings its own `executor`.
        `published(artifact)` is told, here, what the job publishes on its way.
        """

        def tell(artifact: Any) -> None:
            if published is not None:
                self._post(lambda: published(artifact))

        listens = tell if published is not None else None
        job = Job(label, lambda _: self._post(self.changed.emit), listens)
        task = Task(job)
        if not quiet:
            self.running.append(task)
            self.changed.emit()
        (executor or self._executor).submit(lambda: self._work(task, work, done, failed))
        return task

    def follow(self, job: Job) -> Callable[[], None]:
        """Tell of a job that somebody else runs, until what is returned is called."""
        task = Task(job, "running")
        self.running.append(task)
        self.changed.emit()

        def over() -> None:
            if task in self.running:
                task.ended, task.state = time.monotonic(), "cancelled" if job.cancelled else "done"
                self.running.remove(task)
                self.finished.append(task)
                self.changed.emit()

        return over

    def cancel(self) -> None:
        """Ask all of them to stop."""
        for task in self.running:
            task.job.cancel()

    def _work(
        self,
        task: Task,
        work: Callable[[Job], T],
        done: Callable[[T], object],
        failed: Callable[[Exception], object] | None,
    ) -> None:
        result: Any = None
        error: Exception | None = None
        task.state = "running"
        try:
            task.job.checkpoint()
            result = work(task.job)
        except Exception as caught:
            error = caught
        except SystemExit as caught:  # a plugin must not take the program down
            error = RuntimeError(f"a plugin tried to leave the program: {caught}")
        self._post(lambda: self._end(task, result, error, done, failed))

    def _end(
        self,
        task: Task,
        result: Any,
        error: Exception | None,
        done: Callable[[Any], object],
        failed: Callable[[Exception], object] | None,
    ) -> None:
        task.ended = time.monotonic()
        task.state = "done" if error is None else "cancelled" if isinstance(error, Cancelled) else "failed"
        if task in self.running:
            self.running.remove(task)
            self.finished.append(task)
        self.changed.emit()
        if error is None:
            done(result)
            return
        if not isinstance(error, Cancelled):
            self._journal.problem(task.job.label, error)
        if failed is not None:
            failed(error)
