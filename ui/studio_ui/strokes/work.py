"""Strokes on their way into the document: asked of the solver as often as it answers, shown, kept as a step.

A gesture spans the hand's and the solver's part: while the hand paints, each answer is shown; when it lets
go, the last one is waited for, and stroke and explanation are one step of the history.
"""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QObject, QTimer

from studio_core.edits import Compound, Edit
from studio_core.errors import Cancelled
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import NodeId, Scene
from studio_core.shading.job import Job
from studio_core.signal import Signal
from studio_core.strokes.solution import Finding, Lit, Reason, Solution
from studio_core.strokes.stroke import Stroke
from studio_ui.context import Context, Subscriptions
from studio_ui.journal import cause_of
from studio_ui.strokes.bench import NOT_YET, Answer, Bench, Order, lit_for
from studio_ui.strokes.brush_store import BrushStore

_AGAIN_MS = 60  # until a picture is looked for once more


class StrokeWork(QObject):
    """`found()` when there are other findings, `ended()` when a gesture is over, `shown(order)` when an
    order's answer has gone into the document; `moved()` when something else begins or ends.
    """

    def __init__(self, context: Context, store: BrushStore) -> None:
        super().__init__()
        self.found: Signal[[]] = Signal()
        self.ended: Signal[[]] = Signal()
        self.shown: Signal[[Order]] = Signal()
        self.moved: Signal[[]] = Signal()
        self.answer: Answer | None = None
        """The last, also while it is only shown."""
        self.problem = ""
        self._context, self._store = context, store
        assert context.services is not None
        self.bench = Bench(context.services)
        self._label = ""
        self._begun = self._asking = self._letting_go = False
        self._start = context.document.scene
        self._turn = object()
        self._newest: Order | None = None
        self._last: Order | None = None  # since the hand has let go
        self._kept: dict[str, Lit] = {}
        self._owed: list[NodeId] = []  # strokes whose gesture ended before they were explained
        self._explaining: NodeId | None = None
        self._job: Job | None = None
        self._again = QTimer(self)
        self._again.setSingleShot(True)
        self._again.timeout.connect(self._go_on)
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            context.editing.finishing.connect(self._finishing),
            context.editing.settled.connect(self._settled),
            context.document.changed.connect(self._edited),
        )

    def close(self) -> None:
        """Answer nobody any more."""
        self._subscriptions.close()
        self._again.stop()
        if self._job is not None:
            self._job.cancel()

    @property
    def begun(self) -> bool:
        """Whether a gesture is under way."""
        return self._begun

    @property
    def waits(self) -> bool:
        """Whether the hand has let go, and the last answer is not there yet."""
        return self._begun and self._letting_go

    @property
    def asking(self) -> bool:
        """Whether an answer is to come."""
        return self._asking or self._again.isActive()

    # gestures

    def begin(self, label: str) -> bool:
        """Start; what is still waited for is kept as it is. False while somebody else edits."""
        if self.waits:
            self._context.editing.finish()
        if not self._context.editing.begin(self, label):
            return False
        self._begun, self._letting_go, self._label = True, False, label
        self._turn_to(None)
        self._last, self.problem = None, ""
        self.moved.emit()
        return True

    def show(self, order: Order) -> None:
        """What the gesture has come to."""
        if self._begun:
            self._label, self._newest = order.label, order
            self._context.editing.rename(self, order.label)
            self._next()

    def finish(self, order: Order, edit: Edit | None = None) -> None:
        """The hand has let go. `edit` is shown until the answer is there."""
        if not self._begun:
            return
        self._letting_go, self._last = True, order
        if edit is not None:
            self._context.editing.preview(self, edit)
        self.show(order)

    def do(self, order: Order, edit: Edit | None = None) -> bool:
        """A gesture of one moment; `edit` is what the order makes, where that is known already."""
        if not self.begin(order.label):
            return False
        self.finish(order, edit)
        return True

    def cancel(self) -> None:
        """Put everything back."""
        self._context.editing.cancel(self)

    def take(self, finding: Finding, reason: Reason) -> None:
        """Another reason than the first."""
        scene = self._context.document.scene
        name = scene[finding.node].name if finding.node in scene.nodes else "it"
        label = f"{reason.meaning.capitalize()} of {name}" if reason.meaning else f"Leave {name} as it is"
        self._context.editing.apply(Compound(label, (reason.edit,)))

    def explain(self, stroke: NodeId) -> None:
        """Why a stroke is what it is, without changing anything."""
        if self._begun or self._asking:
            return
        self._turn_to(stroke)
        self._ask()

    def findings(self, stroke: NodeId) -> tuple[Finding, ...]:
        """What is known of a stroke."""
        if self.answer is None:
            return ()
        return tuple(found for found in self.answer.solution.findings if stroke in found.strokes)

    def knows(self, stroke: NodeId) -> bool:
        """Whether the last answer is about a stroke."""
        return self.answer is not None and stroke in self.answer.strokes

    @property
    def solution(self) -> Solution | None:
        """The last answer's."""
        return self.answer.solution if self.answer is not None else None

    # asking

    def _turn_to(self, explaining: NodeId | None) -> None:
        """Something else than before: what was asked until now is of no use."""
        self._turn, self._explaining, self._newest = object(), explaining, None
        self._start, self._kept = self._context.document.scene, {}

    def _go_on(self) -> None:
        """What came was of no use any more."""
        if self._begun or self._explaining is not None:
            self._ask()
        else:
            self._pay()

    def _next(self) -> None:
        if not self._asking and not self._again.isActive():
            self._ask()

    def _ask(self) -> None:
        start, kept, solver, bench = self._start, self._kept, self._store.now.solver, self.bench
        order, self._newest = self._newest, None
        if order is None and self._explaining is not None:
            order = Order("", lambda: Compound("", ()), self._explaining)
        if order is None:
            return
        self._asking, last, asked, turn = True, self._letting_go, order, self._turn

        def work(pipeline: Any, job: Job) -> tuple[bool, Answer | None]:
            lit = lit_for(pipeline, start, kept)
            return (False, None) if lit is None else (True, bench.answer(asked, start, lit, solver, job))

        def done(result: Any, error: Exception | None) -> None:
            self._asking = False
            if turn is not self._turn:
                self._go_on()
            elif error is not None:
                self._fail(error)
            elif not result[0]:
                self._newest = self._newest or asked
                self._wait()
            else:
                self._answered(asked, result[1], last)

        self._job = self._context.feed.ask("strokes", start, work, done)
        self.moved.emit()

    def _wait(self) -> None:
        """There is no picture yet of what is painted on."""
        if self._context.feed.busy or self._context.feed.last is None:
            self._again.start(_AGAIN_MS)
        else:
            self._fail(NOT_YET)

    def _answered(self, order: Order, answer: Answer | None, last: bool) -> None:
        if not self._begun:
            self._explaining = None
            if answer is not None:
                self._keep(answer)
            self.moved.emit()
            return
        if answer is not None:
            self._context.editing.preview(self, answer.whole(self._label))
            self._keep(answer)
            self._last = None if order is self._last else self._last
        self.shown.emit(order)
        if self._newest is not None:
            self._ask()
        elif last and answer is None:
            self.cancel()
        elif last:
            self._context.editing.commit(self)

    def _keep(self, answer: Answer) -> None:
        self.answer = answer
        self.found.emit()

    def _fail(self, error: Exception) -> None:
        if not isinstance(error, Cancelled):
            self.problem = cause_of(error)
            self._context.journal.problem(self._label or "Explaining a stroke", error)
        self._explaining = self._newest = None
        if self._begun:
            self.cancel()
        self.moved.emit()

    # what others do meanwhile

    def _finishing(self) -> None:
        """Somebody else cannot wait: what was painted stays, and is explained after that."""
        order, self._last = self._last, None
        if self._begun and order is not None:
            edit = order.make()
            if edit is not None:
                self._context.editing.preview(self, edit)

    def _settled(self) -> None:
        if not self._begun or self._context.editing.busy:
            return
        lost, before = self._letting_go and self.asking, self._start
        self._begun = self._letting_go = False
        self._again.stop()
        self._turn_to(None)
        if lost:
            there = self._context.document.scene
            self._owed += [s.id for s in there.of(Stroke) if before.nodes.get(s.id) is not s]
        if self._asking and self._job is not None:
            self._job.cancel()
        elif self._owed:
            self._again.start(_AGAIN_MS)
        self.ended.emit()
        self.moved.emit()

    def _pay(self) -> None:
        """Explain what was not waited for, as a step of its own."""
        scene = self._context.document.scene
        owed, self._owed = [stroke for stroke in self._owed if stroke in scene.nodes], []
        if owed and not self._begun and not self._context.editing.busy:
            self.do(Order(f"Explain {scene[owed[-1]].name}", lambda: Compound("", ()), owed[-1]))

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if self._begun or not changes:
            return
        if self._explaining is not None:
            self._turn_to(self._explaining)  # the answer is dropped, and asked for again


__all__ = ["StrokeWork"]
