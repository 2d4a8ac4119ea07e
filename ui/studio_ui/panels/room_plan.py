"""The floor plan of a room: a rectangle, or an L without one of its corners."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QVBoxLayout, QWidget

from studio_core.edits import Edit, SetFields
from studio_core.params import ParamInfo, Value
from studio_core.scene.room import Room
from studio_core.scene.room_plans import CORNERS, carried, l_cut, l_plan
from studio_core.scene.room_shape import FARTHEST, Point, rectangle
from studio_ui.editing import Editing
from studio_ui.forms.fields import Combo
from studio_ui.forms.param_form import ParamForm, form_label, form_layout
from studio_ui.forms.sinks import EditSink
from studio_ui.look.theme import GAP

_LEAST = 0.3  # metres that a cut and what is left of a side have at least
_SHARE = 0.4  # of a side that is cut from a new L
_TIP = "A rectangle, or an L that lacks one corner as seen from above"
_CUT: Mapping[str, ParamInfo] = {
    name: ParamInfo("number", label, doc, unit="m", low=_LEAST, high=FARTHEST)
    for name, label, doc in (
        ("width", "Cut width", "What the L lacks, from left to right"),
        ("depth", "Cut depth", "What the L lacks, from front to back"),
    )
}


class PlanForm(QWidget):
    """Follows one room; a plan of another form is left alone until one of these is chosen."""

    def __init__(self, editing: Editing) -> None:
        super().__init__()
        self._editing = editing
        self._room: Room | None = None
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(GAP)
        top = QWidget()
        layout = form_layout(top)
        self.shape = Combo()
        self.shape.setAccessibleName("Floor plan")
        self.shape.setToolTip(_TIP)
        self.shape.setPlaceholderText("Another one")
        self.shape.addItem("Rectangle", "")
        for corner in CORNERS:
            self.shape.addItem(f"L without {corner}", corner)
        self.shape.activated.connect(lambda _: self._choose(self.shape.currentData()))
        layout.addRow(form_label("Floor plan", _TIP), self.shape)
        column.addWidget(top)
        self.cut = ParamForm(_CUT, EditSink(editing, self._make, self._label))
        column.addWidget(self.cut)

    def show_room(self, room: Room) -> None:
        """What the room is now."""
        self._room = room
        cut = l_cut(room.shape.corners)
        there = cut.corner if cut is not None else "" if not room.plan else None
        with QSignalBlocker(self.shape):
            self.shape.setCurrentIndex(-1 if there is None else self.shape.findData(there))
        self.cut.setVisible(cut is not None)
        if cut is not None:
            self.cut.show_values({"width": cut.width, "depth": cut.depth})

    def _choose(self, corner: str) -> None:
        room = self._room
        if room is None:
            return
        if corner:
            cut = l_cut(room.shape.corners)
            taken = (cut.width, cut.depth) if cut else (_SHARE * room.width, _SHARE * room.depth)
            self._editing.apply(self._plan(room, l_plan(room.width, room.depth, *taken, corner)))
        else:
            self._editing.apply(self._plan(room, ()))

    def _plan(self, room: Room, plan: tuple[Point, ...]) -> Edit:
        """The room on another plan, its openings on the walls that look the same way."""
        after = plan or rectangle(room.width, room.depth)
        openings, without = carried(room.openings, room.without, room.shape.corners, after)
        values = {"plan": plan, "openings": openings, "without": without}
        return SetFields(room.id, values, f"Floor plan of {room.name}")

    def _make(self, name: str, value: Value) -> Edit:
        assert self._room is not None
        room = self._room
        cut = l_cut(room.shape.corners)
        assert cut is not None
        made = {"width": cut.width, "depth": cut.depth, name: float(value)}  # type: ignore[arg-type]
        width, depth = (min(made[side], getattr(room, side) - _LEAST) for side in ("width", "depth"))
        plan = l_plan(room.width, room.depth, width, depth, cut.corner)
        return SetFields(room.id, {"plan": plan}, self._label(name))

    def _label(self, name: str) -> str:
        assert self._room is not None
        return f"{_CUT[name].label} of {self._room.name}"
