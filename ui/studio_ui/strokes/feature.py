"""The window's ways to strokes: the tool, its keys, and the panel that comes up with it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from studio_ui.canvas.overlay import Overlay
from studio_ui.canvas.tools import CanvasTools
from studio_ui.canvas.viewport import Pointer, Viewport
from studio_ui.context import Context
from studio_ui.settings import Settings
from studio_ui.strokes.panel import StrokePanel

if TYPE_CHECKING:
    from studio_ui.strokes.desk import StrokeDesk

TOOL = "stroke"


class StrokeFeature:
    """Handlers of actions, and the tool of `CanvasTools` until the desk is there, which loads kernels.

    `show` brings the panel to the front.
    """

    def __init__(
        self,
        context: Context,
        viewport: Viewport,
        tools: CanvasTools,
        settings: Settings,
        panel: StrokePanel,
        hint: Callable[[str], object],
        show: Callable[[], object],
    ) -> None:
        self._context, self._viewport, self._tools = context, viewport, tools
        self._settings, self._hint, self._show, self._panel = settings, hint, show, panel
        self._desk: StrokeDesk | None = None
        tools.own[TOOL] = self
        panel.desk = self.desk
        self._off = tools.tool_changed.connect(lambda tool: show() if tool == TOOL else None)

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {
            "stroke.smaller": lambda: self.desk().store.larger(-1),
            "stroke.larger": lambda: self.desk().store.larger(),
            "stroke.softer": lambda: self.desk().store.harder(-1),
            "stroke.harder": lambda: self.desk().store.harder(),
            "stroke.indirect": self._turn,
            "stroke.match": self._match,
            "stroke.stylise": self._stylise,
        }

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name."""
        return {"stroke_indirect": lambda: self._desk is not None and self._desk.store.now.indirect}

    def desk(self) -> StrokeDesk:
        """Made when it is first asked for."""
        if self._desk is None:
            from studio_ui.strokes.desk import StrokeDesk

            self._desk = StrokeDesk(
                self._context,
                self._viewport,
                self._tools.looking,
                self._settings,
                self._hint,
                self._tools.refresh,
            )
        return self._desk

    def close(self) -> None:
        """Stop everything."""
        self._off()
        if self._desk is not None:
            self._desk.close()

    def _turn(self) -> None:
        store = self.desk().store
        store.use(indirect=not store.now.indirect)

    def _stylise(self) -> None:
        """Where it is chosen how much."""
        self._show()
        if self._panel.controls is not None:
            self._panel.controls.style_.unfold()

    def _match(self) -> None:
        """Where is told how far it is."""
        self._show()
        self.desk().match()

    # as a tool

    def pointer(self, pointer: Pointer) -> bool:
        """See `CanvasTool`."""
        if not self._context.warm:
            return False
        return self.desk().hand.pointer(pointer)

    def wheel(self, pointer: Pointer, steps: float) -> bool:
        """See `CanvasTool`."""
        return self._desk is not None and self._desk.hand.wheel(pointer, steps)

    def marks(self) -> Overlay:
        """See `CanvasTool`."""
        return Overlay() if self._desk is None else self._desk.hand.marks()

    def leave(self) -> None:
        """See `CanvasTool`."""
        if self._desk is not None:
            self._desk.hand.leave()


__all__ = ["StrokeFeature"]
