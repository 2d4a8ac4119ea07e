"""What every verb without a window needs, put together once."""

from __future__ import annotations

import contextlib
import json
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import TextIO

from studio_core.contract import Services
from studio_core.errors import Cancelled
from studio_core.registry import PluginHost
from studio_core.shading.job import Job

LINE_EVERY = 0.1  # seconds between two lines of progress for a program


@dataclass
class Headless:
    """Plugins, threads, progress and result for one command."""

    quiet: bool = False
    threads: int | None = None
    progress: str = "text"
    out: TextIO | None = field(default_factory=lambda: sys.stdout)

    @cached_property
    def registry(self) -> PluginHost:
        """All installed plugins; failures are said on stderr."""
        host = PluginHost.discover()
        for failure in host.failures:
            self.say(f"plugin {failure.plugin}: {failure.what}")
        return host

    @cached_property
    def services(self) -> Services:
        """Threads and registry for backends."""
        from studio_core.folders import user_cache
        from studio_core.parallel import Workers
        from studio_core.shading.cache import DiskCache

        return Services(Workers(self.threads), self.registry, DiskCache(user_cache() / "computed"))

    def say(self, text: str, end: str = "\n") -> None:
        """One line on stderr, where there is one."""
        with contextlib.suppress(OSError):
            print(text, end=end, file=sys.stderr, flush=True)

    def tell(self, job: Job, values: Mapping[str, object]) -> None:
        """One JSON line on stderr, where a program asked for progress like that; its end cancels the job."""
        if self.progress == "json" and sys.stderr is not None:
            try:
                print(json.dumps(values), file=sys.stderr, flush=True)
            except OSError:
                job.cancel()

    def result(self, text: str) -> None:
        """What the command was asked for, on stdout."""
        if self.out is not None:
            print(text, file=self.out)

    @contextmanager
    def job(self, label: str) -> Iterator[Job]:
        """A job whose progress is shown on stderr while it is a terminal, and timed at its end.

        Ctrl-C cancels it, which ends in KeyboardInterrupt at its next checkpoint. With progress as JSON it
        ends likewise when nobody reads that any more.
        """
        shown = not self.quiet and sys.stderr is not None and sys.stderr.isatty()
        last = 0.0
        lines = self.progress == "json"

        def progress(job: Job) -> None:
            nonlocal last
            now = time.monotonic()
            if lines and job.total and now - last > LINE_EVERY:
                last = now
                self.tell(job, {"label": job.label, "done": job.done, "total": job.total})
            elif shown and job.total and now - last > 0.2:
                last = now
                self.say(f"\r{label}: {100 * job.done // job.total:3d} %", end="")

        started = time.monotonic()
        job = Job(label, progress)
        try:
            with _interrupts(job):
                yield job
        except BaseException:
            if last and not lines:
                self.say("")  # what follows gets a line of its own
            raise
        if not self.quiet and not lines:
            start = "\r" if last else ""
            self.say(f"{start}{label}: {time.monotonic() - started:.1f} s")

    def close(self) -> None:
        """Join the threads."""
        if "services" in self.__dict__:
            self.services.workers.close()


@contextmanager
def _interrupts(job: Job) -> Iterator[None]:
    """Inside, the first Ctrl-C, or a polite kill, cancels the job.

    Raised wherever it comes, KeyboardInterrupt is lost inside a compiler's callback.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: object) -> None:
        if job.cancelled:
            raise KeyboardInterrupt
        job.cancel()

    kinds = [signal.SIGINT, signal.SIGTERM]
    before = [signal.signal(kind, stop) for kind in kinds]
    try:
        yield
    except Cancelled:
        raise KeyboardInterrupt from None
    finally:
        for kind, handler in zip(kinds, before, strict=True):
            signal.signal(kind, handler)
    if job.cancelled:
        raise KeyboardInterrupt
