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
        """Call every receiver; one connected meanwhile waits for the next emit."""
        for receiver in tuple(self._receivers):
            receiver(*args, **kwargs)
