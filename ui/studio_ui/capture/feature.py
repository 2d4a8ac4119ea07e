"""The window's ways to the capture panel: menu, palette, drops, and the things that a capture belongs to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from studio_core.scene.capture import Capture
from studio_core.scene.nodes import Environment, NodeId, Scene
from studio_ui.capture.panel import CapturePanel
from studio_ui.context import Context


class CaptureFeature:
    """Handlers of actions. `show` brings the panel to the front."""

    def __init__(self, context: Context, panel: CapturePanel, show: Callable[[], object]) -> None:
        self._context, self._panel, self._show = context, panel, show
        added = panel.reading.added

        def shown(node: NodeId) -> None:
            added(node)
            show()

        panel.reading.added = shown

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {
            "file.capture": self.begin,
            "object.edit_capture": self.edit,
        }

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name."""
        return {"captured": lambda: self._chosen() is not None}

    def begin(self) -> None:
        """Photographs of a room; where some have been imported, the panel."""
        scene = self._context.document.scene
        if next(scene.of(Capture), None) is None:
            self._panel.reading.choose()
        self._show()

    def take(self, paths: Sequence[Path]) -> None:
        """Photographs that were dropped: a capture of their own."""
        self._panel.reading.take(paths)

    def edit(self) -> None:
        """The capture that is chosen, or that the chosen environment came from."""
        node = self._chosen()
        if node is not None:
            self._panel.open(node)
            self._show()

    def _chosen(self) -> NodeId | None:
        scene = self._context.document.scene
        for node in reversed(self._context.session.selection):
            found = capture_behind(scene, node)
            if found is not None:
                return found
        return None


def capture_behind(scene: Scene, node: NodeId) -> NodeId | None:
    """The capture that a node is, or that its light comes from; None for all others."""
    thing = scene.nodes.get(node)
    if isinstance(thing, Capture):
        return thing.id
    if isinstance(thing, Environment):
        return next((capture.id for capture in scene.of(Capture) if capture.environment == node), None)
    return None
