"""First step: which photographs there are, which side they show, and how they were exposed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QSignalBlocker, QSize, Qt
from PySide6.QtGui import QBrush, QColor, QIcon, QImage, QPixmap
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QHeaderView,
    QPushButton,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTreeWidgetItem,
    QWidget,
)

from studio_core.capturing.artifacts import CaptureState
from studio_core.capturing.edits import set_photographs
from studio_core.capturing.settings import SIDES, CaptureSettings, Shot
from studio_core.errors import InputError
from studio_core.scene.capture import Capture, KeptPhotograph
from studio_core.scene.geometry import Image
from studio_ui.capture.desk import CaptureDesk
from studio_ui.capture.preview.picture import Shown
from studio_ui.capture.steps.step import StepForm
from studio_ui.capture.steps.table import Table
from studio_ui.context import Context
from studio_ui.forms.number_style import number_style
from studio_ui.look.theme import DARK, Theme
from studio_ui.panels.panel import heading, note, row

NAME, SIDE, LISTED, MEASURED, HOW = range(5)
_HEADS = ("Photograph", "Side", "Listed", "Measured", "Exposure")
_TIPS = (
    "Without the tick it is left out",
    "Which lens it belongs to; double-click to say so",
    "EV as the photograph says, or as typed: double-click to type it, nothing to have the photograph's again",
    "EV as the pictures themselves show it",
    "What the photograph says of time, sensitivity and aperture",
)
_THUMBNAIL = QSize(48, 32)
_ROWS = 8  # that the table is high, at most
_AUTOMATIC = "as found"


@dataclass(frozen=True)
class Row:
    """What the table tells of one photograph; None where it is not known. `wrong`: listed is not measured."""

    kept: KeptPhotograph
    side: str | None = None
    listed: float | None = None
    measured: float | None = None
    certain: bool = True
    typed: bool = False
    used: bool = True
    wrong: bool = False

    @property
    def how(self) -> str:
        """Time, sensitivity, aperture."""
        facts = self.kept.facts
        parts = []
        if facts.seconds:
            parts.append(f"1/{1 / facts.seconds:.0f} s" if facts.seconds < 0.4 else f"{facts.seconds:.2g} s")
        if facts.iso:
            parts.append(f"ISO {facts.iso:.0f}")
        if facts.aperture:
            parts.append(f"f/{facts.aperture:.2g}")
        return " · ".join(parts) or "not said"


def rows_of(capture: Capture, settings: CaptureSettings, state: CaptureState) -> list[Row]:
    """Front, back, then those that belong to neither; dark to bright where that is known."""
    kept = {photograph.digest: photograph for photograph in capture.photographs}
    decided = {shot.photograph: shot for shot in settings.bracket.shots}
    made: dict[str, Row] = {}
    sides = state.brackets.sides if state.brackets is not None else {}
    for side, bracket in sides.items():
        light = state.lights.get(side)
        solved = light.exposures.solved if light is not None else ()
        for index, shot in enumerate(bracket.shots):
            if shot.digest not in kept or shot.digest in made:
                continue
            made[shot.digest] = Row(
                kept[shot.digest],
                side,
                bracket.listed[index],
                solved[index] if len(solved) == len(bracket.shots) else None,
                bracket.certain[index],
                wrong=light is not None and index in light.exposures.wrong,
            )
    for digest, photograph in kept.items():
        made.setdefault(digest, Row(photograph, listed=photograph.facts.ev))
    for digest, said in decided.items():
        if digest in made:
            found = made[digest]
            made[digest] = replace(
                found,
                side=said.side or found.side,
                listed=found.listed if said.ev is None else said.ev,
                typed=said.ev is not None,
                certain=found.certain or said.ev is not None,
                used=said.used,
            )
    return list(made.values())


def with_shot(shots: tuple[Shot, ...], digest: str, **values: object) -> tuple[Shot, ...]:
    """What was decided about photographs, with something else for one of them."""
    old = next((shot for shot in shots if shot.photograph == digest), Shot(digest))
    new = replace(old, **values)  # type: ignore[arg-type]
    others = tuple(shot for shot in shots if shot.photograph != digest)
    return others if new == Shot(digest) else (*others, new)


class PhotographsStep(StepForm):
    """A table of the photographs; `add` asks for more of them, `new` for those of another room."""

    id = "photographs"

    def __init__(
        self, context: Context, desk: CaptureDesk, add: Callable[[], object], new: Callable[[], object]
    ) -> None:
        super().__init__(context, desk)
        self.rows: list[Row] = []
        self.theme = DARK
        self.table = Table()
        self.table.removed = self._remove
        self.table.setAccessibleName("Photographs")
        self.table.setHeaderLabels(list(_HEADS))
        for column, tip in enumerate(_TIPS):
            self.table.headerItem().setToolTip(column, tip)
        self.table.setRootIsDecorated(False)
        self.table.setIconSize(_THUMBNAIL)
        self.table.setMinimumHeight(200)
        self.table.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.table.setEditTriggers(
            QAbstractItemView.EditTrigger.DoubleClicked | QAbstractItemView.EditTrigger.EditKeyPressed
        )
        self.table.setItemDelegate(_Delegate(self.table))
        self.table.header().setStretchLastSection(False)
        self.table.header().setSectionResizeMode(NAME, QHeaderView.ResizeMode.Interactive)
        self.table.itemChanged.connect(self._changed)
        self.table.currentItemChanged.connect(lambda now, _: self._current(now))
        add_more = QPushButton("Add…")
        add_more.setToolTip("More photographs of the same room")
        add_more.clicked.connect(lambda: add())
        self.remove = QPushButton("Remove")
        self.remove.setToolTip("Take the chosen photographs out of the capture")
        self.remove.clicked.connect(self._remove)
        self.column.addWidget(self.table, 1)
        another = QPushButton("New capture…")
        another.setToolTip("Photographs of another room")
        another.clicked.connect(lambda: new())
        self.column.addLayout(row(add_more, self.remove, another))
        self.column.addWidget(heading("How they belong together"))
        self.column.addWidget(self.form("bracket"))
        self.column.addWidget(
            note(
                "Listed exposures are where the search for the true ones begins. Untick what is blurred or "
                "shows somebody else's hand."
            )
        )
        self.setSizePolicy(self.sizePolicy().horizontalPolicy(), self.sizePolicy().Policy.Preferred)
        self._icons: dict[str, QIcon] = {}

    def set_theme(self, theme: Theme) -> None:
        """Colours of what is wrong."""
        self.theme = theme

    def show_now(self) -> None:
        """The table again where it is another one."""
        super().show_now()
        capture = self.desk.capture
        rows = [] if capture is None else rows_of(capture, self.desk.settings, self.desk.state)
        if [r.kept.digest for r in rows] != [r.kept.digest for r in self.rows]:
            self._rebuild(rows)
        with QSignalBlocker(self.table):
            for index, found in enumerate(rows):
                self._fill(self.table.topLevelItem(index), found)
        self.rows = rows

    def pictures(self) -> list[str]:
        """The photographs that have been read, by name."""
        return self._names()

    def first(self) -> str:
        """One that is neither dark nor bright."""
        names = self._names()
        front = sum(found.side == self.rows[0].side for found in self.rows) if self.rows else 0
        return names[front // 2] if names else ""

    def picture(self, name: str) -> Shown | None:
        """As the camera wrote it."""
        digest = self._digests().get(name, "")
        photograph = self.desk.photographs.get(digest)
        if photograph is None:
            return None
        width, height = photograph.size
        return Shown(f"photograph {width} × {height}", f"{name}, {photograph.kind}", photograph.pixels)

    def shown(self, name: str) -> None:
        """Its row is the current one."""
        names = self._names()
        if name in names:
            with QSignalBlocker(self.table):
                item = self.table.topLevelItem(names.index(name))
                if self.table.currentItem() is not item:
                    self.table.setCurrentItem(item)

    def _names(self) -> list[str]:
        return list(self._digests())

    def _digests(self) -> dict[str, str]:
        """By name; a second one of the same name is numbered."""
        made: dict[str, str] = {}
        for found in self.rows:
            name, number = found.kept.facts.name or "Photograph", 2
            while name in made:
                name = f"{found.kept.facts.name} ({number})"
                number += 1
            made[name] = found.kept.digest
        return made

    def _rebuild(self, rows: list[Row]) -> None:
        with QSignalBlocker(self.table):
            self.table.clear()
            for found in rows:
                item = QTreeWidgetItem()
                item.setIcon(NAME, self._icon(found.kept))
                flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
                item.setFlags(flags | Qt.ItemFlag.ItemIsUserCheckable | Qt.ItemFlag.ItemIsEditable)
                for column in (LISTED, MEASURED):
                    item.setTextAlignment(column, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                self._fill(item, found)
                self.table.addTopLevelItem(item)
        for column in range(self.table.columnCount()):
            self.table.resizeColumnToContents(column)
        self.table.setColumnWidth(NAME, min(self.table.columnWidth(NAME), 190))
        line = self.table.sizeHintForRow(0) if rows else 0
        self.table.setMinimumHeight(max(200, min(len(rows), _ROWS) * line + 60))

    def _fill(self, item: QTreeWidgetItem, found: Row) -> None:
        item.setText(NAME, found.kept.facts.name or "Photograph")
        item.setCheckState(NAME, Qt.CheckState.Checked if found.used else Qt.CheckState.Unchecked)
        item.setText(SIDE, (found.side or "–").capitalize())
        listed = "–" if found.listed is None else _ev(found.listed)
        item.setText(LISTED, f"{listed}{'' if found.certain else ' ?'}{' ✎' if found.typed else ''}")
        item.setText(MEASURED, "" if found.measured is None else _ev(found.measured))
        item.setText(HOW, found.how)
        told = found.kept.facts.name
        told += f"\n{found.kept.size[0]} × {found.kept.size[1]}"
        if not found.certain:
            told += "\nThe photograph does not say how it was exposed: this is a guess."
        if found.wrong:
            told += "\nWhat is listed does not fit the picture; the measured exposure is used."
        colour = self.theme.warning if found.wrong else self.theme.text if found.used else self.theme.dim
        for column in range(len(_HEADS)):
            item.setToolTip(column, told)
            item.setForeground(column, _brush(colour))

    def _icon(self, kept: KeptPhotograph) -> QIcon:
        if kept.digest not in self._icons:
            self._icons[kept.digest] = QIcon(QPixmap.fromImage(thumbnail_image(kept.thumbnail)))
        return self._icons[kept.digest]

    def _current(self, item: QTreeWidgetItem | None) -> None:
        index = self.table.indexOfTopLevelItem(item) if item is not None else -1
        names = self._names()
        if 0 <= index < len(names):
            self.look(names[index])

    def _changed(self, item: QTreeWidgetItem, column: int) -> None:
        index = self.table.indexOfTopLevelItem(item)
        if not 0 <= index < len(self.rows):
            return
        found = self.rows[index]
        name = found.kept.facts.name
        if column == NAME:
            used = item.checkState(NAME) is Qt.CheckState.Checked
            if used != found.used:
                self._decide(found, f"{'Use' if used else 'Leave out'} {name}", used=used)
        elif column == SIDE:
            text = item.text(SIDE).lower()
            side = text if text in SIDES else None
            self._decide(found, f"Side of {name}", side=side)
        elif column == LISTED:
            try:
                text = item.text(LISTED).replace("✎", "").replace("?", "").strip(" –")
                ev = number_style(self).read(text, "EV") if text else None
            except InputError as error:
                self.context.journal.problem("Exposure", error)
                ev = found.listed if found.typed else None
            self._decide(found, f"Exposure of {name}", ev=ev)
        self.show_now()

    def _decide(self, found: Row, label: str, **values: object) -> None:
        shots = with_shot(self.desk.settings.bracket.shots, found.kept.digest, **values)
        if shots != self.desk.settings.bracket.shots:
            self.desk.apply("bracket", label, shots=shots)

    def _remove(self) -> None:
        chosen = {self.table.indexOfTopLevelItem(item) for item in self.table.selectedItems()}
        gone = {self.rows[index].kept.digest for index in chosen if 0 <= index < len(self.rows)}
        capture = self.desk.capture
        if capture is None or not gone:
            return
        left = tuple(kept for kept in capture.photographs if kept.digest not in gone)
        self.context.editing.apply(set_photographs(self.context.document.scene, capture.id, left))


class _Delegate(QStyledItemDelegate):
    """Names are not typed; sides are chosen; EVs are typed as they are."""

    def createEditor(
        self, parent: QWidget, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> QWidget | None:
        """By column."""
        if index.column() == LISTED:
            return super().createEditor(parent, option, index)
        if index.column() != SIDE:
            return None
        combo = QComboBox(parent)
        combo.addItems([_AUTOMATIC, *(side.capitalize() for side in SIDES)])
        combo.activated.connect(partial(self._chosen, combo))
        return combo

    def setEditorData(self, editor: QWidget, index: QModelIndex | QPersistentModelIndex) -> None:
        """What is there; of EVs the number alone."""
        if isinstance(editor, QComboBox):
            editor.setCurrentText(str(index.data()))
            return
        super().setEditorData(editor, index)
        editor.setProperty("text", str(index.data()).replace("✎", "").replace("?", "").strip(" –"))

    def _chosen(self, combo: QComboBox, _: int) -> None:
        self.commitData.emit(combo)
        self.closeEditor.emit(combo)


def thumbnail_image(image: Image) -> QImage:
    """A kept photograph's small picture."""
    pixels = image.pixels[..., :3]
    height, width = pixels.shape[:2]
    return QImage(pixels.tobytes(), width, height, 3 * width, QImage.Format.Format_RGB888).copy()


def _ev(value: float) -> str:
    return f"{value:+.2f}"


def _brush(colour: str) -> QBrush:
    return QBrush(QColor(colour))
