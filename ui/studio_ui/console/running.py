"""While a command runs: the window stays alive, shows how long it takes, and offers to stop it."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QEventLoop, Qt
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import QApplication, QDialog, QLabel, QProgressBar, QPushButton, QVBoxLayout, QWidget

from studio_core.shading.job import Job
from studio_core.shading.scheduler import Executor

_SHOWN_AFTER = 0.4  # seconds
_PUMP_MS = 15


class StopDialog(QDialog):
    """Blocks the rest of the window, since a half-done command must not be edited into."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle("Console")
        self.setWindowModality(Qt.WindowModality.ApplicationModal)
        self.asked = False
        self.label = QLabel("The command is running…")
        self.label.setMinimumWidth(260)
        self.bar = QProgressBar()
        self.bar.setTextVisible(False)
        self.bar.setAccessibleName("Progress")
        self.button = QPushButton("Stop")
        self.button.setToolTip("What the command has changed so far is taken back (Esc)")
        self.button.setDefault(True)
        self.button.clicked.connect(self.reject)
        column = QVBoxLayout(self)
        for widget in (self.label, self.bar):
            column.addWidget(widget)
        column.addWidget(self.button, 0, Qt.AlignmentFlag.AlignRight)

    def reject(self) -> None:
        """Stop; the dialog goes when the command has stopped."""
        self.asked = True
        self.label.setText("Stopping…")
        self.button.setEnabled(False)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Closing is stopping."""
        self.reject()
        event.ignore()

    def tell(self, seconds: float, job: Job | None) -> None:
        """How long it has taken, and how far the job is."""
        if not self.asked:
            self.label.setText(f"{job.label if job else 'The command is running'}… {seconds:.0f} s")
        total = job.total if job is not None else 0
        self.bar.setRange(0, total)
        self.bar.setValue(job.done if job is not None else 0)


class Running:
    """One command at a time: `begin`, `tick` now and then, `end`."""

    def __init__(self, parent: QWidget, flush: Callable[[], object], compute: Executor | None = None) -> None:
        self._parent, self._flush, self._compute = parent, flush, compute
        self._started = 0.0
        self._job: Job | None = None
        self.dialog: StopDialog | None = None

    def begin(self) -> None:
        """A command starts."""
        self._started, self._job = time.monotonic(), None

    def tick(self) -> bool:
        """Let the window live for a moment; whether the command is to stop."""
        seconds = time.monotonic() - self._started
        if seconds < _SHOWN_AFTER:
            return False
        if self.dialog is None:
            self.dialog = StopDialog(self._parent)
            self.dialog.show()
        self.dialog.tell(seconds, self._job)
        self._flush()
        try:
            QApplication.processEvents(QEventLoop.ProcessEventsFlag.AllEvents, _PUMP_MS)
        except Exception:  # somebody's slot or painting: not the command's fault
            sys.excepthook(*sys.exc_info())  # type: ignore[arg-type]
        return self.dialog.asked

    def end(self) -> None:
        """The command is over."""
        if self.dialog is not None:
            self.dialog.hide()
            self.dialog.deleteLater()
            self.dialog = None

    def heavily(self, label: str, work: Callable[[Job], Any]) -> Any:
        """Do work that needs kernels where kernels run, and wait for it."""
        job = Job(label)
        if self._compute is None:
            return work(job)
        done = threading.Event()
        results: list[Any] = []
        errors: list[BaseException] = []

        def body() -> None:
            try:
                results.append(work(job))
            except BaseException as error:
                errors.append(error)
            finally:
                done.set()

        self._job = job
        self._compute.submit(body)
        try:
            while not done.wait(0.03):
                if self.tick():
                    raise KeyboardInterrupt
        finally:
            job.cancel()
            self._job = None
        if errors:
            raise errors[0]
        return results[0]
