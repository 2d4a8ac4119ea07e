"""Chunks of a kernel's work on a few threads: same result for any number of them, and can be cancelled.

Kernels are serial and release the interpreter lock. `Workers.run` cuts a range into chunks whose bounds
depend on the arguments alone, so what a chunk writes is bit-identical however many threads there are;
sums over chunks are combined by the caller, in chunk order. The calling thread works too, and between
its chunks it asks the job whether to go on. Why no `prange`: docs/decisions/0002.
"""

from __future__ import annotations

import os
import queue
import threading
import weakref
from collections.abc import Callable
from typing import Protocol

Body = Callable[[int, int], object]


class Checkpoints(Protocol):
    """What `run` needs of a job."""

    def checkpoint(self, done: int, total: int, /) -> None:
        """Reports progress; raises `Cancelled` when the job was cancelled."""


class _Run:
    """One call of `Workers.run`: hands out chunks, counts those at work, keeps the first error."""

    def __init__(self, count: int, chunk: int, body: Body):
        self.count, self.chunk, self.body = count, chunk, body
        self._next = 0
        self._active = 0
        self._done = 0
        self._failed_at = count
        self._error: BaseException | None = None
        self._changed = threading.Condition()

    @property
    def done(self) -> int:
        return self._done

    def take(self) -> int:
        """The start of the next chunk, or -1."""
        with self._changed:
            start = self._next
            if start >= self.count:
                return -1
            self._next = start + self.chunk
            self._active += 1
            return start

    def work(self, start: int) -> None:
        stop = min(start + self.chunk, self.count)
        error: BaseException | None = None
        try:
            self.body(start, stop)
        except BaseException as caught:
            error = caught
        with self._changed:
            self._active -= 1
            if error is None:
                self._done += stop - start
            else:
                self._next = self.count
                if start < self._failed_at:
                    self._failed_at, self._error = start, error
            if not self._active:
                self._changed.notify_all()

    def finish(self) -> BaseException | None:
        """Starts no further chunk, waits for those at work, gives the error of the earliest chunk."""
        with self._changed:
            self._next = self.count
            while self._active:
                self._changed.wait()
        self.body = _nothing  # a helper may hold this run until its next one
        error, self._error = self._error, None
        return error


def _nothing(start: int, stop: int) -> None:
    """The body of a run that is over."""


def available_cores() -> int:
    """Processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _help(tickets: queue.SimpleQueue[_Run | None], inside: threading.local) -> None:
    inside.active = True
    while (run := tickets.get()) is not None:
        while (start := run.take()) >= 0:
            run.work(start)
        del run


def _dismiss(tickets: queue.SimpleQueue[_Run | None], helpers: int) -> None:
    for _ in range(helpers):
        tickets.put(None)


class Workers:
    """A small pool of threads; made once by the application and passed to whatever runs kernels.

    `threads` counts the calling thread (default: the processors this process may use); with 1 there is
    no other. Several threads may call `run` at once: each works on its own chunks and gets help when a
    helper is free. Use as a context manager, or `close()` it.
    """

    def __init__(self, threads: int | None = None):
        self.threads = available_cores() if threads is None else threads
        if self.threads < 1:
            raise ValueError(f"there must be at least one thread, not {threads}")
        self._tickets: queue.SimpleQueue[_Run | None] = queue.SimpleQueue()
        self._inside = threading.local()
        self._helpers = [
            threading.Thread(
                target=_help, args=(self._tickets, self._inside), name=f"kernel-{index}", daemon=True
            )
            for index in range(1, self.threads)
        ]
        for helper in self._helpers:
            helper.start()
        self._dismissal = weakref.finalize(self, _dismiss, self._tickets, len(self._helpers))

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the threads after the chunks they are at; may be called twice."""
        self._dismissal()
        for helper in self._helpers:
            helper.join()

    def run(self, count: int, chunk: int, body: Body, job: Checkpoints | None = None) -> None:
        """Calls `body(start, stop)` for every chunk [start, stop) of range(count).

        Before each of its own chunks and at the end the calling thread calls
        `job.checkpoint(items done, count)`. When that or a body raises, no further chunk starts, and
        the error of the earliest failed chunk is raised once all threads have left the body. Chunks
        may run in any order and write disjoint results. Inside a body, `run` works through its chunks
        on the spot, without help.
        """
        if chunk < 1:
            raise ValueError(f"a chunk holds at least one item, not {chunk}")
        if not self._dismissal.alive:
            raise RuntimeError("these workers are closed")
        if count <= 0:
            return
        run = _Run(count, chunk, body)
        nested = getattr(self._inside, "active", False)
        if not nested:
            chunks = (count + chunk - 1) // chunk
            for _ in range(min(len(self._helpers), chunks - 1)):
                self._tickets.put(run)
        self._inside.active = True
        try:
            if job is not None:
                job.checkpoint(0, count)
            while (start := run.take()) >= 0:
                run.work(start)
                if job is not None and run.done < count:
                    job.checkpoint(run.done, count)
        finally:
            self._inside.active = nested
            error = run.finish()
        if error is not None:
            raise error
        if job is not None:
            job.checkpoint(count, count)
