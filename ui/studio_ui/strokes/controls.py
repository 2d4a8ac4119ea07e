"""The inside of the stroke panel: brush, strokes, and why they are explained as they are."""

from __future__ import annotations

import dataclasses
from contextlib import suppress

from PySide6.QtCore import QSignalBlocker, QTimer
from PySide6.QtGui import QPaintEvent
from PySide6.QtWidgets import (
    QButtonGroup,
    QCheckBox,
    QGridLayout,
    QHBoxLayout,
    QPushButton,
    QSizePolicy,
    QToolButton,
    QWidget,
)

from studio_core.edits import Remove, SetFields
from studio_core.errors import LucarneError
from studio_core.params import Value, param_infos
from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.nodes import NodeId, Scene
from studio_core.strokes.stroke import BLUR, BRIGHTEN, DARKEN, REPLACE, SHARPEN, SMEAR, Stroke
from studio_ui.forms.fields import Combo
from studio_ui.forms.param_form import ParamForm
from studio_ui.forms.sinks import LiveSink
from studio_ui.look.role import set_role
from studio_ui.look.theme import GAP, Theme
from studio_ui.panels.panel import Panel, heading, note, row
from studio_ui.strokes.bench import Order
from studio_ui.strokes.brush_store import REACH, brush_infos
from studio_ui.strokes.desk import StrokeDesk
from studio_ui.strokes.radiance_field import field_of
from studio_ui.strokes.scene_style import SceneStyle
from studio_ui.strokes.stroke_list import StrokeList
from studio_ui.strokes.stroke_sink import StrokeSink
from studio_ui.strokes.why import Why
from studio_ui.strokes.words import TOOLS

_OF_TOOL = {
    REPLACE: ("colour", "shading"),
    BRIGHTEN: ("stops",),
    DARKEN: ("stops",),
    BLUR: ("radius",),
    SHARPEN: ("radius", "amount"),
    SMEAR: ("amount",),
}
"""Settings that a tool reads; brushes' own are always there."""
_SETTINGS = ("colour", "shading", "stops", "radius", "amount")
_HANDS = (
    (False, "This surface", "The surface itself gets the material that looks as painted"),
    (True, "What it shows", "The surface stays; what lights it or is reflected in it changes"),
)
_STROKE = ("weight", "meaning", "together", *REACH)
_SELDOM = ("weight", "together", *REACH)
"""Folded up: why a stroke is explained as it is should be seen in a small window."""


