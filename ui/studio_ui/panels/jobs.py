"""Jobs: what is being computed, read or written; how far it is and how long it will take; what is done."""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QLabel, QProgressBar, QVBoxLayout, QWidget

from studio_core.shading.job import Job
from studio_ui.context import Context
from studio_ui.panels.panel import Panel, clear, heading, note, row
from studio_ui.tasks import Task

_EVERY_MS, _IDLE_MS = 150, 1000
_SURE = (0.03, 1.0)  # share and seconds from which on the rest is guessed
_WORTH_TELLING = 1.0  # seconds
SHOWN_FOR = 60.0  # seconds, of what is done
_STATES = {"done": "done", "failed": "did not work: see Log", "cancelled": "cancelled"}


class JobRow(QWidget):
    """One job that runs."""

    def __init__(self, panel: Panel, job: Job, cancel: Callable[[], object]) -> None:
        super().__init__()
        self.job = job
        self.label = QLabel(job.label)
        self.label.setWordWrap(True)
        self.bar = QProgressBar()
        self.bar.setTextVisible(False)
        self.bar.setAccessibleName(job.label)
        self.time = QLabel()
        self.time.setProperty("role", "dim")
        self.button = panel.tool("cancel", "Cancel; what is shown stays")
        self.button.setAccessibleName(f"Cancel {job.label}")
        self.button.clicked.connect(lambda: cancel())
        column = QVBoxLayout(self)
        column.setContentsMargins(2, 2, 2, 2)
        column.setSpacing(3)
        column.addLayout(row(self.label, self.button, stretch=0))
        column.addWidget(self.bar)
        column.addWidget(self.time)

    def refresh(self) -> None:
        """How far it is."""
        done, total = self.job.done, self.job.total
        self.bar.setRange(0, 1000 if total else 0)
        if total:
            self.bar.setValue(round(1000 * min(done / total, 1)))
        elapsed = time.monotonic() - self.job.started
        told = words(elapsed)
        left = remaining(elapsed, done, total)
        if left is not None and left >= _WORTH_TELLING:
            told += f", about {words(left)} left"
        self.time.setText("Cancelling…" if self.job.cancelled else told)


class JobsPanel(Panel):
    """Shading and tasks."""

    id = "jobs"
    title = "Jobs"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.rows: list[JobRow] = []
        self.done: list[Task] = []
        self._column = self.scroller()
        self._timer = QTimer(self)
        self._timer.timeout.connect(self.refresh)
        self.subscriptions.add(
            context.tasks.changed.connect(self._wake),
            context.feed.progress.connect(lambda job: self._wake()),
        )
        self.refresh()

    def _wake(self) -> None:
        if not self._timer.isActive() or self._timer.interval() != _EVERY_MS:
            self._timer.start(_EVERY_MS)

    def refresh(self) -> None:
        """Rows for what runs and what is done; the timer rests when there is nothing to tell."""
        jobs: list[tuple[Job, Callable[[], object]]] = [
            (task.job, task.job.cancel) for task in self.context.tasks.running
        ]
        shading = self.context.feed.job
        if shading is not None:
            jobs.insert(0, (shading, self.context.feed.cancel))
        now = time.monotonic()
        done = [task for task in self.context.tasks.finished if now - (task.ended or now) < SHOWN_FOR]
        if (
            [r.job for r in self.rows] != [job for job, _ in jobs]
            or done != self.done
            or not self._column.count()
        ):
            self._build(jobs, done)
        for made in self.rows:
            made.refresh()
        if not jobs and done:
            self._timer.start(_IDLE_MS)
        elif not jobs:
            self._timer.stop()

    def _build(self, jobs: list[tuple[Job, Callable[[], object]]], done: list[Task]) -> None:
        clear(self._column)
        self.done = done
        self.rows = [JobRow(self, job, cancel) for job, cancel in jobs]
        for made in self.rows:
            self._column.addWidget(made)
        if not jobs:
            self._column.addWidget(note("Nothing is being computed."))
        if done:
            self._column.addWidget(heading("Done"))
        for task in reversed(done):
            told = note(f"{task.job.label}: {_STATES.get(task.state, task.state)}, {words(task.seconds)}")
            if task.state == "failed":
                told.setProperty("role", "problem")
            self._column.addWidget(told)
        self._column.addStretch(1)

    def close_panel(self) -> None:
        """Stop the timer too."""
        self._timer.stop()
        super().close_panel()


def remaining(elapsed: float, done: int, total: int) -> float | None:
    """Seconds that are left if it goes on like this; None while that cannot be said."""
    share = done / total if total else 0.0
    if share < _SURE[0] or elapsed < _SURE[1]:
        return None
    return elapsed * (1 - min(share, 1.0)) / share


def words(seconds: float) -> str:
    """`0.4 s`, `12 s`, `3 min 5 s`, `1 h 12 min`."""
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if not minutes:
        return f"{rest} s"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s"
