"""A stroke that is explained again under the light that its answer brings, until the picture shows it.

After each answer the picture is waited for (`strokes.matching`). All rounds are one gesture, which gives way
to whoever else edits: what there is then, stays.
"""

from __future__ import annotations

import math
from typing import Any

from PySide6.QtCore import QObject, QTimer

from studio_core.edits import Edit
from studio_core.errors import Cancelled
from studio_core.scene.nodes import NodeId
from studio_core.shading.job import Job
from studio_core.signal import Signal
from studio_core.strokes.edits import concerned
from studio_core.strokes.matching import MET, Match
from studio_core.strokes.stroke import Stroke
from studio_ui.context import Context, Subscriptions
from studio_ui.feed import Freshness
from studio_ui.journal import cause_of
from studio_ui.strokes.bench import NOT_YET, Bench, lit_for
from studio_ui.strokes.brush_store import BrushStore

_AGAIN_MS = 60  # until a picture is looked for once more


class Matching(QObject):
    """`changed()` when there is something else to tell: `told`, of the stroke `of`; `matched(stroke)` when it
    is in the document.
    """

    def __init__(self, context: Context, store: BrushStore, bench: Bench) -> None:
        super().__init__()
        self.changed: Signal[[]] = Signal()
        self.matched: Signal[[NodeId]] = Signal()
        self.of: NodeId | None = None
        self.told, self.failed = "", False
        self._context, self._store, self._bench = context, store, bench
        self._match: Match | None = None
        self._seen: tuple[Edit, ...] = ()
        self._job: Job | None = None
        self._again = QTimer(self, singleShot=True, interval=_AGAIN_MS)
        self._again.timeout.connect(self._ask)
        self._subscriptions = Subscriptions()
        self._subscriptions.add(context.editing.settled.connect(self._settled))

    def close(self) -> None:
        """Ask no more."""
        self._subscriptions.close()
        self._over()

    @property
    def running(self) -> bool:
        """Whether a stroke is being matched."""
        return self._match is not None

    def start(self, stroke: NodeId) -> None:
        """Match it, and with it all strokes that it is explained with."""
        scene = self._context.document.scene
        node = scene[stroke]
        assert isinstance(node, Stroke)
        label = f"Match {node.name}"
        match = Match(label, scene, concerned(scene, (node,)))
        if stroke in match.wishes and self._context.editing.begin(self, label, gives_way=True):
            self._match, self._seen, self.of = match, (), stroke
            self._say("Looking at the light there is…")
            self._ask()

    def stop(self) -> None:
        """What there is now, stays."""
        self._context.editing.commit(self)

    def _ask(self) -> None:
        """Once the light is that of the last answer."""
        feed, match, scene = self._context.feed, self._match, self._context.document.scene
        solver, bench = self._store.now.solver, self._bench
        if match is None:
            return
        sure = feed.state is Freshness.CURRENT or not feed.busy  # nobody goes on where it was stopped
        if feed.state in (Freshness.NONE, Freshness.FAILED) and not feed.busy:
            self._fail(NOT_YET)
            return
        if not feed.at_rest or (match.near and not sure):
            self._again.start()
            return

        def work(pipeline: Any, job: Job) -> bool | None:
            lit = lit_for(pipeline, scene, {})
            return None if lit is None else bench.round(match, scene, lit, solver, job, sure=sure)

        def done(more: bool | None, error: Exception | None) -> None:
            if match is not self._match:
                return
            if error is not None:
                self._fail(error)
            elif more is not None:
                self._take(match, more)
            elif sure and self._context.document.scene is scene:
                self._fail(NOT_YET)  # nor will there be: its backend keeps nothing that strokes need
            else:
                self._again.start()

        self._job = feed.ask("matching", scene, work, done)

    def _take(self, match: Match, more: bool) -> None:
        if match.edit.edits != self._seen:
            self._seen = match.edit.edits
            self._context.editing.preview(self, match.edit)
        if more:
            self._say("Nearly: looking closely…" if match.near else f"{_percent(match.offs[-1])} off…")
            self._ask()
            return
        self._over()
        self._context.editing.commit(self)
        self._say(_verdict(match.offs[0], match.off))
        if match.edit.edits and self.of is not None:
            self.matched.emit(self.of)

    def _fail(self, error: Exception) -> None:
        label = self._match.label if self._match is not None else ""
        self._over()
        self._context.editing.cancel(self)
        if isinstance(error, Cancelled):
            self._say("")
            return
        self._context.journal.problem(label, error)
        self._say(cause_of(error), failed=True)

    def _over(self) -> None:
        self._match, job, self._job = None, self._job, None
        self._again.stop()
        if job is not None:
            job.cancel()

    def _settled(self) -> None:
        """By Esc, by `stop`, or because somebody else edits."""
        match = self._match
        if match is not None and not self._context.editing.busy:
            self._over()
            self._say(f"Stopped {_percent(match.offs[-1])} off." if match.offs else "")

    def _say(self, text: str, *, failed: bool = False) -> None:
        self.told, self.failed = text, failed
        self.changed.emit()


def _percent(off: float) -> str:
    """Of the light that is wanted: 0.7 %, 42 %."""
    share = 100 * math.expm1(off)
    return f"{share:.1f} %" if share < 10 else f"{share:.0f} %"


def _verdict(before: float, after: float) -> str:
    if before <= MET:
        return f"The picture shows what was painted: {_percent(before)} off."
    if after <= MET:
        return f"Matched: {_percent(after)} off, before {_percent(before)}."
    return f"No nearer than {_percent(after)}, before {_percent(before)}."


__all__ = ["Matching"]
