"""Everything that strokes need in the window, made when they are first used: it loads kernels."""

from __future__ import annotations

from collections.abc import Callable

from studio_core.scene.diff import Changes
from studio_core.scene.nodes import NodeId, Scene
from studio_core.signal import Signal
from studio_core.strokes.settling import wishes_of
from studio_core.strokes.stroke import Stroke
from studio_ui.canvas.looking import Looking
from studio_ui.canvas.viewport import Viewport
from studio_ui.context import Context, Subscriptions
from studio_ui.settings import Settings
from studio_ui.strokes.brush_store import BrushStore
from studio_ui.strokes.hand import StrokeHand
from studio_ui.strokes.likeness import Likeness
from studio_ui.strokes.matching import Matching
from studio_ui.strokes.sketches import Sketches
from studio_ui.strokes.work import StrokeWork


class StrokeDesk:
    """`stroke` is the one that is worked on; `changed()` when it is another, or more is known of it."""

    def __init__(
        self,
        context: Context,
        viewport: Viewport,
        looking: Looking,
        settings: Settings,
        hint: Callable[[str], object],
        refresh: Callable[[], object],
    ) -> None:
        self.changed: Signal[[]] = Signal()
        self.stroke: NodeId | None = None
        self.store = BrushStore(settings)
        self.work = StrokeWork(context, self.store)
        self.matching = Matching(context, self.store, self.work.bench)
        self.likeness = Likeness(context, self.store, self.work.bench)
        self.sketches = Sketches(context, lambda: not (self.work.begun or self.work.asking))
        self.hand = StrokeHand(context, viewport, looking, self.store, self.work, hint, refresh)
        self.hand.also = lambda: self.likeness.marks(viewport.placed())
        self._document, self._session, self._hint = context.document, context.session, hint
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            self.work.found.connect(self.changed.emit),
            self.work.moved.connect(self.sketches.follow),
            self.work.moved.connect(self.changed.emit),
            self.matching.changed.connect(self.changed.emit),
            self.matching.matched.connect(self.work.explain),
            self.likeness.changed.connect(refresh),
            context.document.changed.connect(self._edited),
        )

    def close(self) -> None:
        """Stop everything."""
        self._subscriptions.close()
        for part in (self.hand, self.matching, self.likeness, self.sketches, self.work):
            part.close()

    def choose(self, stroke: NodeId | None) -> None:
        """Work on this one; what explains it is looked for where that is not known."""
        if stroke != self.stroke:
            self.stroke = stroke
            self._look()
            self.changed.emit()

    def can_match(self) -> bool:
        """Whether there is a stroke that counts, and light between surfaces that follows it."""
        node = self._document.scene.nodes.get(self.stroke or "")
        return isinstance(node, Stroke) and bool(wishes_of((node,))) and self._session.bouncing

    def match(self) -> None:
        """Explain the stroke again until the picture shows what was painted; or leave it at what there is."""
        if self.matching.running:
            self.matching.stop()
        elif self.stroke is not None and self.can_match():
            self.matching.start(self.stroke)
        else:
            self._hint("Choose a stroke that paints light, with Light between surfaces switched on")

    def _look(self) -> None:
        node = self._document.scene.nodes.get(self.stroke or "")
        if isinstance(node, Stroke) and not node.hidden and not self.work.knows(node.id):
            self.work.explain(node.id)

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        """A new stroke is worked on; one that has gone is not."""
        new = [n for n in changes.nodes if isinstance(after.nodes.get(n), Stroke) and n not in before.nodes]
        if new and len(new) < 2:
            self.choose(new[0])
        elif self.stroke is not None and self.stroke not in after.nodes:
            self.choose(None)


__all__ = ["StrokeDesk"]
