"""Fourth step: light thrown back by the lens' frame, as rectangles of the ring, before and after."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtWidgets import QPushButton, QTreeWidgetItem

from studio_core.capturing.settings import FRONT, OTHER_LENS, RING, SIDES, Patch
from studio_core.params import ParamInfo, Value
from studio_ui.capture.desk import CaptureDesk
from studio_ui.capture.preview.picture import Shown
from studio_ui.capture.steps.step import StepForm, fitted_circle, lens_of, named
from studio_ui.capture.steps.table import Table
from studio_ui.capture.tools.ring_tool import RingTool
from studio_ui.context import Context
from studio_ui.forms.param_form import ParamForm
from studio_ui.panels.panel import heading, note, row

_HEADS = ("Side", "Place", "Too bright", "From")
_TIPS = (
    "Without the tick it stays as it is",
    "Azimuth around the lens' axis (0° right, 90° up) and angle from it",
    "Stops, in the median, where the program found it",
    "What replaces it",
)
_FIELDS = {
    "azimuth": ParamInfo(
        "number", "Begins at", "Around the lens' axis: 0° is right, 90° up", "°", 0.0, 360.0
    ),
    "width": ParamInfo("number", "Width", "Around the lens' axis", "°", 1.0, 360.0),
    "inner": ParamInfo("number", "From", "The inner side, from the lens' axis", "°", 0.0, 140.0),
    "outer": ParamInfo("number", "To", "The outer side, from the lens' axis", "°", 0.0, 140.0),
    "source": ParamInfo("choice", "Replaced by", "Seamlessly", choices=(OTHER_LENS, RING)),
    "source_azimuth": ParamInfo(
        "number", "Clean at", "Where the clean rectangle of the same size begins", "°", 0.0, 360.0
    ),
}
_NEW = Patch(FRONT, 80.0, 20.0, 82.0, 95.0)


class ReflectionsStep(StepForm):
    """What is found can be moved, switched off and taken away; others can be drawn."""

    id = "reflections"

    def __init__(self, context: Context, desk: CaptureDesk) -> None:
        super().__init__(context, desk)
        self.side, self.index = FRONT, -1  # the index counts all patches of both sides
        self.tool = self.ring = RingTool()
        self.ring.begin = desk.begin
        self.ring.preview = lambda i, patch: desk.preview(
            "reflections", "Change a reflection's rectangle", patches=self._with(i, patch)
        )
        self.ring.commit, self.ring.cancel = desk.commit, desk.cancel
        self.ring.apply = lambda i, patch: self._apply(
            "Change a reflection's rectangle", self._with(i, patch)
        )
        self.ring.remove = lambda i: self._remove_at(self._all_index(i))
        self.ring.choose = lambda i: self._choose(self._all_index(i))
        self.column.addWidget(self.form("reflections"))
        self.column.addWidget(heading("Rectangles"))
        self.table = Table()
        self.table.removed = lambda: self._remove_at(self.index)
        self.table.setAccessibleName("Rectangles of reflections")
        self.table.setHeaderLabels(list(_HEADS))
        for column, tip in enumerate(_TIPS):
            self.table.headerItem().setToolTip(column, tip)
        self.table.setRootIsDecorated(False)
        self.table.setMinimumHeight(110)
        self.table.itemChanged.connect(self._ticked)
        self.table.currentItemChanged.connect(lambda now, _: self._picked(now))
        self.column.addWidget(self.table)
        add = QPushButton("Add")
        add.setToolTip("A rectangle at the top of the ring; or draw one in the picture")
        add.clicked.connect(self._add)
        self.remove = QPushButton("Remove")
        self.remove.setToolTip("Take the chosen rectangle away: nothing is replaced there")
        self.remove.clicked.connect(lambda: self._remove_at(self.index))
        self.again = QPushButton("Find again")
        self.again.setToolTip("What the program finds, instead of what was changed by hand")
        self.again.clicked.connect(lambda: desk.apply("reflections", "Find reflections again", patches=None))
        self.column.addLayout(row(add, self.remove, self.again))
        self.fields = ParamForm(_FIELDS, _PatchSink(self))
        self.column.addWidget(self.fields)
        self.column.addWidget(note(RingTool.tip))

    # what is there

    @property
    def patches(self) -> tuple[Patch, ...]:
        """By hand, else found."""
        by_hand = self.desk.settings.reflections.patches
        if by_hand is not None:
            return by_hand
        found = self.desk.state.reflections
        return found.patches if found is not None else ()

    @property
    def patch(self) -> Patch | None:
        """The chosen one."""
        return self.patches[self.index] if 0 <= self.index < len(self.patches) else None

    def show_now(self) -> None:
        """Settings, rectangles, the chosen one's numbers."""
        super().show_now()
        patches = self.patches
        self.index = min(self.index, len(patches) - 1)
        self._fill(patches)
        self.sync()
        chosen = self.patch
        self.fields.setVisible(chosen is not None)
        self.remove.setEnabled(chosen is not None)
        self.again.setEnabled(self.desk.settings.reflections.patches is not None)
        if chosen is not None:
            self.fields.show_values(vars(chosen))
            self.fields.show_row("source_azimuth", chosen.source == RING)

    def sync(self) -> None:
        """This side's rectangles."""
        patches = self.patches
        self.ring.side = self.side
        self.ring.patches = tuple(patch for patch in patches if patch.side == self.side)
        mine = [i for i, patch in enumerate(patches) if patch.side == self.side]
        self.ring.chosen = mine.index(self.index) if self.index in mine else -1
        self.ring.lens, self.ring.circle = lens_of(self.desk), fitted_circle(self.desk, self.side)

    def pictures(self) -> list[str]:
        """Sides."""
        return named(self.desk.state.lights)

    def picture(self, name: str) -> Shown | None:
        """With the reflections replaced, and before."""
        side, found = name.lower(), self.desk.state.reflections
        light = self.desk.state.lights.get(side)
        after = found.lights.get(side) if found is not None else None
        if light is None or after is None or after is light.light or after.shape != light.light.shape:
            return self.lens_shown(side)
        return self.lens_shown(side, after, light.light)

    def shown(self, name: str) -> None:
        """The rectangles of that side."""
        if name.lower() in SIDES and name.lower() != self.side:
            self.side = name.lower()
            if self.patch is not None and self.patch.side != self.side:
                self.index = -1
        self.show_now()

    # edits

    def _with(self, index: int, patch: Patch) -> tuple[Patch, ...]:
        """All patches, one of this side's another one, or one more."""
        patches = list(self.patches)
        at = self._all_index(index)
        patch = replace(patch, found=False, excess=0.0) if at < 0 else patch
        if 0 <= at < len(patches):
            patches[at] = patch
        else:
            patches.append(patch)
        return tuple(patches)

    def _all_index(self, index: int) -> int:
        """Of all patches, for one of this side's."""
        mine = [i for i, patch in enumerate(self.patches) if patch.side == self.side]
        return mine[index] if 0 <= index < len(mine) else -1

    def _apply(self, label: str, patches: tuple[Patch, ...]) -> None:
        self.desk.apply("reflections", label, patches=patches)

    def change(self, name: str, value: Value) -> tuple[Patch, ...]:
        """All patches after a number of the chosen one was typed."""
        chosen = self.patch
        assert chosen is not None
        made = replace(chosen, **{name: value})  # type: ignore[arg-type]
        if made.outer <= made.inner:
            made = (
                replace(made, inner=made.outer - 1)
                if name == "outer"
                else replace(made, outer=made.inner + 1)
            )
        patches = list(self.patches)
        patches[self.index] = made
        return tuple(patches)

    def _add(self) -> None:
        lens = lens_of(self.desk)
        edge = lens.fov / 2 if lens is not None else 95.0
        made = replace(_NEW, side=self.side, inner=edge - 10, outer=edge)
        self.index = len(self.patches)
        self._apply("Add a rectangle of reflections", (*self.patches, made))
        self.show_now()

    def _remove_at(self, index: int) -> None:
        if 0 <= index < len(self.patches):
            left = tuple(patch for i, patch in enumerate(self.patches) if i != index)
            self._apply("Remove a rectangle of reflections", left)

    # the table

    def _fill(self, patches: tuple[Patch, ...]) -> None:
        with QSignalBlocker(self.table):
            while self.table.topLevelItemCount() > len(patches):
                self.table.takeTopLevelItem(self.table.topLevelItemCount() - 1)
            while self.table.topLevelItemCount() < len(patches):
                item = QTreeWidgetItem()
                item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
                self.table.addTopLevelItem(item)
            for index, patch in enumerate(patches):
                item = self.table.topLevelItem(index)
                item.setText(0, patch.side.capitalize())
                item.setCheckState(0, Qt.CheckState.Checked if patch.used else Qt.CheckState.Unchecked)
                item.setText(1, place_text(patch))
                item.setText(2, f"{patch.excess:+.2f}" if patch.found else "by hand")
                item.setText(3, patch.source)
            for column in range(len(_HEADS)):
                self.table.resizeColumnToContents(column)
            item = self.table.topLevelItem(self.index) if self.index >= 0 else None
            self.table.setCurrentItem(item)

    def _ticked(self, item: QTreeWidgetItem, column: int) -> None:
        index = self.table.indexOfTopLevelItem(item)
        used = item.checkState(0) is Qt.CheckState.Checked
        if column == 0 and 0 <= index < len(self.patches) and self.patches[index].used != used:
            patches = list(self.patches)
            patches[index] = replace(patches[index], used=used)
            self._apply(f"{'Replace' if used else 'Keep'} a reflection", tuple(patches))

    def _picked(self, item: QTreeWidgetItem | None) -> None:
        self._choose(self.table.indexOfTopLevelItem(item) if item is not None else -1)

    def _choose(self, index: int) -> None:
        self.index = index
        chosen = self.patch
        if chosen is not None and chosen.side != self.side:
            self.look(chosen.side.capitalize())
        self.show_now()
        self.redraw()


class _PatchSink:
    """The numbers of the chosen rectangle."""

    def __init__(self, step: ReflectionsStep) -> None:
        self._step = step

    def _label(self, name: str) -> str:
        return f"{_FIELDS[name].label} of a reflection's rectangle"

    def begin(self, name: str) -> bool:
        """A drag starts."""
        return self._step.desk.begin(self._label(name))

    def preview(self, name: str, value: Value) -> None:
        """The drag goes on."""
        self._step.desk.preview("reflections", self._label(name), patches=self._step.change(name, value))

    def commit(self) -> None:
        """One step."""
        self._step.desk.commit()

    def cancel(self) -> None:
        """Never was."""
        self._step.desk.cancel()

    def apply(self, name: str, value: Value) -> None:
        """One step."""
        if self._step.patch is not None:
            self._step.desk.apply("reflections", self._label(name), patches=self._step.change(name, value))


def place_text(patch: Patch) -> str:
    """Where a rectangle lies."""
    end = (patch.azimuth + patch.width) % 360
    return f"{patch.azimuth:.0f}°–{end:.0f}°, {patch.inner:.0f}°–{patch.outer:.0f}°"
