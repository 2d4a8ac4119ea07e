"""Unit, axis and place of a model that comes in, beside a person; the same for one that is there already."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QVBoxLayout,
    QWidget,
)

from studio_core.params import ParamInfo
from studio_core.scene.imported import Up
from studio_ui.files.import_preview import ImportPreview
from studio_ui.files.import_question import UNITS, ImportChoice, ImportQuestion
from studio_ui.files.leftovers import counted
from studio_ui.forms.number_style import number_style
from studio_ui.forms.spin import Spin
from studio_ui.panels.panel import heading, note

_AXES: tuple[tuple[str, Up], ...] = (("Y is up", "y"), ("Z is up", "z"))
_OTHER = "other"
_NOTES = 3


class ImportDialog(QDialog):
    """Shows the question's guess; `choice()` is what was made of it."""

    def __init__(self, parent: QWidget | None, question: ImportQuestion) -> None:
        super().__init__(parent)
        self._question, guess = question, question.guess
        self.setWindowTitle("Correct units" if question.correcting else "Import model")
        self.preview = ImportPreview(question)
        self.unit = self._units(guess.unit)
        self.factor = Spin(ParamInfo("number", "Size of the unit", low=1e-6, high=1e6), decimals=6)
        self.factor.setToolTip("Metres of one unit of the file")
        self.factor.setValue(guess.unit)
        self.axis = QComboBox()
        for text, up in _AXES:
            self.axis.addItem(text, up)
        self.axis.setCurrentIndex(0 if guess.up == "y" else 1)
        self.axis.setToolTip("Which axis of the file points to the ceiling")
        self.size = QLabel()
        self.size.setProperty("role", "title")
        self.stand, self.centre = QCheckBox("Stand on the floor"), QCheckBox("Centre where it is put")
        self.stand.setToolTip("Otherwise it keeps the height that the file gives it")
        self.centre.setToolTip("Otherwise it keeps the place that the file gives it")
        self.remember = QCheckBox(f"Remember for {question.suffix} files")
        self.stand.setChecked(guess.stand)
        self.centre.setChecked(guess.centre)
        for box in (self.stand, self.centre, self.remember):
            box.setVisible(not question.correcting)
        self.unit.setAccessibleName("Unit of the file")
        self.axis.setAccessibleName("Axis that points up")
        self._lay_out()
        self.unit.currentIndexChanged.connect(lambda _: self._unit_chosen())
        self.factor.valueChanged.connect(lambda _: self._factor_typed())
        self.axis.currentIndexChanged.connect(lambda _: self._show())
        self._show()

    def choice(self) -> ImportChoice:
        """What the controls say."""
        return ImportChoice(
            unit=self.factor.value(),
            up=self.axis.currentData(),
            stand=self.stand.isChecked(),
            centre=self.centre.isChecked(),
            remember=self.remember.isChecked(),
        )

    def _units(self, guess: float) -> QComboBox:
        made = QComboBox()
        if self._question.correcting:
            made.addItem("As it is", 1.0)
            made.addItem("Was in centimetres (÷ 100)", 0.01)
            made.addItem("Was in millimetres (÷ 1000)", 0.001)
            made.addItem("Was in inches", 0.0254)
            made.addItem("Was in feet", 0.3048)
            made.addItem("Was in metres, read as centimetres (× 100)", 100.0)
            made.addItem("Was in metres, read as millimetres (× 1000)", 1000.0)
        else:
            for name, factor in UNITS.items():
                made.addItem(name.capitalize(), factor)
        made.addItem("Other factor", _OTHER)
        known = [made.itemData(i) for i in range(made.count())]
        made.setCurrentIndex(known.index(guess) if guess in known else made.count() - 1)
        made.setToolTip("What one unit of the file means")
        return made

    def _lay_out(self) -> None:
        question = self._question
        form = QFormLayout()
        form.setHorizontalSpacing(12)
        counts = f"{counted(question.triangles, 'triangle')}, {counted(question.materials, 'material')}"
        form.addRow("In it", QLabel(counts))
        form.addRow("Unit of the file" if not question.correcting else "Correction", self.unit)
        form.addRow("Factor", self.factor)
        form.addRow("Axis", self.axis)
        form.addRow("Size", self.size) if not question.correcting else form.addRow("Then", self.size)
        right = QVBoxLayout()
        right.setSpacing(8)
        right.addWidget(heading(question.name))
        if question.doubt:
            right.addWidget(note(f"{question.doubt} Is this how it should be?"))
        right.addLayout(form)
        for box in (self.stand, self.centre, self.remember):
            right.addWidget(box)
        for text in question.notes[:_NOTES]:
            right.addWidget(note(text))
        if len(question.notes) > _NOTES:
            right.addWidget(note(f"{len(question.notes) - _NOTES} more notes will be in the log."))
        right.addStretch(1)
        left = QVBoxLayout()
        left.addWidget(self.preview, 1)
        left.addWidget(note("Beside a person of 1.75 m"))
        row = QHBoxLayout()
        row.setSpacing(16)
        row.addLayout(left, 1)
        row.addLayout(right)
        kinds = QDialogButtonBox.StandardButton
        buttons = QDialogButtonBox(kinds.Ok | kinds.Cancel)
        buttons.button(kinds.Ok).setText("Correct" if question.correcting else "Import")
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        column = QVBoxLayout(self)
        column.setSpacing(12)
        column.addLayout(row, 1)
        column.addWidget(buttons)
        self.setTabOrder(self.unit, self.factor)

    def _unit_chosen(self) -> None:
        factor = self.unit.currentData()
        if factor != _OTHER:
            with QSignalBlocker(self.factor):
                self.factor.setValue(factor)
        self._show()

    def _factor_typed(self) -> None:
        known = [self.unit.itemData(i) for i in range(self.unit.count())]
        value = self.factor.value()
        with QSignalBlocker(self.unit):
            self.unit.setCurrentIndex(known.index(value) if value in known else len(known) - 1)
        self._show()

    def _show(self) -> None:
        choice = self.choice()
        self.preview.show_choice(choice)
        style = number_style(self)
        sides = [style.text(side, "m", with_unit=False) for side in self._question.size(choice)]
        unit = style.length if style.length != "ft-in" else ""
        self.size.setText(f"{' × '.join(sides)} {unit}".strip())
        self.size.setToolTip("Width × depth × height")
