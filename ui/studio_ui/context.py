"""What panels are given: built once by the composition root, passed along."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field

from studio_core.contract import Services
from studio_core.document import Document
from studio_core.registry import PluginHost
from studio_core.session import Session
from studio_core.shading.scheduler import Executor
from studio_core.signal import Signal
from studio_ui.editing import Editing
from studio_ui.feed import PictureFeed
from studio_ui.journal import Journal
from studio_ui.tasks import Tasks


class Subscriptions:
    """Connections that end together."""

    def __init__(self) -> None:
        self._off: list[Callable[[], None]] = []

    def add(self, *disconnects: Callable[[], None]) -> None:
        """Keep what `Signal.connect` returned."""
        self._off += disconnects

    def close(self) -> None:
        """Disconnect everything."""
        while self._off:
            self._off.pop()()


@dataclass
class Context:
    """Document, session and what serves them. `warm` tells whether models and backends are loaded.

    Before that panels must not touch `host.get`: it would import what is heavy on the window's thread.
    `compute` runs what needs kernels, with `services`; `aside` what is small and must not wait for pictures;
    inside `quiet()` results of other threads wait.
    """

    document: Document
    session: Session
    editing: Editing
    host: PluginHost
    journal: Journal
    tasks: Tasks
    feed: PictureFeed
    services: Services | None = None
    compute: Executor | None = None
    quiet: Callable[[], AbstractContextManager[None]] = nullcontext
    warm: bool = False
    warmed: Signal[[]] = field(default_factory=Signal)
    aside: Executor | None = None
