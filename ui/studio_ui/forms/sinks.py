"""Where the values of a form go: into edits of the document, or to a callback."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from studio_core.edits import Edit
from studio_core.params import Value
from studio_ui.editing import Editing


class Sink(Protocol):
    """Where a form's values go. A slider's drag is begin, preview …, commit; all else is apply."""

    def begin(self, name: str) -> bool:
        """A gesture on one parameter starts; False when it may not."""
        ...

    def preview(self, name: str, value: Value) -> None:
        """Show a value."""
        ...

    def commit(self) -> None:
        """The gesture ends."""
        ...

    def cancel(self) -> None:
        """The gesture is rolled back."""
        ...

    def apply(self, name: str, value: Value) -> None:
        """One step."""
        ...


class EditSink:
    """Values become edits of a document: `make(name, value)`; a gesture on `name` is called `label(name)`.

    What `make` has no edit for (None) changes nothing.
    """

    def __init__(
        self, editing: Editing, make: Callable[[str, Value], Edit | None], label: Callable[[str], str]
    ) -> None:
        self._editing, self._make, self._label = editing, make, label

    def begin(self, name: str) -> bool:
        """Start a gesture named after the parameter."""
        return self._editing.begin(self, self._label(name))

    def preview(self, name: str, value: Value) -> None:
        """Show a value."""
        edit = self._make(name, value)
        if edit is not None:
            self._editing.preview(self, edit)

    def commit(self) -> None:
        """One history entry."""
        self._editing.commit(self)

    def cancel(self) -> None:
        """Roll back."""
        self._editing.cancel(self)

    def apply(self, name: str, value: Value) -> None:
        """One step."""
        edit = self._make(name, value)
        if edit is not None:
            self._editing.apply(edit)


class PlainSink:
    """Values go to a callback; what is dragged is only told at the end."""

    def __init__(self, told: Callable[[str, Value], object]) -> None:
        self._told = told
        self._last: tuple[str, Value] | None = None

    def begin(self, name: str) -> bool:
        """Remember nothing yet."""
        self._last = None
        return True

    def preview(self, name: str, value: Value) -> None:
        """Remember the last."""
        self._last = (name, value)

    def commit(self) -> None:
        """Tell the last."""
        last, self._last = self._last, None
        if last is not None:
            self._told(*last)

    def cancel(self) -> None:
        """Forget it."""
        self._last = None

    def apply(self, name: str, value: Value) -> None:
        """Tell at once."""
        self._told(name, value)


class LiveSink(PlainSink):
    """Tells while a hand drags, and puts back what was there when it gives up."""

    def __init__(self, told: Callable[[float], object], now: Callable[[], float]) -> None:
        super().__init__(lambda name, value: None)
        self._say, self._now, self._before = told, now, 0.0

    def begin(self, name: str) -> bool:
        """Remember."""
        self._before = self._now()
        return True

    def preview(self, name: str, value: Value) -> None:
        """At once."""
        self.apply(name, value)

    def commit(self) -> None:
        """Nothing is left to tell."""

    def cancel(self) -> None:
        """As before."""
        self._say(self._before)

    def apply(self, name: str, value: Value) -> None:
        """At once."""
        assert isinstance(value, int | float)
        self._say(float(value))
