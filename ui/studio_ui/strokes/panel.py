"""The stroke brush's panel. Its inside is made when it is first shown and models are loaded."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtGui import QShowEvent

from studio_ui.context import Context
from studio_ui.look.theme import Theme
from studio_ui.panels.panel import Panel, note

if TYPE_CHECKING:
    from studio_ui.strokes.controls import StrokeControls
    from studio_ui.strokes.desk import StrokeDesk


class StrokePanel(Panel):
    """`desk()` is asked once, when somebody looks."""

    id = "strokes"
    title = "Strokes"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.desk: Callable[[], StrokeDesk] | None = None
        self.controls: StrokeControls | None = None
        self._inside = self.scroller()
        self._wait = note("A moment: models are being loaded.")
        self._inside.addWidget(self._wait)
        self._inside.addStretch(1)
        self.subscriptions.add(context.warmed.connect(self._build))

    def showEvent(self, event: QShowEvent) -> None:
        """Somebody looks."""
        super().showEvent(event)
        self._build()

    def set_theme(self, theme: Theme) -> None:
        """Another theme."""
        super().set_theme(theme)
        if self.controls is not None:
            self.controls.set_theme(theme)

    def _build(self) -> None:
        if self.controls is not None or self.desk is None or not self.context.warm or not self.isVisible():
            return
        from studio_ui.strokes.controls import StrokeControls

        self.controls = StrokeControls(self, self.desk())
        self._wait.hide()
        self._inside.insertWidget(0, self.controls)


__all__ = ["StrokePanel"]
