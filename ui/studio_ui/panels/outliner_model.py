"""The scene as Qt's tree model: names, eyes and locks; rename, re-parent and reorder by edits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from PySide6.QtCore import QAbstractItemModel, QMimeData, QModelIndex, QPersistentModelIndex, Qt
from PySide6.QtGui import QColor, QIcon

from studio_core.edits import Compound, Edit, Order, Reparent, SetFields
from studio_core.scene.capture import Capture
from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.nodes import Camera, Environment, Node, NodeId, Scene
from studio_ui.editing import Editing
from studio_ui.look.icons import icon
from studio_ui.look.theme import DARK, Theme
from studio_ui.objects.material_drag import LIBRARY_MIME, MIME, assigned, dragged_entry, dragged_material
from studio_ui.panels.node_kinds import LISTED_APART, kind_icon, kind_name

Index = QModelIndex | QPersistentModelIndex
NAME, EYE, LOCK = range(3)
FIELDS = {EYE: "hidden", LOCK: "locked"}
_MIME = "application/x-lucarne-nodes"
_ROOT = QModelIndex()


class OutlinerModel(QAbstractItemModel):
    """Rows are nodes. An edit is told to the views as what it is: rows that come, go, or move, or cells.

    So that what is unfolded and chosen stays; the whole is never reset but by another theme.
    `given(key, nodes)`: an entry of the library was dropped on a node.
    """

    def __init__(self, scene: Scene, editing: Editing) -> None:
        super().__init__()
        self.given: Callable[[str, Sequence[NodeId]], object] = lambda key, nodes: None
        self._editing = editing
        self._scene = scene
        self._children: dict[NodeId | None, list[NodeId]] = {None: []}
        self._parent: dict[NodeId, NodeId | None] = {}
        self._row: dict[NodeId, int] = {}
        self._ids: dict[int, NodeId] = {}
        self._numbers: dict[NodeId, int] = {}
        self._theme = DARK
        self._icons: dict[str, QIcon] = {}
        self._take(_tree(scene))

    def set_theme(self, theme: Theme) -> None:
        """Icons and colours of another theme."""
        self._theme = theme
        self._icons = {}
        self._tell_cells(self._parent)

    # following the scene

    def follow(self, after: Scene, changes: Changes) -> bool:
        """Take over another scene; True when rows came, went or moved."""
        before, self._scene = self._scene, after
        same = tuple(before.nodes) == tuple(after.nodes) and all(
            self._parent.get(n, after.nodes[n].parent) == after.nodes[n].parent
            for n in changes.nodes
            if n in after.nodes
        )
        if not same:
            self._restructure(_tree(after))
        self._tell_cells(n for n in changes.of(Aspect.NAME | Aspect.STRUCTURE) if n in self._parent)
        return not same

    def _restructure(self, wanted: dict[NodeId | None, list[NodeId]]) -> None:
        """What is new comes, last under its parent; then all that stays is put in order; the rest goes."""
        there = {node for nodes in wanted.values() for node in nodes}
        old = set(self._parent)
        self._insert(wanted, old)
        aim = {}
        for parent in (*self._children, *wanted):
            now, then = self._children.get(parent, []), wanted.get(parent, [])
            same = [node for node in now if node in there] == then
            aim[parent] = now if same else [*then, *(node for node in now if node not in there)]
        if any(aim[parent] != nodes for parent, nodes in self._children.items()):
            self.layoutAboutToBeChanged.emit()
            held = self.persistentIndexList()
            nodes = [self.node(index) for index in held]
            self._take(aim)
            found = [
                self.of(n, index.column()) if n is not None else _ROOT
                for n, index in zip(nodes, held, strict=True)
            ]
            self.changePersistentIndexList(held, found)
            self.layoutChanged.emit()
        self._remove(there)

    def _insert(self, wanted: dict[NodeId | None, list[NodeId]], old: set[NodeId]) -> None:
        for parent in [None, *self._parent]:
            new = [node for node in wanted.get(parent, ()) if node not in old]
            if not new:
                continue
            start = len(self._children.get(parent, ()))
            self.beginInsertRows(
                self.of(parent) if parent is not None else _ROOT, start, start + len(new) - 1
            )
            made = dict(self._children)
            made[parent] = [*made.get(parent, ()), *new]
            below = list(new)
            for node in below:
                made[node] = [n for n in wanted.get(node, ()) if n not in old]
                below += made[node]
            self._take(made)
            self.endInsertRows()

    def _remove(self, there: set[NodeId]) -> None:
        """Runs of rows, the last first; what hangs below goes with them."""
        for parent, nodes in list(self._children.items()):
            if parent is not None and parent not in there:
                continue
            above = self.of(parent) if parent is not None else _ROOT
            end = len(nodes)
            while end:
                if nodes[end - 1] in there:
                    end -= 1
                    continue
                start = next((i + 1 for i in range(end - 1, -1, -1) if nodes[i] in there), 0)
                self.beginRemoveRows(above, start, end - 1)
                made = dict(self._children)
                below = made[parent][start:end]
                made[parent] = [*made[parent][:start], *made[parent][end:]]
                for node in below:
                    below += made.pop(node, ())
                self._take(made)
                self.endRemoveRows()
                end = start

    def _take(self, children: dict[NodeId | None, list[NodeId]]) -> None:
        self._children = children
        self._parent, self._row = {}, {}
        for parent, nodes in children.items():
            for row, node in enumerate(nodes):
                self._parent[node], self._row[node] = parent, row
                if node not in self._numbers:
                    number = len(self._numbers) + 1
                    self._numbers[node], self._ids[number] = number, node

    def _tell_cells(self, nodes: Iterable[NodeId]) -> None:
        """One signal for all changed rows under one parent."""
        spans: dict[NodeId | None, tuple[int, int]] = {}
        for node in nodes:
            parent, row = self._parent[node], self._row[node]
            low, high = spans.get(parent, (row, row))
            spans[parent] = (min(low, row), max(high, row))
        for parent, (low, high) in spans.items():
            siblings = self._children[parent]
            self.dataChanged.emit(self.of(siblings[low], NAME), self.of(siblings[high], LOCK))

    def node(self, index: Index) -> NodeId | None:
        """The node of a row."""
        return self._ids.get(index.internalId()) if index.isValid() else None

    def of(self, node: NodeId, column: int = NAME) -> QModelIndex:
        """Where a node is."""
        if node not in self._row:
            return QModelIndex()
        return self.createIndex(self._row[node], column, self._numbers[node])

    def seen(self, row: int, parent: Index) -> Node | None:
        """The node of a row under `parent`, if the scene still has it."""
        siblings = self._children.get(self.node(parent), [])
        return self._scene.nodes.get(siblings[row]) if row < len(siblings) else None

    # Qt's questions

    def index(self, row: int, column: int, parent: Index = _ROOT) -> QModelIndex:
        """The cell there."""
        siblings = self._children.get(self.node(parent), [])
        if not (0 <= row < len(siblings) and 0 <= column < 3) or parent.column() > 0:
            return QModelIndex()
        return self.createIndex(row, column, self._numbers[siblings[row]])

    def parent(self, index: Index = _ROOT) -> QModelIndex:  # type: ignore[override]
        """The row above."""
        node = self.node(index)
        above = self._parent.get(node) if node is not None else None
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
            return self._name(node, role)
        if role == Qt.ItemDataRole.DecorationRole:
            if index.column() == EYE:
                return self._icon("eye-off" if node.hidden else "eye", dim=not node.hidden)
            return self._icon("lock" if node.locked else "unlock", dim=not node.locked)
        if role == Qt.ItemDataRole.ToolTipRole:
            if index.column() == EYE:
                told = "Hidden: click to show" if node.hidden else "Shown: click to hide"
                return f"{told}; drag over several"
            told = "Locked: click to unlock" if node.locked else "Click to lock: neither picked nor moved"
            return f"{told}; drag over several"
        if role == Qt.ItemDataRole.AccessibleTextRole:
            if index.column() == EYE:
                return "Hidden" if node.hidden else "Shown"
            return "Locked" if node.locked else "Not locked"
        return None

    def _name(self, node: Node, role: int) -> Any:
        if role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.EditRole):
            return node.name
        if role == Qt.ItemDataRole.DecorationRole:
            return self._icon(kind_icon(node))
        if role == Qt.ItemDataRole.ForegroundRole and not self._scene.shown(node.id):
            return QColor(self._theme.dim)
        if role == Qt.ItemDataRole.ToolTipRole:
            hidden = "" if self._scene.shown(node.id) else " (hidden)"
            return f"{node.name}\n{kind_name(node)}{hidden}"
        return None

    def setData(self, index: Index, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        """Rename."""
        node = self.node(index)
        name = str(value).strip()
        if node is None or not name or name == self._scene[node].name:
            return False
        return self._editing.apply(SetFields(node, {"name": name}, f"Rename {self._scene[node].name}"))

    def flags(self, index: Index) -> Qt.ItemFlag:
        """Names can be edited and dragged; cameras, captures and environments hold nothing."""
        if not index.isValid():
            return Qt.ItemFlag.ItemIsDropEnabled
        made = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable
        node = self._scene.nodes.get(self.node(index) or "")
        if not isinstance(node, Camera | Capture | Environment):
            made |= Qt.ItemFlag.ItemIsDropEnabled
        if index.column() == NAME:
            made |= Qt.ItemFlag.ItemIsEditable | Qt.ItemFlag.ItemIsDragEnabled
        return made

    # dragging

    def supportedDropActions(self) -> Qt.DropAction:
        """Things are moved in the tree; materials are copied into it."""
        return Qt.DropAction.MoveAction | Qt.DropAction.CopyAction

    def supportedDragActions(self) -> Qt.DropAction:
        """Things are moved in the tree."""
        return Qt.DropAction.MoveAction

    def mimeTypes(self) -> list[str]:
        """What can be dropped: nodes, materials of the scene and of the library. Nodes are dragged."""
        return [_MIME, MIME, LIBRARY_MIME]

    def mimeData(self, indexes: Sequence[QModelIndex]) -> QMimeData:
        """The dragged nodes' ids."""
        nodes = [self.node(i) for i in indexes if i.column() == NAME]
        made = QMimeData()
        made.setData(_MIME, "\n".join(n for n in nodes if n is not None).encode())
        return made

    def canDropMimeData(
        self, data: QMimeData, action: Qt.DropAction, row: int, column: int, parent: Index
    ) -> bool:
        """Nodes anywhere, materials on what can have them."""
        if dragged_material(data) is not None or dragged_entry(data) is not None:
            return parent.isValid()
        return data.hasFormat(_MIME)

    def dropMimeData(
        self, data: QMimeData, action: Qt.DropAction, row: int, column: int, parent: Index
    ) -> bool:
        """Hang the dragged nodes where they fell, keeping their place in the world; or assign a material.

        False on purpose: the edit has done it, the view must not remove rows.
        """
        target = self.node(parent)
        material = dragged_material(data)
        if material is not None:
            edit = assigned(self._scene, (target,), material) if target is not None else None
            if edit is not None:
                self._editing.apply(edit)
            return False
        key = dragged_entry(data)
        if key is not None:
            if target is not None:
                self.given(key, (target,))
            return False
        dragged = bytes(data.data(_MIME).data()).decode().split("\n")
        if not all(node in self._scene.nodes for node in dragged):
            return False
        edit = self._moved(dragged, target, row)
        if edit is not None:
            self._editing.apply(edit)
        return False

    def _moved(self, dragged: Sequence[NodeId], target: NodeId | None, row: int) -> Edit | None:
        """What hangs under another dragged node goes with it; the others keep their order."""
        scene = self._scene
        tops = {n for n in dragged if not any(above.id in dragged for above in scene.ancestors(n))}
        nodes = tuple(n for n in scene.nodes if n in tops)
        what = scene[nodes[0]].name if len(nodes) == 1 else f"{len(nodes)} things"
        steps: list[Edit] = []
        label = f"Reorder {what}"
        if any(scene[n].parent != target for n in nodes):
            steps.append(Reparent(nodes, target))
            label = f"Hang {what} under {scene[target].name}" if target is not None else f"Take {what} out"
        if row >= 0 or steps:  # dropped on something rather than between: last there
            behind = self._children.get(target, [])[row:] if row >= 0 else []
            steps.append(Order(nodes, next((n for n in behind if n not in tops), None)))
        return Compound(label, tuple(steps)) if steps else None

    def _icon(self, name: str, *, dim: bool = False) -> QIcon:
        key = f"{name}{dim}"
        if key not in self._icons:
            colour = self._theme.dim if dim else self._theme.text
            self._icons[key] = icon(name, colour, selected=self._theme.on_accent)
        return self._icons[key]


def _tree(scene: Scene) -> dict[NodeId | None, list[NodeId]]:
    """Children by parent, in the scene's order; kinds that are listed elsewhere are left out."""
    made: dict[NodeId | None, list[NodeId]] = {None: []}
    for node in scene.nodes.values():
        if isinstance(node, LISTED_APART):
            continue
        made.setdefault(node.parent, []).append(node.id)
    return made
