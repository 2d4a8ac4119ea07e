"""The window's way to the document: edits, gestures that span events, errors told instead of raised."""

from __future__ import annotations

from collections.abc import Callable

from studio_core.document import Document, Gesture
from studio_core.edits import Edit
from studio_core.errors import LucarneError
from studio_core.signal import Signal


class Editing:
    """Panels and tools write through this. One gesture at a time; whoever began it ends it."""

    def __init__(self, document: Document, refuse: Callable[[str, BaseException], object]) -> None:
        self.document = document
        self.began: Signal[[]] = Signal()  # a gesture started: pictures should come quickly
        self.finishing: Signal[[]] = Signal()  # it is about to stay as it is: the last moment to preview
        self.settled: Signal[[]] = Signal()  # it ended: they may take their time again
        self.done: Signal[[Edit]] = Signal()  # an edit went into the history, or a gesture's last one
        self.stepped: Signal[[int]] = Signal()  # so many steps back or forward in the history
        self._refuse = refuse
        self._last: Edit | None = None
        self._gesture: Gesture | None = None
        self._owner: object = None
        self._gives_way = False

    @property
    def busy(self) -> bool:
        """Whether a gesture is under way."""
        return self._gesture is not None

    def apply(self, edit: Edit) -> bool:
        """Do an edit as one step (a gesture under way is ended first); False when it was refused."""
        self.finish()
        before = self.document.scene
        if not self._try(edit.label, lambda: self.document.apply(edit)):
            return False
        if self.document.scene is not before:
            self.done.emit(edit)
        return True

    def begin(self, owner: object, label: str, *, gives_way: bool = False) -> bool:
        """Start a gesture; False while another one is under way.

        One that `gives_way` is no hand's: pictures are as at rest meanwhile, and the next gesture ends it.
        """
        if self._gesture is not None and self._gives_way:
            self.finish()
        if self._gesture is not None:
            return False
        self._gesture, self._owner, self._gives_way = self.document.begin(label), owner, gives_way
        if not gives_way:
            self.began.emit()
        return True

    def preview(self, owner: object, edit: Edit) -> bool:
        """Show the scene as at the gesture's start, changed by `edit`."""
        gesture = self._gesture
        if gesture is None or self._owner is not owner:
            return False
        self._last = edit if self._try(gesture.label, lambda: gesture.apply(edit)) else self._last
        return self._last is edit

    def call(self, owner: object, label: str) -> None:
        """Give the gesture another name: what it does became clear while it lasted."""
        if self._gesture is not None and self._owner is owner:
            self._gesture.label = label

    def rename(self, owner: object, label: str) -> None:
        """What the history will call the gesture."""
        if self._gesture is not None and self._owner is owner:
            self._gesture.label = label

    def commit(self, owner: object) -> None:
        """End the gesture as one step."""
        if self._gesture is not None and self._owner is owner:
            self.finish()

    def cancel(self, owner: object) -> None:
        """Roll the gesture back."""
        if self._gesture is not None and self._owner is owner:
            self._end(self.document.cancel)

    def finish(self) -> None:
        """Commit whatever gesture is under way."""
        if self._gesture is None:
            return
        self.finishing.emit()
        changed, last = self.document.scene is not self._gesture.start, self._last
        self._end(self.document.commit)
        if changed and last is not None:
            self.done.emit(last)

    def cancel_any(self) -> bool:
        """Roll back whatever gesture is under way (Esc); whether there was one."""
        if self._gesture is None:
            return False
        self._end(self.document.cancel)
        return True

    def undo(self) -> None:
        """One step back."""
        self.finish()
        self.go_to(self.document.position - 1)

    def redo(self) -> None:
        """One step forward."""
        self.finish()
        self.go_to(self.document.position + 1)

    def go_to(self, position: int) -> None:
        """Show any step of the history."""
        self.finish()
        before = self.document.position
        if self.document.go_to(position):
            self.stepped.emit(position - before)

    def _end(self, how: Callable[[], None]) -> None:
        self._gesture = self._owner = self._last = None
        how()
        self.settled.emit()

    def _try(self, label: str, action: Callable[[], object]) -> bool:
        try:
            action()
        except (LucarneError, ValueError) as error:
            self._refuse(label, error)
            return False
        return True
