"""The scene as Qt's tree model: names, eyes and locks; rename and re-parent by edits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from PySide6.QtCore import QAbstractItemModel, QMimeData, QModelIndex, QPersistentModelIndex, Qt
from PySide6.QtGui import QColor, QIcon

from studio_core.edits import Compound, Order, Reparent, SetFields
from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.nodes import Camera, Environment, Group, Light, Node, NodeId, Scene
from studio_ui.editing import Editing
from studio_ui.icons import icon
from studio_ui.theme import DARK, Theme

Index = QModelIndex | QPersistentModelIndex
NAME, EYE, LOCK = range(3)
_MIME = "application/x-lucarne-nodes"
_ROOT = QModelIndex()


class OutlinerModel(QAbstractItemModel):
    """Rows are node ids; the tree is rebuilt when the structure changes, else cells are told apart."""

    def __init__(self, scene: Scene, editing: Editing) -> None:
        super().__init__()
        self._editing = editing
        self._scene = scene
        self._children: dict[NodeId | None, list[NodeId]] = {}
        self._row: dict[NodeId, int] = {}
        self._ids: dict[int, NodeId] = {}
        self._numbers: dict[NodeId, int] = {}
        self._theme = DARK
        self._icons: dict[str, QIcon] = {}
        self._index_scene()

    def set_theme(self, theme: Theme) -> None:
        """Icons and colours of another theme."""
        self.beginResetModel()
        self._theme = theme
        self._icons = {}
        self.endResetModel()

    def follow(self, after: Scene, changes: Changes) -> bool:
        """Take over another scene; True when the tree was rebuilt."""
        before, self._scene = self._scene, after
        parents_same = tuple(before.nodes) == tuple(after.nodes) and all(
            before.nodes[n].parent == after.nodes[n].parent for n in changes.nodes if n in after.nodes
        )
        if not parents_same:
            self.beginResetModel()
            self._index_scene()
            self.endResetModel()
            return True
        for node in changes.of(Aspect.NAME | Aspect.STRUCTURE):
            if node in after.nodes:
                self.dataChanged.emit(self.of(node, NAME), self.of(node, LOCK))
        return False

    def node(self, index: Index) -> NodeId | None:
        """The node of a row."""
        return self._ids.get(index.internalId()) if index.isValid() else None

    def of(self, node: NodeId, column: int = NAME) -> QModelIndex:
        """Where a node is."""
        if node not in self._row:
            return QModelIndex()
        return self.createIndex(self._row[node], column, self._numbers[node])

    def _index_scene(self) -> None:
        self._children, self._row = {None: []}, {}
        for node in self._scene.nodes.values():
            siblings = self._children.setdefault(node.parent, [])
            self._row[node.id] = len(siblings)
            siblings.append(node.id)
            if node.id not in self._numbers:
                number = len(self._numbers) + 1
                self._numbers[node.id], self._ids[number] = number, node.id

    # Qt's questions

    def index(self, row: int, column: int, parent: Index = _ROOT) -> QModelIndex:
        """The cell there."""
        siblings = self._children.get(self.node(parent), [])
        if not (0 <= row < len(siblings) and 0 <= column < 3):
            return QModelIndex()
        return self.createIndex(row, column, self._numbers[siblings[row]])

    def parent(self, index: Index = _ROOT) -> QModelIndex:  # type: ignore[override]
        """The row above."""
        node = self.node(index)
        above = self._scene.nodes[node].parent if node is not None and node in self._scene.nodes else None
        return self.of(above) if above is not None else QModelIndex()

    def rowCount(self, parent: Index = _ROOT) -> int:
        """How many nodes hang there."""
        return len(self._children.get(self.node(parent), [])) if parent.column() <= 0 else 0

    def columnCount(self, parent: Index = _ROOT) -> int:
        """Name, eye, lock."""
        return 3

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """What a cell shows."""
        node = self._scene.nodes.get(self.node(index) or "")
        if node is None:
            return None
        if index.column() == NAME:
            if role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.EditRole):
                return node.name
            if role == Qt.ItemDataRole.DecorationRole:
                return self._icon(kind_icon(node))
            if role == Qt.ItemDataRole.ForegroundRole and not self._scene.shown(node.id):
                return QColor(self._theme.dim)
        elif role == Qt.ItemDataRole.DecorationRole:
            if index.column() == EYE:
                return self._icon("eye-off" if node.hidden else "eye", dim=not node.hidden)
            return self._icon("lock" if node.locked else "unlock", dim=not node.locked)
        elif role == Qt.ItemDataRole.ToolTipRole:
            if index.column() == EYE:
                return "Hidden: click to show" if node.hidden else "Shown: click to hide"
            return "Locked: click to unlock" if node.locked else "Click to lock: not picked or moved"
        return None

    def setData(self, index: Index, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        """Rename."""
        node = self.node(index)
        name = str(value).strip()
        if node is None or not name or name == self._scene[node].name:
            return False
        return self._editing.apply(SetFields(node, {"name": name}, "Rename"))

    def flags(self, index: Index) -> Qt.ItemFlag:
        """Names can be edited and dragged."""
        made = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable | Qt.ItemFlag.ItemIsDropEnabled
        if index.isValid() and index.column() == NAME:
            made |= Qt.ItemFlag.ItemIsEditable | Qt.ItemFlag.ItemIsDragEnabled
        return made

    def supportedDropActions(self) -> Qt.DropAction:
        """Things are moved in the tree."""
        return Qt.DropAction.MoveAction

    def mimeTypes(self) -> list[str]:
        """Node ids."""
        return [_MIME]

    def mimeData(self, indexes: Sequence[QModelIndex]) -> QMimeData:
        """The dragged nodes' ids."""
        nodes = [self.node(i) for i in indexes if i.column() == NAME]
        made = QMimeData()
        made.setData(_MIME, "\n".join(n for n in nodes if n is not None).encode())
        return made

    def dropMimeData(
        self, data: QMimeData, action: Qt.DropAction, row: int, column: int, parent: Index
    ) -> bool:
        """Hang the dragged nodes where they fell, keeping their place in the world.

        False on purpose: the edit has done it, the view must not remove rows.
        """
        nodes = tuple(bytes(data.data(_MIME).data()).decode().split("\n"))
        if not all(node in self._scene.nodes for node in nodes):
            return False
        target = self.node(parent)
        steps: list[Any] = []
        if any(self._scene[n].parent != target for n in nodes):
            steps.append(Reparent(nodes, target))
        siblings = self._children.get(target, [])
        if row >= 0:
            before = next((n for n in siblings[row:] if n not in nodes), None)
            steps.append(Order(nodes, before))
        if steps:
            self._editing.apply(Compound(steps[0].label, tuple(steps)))
        return False

    def _icon(self, name: str, *, dim: bool = False) -> QIcon:
        key = f"{name}{dim}"
        if key not in self._icons:
            colour = self._theme.dim if dim else self._theme.text
            self._icons[key] = icon(name, colour, selected=self._theme.on_accent)
        return self._icons[key]


def kind_icon(node: Node) -> str:
    """Name of the icon for a kind of node."""
    if isinstance(node, Group):
        return "group"
    if isinstance(node, Camera):
        return "camera"
    if isinstance(node, Environment):
        return "environment"
    return "lamp" if isinstance(node, Light) else "object"
