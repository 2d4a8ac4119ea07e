"""Properties of what is chosen: its place with units, its parameters from their metadata, its materials."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

from PySide6.QtCore import QSignalBlocker, QTimer
from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget

from studio_core.edits import Assign, Edit, Move, SetFields
from studio_core.params import ParamInfo, Value, param_infos
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Camera, Environment, Light, MeshObject, Node, NodeId, Scene
from studio_core.scene.transform import Transform
from studio_ui.canvas.projection import bounds
from studio_ui.context import Context
from studio_ui.euler import from_euler, to_euler
from studio_ui.fields import Combo, Spin
from studio_ui.panels.panel import Panel, clear, heading, note
from studio_ui.param_form import ParamForm, form_label, form_layout
from studio_ui.sinks import EditSink

_POSITION = ParamInfo("number", "Position", "Metres from the parent's origin", unit="m", low=-1e6, high=1e6)
_ANGLE = ParamInfo(
    "number", "Rotation", "Tilt about x, turn about y, roll about z", unit="°", low=-3600, high=3600
)
_SCALE = ParamInfo("number", "Scale", "Uniform", low=1e-6, high=1e6, scale="log")
KINDS = {
    "Group": "Group",
    "MeshObject": "Object",
    "Camera": "Camera",
    "Environment": "Environment",
    "PointLamp": "Point lamp",
    "SpotLamp": "Spot lamp",
    "DirectionalLamp": "Sun",
    "AreaLamp": "Area lamp",
}


class Triple(QWidget):
    """Three numbers of one kind."""

    def __init__(self, info: ParamInfo, typed: Callable[[int, float], object]) -> None:
        super().__init__()
        self.spins = [Spin(dataclasses.replace(info, unit="")) for _ in range(3)]
        self._values = [0.0, 0.0, 0.0]
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(3)
        for index, (spin, axis) in enumerate(zip(self.spins, "xyz", strict=True)):
            spin.setMinimumWidth(44)
            spin.setToolTip(f"{axis}: {info.doc}{f' ({info.unit})' if info.unit else ''}")
            spin.setAccessibleName(f"{info.label} {axis}")
            spin.setSingleStep(1 if info.unit == "°" else 0.05)
            spin.valueChanged.connect(lambda value, i=index: self._told(i, value, typed))
            layout.addWidget(spin, 1)

    def show_values(self, values: tuple[float, float, float]) -> None:
        """Without telling."""
        self._values = list(values)
        for spin, value in zip(self.spins, values, strict=True):
            with QSignalBlocker(spin):
                spin.setValue(value)

    def _told(self, index: int, value: float, typed: Callable[[int, float], object]) -> None:
        if abs(value - self._values[index]) >= 0.5 * 10.0 ** -self.spins[index].decimals():
            typed(index, value)


class PropertiesPanel(Panel):
    """Follows the last chosen node; rebuilt when that is another one."""

    id = "properties"
    title = "Properties"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.node: NodeId | None = None
        self._sink = EditSink(context.editing, self._set, self._label)
        self.form: ParamForm | None = None
        self.position: Triple | None = None
        self.rotation: Triple | None = None
        self.scale: Spin | None = None
        self._size = QLabel()
        self._slots: list[Combo] = []
        self._materials: tuple[tuple[str, str], ...] = ()
        self._column = self.scroller()
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self.refresh)
        self.subscriptions.add(
            context.document.changed.connect(self._edited),
            context.session.selected.connect(lambda: self._soon.start(0)),
        )
        self._build(None)

    def refresh(self) -> None:
        """Show what is chosen as it is now."""
        scene = self.context.document.scene
        chosen = [n for n in self.context.session.selection if n in scene.nodes]
        node = chosen[-1] if chosen else None
        slots = len(_slots_of(scene, node))
        known = tuple((m.id, m.name) for m in scene.materials.values())
        if node != self.node or slots != len(self._slots) or (slots and known != self._materials):
            self._materials = known
            self._build(node)
        if node is not None:
            self._fill(scene, scene[node])

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        gone = self.node is not None and self.node not in after.nodes
        if gone or changes.materials or (self.node in changes.nodes):
            self._soon.start(0)

    def _build(self, node_id: NodeId | None) -> None:
        self._sink.commit()
        clear(self._column)
        self.node, self.form = node_id, None
        self.position = self.rotation = self.scale = None
        self._slots = []
        scene = self.context.document.scene
        if node_id is None:
            self._column.addWidget(note("Click something in the picture or the outliner to see what it is."))
            self._column.addStretch(1)
            return
        node = scene[node_id]
        chosen = self.context.session.selection
        kind = KINDS.get(type(node).__name__, type(node).__name__)
        self._column.addWidget(heading(kind))
        if len(chosen) > 1:
            self._column.addWidget(note(f"{len(chosen)} chosen; this is the last one."))
        infos = param_infos(type(node))
        self.form = ParamForm(infos, self._sink, skip=("hidden", "locked"))
        self._column.addWidget(self.form)
        if not isinstance(node, Environment):
            self._place()
        if isinstance(node, MeshObject):
            self._mesh(scene, node)
        flags = {name: infos[name] for name in ("hidden", "locked")}
        self._flags = ParamForm(flags, self._sink)
        self._column.addWidget(self._flags)
        self._column.addStretch(1)

    def _place(self) -> None:
        self._column.addWidget(heading("Place"))
        box = QWidget()
        layout = form_layout(box)
        self.position = Triple(_POSITION, lambda i, v: self._move(0, i, v))
        self.rotation = Triple(_ANGLE, lambda i, v: self._move(1, i, v))
        self.scale = Spin(_SCALE)
        self.scale.valueChanged.connect(lambda value: self._move(2, 0, value))
        self._size = QLabel()
        layout.addRow(form_label("Position (m)", _POSITION.doc), self.position)
        layout.addRow(form_label("Rotation (°)", _ANGLE.doc), self.rotation)
        layout.addRow(form_label("Scale", _SCALE.doc), self.scale)
        layout.addRow(form_label("Size (m)", "Width × depth × height of the box around it"), self._size)
        self._column.addWidget(box)

    def _mesh(self, scene: Scene, node: MeshObject) -> None:
        self._column.addWidget(heading("Materials"))
        box = QWidget()
        layout = form_layout(box)
        for index in range(len(node.materials)):
            combo = Combo()
            for material in scene.materials.values():
                combo.addItem(material.name, material.id)
            combo.activated.connect(lambda _, i=index: self._assign(i))
            layout.addRow(form_label(f"Slot {index + 1}" if len(node.materials) > 1 else "Material"), combo)
            self._slots.append(combo)
        shared = sum(1 for other in scene.of(MeshObject) if other.geometry is node.geometry)
        told = f"{len(node.geometry.faces):,} triangles"
        layout.addRow(note(told if shared < 2 else f"{told}, shared by {shared} objects"))
        self._column.addWidget(box)

    def _fill(self, scene: Scene, node: Node) -> None:
        assert self.form is not None
        values = {name: getattr(node, name) for name in param_infos(type(node))}
        self.form.show_values(values)
        self._flags.show_values(values)
        if self.position is not None and self.rotation is not None and self.scale is not None:
            self.position.show_values(node.transform.translation)
            self.rotation.show_values(to_euler(node.transform.rotation))
            with QSignalBlocker(self.scale):
                self.scale.setValue(node.transform.scale)
            found = None if isinstance(node, Camera | Light) else bounds(scene, (node.id,))
            if found is not None:
                width, height, depth = found[1] - found[0]
                self._size.setText(f"{width:.2f} × {depth:.2f} × {height:.2f}")
            else:
                self._size.setText("–")
        for combo, material in zip(self._slots, _slots_of(scene, node.id), strict=False):
            combo.setCurrentIndex(combo.findData(material))

    def _set(self, name: str, value: Value) -> Edit:
        assert self.node is not None
        return SetFields(self.node, {name: value}, self._label(name))

    def _label(self, name: str) -> str:
        assert self.node is not None
        node = self.context.document.scene[self.node]
        return f"{param_infos(type(node))[name].label} of {node.name}"

    def _assign(self, slot: int) -> None:
        if self.node is not None:
            self.context.editing.apply(Assign(self.node, self._slots[slot].currentData(), slot))

    def _move(self, what: int, index: int, value: float) -> None:
        if self.node is None or not math.isfinite(value):
            return
        node = self.context.document.scene[self.node]
        old = node.transform
        if what == 0:
            place = list(old.translation)
            place[index] = value
            made = dataclasses.replace(old, translation=(place[0], place[1], place[2]))
        elif what == 1:
            angles = list(to_euler(old.rotation))
            angles[index] = value
            made = dataclasses.replace(old, rotation=from_euler((angles[0], angles[1], angles[2])))
        elif abs(value - round(old.scale, 3)) >= 0.0005 and value > 0:
            made = Transform(old.translation, old.rotation, value)
        else:
            return
        verb = ("Move", "Turn", "Scale")[what]
        self.context.editing.apply(Move({self.node: made}, f"{verb} {node.name}"))


def _slots_of(scene: Scene, node: NodeId | None) -> tuple[str, ...]:
    found = scene.nodes.get(node) if node is not None else None
    return found.materials if isinstance(found, MeshObject) else ()
