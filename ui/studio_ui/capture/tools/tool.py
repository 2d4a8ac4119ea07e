"""What the preview asks of a tool: draw over the picture, take the mouse and keys first."""

from __future__ import annotations

from typing import Protocol

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QKeyEvent, QPainter

from studio_ui.look.theme import Theme


class Canvas(Protocol):
    """The preview as a tool sees it: points of the picture to the widget's and back."""

    theme: Theme

    def to_widget(self, x: float, y: float) -> QPointF:
        """Where a point of the picture is seen."""
        ...

    def to_picture(self, at: QPointF) -> tuple[float, float]:
        """Which point of the picture is seen there."""
        ...

    def update(self) -> None:
        """Draw again."""
        ...


class Tool:
    """Does nothing; tools do some of it. A press that returns True is a drag until its release."""

    tip = ""

    def paint(self, painter: QPainter, canvas: Canvas) -> None:
        """Over the picture, in widget pixels."""

    def cursor(self, canvas: Canvas, at: QPointF) -> Qt.CursorShape | None:
        """What the cursor looks like there; None: as usual."""
        return None

    def press(self, canvas: Canvas, at: QPointF, keys: Qt.KeyboardModifier) -> bool:
        """Whether the tool takes it."""
        return False

    def move(self, canvas: Canvas, at: QPointF, keys: Qt.KeyboardModifier) -> None:
        """The drag goes on."""

    def release(self, canvas: Canvas) -> None:
        """The drag ends."""

    def drop(self, canvas: Canvas) -> bool:
        """Esc: whether there was a drag to give up."""
        return False

    def key(self, canvas: Canvas, event: QKeyEvent) -> bool:
        """Whether the tool takes it."""
        return False
