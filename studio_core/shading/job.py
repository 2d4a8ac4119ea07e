"""One piece of work that can report, be cancelled, and hand out partial results."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from studio_core.errors import Cancelled

_numbers = itertools.count(1)


class Job:
    """Passed down to everything that computes for long.

    `checkpoint` is called between chunks: it reports progress and raises `Cancelled` once `cancel` was
    called (from any thread). `publish` hands a partial artifact to whoever waits for it.
    """

    def __init__(
        self,
        label: str,
        on_progress: Callable[[Job], None] | None = None,
        on_publish: Callable[[Any], None] | None = None,
    ) -> None:
        self.number = next(_numbers)
        self.label = label
        self.done = 0
        self.total = 0
        self.checkpoints = 0
        self.ended = False  # set by whoever runs it
        self.started = time.monotonic()
        self._on_progress = on_progress
        self._on_publish = on_publish
        self._finish: Callable[[Any], Any] = lambda artifact: artifact
        self._cancelled = threading.Event()

    def cancel(self) -> None:
        """Ask the job to stop at its next checkpoint."""
        self._cancelled.set()

    @property
    def cancelled(self) -> bool:
        """Whether it was asked to stop."""
        return self._cancelled.is_set()

    def checkpoint(self, done: int = 0, total: int = 0) -> None:
        """Report `done` of `total` and stop here when cancelled."""
        self.checkpoints += 1
        if self._cancelled.is_set():
            raise Cancelled(self.label)
        self.done, self.total = done, total
        if self._on_progress is not None:
            self._on_progress(self)

    @property
    def listened_to(self) -> bool:
        """Whether somebody wants partial results; without, steps towards the last need not be made."""
        return self._on_publish is not None

    def publish(self, artifact: Any) -> None:
        """Show a partial result; ignored where nobody listens."""
        if self._on_publish is not None:
            self._on_publish(self._finish(artifact))

    @contextmanager
    def publishing(self, finish: Callable[[Any], Any]) -> Iterator[None]:
        """Inside, what is published first goes through `finish`."""
        before, self._finish = self._finish, finish
        try:
            yield
        finally:
            self._finish = before

    @contextmanager
    def unheard(self) -> Iterator[None]:
        """Inside, nobody listens: what is finer is on the screen already."""
        before, self._on_publish = self._on_publish, None
        try:
            yield
        finally:
            self._on_publish = before
