"""A room in the properties panel: floor plan, which walls stand, windows, doors and passages in them."""

from __future__ import annotations

import dataclasses
from functools import partial

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtWidgets import (
    QCheckBox,
    QGridLayout,
    QListWidget,
    QListWidgetItem,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from studio_core.edits import Edit, SetFields
from studio_core.params import Value, param_infos
from studio_core.scene.nodes import NodeId
from studio_core.scene.room import Room
from studio_core.scene.room_shape import KINDS, Opening
from studio_ui.editing import Editing
from studio_ui.forms.fields import Combo
from studio_ui.forms.number_style import NumberStyle, number_style
from studio_ui.forms.param_form import ParamForm, form_label, form_layout
from studio_ui.forms.sinks import EditSink
from studio_ui.look.theme import GAP
from studio_ui.panels.panel import heading, note, row
from studio_ui.panels.room_plan import PlanForm

NAMES = {"window": "Window", "door": "Door", "opening": "Passage"}
NEW = {
    "window": Opening(),
    "door": Opening(kind="door", width=0.9, height=2.05, sill=0.0),
    "opening": Opening(kind="opening", width=1.2, height=2.1, sill=0.0),
}
_TIPS = {
    "window": "A window with a frame, in the wall of the chosen opening",
    "door": "A closed door",
    "opening": "A hole in the wall to walk through",
}
_ROWS = 5
_COLUMNS = 2
_SIDE_BY_SIDE = (0, 2, 3, 1)  # back and front, left and right


class RoomForm(QWidget):
    """Follows one room; everything it does is an edit of the room's fields."""

    def __init__(self, editing: Editing) -> None:
        super().__init__()
        self._editing = editing
        self._room: Room | None = None
        self._sink = EditSink(editing, self._make, self._label)
        self.walls: list[QCheckBox] = []
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(GAP)
        self.plan = PlanForm(editing)
        column.addWidget(self.plan)
        column.addWidget(heading("Walls"))
        self._grid = QGridLayout()
        self._grid.setContentsMargins(0, 0, 0, 0)
        column.addLayout(self._grid)
        self.remove = _button("Remove", "Close the chosen window, door or passage")
        self.remove.clicked.connect(self._remove)
        column.addLayout(row(heading("Windows and doors"), self.remove, stretch=0))
        self.list = QListWidget()
        self.list.setAccessibleName("Windows and doors")
        self.list.currentRowChanged.connect(lambda _: self._show_chosen())
        column.addWidget(self.list)
        self.add: dict[str, QToolButton] = {}
        for kind in KINDS:
            self.add[kind] = button = _button(f"+ {NAMES[kind]}", _TIPS[kind])
            button.clicked.connect(partial(self._add, kind))
        column.addLayout(row(*self.add.values()))
        self.chosen = QWidget()
        rows = QVBoxLayout(self.chosen)
        rows.setContentsMargins(0, 0, 0, 0)
        rows.setSpacing(GAP)
        kinds = QWidget()
        layout = form_layout(kinds)
        self.kind, self.wall = Combo(), Combo()
        for kind in KINDS:
            self.kind.addItem(NAMES[kind], kind)
        for combo, label, tip in (
            (self.kind, "Kind", "What fills the hole: a frame, a closed door, nothing"),
            (self.wall, "Wall", "Which wall it is in"),
        ):
            combo.setAccessibleName(label)
            combo.setToolTip(tip)
            layout.addRow(form_label(label, tip), combo)
        self.kind.activated.connect(lambda _: self._replace("kind", self.kind.currentData()))
        self.wall.activated.connect(lambda _: self._replace("wall", self.wall.currentData()))
        rows.addWidget(kinds)
        self.form = ParamForm(param_infos(Opening), self._sink)
        rows.addWidget(self.form)
        self.doubt = note("")
        rows.addWidget(self.doubt)
        column.addWidget(self.chosen)

    @property
    def node(self) -> NodeId | None:
        """The room that is shown."""
        return None if self._room is None else self._room.id

    def show_room(self, room: Room) -> None:
        """What the room is now."""
        before, self._room = self._room, room
        self.plan.show_room(room)
        if before is None or before.walls != room.walls:
            self._make_walls(room)
        for wall, box in enumerate(self.walls):
            with QSignalBlocker(box):
                box.setChecked(wall not in room.without)
        self._show_list(room)
        self._show_chosen()

    def _make_walls(self, room: Room) -> None:
        for box in self.walls:
            box.hide()
            box.deleteLater()
        self.walls = []
        with QSignalBlocker(self.wall):
            self.wall.clear()
            for wall, name in enumerate(room.walls):
                self.wall.addItem(name, wall)
                box = QCheckBox(name)
                box.setToolTip("Leave a wall out to look into the room; light comes in there")
                box.toggled.connect(partial(self._switch, wall))
                place = _SIDE_BY_SIDE.index(wall) if len(room.walls) == len(_SIDE_BY_SIDE) else wall
                self._grid.addWidget(box, place // _COLUMNS, place % _COLUMNS)
                self.walls.append(box)

    def _show_list(self, room: Room) -> None:
        with QSignalBlocker(self.list):
            current = max(self.list.currentRow(), 0)
            while self.list.count() > len(room.openings):
                self.list.takeItem(self.list.count() - 1)
            while self.list.count() < len(room.openings):
                self.list.addItem(QListWidgetItem())
            made = {one.opening for one in room.placed()}
            for number, opening in enumerate(room.openings):
                item = self.list.item(number)
                item.setText(_text(room, opening, number_style(self), number in made))
            self.list.setCurrentRow(min(current, len(room.openings) - 1))
        shown = min(max(len(room.openings), 1), _ROWS)
        height = self.list.sizeHintForRow(0) if room.openings else self.fontMetrics().height() + GAP
        self.list.setFixedHeight(shown * height + 2 * self.list.frameWidth() + 2)
        self.list.setVisible(bool(room.openings))

    def _show_chosen(self) -> None:
        room, number = self._room, self.list.currentRow()
        there = room is not None and 0 <= number < len(room.openings)
        self.chosen.setVisible(there)
        self.remove.setEnabled(there)
        if room is None or not there:
            return
        opening = room.openings[number]
        with QSignalBlocker(self.kind), QSignalBlocker(self.wall):
            self.kind.setCurrentIndex(self.kind.findData(opening.kind))
            self.wall.setCurrentIndex(self.wall.findData(opening.wall))
        self.form.show_values({name: getattr(opening, name) for name in self.form.fields})
        told = ""
        if opening.wall in room.without:
            told = "This wall is left out."
        elif number not in {one.opening for one in room.placed()}:
            told = "It finds no room in this wall: another one is in its way, or the wall is too low."
        self.doubt.setText(told)
        self.doubt.setVisible(bool(told))

    # edits

    def _add(self, kind: str) -> None:
        if self._room is None:
            return
        number = self.list.currentRow()
        near = self._room.openings[number].wall if 0 <= number < len(self._room.openings) else 0
        made = dataclasses.replace(NEW[kind], wall=self._free(near, NEW[kind]))
        made = dataclasses.replace(made, along=self._place(made))
        label = f"New {NAMES[kind].lower()} of {self._room.name}"
        if self._editing.apply(SetFields(self._room.id, {"openings": (*self._room.openings, made)}, label)):
            self._refreshed(len(self._room.openings))

    def _free(self, near: int, wanted: Opening) -> int:
        """The wall for a new opening: that of the chosen one where there is place, else another one."""
        assert self._room is not None
        walls = [near, *(wall for wall in range(len(self._room.walls)) if wall != near)]
        standing = [wall for wall in walls if wall not in self._room.without] or walls
        fits = (w for w in standing if self._place(dataclasses.replace(wanted, wall=w), None) is not None)
        return next(fits, standing[0])

    def _place(self, opening: Opening, otherwise: float | None = 0.0) -> float | None:
        """Where along its wall the opening is in nobody's way, nearest to the middle."""
        assert self._room is not None
        shape = self._room.shape
        for step in range(40):
            for side in (1, -1):
                tried = dataclasses.replace(opening, along=side * step * 0.1)
                made = dataclasses.replace(shape, openings=(*shape.openings, tried)).placed()
                last = next((one for one in made if one.opening == len(shape.openings)), None)
                if last is not None and last.end - last.start > opening.width - 1e-6:
                    return tried.along
        return otherwise

    def _remove(self) -> None:
        number = self.list.currentRow()
        if self._room is None or not 0 <= number < len(self._room.openings):
            return
        gone = self._room.openings[number]
        kept = tuple(one for k, one in enumerate(self._room.openings) if k != number)
        label = f"Remove {NAMES[gone.kind].lower()} of {self._room.name}"
        self._editing.apply(SetFields(self._room.id, {"openings": kept}, label))

    def _refreshed(self, chosen: int) -> None:
        """Show the room as the edit has left it, that opening chosen."""
        assert self._room is not None
        room = self._editing.document.scene.nodes.get(self._room.id)
        if isinstance(room, Room):
            self.show_room(room)
            self.list.setCurrentRow(chosen)

    def _switch(self, wall: int, there: bool) -> None:
        if self._room is None:
            return
        without = {*self._room.without} - {wall} if there else {*self._room.without, wall}
        name = self._room.walls[wall].lower()
        label = f"{'Close' if there else 'Open'} {name} wall of {self._room.name}"
        self._editing.apply(SetFields(self._room.id, {"without": tuple(sorted(without))}, label))

    def _replace(self, name: str, value: Value) -> None:
        self._editing.apply(self._make(name, value))

    def _make(self, name: str, value: Value) -> Edit:
        assert self._room is not None
        number = self.list.currentRow()
        openings = list(self._room.openings)
        openings[number] = dataclasses.replace(openings[number], **{name: value})  # type: ignore[arg-type]
        return SetFields(self._room.id, {"openings": tuple(openings)}, self._label(name))

    def _label(self, name: str) -> str:
        assert self._room is not None
        opening = self._room.openings[self.list.currentRow()]
        info = param_infos(Opening).get(name)
        return f"{info.label if info else name.capitalize()} of {NAMES[opening.kind].lower()}"


def _button(text: str, tip: str) -> QToolButton:
    button = QToolButton()
    button.setText(text)
    button.setToolTip(tip)
    button.setAccessibleName(text.replace("+ ", "New "))
    button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    return button


def _text(room: Room, opening: Opening, style: NumberStyle, made: bool) -> str:
    wall = room.walls[opening.wall]
    width, height = style.text(opening.width, "m", with_unit=False), style.text(opening.height, "m")
    return f"{NAMES[opening.kind]} · {wall} · {f'{width} × {height}' if made else 'left out'}"
