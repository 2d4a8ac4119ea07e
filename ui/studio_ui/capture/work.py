"""The panel's inside: steps and their controls beside the preview, or under it where it is narrow."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QLabel,
    QProgressBar,
    QPushButton,
    QSplitter,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from studio_ui.ask import Ask
from studio_ui.capture.desk import CaptureDesk
from studio_ui.capture.preview.preview import Preview
from studio_ui.capture.step_list import StepList
from studio_ui.capture.steps.calibration import CalibrationStep
from studio_ui.capture.steps.join import JoinStep
from studio_ui.capture.steps.lens import LensStep
from studio_ui.capture.steps.light import LightStep
from studio_ui.capture.steps.photographs import PhotographsStep
from studio_ui.capture.steps.reflections import ReflectionsStep
from studio_ui.capture.steps.result import ResultStep
from studio_ui.capture.steps.step import StepForm
from studio_ui.capture.telling import STEPS, Told, tell_all
from studio_ui.context import Context
from studio_ui.look.theme import GAP, PANEL_WIDTH, Theme
from studio_ui.panels.panel import Panel, Scroller, row
from studio_ui.tasks import Task

_NARROW = 700  # pixels, under which the preview is above the controls
_FORMS = PANEL_WIDTH + 90


class CaptureWork(QWidget):
    """One step at a time; the preview keeps showing what the step last had."""

    def __init__(
        self,
        panel: Panel,
        context: Context,
        desk: CaptureDesk,
        ask: Ask,
        beside: Callable[[str], Path],
        add: Callable[[], object],
        new: Callable[[], object],
    ) -> None:
        super().__init__()
        self.context, self.desk = context, desk
        self.step = STEPS[0].id
        self.names: dict[str, str] = {}  # the picture that was chosen, by step
        self.forms: dict[str, StepForm] = {
            form.id: form
            for form in (
                PhotographsStep(context, desk, add, new),
                LightStep(context, desk),
                LensStep(context, desk, ask),
                ReflectionsStep(context, desk),
                JoinStep(context, desk),
                CalibrationStep(context, desk),
                ResultStep(context, desk, ask, beside),
            )
        }
        self.preview = Preview(context)
        self.preview.chosen = self._look
        self.steps = StepList()
        self.steps.chosen = self.go
        self.warnings = QLabel()
        self.warnings.setWordWrap(True)
        self.warnings.setProperty("role", "warning")
        self.warnings.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.warnings.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.bar = QProgressBar()
        self.bar.setTextVisible(False)
        self.bar.setAccessibleName("Progress of the capture")
        self.stop = panel.tool("cancel", "Cancel; what is shown stays")
        self.stop.clicked.connect(desk.stop)
        self.again = QPushButton("Compute it again")
        self.again.clicked.connect(desk.again)
        self._stack = QStackedWidget()
        for form in self.forms.values():
            form.look, form.redraw = self._look, self._redraw
            self._stack.addWidget(_scrolled(form))
        self._side = QWidget()
        column = QVBoxLayout(self._side)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(GAP)
        column.addWidget(self.steps)
        column.addLayout(row(self.bar, self.stop, stretch=0))
        column.addWidget(self.again)
        column.addWidget(self.warnings)
        column.addWidget(self._stack, 1)
        self.split = QSplitter()
        self.split.setChildrenCollapsible(False)
        self.split.addWidget(self._side)
        self.split.addWidget(self.preview)
        self.split.setStretchFactor(0, 0)
        self.split.setStretchFactor(1, 1)
        self.split.setSizes([_FORMS, 3 * _FORMS])
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addWidget(self.split)
        self._shown: tuple[object, ...] = ()
        self._small = False
        self.refresh()

    def set_theme(self, theme: Theme) -> None:
        """Another theme."""
        self.preview.set_theme(theme)
        self.steps.set_theme(theme)
        for form in self.forms.values():
            form.set_theme(theme)

    def go(self, step: str) -> None:
        """To another step."""
        self.step = step
        self.refresh()

    @property
    def form(self) -> StepForm:
        """The step's controls."""
        return self.forms[self.step]

    def told(self) -> dict[str, Told]:
        """What every step says now."""
        desk = self.desk
        return tell_all(
            desk.state, desk.settings, desk.fresh, busy=desk.busy, error=desk.error, missing=desk.missing
        )

    def refresh(self) -> None:
        """Settings and results as they are now."""
        told = self.told()
        self.steps.tell(told)
        self.steps.show_step(self.step)
        self._stack.setCurrentIndex(list(self.forms).index(self.step))
        now = told[self.step]
        self.warnings.setText("\n".join(now.warnings))
        self.warnings.setVisible(bool(now.warnings))
        captured = self.desk.state.captured
        self.preview.scale = captured.calibration.luminance_scale if captured is not None else None
        self.form.show_now()
        self._show()
        stale = now.mark in ("working", "waiting", "error") and self.step != "photographs"
        self.preview.view.set_remark("from earlier settings" if stale else "")
        self.progress()

    def progress(self, task: Task | None = None) -> None:
        """How far the work is."""
        task = self.desk.task
        self.stop.setVisible(task is not None)
        self.bar.setVisible(task is not None)
        self.again.setVisible(not self.desk.busy and bool(self.desk.error))
        if task is None:
            return
        self.bar.setRange(0, task.job.total)
        self.bar.setValue(min(task.job.done, task.job.total))

    def follow(self) -> None:
        """An edit was made: tools have it at once, the rest with the next `refresh`."""
        self.form.sync()
        self.preview.view.update()

    def _look(self, name: str) -> None:
        """Another picture of the step."""
        if self.names.get(self.step) != name:
            self.names[self.step] = name
            self._show()

    def _show(self) -> None:
        form = self.form
        names = form.pictures()
        name = self.names.get(self.step, "")
        if name not in names:
            name = self._same_side(names) or form.first()
        self.preview.offer(names, name)
        form.shown(name)
        picture = form.picture(name) if name else None
        arrays: tuple[object, ...] = ()
        if picture is not None:
            arrays = (picture.pixels, picture.before, tuple(mark.mask for mark in picture.marks))
        key = (self.step, name, *arrays)
        if not _alike(key, self._shown):
            self._shown = key
            self.preview.show_picture(picture)
        elif picture is not None and self.preview.view.shown is not None:
            self.preview.follow(picture)
        self._redraw()

    def _same_side(self, names: list[str]) -> str:
        """The side that was looked at in another step."""
        return next((n for n in reversed(list(self.names.values())) if n in names), "")

    def _redraw(self) -> None:
        """The tool over the picture, and a picture that is being turned."""
        form, view = self.form, self.preview.view
        if view.tool is not form.tool:
            view.set_tool(form.tool)
        turned = getattr(form, "turned", None)
        view.turn(turned() if turned is not None and view.shown is not None else None)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """The preview goes above the controls where it is narrow."""
        small = self.width() < _NARROW
        if small is self._small:
            return
        self._small = small
        self.steps.set_small(small)
        self.split.setOrientation(Qt.Orientation.Vertical if small else Qt.Orientation.Horizontal)
        self.split.insertWidget(0, self.preview if small else self._side)
        QTimer.singleShot(0, self, self._share_room)  # once both have their new shapes

    def _share_room(self) -> None:
        if self._small:
            self.split.setSizes([self.height() * 11 // 20, self.height() * 9 // 20])
        else:
            self.split.setSizes([_FORMS, self.width() - _FORMS])


def _alike(one: tuple[object, ...], other: tuple[object, ...]) -> bool:
    """The same texts and the very same arrays."""
    if len(one) != len(other):
        return False
    for a, b in zip(one, other, strict=True):
        if isinstance(a, tuple) and isinstance(b, tuple):
            if not _alike(a, b):
                return False
        elif a is not b and not (isinstance(a, str) and a == b):
            return False
    return True


def _scrolled(form: StepForm) -> Scroller:
    area = Scroller()
    area.setWidgetResizable(True)
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    area.setFrameShape(area.Shape.NoFrame)
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    inside = QWidget()
    column = QVBoxLayout(inside)
    column.setContentsMargins(0, 0, 2, 0)
    column.addWidget(form)
    column.addStretch(1)
    area.setWidget(inside)
    return area
