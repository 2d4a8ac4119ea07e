"""The light of the whole scene, sharpened or smoothed: at the end of the stroke panel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QPushButton, QVBoxLayout, QWidget

from studio_core.errors import Cancelled
from studio_core.params import param_infos
from studio_core.scene.nodes import MeshObject
from studio_core.shading.job import Job
from studio_core.strokes.solution import Solution
from studio_core.strokes.stylising import Stylising
from studio_ui.context import Context
from studio_ui.forms.param_form import ParamForm, fold
from studio_ui.forms.sinks import LiveSink
from studio_ui.journal import cause_of
from studio_ui.look.role import set_role
from studio_ui.look.theme import GAP
from studio_ui.panels.panel import note
from studio_ui.strokes.bench import NOT_YET, Bench, lit_for
from studio_ui.strokes.brush_store import BrushStore

_TOLD = (
    "Makes the light on every object crisper, as sharpening does to a photograph, by painting its material. "
    "Below 0 it is softened."
)
_AGAIN_MS = 60  # until a picture is looked for once more


class SceneStyle(QWidget):
    """Folded up until somebody wants it. One step of the history, that can be cancelled until it is there."""

    def __init__(self, context: Context, store: BrushStore, bench: Bench) -> None:
        super().__init__()
        self._context, self._store, self._bench = context, store, bench
        self.amount = Stylising().amount
        self.job: Job | None = None
        self._over: Callable[[], None] = lambda: None
        inside = QWidget()
        column = QVBoxLayout(inside)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(GAP)
        self.form = ParamForm(param_infos(Stylising), LiveSink(self._use, lambda: self.amount))
        self.button = QPushButton("Stylise")
        self.button.setToolTip("Paint all objects so; Undo takes it back")
        self.button.clicked.connect(self.run)
        self.told = note("")
        self.told.hide()
        for widget in (note(_TOLD), self.form, self.button, self.told):
            column.addWidget(widget)
        self.fold = fold(inside, "Whole scene", "Sharpen or soften the light of everything at once")
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.setSpacing(GAP)
        whole.addWidget(self.fold)
        whole.addWidget(inside)
        self._again = QTimer(self, singleShot=True, interval=_AGAIN_MS)
        self._again.timeout.connect(self.run)
        self._use(self.amount)

    def unfold(self) -> None:
        """Let it be seen, with the keys in it."""
        self.fold.setChecked(True)
        self.button.setFocus(Qt.FocusReason.ShortcutFocusReason)

    def run(self) -> None:
        """Do it."""
        if self.job is not None:
            return
        context, scene, amount = self._context, self._context.document.scene, self.amount
        solver, bench = self._store.now.solver, self._bench

        def work(pipeline: Any, job: Job) -> Solution | None:
            lit = lit_for(pipeline, scene, {})
            return None if lit is None else bench.stylise(scene, amount, lit, solver, job)

        def done(found: Solution | None, error: Exception | None) -> None:
            self.job = None
            self._over()
            self.button.setEnabled(True)
            if error is not None:
                self._fail(error)
            elif found is None and (context.feed.busy or context.feed.last is None):
                self.button.setEnabled(False)
                self._again.start()
            elif found is None:
                self._fail(NOT_YET)
            elif context.document.scene is not scene:
                self.run()  # of what is there now
            else:
                self._take(found)

        self.button.setEnabled(False)
        self._say("")
        self.job = job = context.feed.ask("Stylising", scene, work, done)
        self._over = context.tasks.follow(job)

    def _take(self, found: Solution) -> None:
        before = self._context.document.scene
        if self._context.editing.apply(found.edit):
            after = self._context.document.scene
            painted = sum(after[node.id] is not node for node in before.of(MeshObject))
            self._say("\n".join([f"{painted} objects painted.", *found.notes]))

    def _fail(self, error: Exception) -> None:
        if not isinstance(error, Cancelled):
            self._context.journal.problem("Stylising", error)
            self._say(cause_of(error), problem=True)

    def _say(self, text: str, *, problem: bool = False) -> None:
        self.told.setText(text)
        self.told.setVisible(bool(text))
        set_role(self.told, "problem" if problem else "dim")

    def _use(self, amount: float) -> None:
        self.amount = amount
        self.form.show_values({"amount": amount})


__all__ = ["SceneStyle"]
