"""What every verb without a window needs, put together once."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

from studio_core.contract import Services
from studio_core.registry import PluginHost
from studio_core.shading.job import Job


@dataclass
class Headless:
    """Plugins, threads and progress for one command."""

    quiet: bool = False
    threads: int | None = None

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
        from studio_core.parallel import Workers

        return Services(Workers(self.threads), self.registry)

    def say(self, text: str) -> None:
        """One line on stderr."""
        print(text, file=sys.stderr, flush=True)

    @contextmanager
    def job(self, label: str) -> Iterator[Job]:
        """A job whose progress is shown on stderr while it is a terminal, and timed at its end."""
        shown = sys.stderr.isatty() and not self.quiet
        last = 0.0

        def progress(job: Job) -> None:
            nonlocal last
            now = time.monotonic()
            if shown and job.total and now - last > 0.2:
                last = now
                print(f"\r{label}: {100 * job.done // job.total:3d} %", end="", file=sys.stderr, flush=True)

        started = time.monotonic()
        yield Job(label, progress)
        if not self.quiet:
            start = "\r" if shown else ""
            self.say(f"{start}{label}: {time.monotonic() - started:.1f} s")

    def close(self) -> None:
        """Join the threads."""
        if "services" in self.__dict__:
            self.services.workers.close()
