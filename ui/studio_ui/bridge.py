"""From any thread to the window's: the only QObject that two threads know."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from PySide6.QtCore import QCoreApplication, QObject, Qt, QTimerEvent, Signal


class Bridge(QObject):
    """Queues calls on the thread that made it. Safe while the window goes: late calls are dropped."""

    _called = Signal(object)

    def __init__(self, on_error: Callable[[Exception], object] | None = None) -> None:
        super().__init__()
        self.on_error = on_error
        self._guard = threading.Lock()
        self._open = True
        self._later: dict[int, Callable[[], object]] = {}
        self._held: list[Callable[[], object]] | None = None
        self._called.connect(self._run, Qt.ConnectionType.QueuedConnection)

    def post(self, call: Callable[[], object]) -> None:
        """Run `call` on the window's thread soon, in the order of posting."""
        with self._guard:
            if self._open:
                self._called.emit(call)

    def later(self, milliseconds: int, call: Callable[[], object]) -> None:
        """Run `call` after a while; from the window's thread alone."""
        if self._open:
            self._later[self.startTimer(milliseconds)] = call

    @contextmanager
    def quiet(self) -> Iterator[None]:
        """Inside, calls wait, also while events are handled; they run soon after, in their order."""
        if self._held is not None:
            yield
            return
        self._held = []
        try:
            yield
        finally:
            held, self._held = self._held, None
            for call in held:
                self.post(call)

    def close(self) -> None:
        """Drop what is queued and what is still to come."""
        with self._guard:
            self._open = False
        for timer in self._later:
            self.killTimer(timer)
        self._later.clear()
        QCoreApplication.sendPostedEvents(self)  # Qt keeps what nobody receives

    def timerEvent(self, event: QTimerEvent) -> None:
        """One of `later`."""
        self.killTimer(event.timerId())
        call = self._later.pop(event.timerId(), None)
        if call is not None:
            self._run(call)

    def _run(self, call: Callable[[], object]) -> None:
        if not self._open:
            return
        if self._held is not None:
            self._held.append(call)
            return
        try:
            call()
        except Exception as error:
            if self.on_error is None:
                raise
            self.on_error(error)
