"""Work beside the window of which only the newest wish counts; what runs is let end."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from studio_ui.context import Context


class Newest:
    """One piece of work at a time; `done` is told of the last that was asked for, and of some before."""

    def __init__(self, context: Context, label: str) -> None:
        self._context, self._label = context, label
        self._waiting: tuple[Callable[[], Any], Callable[[Any], object]] | None = None
        self._busy = self._closed = False

    @property
    def busy(self) -> bool:
        """Whether something is made or waits."""
        return self._busy or self._waiting is not None

    def ask(self, work: Callable[[], Any], done: Callable[[Any], object]) -> None:
        """Do `work()` elsewhere, then `done(result)` here."""
        if not self._closed:
            self._waiting = (work, done)
            self._next()

    def close(self) -> None:
        """Tell nobody any more."""
        self._closed, self._waiting = True, None

    def _next(self) -> None:
        if self._busy or self._waiting is None:
            return
        self._busy = True
        (work, done), self._waiting = self._waiting, None

        def ended(result: Any) -> None:
            self._busy = False
            if not self._closed:
                done(result)
            self._next()

        def failed(error: Exception) -> None:
            self._busy = False
            self._next()

        context = self._context
        context.tasks.run(self._label, lambda job: work(), ended, failed, quiet=True, executor=context.aside)


__all__ = ["Newest"]
