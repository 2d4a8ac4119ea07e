"""Over the picture: what is being read or written, once it takes longer than a moment; and Cancel."""

from __future__ import annotations

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QProgressBar

from studio_ui.context import Subscriptions
from studio_ui.files.notice_bar import Bar
from studio_ui.tasks import Task, Tasks

_EVERY_MS = 120
_MOMENT = 0.7  # seconds


class TaskBar(Bar):
    """Follows the oldest task; `patience` is how long it may take without being told of."""

    def __init__(self, tasks: Tasks, patience: float = _MOMENT) -> None:
        super().__init__("task", closable=False)
        self._tasks, self._patience = tasks, patience
        self.progress = QProgressBar()
        self.progress.setTextVisible(False)
        self.progress.setFixedWidth(140)
        self.progress.setAccessibleName("How far it is")
        self._row.insertWidget(1, self.progress)
        self.cancel = self.button("Cancel", "Stop it; what is shown stays", self._cancel)
        self._timer = QTimer(self)
        self._timer.setInterval(_EVERY_MS)
        self._timer.timeout.connect(self.refresh)
        self._subscriptions = Subscriptions()
        self._subscriptions.add(tasks.changed.connect(self.refresh))
        self.hide()

    @property
    def task(self) -> Task | None:
        """What is told of."""
        running = self._tasks.running
        return running[0] if running else None

    def close_panel(self) -> None:
        """Stop following."""
        self._timer.stop()
        self._subscriptions.close()

    def refresh(self) -> None:
        """How far it is; the timer rests when nothing runs."""
        task = self.task
        if task is None:
            self._timer.stop()
            self.hide()
            return
        if not self._timer.isActive():
            self._timer.start()
        if task.seconds < self._patience or self.parent() is None:
            return
        job = task.job
        text = f"Stopping: {job.label}" if job.cancelled else f"{job.label}…"
        if self.text.text() != text:
            self.say(text)
        self.progress.setRange(0, 1000 if job.total else 0)
        if job.total:
            self.progress.setValue(round(1000 * min(job.done / job.total, 1)))
        self.cancel.setEnabled(not job.cancelled)
        if self.isHidden():
            self.show()

    def _cancel(self) -> None:
        if self.task is not None:
            self.task.job.cancel()
            self.refresh()
