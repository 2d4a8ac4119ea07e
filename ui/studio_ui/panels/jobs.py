"""Jobs: what is being computed, read or written; how far it is; cancel."""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QLabel, QProgressBar, QVBoxLayout, QWidget

from studio_core.shading.job import Job
from studio_ui.context import Context
from studio_ui.panels.panel import Panel, clear, note, row

_EVERY_MS = 150


class JobRow(QWidget):
    """One job."""

    def __init__(self, panel: Panel, job: Job, cancel: Callable[[], object]) -> None:
        super().__init__()
        self.job = job
        self.label = QLabel(job.label)
        self.bar = QProgressBar()
        self.bar.setTextVisible(False)
        self.time = QLabel()
        self.time.setProperty("role", "dim")
        self.button = panel.tool("cancel", "Cancel; what is shown stays")
        self.button.clicked.connect(lambda: cancel())
        column = QVBoxLayout(self)
        column.setContentsMargins(2, 2, 2, 2)
        column.setSpacing(3)
        column.addLayout(row(self.label, self.time, self.button, stretch=0))
        column.addWidget(self.bar)

    def refresh(self) -> None:
        """How far it is."""
        done, total = self.job.done, self.job.total
        self.bar.setRange(0, 1000 if total else 0)
        if total:
            self.bar.setValue(round(1000 * min(done / total, 1)))
        elapsed = time.monotonic() - self.job.started
        self.time.setText("cancelling…" if self.job.cancelled else f"{elapsed:.0f} s")


class JobsPanel(Panel):
    """Shading and tasks."""

    id = "jobs"
    title = "Jobs"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.rows: list[JobRow] = []
        self._column = self.scroller()
        self._timer = QTimer(self)
        self._timer.setInterval(_EVERY_MS)
        self._timer.timeout.connect(self.refresh)
        self.subscriptions.add(
            context.tasks.changed.connect(self._wake),
            context.feed.progress.connect(lambda job: self._wake()),
        )
        self.refresh()

    def _wake(self) -> None:
        if not self._timer.isActive():
            self._timer.start()

    def refresh(self) -> None:
        """Rows for what runs; the timer rests when nothing does."""
        jobs: list[tuple[Job, Callable[[], object]]] = [
            (task.job, task.job.cancel) for task in self.context.tasks.running
        ]
        shading = self.context.feed.job
        if shading is not None:
            jobs.insert(0, (shading, self.context.feed.cancel))
        if [r.job for r in self.rows] != [job for job, _ in jobs] or (not jobs and not self._column.count()):
            clear(self._column)
            self._icons.clear()
            self.rows = [JobRow(self, job, cancel) for job, cancel in jobs]
            for made in self.rows:
                self._column.addWidget(made)
            if not jobs:
                self._column.addWidget(note("Nothing is being computed."))
            self._column.addStretch(1)
        for made in self.rows:
            made.refresh()
        if not jobs:
            self._timer.stop()

    def close_panel(self) -> None:
        """Stop the timer too."""
        self._timer.stop()
        super().close_panel()
