"""File ▸ Material from photographs: an order, its progress, its report; the window stays usable meanwhile."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from PySide6.QtCore import QPoint, QSize, Qt, QTimer
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import (
    QDialog,
    QHBoxLayout,
    QLabel,
    QProgressBar,
    QPushButton,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from studio_core.errors import Cancelled
from studio_core.fitting import FitRequest, Fitted
from studio_core.library.lucmat import Kept
from studio_ui.ask import Ask
from studio_ui.context import Context
from studio_ui.look.role import set_role
from studio_ui.look.theme import GAP, Theme
from studio_ui.material_fit.order_page import OrderPage
from studio_ui.material_fit.report_page import ReportPage
from studio_ui.pictures.order import duration
from studio_ui.tasks import Task

_EVERY_MS = 200
_ORDER, _REPORT = (640, 420), (1080, 760)


class Fitting(Protocol):
    """Who has materials fitted, and what is done with them."""

    def start(self, request: FitRequest) -> Task:
        """Begin; the dialog is told how it goes."""
        ...

    def add(self, kept: Kept) -> None:
        """Into the scene."""
        ...

    def keep(self, kept: Kept) -> None:
        """For all projects."""
        ...

    def save(self, kept: Kept) -> None:
        """As a file."""
        ...

    def save_report(self, fitted: Fitted, name: str) -> None:
        """Its numbers as a file."""
        ...


class FitDialog(QDialog):
    """Two pages. Closed while something is fitted it hides: the report comes when it is there."""

    def __init__(self, parent: QWidget | None, context: Context, ask: Ask, fitting: Fitting) -> None:
        super().__init__(parent)
        self.setWindowTitle("Material from photographs")
        self._fitting = fitting
        self.task: Task | None = None
        self._reported = False
        self.order, self.report = OrderPage(ask), ReportPage(context)
        self.pages = QStackedWidget()
        self.pages.addWidget(self.order)
        self.pages.addWidget(self.report)
        self.bar = QProgressBar()
        self.bar.setTextVisible(False)
        self.bar.setAccessibleName("Progress of the fit")
        self.told = QLabel()
        self.told.setWordWrap(True)
        self.told.setProperty("role", "dim")
        self.fit_button = self._button("Fit", self.fit)
        self.fit_button.setDefault(True)
        self.cancel_button = self._button("Cancel", self.cancel)
        self.again_button = self._button("Other settings", self.again)
        self.add_button = self._button("Add to scene", lambda: self._give(fitting.add))
        self.keep_button = self._button("Keep for all projects", lambda: self._give(fitting.keep))
        self.save_button = self._button("Save as .lucmat…", lambda: self._give(fitting.save))
        self.report_button = self._button("Save report…", self._save_report)
        self.close_button = self._button("Close", self.close)
        buttons = QHBoxLayout()
        for button in (self.again_button, self.report_button):
            buttons.addWidget(button)
        buttons.addStretch(1)
        for button in (self.save_button, self.keep_button, self.add_button):
            buttons.addWidget(button)
        for button in (self.close_button, self.cancel_button, self.fit_button):
            buttons.addWidget(button)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(2 * GAP, 2 * GAP, 2 * GAP, 2 * GAP)
        whole.setSpacing(2 * GAP)
        whole.addWidget(self.pages, 1)
        whole.addWidget(self.bar)
        whole.addWidget(self.told)
        whole.addLayout(buttons)
        self.order.ready.connect(lambda _: self._state())
        self._timer = QTimer(self)
        self._timer.setInterval(_EVERY_MS)
        self._timer.timeout.connect(self._follow)
        self.resize(*_ORDER)
        self._state()

    def set_theme(self, theme: Theme) -> None:
        """Other colours."""
        self.report.set_theme(theme)

    @property
    def busy(self) -> bool:
        """Whether something is fitted now."""
        return self.task is not None

    def take(self, folder: Path) -> None:
        """That folder, unless another one is at work."""
        if not self.busy:
            self.order.take(folder)
            self.again()

    # what happens

    def fit(self) -> None:
        """Begin."""
        request = self.order.request()
        if self.busy or request is None:
            return
        self.tell("Starting…")
        self.bar.setRange(0, 0)
        self._timer.start()
        task = self._fitting.start(request)
        self.task = task if task.ended is None else None  # it may be over already
        self._state()

    def cancel(self) -> None:
        """Stop at the next step."""
        if self.task is not None:
            self.task.job.cancel()
            self.tell("Stopping at the next step…")
            self.cancel_button.setEnabled(False)

    def again(self) -> None:
        """Back to the order."""
        self.pages.setCurrentIndex(0)
        self._state()

    def finished_well(self, fitted: Fitted) -> None:
        """The report."""
        self._over()
        self.tell("")
        if not self._reported:  # later the size is the person's own
            self._reported = True
            self._grow()
        self.pages.setCurrentIndex(1)
        self.report.show_fit(fitted)
        self._state()
        self.show()
        self.raise_()
        self.add_button.setFocus(Qt.FocusReason.OtherFocusReason)

    def failed(self, error: Exception) -> None:
        """Nothing is there."""
        self._over()
        if isinstance(error, Cancelled):
            self.tell("Stopped.")
        else:
            self.tell(f"{str(error).rstrip('.')}.", "problem")
        self._state()
        if not isinstance(error, Cancelled):
            self.show()

    def tell(self, text: str, role: str = "dim") -> None:
        """One line under the page."""
        self.told.setText(text)
        set_role(self.told, role)

    def closeEvent(self, event: QCloseEvent) -> None:
        """What is under way goes on, in the jobs panel."""
        if self.busy:
            event.ignore()
            self.hide()
            return
        super().closeEvent(event)

    def reject(self) -> None:
        """Esc does what Close does."""
        self.close()

    def close_dialog(self) -> None:
        """For good."""
        self._timer.stop()
        self.task = None
        self.report.close_page()
        self.close()
        self.deleteLater()

    def _button(self, text: str, does: Callable[[], object]) -> QPushButton:
        made = QPushButton(text)
        made.setAutoDefault(False)
        made.clicked.connect(lambda: does())
        return made

    def _give(self, to: Callable[[Kept], None]) -> None:
        kept = self.report.kept()
        if kept is not None:
            to(kept)

    def _save_report(self) -> None:
        kept = self.report.kept()
        if self.report.fitted is not None and kept is not None:
            self._fitting.save_report(self.report.fitted, kept.name)

    def _grow(self) -> None:
        """Room for the report, in the middle of the window and within the screen."""
        room = self.screen().availableGeometry()
        size = self.size().expandedTo(QSize(*_REPORT)).boundedTo(room.size())
        self.resize(size)
        around = self.parentWidget()
        middle = around.frameGeometry().center() if around is not None else room.center()
        corner = middle - QPoint(size.width() // 2, size.height() // 2)
        most = room.bottomRight() - QPoint(size.width() - 1, size.height() - 1)
        x, y = max(min(corner.x(), most.x()), room.left()), max(min(corner.y(), most.y()), room.top())
        self.move(x, y)

    def _over(self) -> None:
        self._timer.stop()
        self.task = None

    def _state(self) -> None:
        busy, reported = self.busy, self.pages.currentIndex() == 1
        self.order.setEnabled(not busy)
        self.bar.setVisible(busy)
        self.told.setVisible(not reported)
        self.fit_button.setVisible(not busy and not reported)
        self.fit_button.setEnabled(self.order.request() is not None)
        self.cancel_button.setVisible(busy)
        self.cancel_button.setEnabled(busy)
        for button in (
            self.again_button, self.add_button, self.keep_button, self.save_button, self.report_button,
        ):  # fmt: skip
            button.setVisible(reported)
        self.close_button.setText("Go on in the background" if busy else "Close")

    def _follow(self) -> None:
        """How far it is."""
        if self.task is None or self.task.job.cancelled:
            return
        job = self.task.job
        if not job.total:
            return
        share = min(job.done / job.total, 1.0)
        self.bar.setRange(0, 1000)
        self.bar.setValue(round(1000 * share))
        taken = time.monotonic() - job.started
        left = f", about {duration(taken / share - taken)} left" if share > 0.3 and taken > 5 else ""
        self.tell(f"{job.label}: {100 * share:.0f} %{left}")


__all__ = ["FitDialog", "Fitting"]
