"""Properties of what is chosen, of one thing or of several at once: parameters, place, materials."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QSignalBlocker, QTimer
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QPushButton, QWidget

from studio_core.edits import Assign, Compound
from studio_core.params import ParamInfo, param_infos
from studio_core.scene.arranging import PLACELESS
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import MaterialId, MeshObject, Node, NodeId, Scene
from studio_core.scene.room import SLOTS, Room
from studio_ui.capture.feature import capture_behind
from studio_ui.context import Context
from studio_ui.forms.fields import Combo
from studio_ui.forms.node_sink import NodeSink
from studio_ui.forms.param_form import ParamForm, form_label, form_layout
from studio_ui.forms.spin import MIXED
from studio_ui.panels.light_form import NodeForm, shared_values
from studio_ui.panels.node_kinds import kinds_name
from studio_ui.panels.panel import Panel, clear, heading, note
from studio_ui.panels.place import PlaceEditor
from studio_ui.panels.room_form import RoomForm

_FLAGS = ("hidden", "locked")
_MOST = 200  # things whose values are compared; of more, the first ones


class PropertiesPanel(Panel):
    """Follows the choice; built anew when other kinds of things are chosen."""

    id = "properties"
    title = "Properties"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.nodes: tuple[NodeId, ...] = ()
        self._sink = NodeSink(context, lambda: self.nodes)
        self.form: NodeForm | None = None
        self._actions: Mapping[str, QAction] = {}
        self.flags: ParamForm | None = None
        self.place: PlaceEditor | None = None
        self.room: RoomForm | None = None
        self.edit_capture: QPushButton | None = None
        self.slots: list[Combo] = []
        self._built: object = self
        self._column = self.scroller()
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self.refresh)
        self.subscriptions.add(
            context.document.changed.connect(self._edited),
            context.session.selected.connect(lambda: self._soon.start(0)),
        )
        self.refresh()

    def use_actions(self, actions: Mapping[str, QAction]) -> None:
        """Some things have one of their own here."""
        self._actions = actions

    def refresh(self) -> None:
        """Show what is chosen as it is now."""
        scene = self.context.document.scene
        self.nodes = tuple(n for n in self.context.session.selection if n in scene.nodes)
        nodes = [scene[n] for n in self.nodes]
        known = tuple((m.id, m.name) for m in scene.materials.values())
        meshes = [node for node in nodes if isinstance(node, MeshObject)]
        slots = len(meshes[0].materials) if meshes else 0
        if len({len(mesh.materials) for mesh in meshes}) > 1:
            slots = 1  # one for all
        captured = len(nodes) == 1 and capture_behind(scene, nodes[0].id) is not None
        key = (self.nodes, tuple(type(node) for node in nodes), slots, known if slots else (), captured)
        if key != self._built:
            self._built = key
            self._build(scene, nodes, slots)
        if nodes:
            self._fill(scene, nodes)

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if changes.materials or any(n in changes.nodes or n not in after.nodes for n in self.nodes):
            self._soon.start(0)

    def _build(self, scene: Scene, nodes: list[Node], slots: int) -> None:
        self._sink.commit()
        clear(self._column)
        self.form = self.flags = self.place = self.room = self.edit_capture = None
        self.slots = []
        if not nodes:
            self._column.addWidget(note("Click something in the picture or the outliner to see what it is."))
            self._column.addStretch(1)
            return
        self._column.addWidget(heading(kinds_name(nodes)))
        if len(nodes) > 1:
            self._column.addWidget(note(f"What is typed counts for all of them; {MIXED} where they differ."))
        infos = shared_infos(nodes)
        self.form = NodeForm(type(nodes[-1]), infos, self._sink)
        self._column.addWidget(self.form)
        if len(nodes) == 1 and isinstance(nodes[0], Room):
            self.room = RoomForm(self.context.editing)
            self._column.addWidget(self.room)
        if len(nodes) == 1 and capture_behind(scene, nodes[0].id) is not None:
            self.edit_capture = self._capture_button()
            self._column.addWidget(self.edit_capture)
        if not any(isinstance(node, PLACELESS) for node in nodes):
            self._column.addWidget(heading("Place"))
            self.place = PlaceEditor(self.context)
            self._column.addWidget(self.place)
        if slots:
            self._column.addWidget(heading("Materials"))
            self._column.addWidget(self._materials(scene, nodes, slots))
        self.flags = ParamForm({name: infos[name] for name in _FLAGS}, self._sink)
        self._column.addWidget(self.flags)
        self._column.addStretch(1)

    def _capture_button(self) -> QPushButton:
        button = QPushButton("Edit capture…")
        button.setToolTip("The photographs and decisions that the light was made from")
        action = self._actions.get("object.edit_capture")
        if action is not None:
            button.clicked.connect(action.trigger)
        return button

    def _materials(self, scene: Scene, nodes: list[Node], slots: int) -> QWidget:
        box = QWidget()
        layout = form_layout(box)
        named = slots == len(SLOTS) and all(isinstance(node, Room) for node in nodes)
        for index in range(slots):
            combo = Combo()
            combo.setPlaceholderText(MIXED)
            slot = SLOTS[index] if named else f"Slot {index + 1}" if slots > 1 else "Material"
            combo.setAccessibleName(f"Material {slot.lower()}" if slots > 1 else slot)
            for material in scene.materials.values():
                combo.addItem(material.name, material.id)
            combo.activated.connect(lambda _, i=index: self._assign(i))
            layout.addRow(form_label(slot), combo)
            self.slots.append(combo)
        meshes = [node for node in nodes if isinstance(node, MeshObject)]
        told = f"{sum(len(mesh.geometry.faces) for mesh in meshes):,} triangles"
        shared = sum(other.geometry is meshes[-1].geometry for other in scene.of(MeshObject))
        if len(meshes) == 1 and shared > 1:
            told += f", shared by {shared} objects"
        layout.addRow(note(told))
        return box

    def _fill(self, scene: Scene, nodes: list[Node]) -> None:
        assert self.form is not None
        assert self.flags is not None
        looked = nodes[-_MOST:]
        self.form.show_nodes(scene, looked)
        self.flags.show_values(*shared_values(looked, _FLAGS))
        if self.place is not None:
            self.place.show_nodes(scene, self.nodes)
        if self.room is not None and isinstance(nodes[-1], Room):
            self.room.show_room(nodes[-1])
        meshes = [node for node in looked if isinstance(node, MeshObject)]
        for index, combo in enumerate(self.slots):
            there = {material for mesh in meshes for material in self._in_slot(mesh, index)}
            with QSignalBlocker(combo):
                combo.setCurrentIndex(combo.findData(next(iter(there))) if len(there) == 1 else -1)

    def _in_slot(self, mesh: MeshObject, index: int) -> tuple[MaterialId, ...]:
        return mesh.materials if len(self.slots) == 1 else mesh.materials[index : index + 1]

    # edits

    def _assign(self, slot: int) -> None:
        scene = self.context.document.scene
        material = self.slots[slot].currentData()
        meshes = [scene[n] for n in self.nodes if isinstance(scene.nodes.get(n), MeshObject)]
        one = None if len(self.slots) == 1 else slot
        edits = tuple(Assign(mesh.id, material, one) for mesh in meshes)
        what = meshes[0].name if len(meshes) == 1 else f"{len(meshes)} objects"
        self.context.editing.apply(Compound(f"{scene.material(material).name} on {what}", edits))


def shared_infos(nodes: list[Node]) -> dict[str, ParamInfo]:
    """The parameters that all of them have, as the last one has them."""
    kinds = [param_infos(kind) for kind in {type(node) for node in nodes}]
    return {
        name: info
        for name, info in param_infos(type(nodes[-1])).items()
        if all(name in kind for kind in kinds)
    }
