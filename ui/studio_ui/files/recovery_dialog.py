"""After a bad end: both versions side by side, and documents that were never saved."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QImage, QPixmap
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QFrame,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from studio_core.project.outline import Outline
from studio_core.project.records import Revision
from studio_ui.ask import LeftoverChoice, Recover
from studio_ui.files.leftovers import Leftover, counted
from studio_ui.files.recent import when_title

_PICTURE = (256, 144)


class RecoveryDialog(QDialog):
    """One project, saved and autosaved; `answer` is "later" until something else is chosen."""

    def __init__(self, parent: QWidget | None, left: Leftover) -> None:
        super().__init__(parent)
        self.answer: Recover = "later"
        self.setWindowTitle("Recover your work")
        column = QVBoxLayout(self)
        column.setSpacing(10)
        column.addWidget(_words(f"Lucarne ended before {left.name} was saved.", "title"))
        text = "Your latest work was kept. Which version do you want to open?"
        column.addWidget(_words(text if left.saved or left.found.saved else "Your latest work was kept."))
        row = QHBoxLayout()
        row.setSpacing(14)
        row.addWidget(
            _version("Recovered version", left.found.recovered, left.recovered, left.recovered_image)
        )
        if left.found.saved is not None:
            row.addWidget(_version("Saved version", left.found.saved, left.saved, left.saved_image))
        else:
            row.addWidget(_words("There is no saved version that can be read.", "dim"))
        column.addLayout(row)
        difference = left.difference()
        if difference:
            column.addWidget(_words(difference))
        if left.found.saved is not None:
            drop = "If you open the saved version, the recovered one is dropped."
            column.addWidget(_words(drop, "dim"))
        buttons = QDialogButtonBox()
        role = QDialogButtonBox.ButtonRole
        self.recovered = buttons.addButton("Open recovered version", role.AcceptRole)
        self.saved: QPushButton | None = None
        if left.found.saved is not None:
            self.saved = buttons.addButton("Open saved version", role.ActionRole)
            self.saved.clicked.connect(lambda: self._choose("saved"))
        self.later = buttons.addButton("Decide later", role.RejectRole)
        self.later.setToolTip("Nothing is opened and nothing is lost; you are asked again next time")
        self.recovered.clicked.connect(lambda: self._choose("recovered"))
        buttons.rejected.connect(self.reject)
        self.recovered.setDefault(True)
        column.addWidget(buttons)
        wide = self.sizeHint().width()
        self.resize(wide, column.heightForWidth(wide))  # words that wrap are not in the size hint

    def _choose(self, answer: Recover) -> None:
        self.answer = answer
        self.accept()


class LeftoversDialog(QDialog):
    """Documents that were never saved, the newest first; `choice` says what becomes of them."""

    def __init__(self, parent: QWidget | None, found: Sequence[Leftover]) -> None:
        super().__init__(parent)
        self.choice = LeftoverChoice()
        self._discarded: list[Leftover] = []
        self.setWindowTitle("Recover your work")
        column = QVBoxLayout(self)
        column.setSpacing(10)
        one = "A scene that was never saved was kept when Lucarne ended."
        many = f"{len(found)} scenes that were never saved were kept when Lucarne ended."
        column.addWidget(_words(one if len(found) == 1 else many, "title"))
        inside = QWidget()
        rows = QVBoxLayout(inside)
        rows.setContentsMargins(0, 0, 0, 0)
        self.rows: list[tuple[Leftover, QWidget, QPushButton, QPushButton]] = []
        for left in found:
            rows.addWidget(self._row(left))
        rows.addStretch(1)
        area = QScrollArea()
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # its buttons scroll into sight
        area.setWidgetResizable(True)
        area.setFrameShape(QFrame.Shape.NoFrame)
        area.setWidget(inside)
        area.setMinimumSize(inside.sizeHint().width() + 24, min(inside.sizeHint().height(), 420))
        column.addWidget(area, 1)
        buttons = QDialogButtonBox()
        self.later = buttons.addButton("Decide later", QDialogButtonBox.ButtonRole.RejectRole)
        self.later.setToolTip("You are asked again next time")
        buttons.rejected.connect(self._later)
        column.addWidget(buttons)
        self.rows[0][2].setDefault(True)

    def _row(self, left: Leftover) -> QWidget:
        frame = QWidget()
        row = QHBoxLayout(frame)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(12)
        row.addWidget(
            _version("", left.found.recovered, left.recovered, left.recovered_image, across=True), 1
        )
        open_, discard = QPushButton("Open"), QPushButton("Discard")
        open_.clicked.connect(lambda: self._open(left))
        discard.clicked.connect(lambda: self._discard(left, frame))
        discard.setToolTip("It is gone for good when this window closes")
        buttons = QVBoxLayout()
        buttons.addWidget(open_)
        buttons.addWidget(discard)
        buttons.addStretch(1)
        row.addLayout(buttons)
        self.rows.append((left, frame, open_, discard))
        return frame

    def _open(self, left: Leftover) -> None:
        self.choice = LeftoverChoice(left, tuple(self._discarded))
        self.accept()

    def _discard(self, left: Leftover, row: QWidget) -> None:
        self._discarded.append(left)
        row.hide()
        if len(self._discarded) == len(self.rows):
            self._later()

    def _later(self) -> None:
        self.choice = LeftoverChoice(None, tuple(self._discarded))
        self.reject()


def _version(
    title: str,
    revision: Revision | None,
    told: Outline | None,
    image: QImage | None,
    *,
    across: bool = False,
) -> QWidget:
    """A picture, when it was made, what is in it and what was done last."""
    made = QWidget()
    layout = QHBoxLayout(made) if across else QVBoxLayout(made)
    layout.setContentsMargins(0, 0, 0, 0)
    layout.addWidget(_picture(image))
    words = QVBoxLayout()
    words.setSpacing(3)
    if title:
        words.addWidget(_line(title, "title"))
    if revision is not None:
        words.addWidget(_line(when_title(revision.time), "title" if not title else ""))
    if told is not None:
        words.addWidget(
            _line(", ".join((counted(told.objects, "object"), counted(told.materials, "material"))), "dim")
        )
        for number, step in enumerate(told.steps):
            words.addWidget(_line(step if number else f"Done last: {step}", "dim"))
    words.addStretch(1)
    layout.addLayout(words, 1)
    made.setMinimumSize(made.sizeHint())
    return made


def _picture(image: QImage | None) -> QLabel:
    label = QLabel()
    label.setFixedSize(*_PICTURE)
    if image is not None:
        fitted = QPixmap.fromImage(image).scaled(
            *_PICTURE, Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation
        )
        label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        label.setPixmap(fitted)
    else:
        label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        label.setText("No picture")
        label.setFrameShape(QFrame.Shape.StyledPanel)
        label.setProperty("role", "dim")
    return label


def _line(text: str, role: str = "") -> QLabel:
    """One line, as wide as the picture; its end is left out where it is longer."""
    label = _words(text, role)
    label.setWordWrap(False)
    label.setText(label.fontMetrics().elidedText(text, Qt.TextElideMode.ElideRight, _PICTURE[0]))
    label.setToolTip(text)
    return label


def _words(text: str, role: str = "") -> QLabel:
    label = QLabel(text)
    label.setTextFormat(Qt.TextFormat.PlainText)
    label.setWordWrap(True)
    label.setMaximumWidth(560)
    if role:
        label.setProperty("role", role)
    return label
