"""What both export dialogs are: a form, a preview, progress; the window stays usable meanwhile."""

from __future__ import annotations

import time
from typing import Protocol

from PySide6.QtCore import Qt, QTimer, QUrl
from PySide6.QtGui import QCloseEvent, QDesktopServices, QImage, QPixmap, QResizeEvent
from PySide6.QtWidgets import (
    QDialog,
    QHBoxLayout,
    QLabel,
    QProgressBar,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from studio_core.errors import Cancelled
from studio_ui.look.role import set_role
from studio_ui.look.theme import GAP
from studio_ui.pictures.order import duration
from studio_ui.pictures.work import Order
from studio_ui.tasks import Task

_EVERY_MS = 200
FORM_WIDTH, SCROLL_BAR = 380, 12


class Orders(Protocol):
    """Who has pictures made."""

    def start(self, order: Order, dialog: PictureDialog) -> Task:
        """Begin; the dialog is told how it goes."""
        ...


class Preview(QLabel):
    """A picture as large as there is room."""

    def __init__(self) -> None:
        super().__init__()
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.setMinimumSize(420, 300)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName("Preview")
        self._image = QImage()

    def show_image(self, image: QImage, instead: str = "") -> None:
        """Another picture; where there is none, a word `instead`."""
        self._image = image
        if image.isNull():
            self.setText(instead)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Fit again."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        if self._image.isNull():
            return
        ratio = self.devicePixelRatioF()
        smooth, keep = Qt.TransformationMode.SmoothTransformation, Qt.AspectRatioMode.KeepAspectRatio
        made = self._image.scaled(self.size() * ratio, keep, smooth)
        made.setDevicePixelRatio(ratio)
        self.setPixmap(QPixmap.fromImage(made))


class PictureDialog(QDialog):
    """A form is put into `form_column`; `order()` says what it means."""

    title = ""
    verb = "Export"

    def __init__(self, parent: QWidget | None, orders: Orders) -> None:
        super().__init__(parent)
        self.setWindowTitle(self.title)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self._orders = orders
        self.task: Task | None = None
        self._folder = ""
        self.form_column = QVBoxLayout()
        self.form_column.setSpacing(2 * GAP)
        self.preview = Preview()
        self.told = QLabel()
        self.told.setWordWrap(True)
        self.told.setProperty("role", "dim")
        self.bar = QProgressBar()
        self.bar.setTextVisible(False)
        self.bar.setAccessibleName("Progress")
        self.export_button = QPushButton(self.verb)
        self.export_button.setDefault(True)
        self.cancel_button, self.folder_button = QPushButton("Cancel"), QPushButton("Open folder")
        self.close_button = QPushButton("Close")
        self._layout()
        self.export_button.clicked.connect(self.export)
        self.cancel_button.clicked.connect(self.cancel)
        self.folder_button.clicked.connect(self.open_folder)
        self.close_button.clicked.connect(self.close)
        self._timer = QTimer(self)
        self._timer.setInterval(_EVERY_MS)
        self._timer.timeout.connect(self._follow)
        self._state(False)
        self.folder_button.hide()

    def _layout(self) -> None:
        self.form = QWidget()
        self.form.setLayout(self.form_column)
        self.form_column.setContentsMargins(0, 0, SCROLL_BAR, 0)
        right = QVBoxLayout()
        right.setSpacing(GAP)
        right.addWidget(self.preview, 1)
        right.addWidget(self.bar)
        right.addWidget(self.told)
        halves = QHBoxLayout()
        halves.setSpacing(3 * GAP)
        area = QScrollArea()
        area.setWidgetResizable(True)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setWidget(self.form)
        area.setAccessibleName("What is exported")
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the keyboard goes to the fields
        area.setFixedWidth(FORM_WIDTH + SCROLL_BAR)
        halves.addWidget(area)
        halves.addLayout(right, 1)
        buttons = QHBoxLayout()
        buttons.addWidget(self.folder_button)
        buttons.addStretch(1)
        for button in (self.close_button, self.cancel_button, self.export_button):
            buttons.addWidget(button)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(2 * GAP, 2 * GAP, 2 * GAP, 2 * GAP)
        whole.setSpacing(2 * GAP)
        whole.addLayout(halves, 1)
        whole.addLayout(buttons)

    # what subclasses say

    def order(self) -> Order | None:
        """What is asked for; None where a question was answered by going back."""
        raise NotImplementedError

    def estimate(self) -> str:
        """How long it will take."""
        return ""

    # what happens

    def export(self) -> None:
        """Begin."""
        if self.task is not None:
            return
        order = self.order()
        if order is None:
            return
        self._folder = str(order.path.parent)
        self.folder_button.hide()
        self._state(True)
        self.tell("Starting…")
        self.task = self._orders.start(order, self)
        self._timer.start()

    def cancel(self) -> None:
        """Stop; nothing half done is left."""
        if self.task is not None:
            self.task.job.cancel()
            self.tell("Stopping…")
            self.cancel_button.setEnabled(False)

    def seen(self, png: bytes) -> None:
        """A small picture of what there is so far."""
        image = QImage.fromData(png)
        if not image.isNull():
            self.preview.show_image(image)

    def finished_well(self, text: str) -> None:
        """All is there."""
        self._over()
        self.bar.setValue(self.bar.maximum())
        self.tell(text)
        self.folder_button.show()

    def failed(self, error: Exception) -> None:
        """Nothing is there."""
        self._over()
        self.bar.setValue(0)
        if isinstance(error, Cancelled):
            self.tell("Stopped; nothing half done is left.")
        else:
            self.tell(f"{error}.", "problem")

    def tell(self, text: str, role: str = "dim") -> None:
        """One line under the preview."""
        self.told.setText(text)
        set_role(self.told, role)

    def open_folder(self) -> None:
        """In the system's file manager."""
        QDesktopServices.openUrl(QUrl.fromLocalFile(self._folder))

    def closeEvent(self, event: QCloseEvent) -> None:
        """What is under way goes on, in the jobs panel."""
        self._timer.stop()
        super().closeEvent(event)

    def _state(self, busy: bool) -> None:
        self.form.setEnabled(not busy)
        self.export_button.setVisible(not busy)
        self.cancel_button.setVisible(busy)
        self.cancel_button.setEnabled(True)
        self.bar.setVisible(busy)
        self.close_button.setText("Go on in the background" if busy else "Close")
        if busy:
            self.bar.setRange(0, 0)
            self.cancel_button.setFocus(Qt.FocusReason.OtherFocusReason)

    def _over(self) -> None:
        self._timer.stop()
        self.task = None
        self._state(False)
        self.export_button.setFocus(Qt.FocusReason.OtherFocusReason)

    def _follow(self) -> None:
        """How far it is."""
        if self.task is None:
            return
        job, now = self.task.job, time.monotonic()
        if job.cancelled:
            return
        if self.task.state == "waiting":
            self.tell("Waiting for another picture…")
            return
        if not job.total:
            return
        share = min(job.done / job.total, 1.0)
        self.bar.setRange(0, 1000)
        self.bar.setValue(round(1000 * share))
        taken = now - job.started
        left = f", about {duration(taken / share - taken)} left" if share > 0.05 and taken > 3 else ""
        self.tell(f"{job.label}: {100 * share:.0f} %{left}")
