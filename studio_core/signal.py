"""A signal without a toolkit: callbacks called in the order they were connected."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, ParamSpec

P = ParamSpec("P")


class Signal(Generic[P]):
    """`connect` returns a function that disconnects again."""

    def __init__(self) -> None:
        self._receivers: list[Callable[P, object]] = []

    def connect(self, receiver: Callable[P, object]) -> Callable[[], None]:
        """Call `receiver` on every emit from now on."""
        self._receivers.append(receiver)

        def disconnect() -> None:
            if receiver in self._receivers:
                self._receivers.remove(receiver)

        return disconnect

    def emit(self, *args: P.args, **kwargs: P.kwargs) -> None:
        """Call every receiver; one connected meanwhile waits for the next emit, one that left is not called.

        An error of one keeps no other from being called: the first is raised in the end, with a note of
        each later one.
        """
        first: Exception | None = None
        for receiver in tuple(self._receivers):
            try:
                if receiver in self._receivers:
                    receiver(*args, **kwargs)
            except Exception as error:
                if first is None:
                    first = error
                else:
                    first.add_note(f"another receiver failed as well: {error!r}")
        if first is not None:
            raise first