class StrokeControls(QWidget):
    """Made when the panel is first shown."""

    def __init__(self, panel: Panel, desk: StrokeDesk) -> None:
        super().__init__()
        self._panel, self._desk, self._context = panel, desk, panel.context
        self.soon = QTimer(self)
        self.soon.setSingleShot(True)
        self.soon.timeout.connect(self.refresh)
        self.tools: dict[str, QToolButton] = {}
        self.hands: dict[bool, QToolButton] = {}
        column = panel.column_of(self)
        column.addLayout(self._tool_buttons())
        column.addLayout(self._hand_buttons())
        self.dark = note("Nothing lights anything else now: switch on Light between surfaces on the toolbar.")
        column.addWidget(self.dark)
        self.brush = self._brush_form()
        column.addWidget(self.brush)
        self.across = QCheckBox("On whatever is under the brush")
        self.across.setToolTip("Otherwise strokes stay on the object that they begin on")
        self.across.toggled.connect(lambda on: desk.store.use(across=on))
        column.addWidget(self.across)
        self.solver = Combo()
        self.solver.setAccessibleName("Solver")
        self.solver.setToolTip("How the material that explains a stroke is found")
        self.solver.activated.connect(lambda i: desk.store.use(solver=self.solver.itemData(i)))
        column.addWidget(self.solver)
        self.list = StrokeList()
        self.list.chosen = desk.choose
        self.list.switched = self._switch
        self.list.renamed = self._rename
        self.list.deleted = self.delete
        self.bin = panel.tool("delete", "Delete the chosen stroke; what is left is solved again")
        self.bin.clicked.connect(self.delete)
        self.spread = QToolButton()
        self.spread.setText("Show the spread")
        self.spread.setToolTip("A pattern over the picture: what else changes with the chosen stroke")
        self.spread.setCheckable(True)
        self.spread.toggled.connect(lambda _: self._show_spread())
        column.addLayout(row(heading("Strokes"), self.spread, self.bin, stretch=0))
        column.addWidget(self.list)
        self._held = ""
        sink = StrokeSink(self._context, desk.work, desk.store, lambda: desk.stroke, self._hold)
        infos = {name: dataclasses.replace(info, advanced=name in _SELDOM)
                 for name, info in param_infos(Stroke).items() if name in _STROKE}  # fmt: skip
        self.form = ParamForm(infos, sink)
        column.addWidget(self.form)
        self.match = QPushButton()
        self.match.setToolTip(
            "What changes lights other things, and they light it: explain it again until the picture shows "
            "what was painted"
        )
        self.match.clicked.connect(desk.match)
        self.matched = note("")
        column.addWidget(self.match)
        column.addWidget(self.matched)
        column.addWidget(heading("Why"))
        self.why = Why(self._context.host, desk.sketches)
        self.why.taken = desk.work.take
        column.addWidget(self.why)
        self.style_ = SceneStyle(self._context, desk.store, desk.work.bench)
        column.addWidget(self.style_)
        panel.subscriptions.add(
            desk.store.changed.connect(self._show_brush),
            desk.changed.connect(self._later),
            self._context.document.changed.connect(self._edited),
            self._context.session.displayed.connect(self._show_brush),
            self._context.session.changed.connect(self._lit_otherwise),
        )
        self._seen: QTimer | None = None
        self._show_brush()
        self.refresh()

    def set_theme(self, theme: Theme) -> None:
        """Icons in other colours."""
        self.refresh()

    # the brush

    def _tool_buttons(self) -> QGridLayout:
        grid, group = QGridLayout(), QButtonGroup(self)
        grid.setSpacing(GAP // 2)
        for number, (tool, (text, _, _, tip)) in enumerate(TOOLS.items()):
            self.tools[tool] = button = _button(text, tip, group)
            button.clicked.connect(lambda _, tool=tool: self._desk.store.use(tool=tool))
            grid.addWidget(button, number // 4, number % 4)
        return grid

    def _hand_buttons(self) -> QHBoxLayout:
        made, group = QHBoxLayout(), QButtonGroup(self)
        made.setSpacing(GAP // 2)
        for indirect, text, tip in _HANDS:
            self.hands[indirect] = button = _button(text, tip, group)
            button.clicked.connect(lambda _, indirect=indirect: self._desk.store.use(indirect=indirect))
            made.addWidget(button)
        return made

    def _brush_form(self) -> ParamForm:
        infos = {name: dataclasses.replace(info, high=min(info.high, 1.0)) if name == "size" else info
                 for name, info in brush_infos().items() if info.kind != "text"}  # fmt: skip
        return ParamForm(infos, _BrushSink(self._desk), special={"colour": field_of(self._context.session)})

    def _show_brush(self) -> None:
        now = self._desk.store.now
        self.tools[now.tool].setChecked(True)
        self.hands[now.indirect].setChecked(True)
        self.dark.setVisible(now.indirect and not self._context.session.bouncing)
        with QSignalBlocker(self.across):
            self.across.setChecked(now.across)
        for name in _SETTINGS:
            self.brush.show_row(name, name in _OF_TOOL.get(now.tool, ()))
        self.brush.show_values(self._desk.store.values())

    def _lit_otherwise(self, aspect: Aspect) -> None:
        if aspect & Aspect.INDIRECT:
            self._show_brush()
            self._show_match()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Solvers are asked for their names once somebody sees this: to ask loads them."""
        super().paintEvent(event)
        if self._seen is None:
            self._seen = QTimer(self, singleShot=True, interval=0)
            self._seen.timeout.connect(self._offer_solvers)
            self._seen.start()

    def _offer_solvers(self) -> None:
        host, known = self._context.host, []
        for name in host.names("solver"):
            with suppress(LucarneError):  # told under Help ▸ Plugins
                known.append((name, str(getattr(host.get("solver", name), "label", name))))
        with QSignalBlocker(self.solver):
            for name, label in known:
                self.solver.addItem(label, name)
            at = self.solver.findData(self._desk.store.now.solver or "joint")
            self.solver.setCurrentIndex(max(at, 0))
        self.solver.setVisible(len(known) > 1)

    # the strokes

    def delete(self) -> None:
        """The chosen stroke, and what it did."""
        scene, stroke = self._context.document.scene, self._desk.stroke
        if stroke is not None and stroke in scene.nodes:
            label = f"Delete {scene[stroke].name}"
            edit = Remove((stroke,), label)
            self._desk.work.do(Order(label, lambda: edit, stroke), edit)

    def _switch(self, stroke: NodeId, on: bool) -> None:
        scene = self._context.document.scene
        if scene[stroke].hidden == on:
            label = f"{'Count' if on else 'Leave out'} {scene[stroke].name}"
            edit = SetFields(stroke, {"hidden": not on}, label)
            self._desk.work.do(Order(label, lambda: edit, stroke), edit)

    def _rename(self, stroke: NodeId, name: str) -> None:
        scene = self._context.document.scene
        if stroke in scene.nodes and name and name != scene[stroke].name:
            self._context.editing.apply(SetFields(stroke, {"name": name}, f"Rename {scene[stroke].name}"))

    def _hold(self, name: str) -> None:
        """While a hand drags one of the reach's values, the picture tells what it reaches."""
        self._held = name
        self._show_spread()

    def _show_spread(self) -> None:
        wanted = self.spread.isChecked() or self._held in REACH
        self._desk.likeness.show(self._desk.stroke if wanted else None)

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if any(isinstance(s.nodes.get(n), Stroke) for n in changes.nodes for s in (before, after)):
            self._later()

    def _later(self) -> None:
        """Not while the list tells of what it holds."""
        self.soon.start(0)

    def refresh(self) -> None:
        """What there is now."""
        desk, scene = self._desk, self._context.document.scene
        strokes = list(scene.of(Stroke))
        stroke = next((one for one in strokes if one.id == desk.stroke), None)
        self.list.show_strokes(strokes, desk.stroke, self._panel.theme)
        self.bin.setEnabled(stroke is not None)
        for widget in (self.form, self.spread):
            widget.setVisible(stroke is not None)
        if stroke is not None:
            self.form.show_values({name: getattr(stroke, name) for name in _STROKE})
            self._show_spread()
        self._tell(scene, stroke)
        self._show_match()

    def _show_match(self) -> None:
        matching, can = self._desk.matching, self._desk.can_match()
        self.match.setText("Stop here" if matching.running else "Match what was painted")
        self.match.setVisible(can or matching.running)
        mine = matching.of == self._desk.stroke and self._desk.stroke is not None
        self.matched.setText(matching.told if mine else "")
        self.matched.setVisible(bool(self.matched.text()))
        set_role(self.matched, "problem" if matching.failed else "dim")

    def _tell(self, scene: Scene, stroke: Stroke | None) -> None:
        desk = self._desk
        found = desk.work.findings(stroke.id) if stroke is not None else ()
        if desk.work.problem:
            self.why.say(desk.work.problem, problem=True)
        elif stroke is None:
            self.why.say("Paint on the picture: what explains the stroke is told here.")
        elif stroke.hidden:
            self.why.say("This stroke does not count.")
        elif not found and desk.work.asking:
            self.why.say("Looking for what explains it…")
        elif desk.work.solution is not None and (found or desk.work.knows(stroke.id)):
            self.why.show_findings(scene, stroke, found, desk.work.solution)
        else:
            self.why.say("")


class _BrushSink(LiveSink):
    """Every value at once: the brush is in no history."""

    def __init__(self, desk: StrokeDesk) -> None:
        super().__init__(lambda value: None, lambda: 0.0)
        self._desk = desk
        self._was: tuple[str, Value] | None = None

    def begin(self, name: str) -> bool:
        """Remember, for Esc."""
        self._was = (name, self._desk.store.values()[name])
        return True

    def cancel(self) -> None:
        """As before."""
        if self._was is not None:
            self.apply(*self._was)

    def apply(self, name: str, value: Value) -> None:
        """At once."""
        self._desk.store.use(**{name: value})


def _button(text: str, tip: str, group: QButtonGroup) -> QToolButton:
    button = QToolButton()
    button.setText(text)
    button.setToolTip(tip)
    button.setAccessibleName(text)
    button.setCheckable(True)
    button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
    group.addButton(button)
    return button


__all__ = ["StrokeControls"]
