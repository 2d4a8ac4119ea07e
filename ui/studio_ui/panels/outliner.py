"""Outliner: everything in the scene as a tree."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping

from PySide6.QtCore import (
    QItemSelection,
    QItemSelectionModel,
    QItemSelectionRange,
    QModelIndex,
    QPoint,
    Qt,
    QTimer,
)
from PySide6.QtGui import QAction, QShowEvent
from PySide6.QtWidgets import QLineEdit, QMenu

from studio_core.edits import Compound, Edit, SetFields
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import NodeId, Scene
from studio_ui.context import Context
from studio_ui.forms.fields import Combo
from studio_ui.look.theme import Theme
from studio_ui.panels.node_kinds import FILTERS
from studio_ui.panels.outliner_filter import OutlinerFilter
from studio_ui.panels.outliner_model import FIELDS, NAME, OutlinerModel
from studio_ui.panels.outliner_tree import OutlinerTree
from studio_ui.panels.panel import Panel, row

_VERBS = {"hidden": ("Show", "Hide"), "locked": ("Unlock", "Lock")}
_MENU = (
    ("view.frame_selection",),
    ("object.edit_capture",),
    ("object.group", "object.ungroup", "edit.duplicate", "edit.delete"),
    ("edit.select_material", "edit.select_instances"),
)


class OutlinerPanel(Panel):
    """The tree follows the selection and makes it."""

    id = "outliner"
    title = "Outliner"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.model = OutlinerModel(context.document.scene, context.editing)
        self.proxy = OutlinerFilter(self.model, self)
        self.filter = QLineEdit()
        self.filter.setPlaceholderText("Find by name")
        self.filter.setAccessibleName("Find by name")
        self.filter.setClearButtonEnabled(True)
        self.kind = Combo()
        self.kind.setAccessibleName("Kinds that are listed")
        self.kind.setToolTip("Kinds that are listed")
        self.kind.setMinimumContentsLength(7)
        for name, (text, _) in FILTERS.items():
            self.kind.addItem(text, name)
        self.filter.textChanged.connect(self._narrow)
        self.kind.currentIndexChanged.connect(self._narrow)
        self.tree = OutlinerTree()
        self.tree.setModel(self.proxy)
        self.tree.size_columns()
        self.tree.pressed_cell = self._press
        self.tree.swept = self._sweep
        self.tree.let_go = self._let_go
        self.tree.customContextMenuRequested.connect(self._ask_menu)
        self.tree.selectionModel().selectionChanged.connect(lambda *_: self._chosen())
        self._actions: Mapping[str, QAction] = {}
        self.column.addLayout(row(self.filter, self.kind, stretch=0))
        self.column.addWidget(self.tree, 1)
        self._open: set[NodeId] = set()
        self._reveal = QTimer(self)
        self._reveal.setSingleShot(True)
        self._reveal.timeout.connect(self._selected)
        self._following = self._folding = False
        self._sweeping: tuple[str, bool] | None = None
        self._swept: list[NodeId] = []
        self.tree.expanded.connect(lambda i: self._remember(i, True))
        self.tree.collapsed.connect(lambda i: self._remember(i, False))
        self.subscriptions.add(
            context.document.changed.connect(self._edited), context.session.selected.connect(self._selected)
        )
        self._selected()

    def set_theme(self, theme: Theme) -> None:
        """Icons of another theme."""
        super().set_theme(theme)
        self.model.set_theme(theme)

    def use_actions(self, actions: Mapping[str, QAction]) -> None:
        """What the menu offers; F works here as it does in the picture."""
        self._actions = actions
        self.tree.addAction(actions["view.frame_selection"])

    def showEvent(self, event: QShowEvent) -> None:
        """What is chosen is in sight when the panel comes up."""
        super().showEvent(event)
        self._selected()

    def rename(self) -> None:
        """Type another name for the row that the keyboard is at."""
        index = self.tree.currentIndex().siblingAtColumn(NAME)
        if index.isValid():
            self.tree.scrollTo(index)
            self.tree.edit(index)

    def index_of(self, node: NodeId, column: int = NAME) -> QModelIndex:
        """Where the tree shows a node."""
        return self.proxy.mapFromSource(self.model.of(node, column))

    # following the document and the choice

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if not changes:
            return
        self._following = True
        restructured = self.model.follow(after, changes)
        self._following = False
        if restructured:
            self._unfold()
            self._selected()
            self._reveal.start(0)  # a tree that is dropped on unfolds nothing before the drop is over

    def _unfold(self) -> None:
        """What was open and came back, say by an undo, is open again."""
        for node in self._open:
            index = self.index_of(node)
            if index.isValid() and not self.tree.isExpanded(index):
                self.tree.expand(index)

    def _remember(self, index: QModelIndex, is_open: bool) -> None:
        node = self.model.node(self.proxy.mapToSource(index))
        if node is not None and not self.proxy.narrowed and not self._folding:
            (self._open.add if is_open else self._open.discard)(node)

    def _narrow(self) -> None:
        was = self.proxy.narrowed
        self._following = True
        self.proxy.narrow(self.filter.text(), FILTERS[self.kind.currentData()][1])
        if self.proxy.narrowed:
            self.tree.expandAll()
        elif was:
            self._folding = True
            self.tree.collapseAll()
            self._folding = False
        self._following = False
        if was and not self.proxy.narrowed:
            self._unfold()
        self._selected()

    def _chosen(self) -> None:
        """The tree's selection becomes the session's, unless it only follows that."""
        if self._following:
            return
        current = self.tree.currentIndex()
        rows = sorted(self.tree.selectionModel().selectedRows(NAME), key=lambda r: r == current)
        nodes = [self.model.node(self.proxy.mapToSource(found)) for found in rows]
        self.context.session.select(n for n in nodes if n is not None)

    def _selected(self) -> None:
        found = [self.index_of(node) for node in self.context.session.selection]
        found = [index for index in found if index.isValid()]
        selection, last = _selection(found), found[-1] if found else QModelIndex()
        flags = QItemSelectionModel.SelectionFlag
        model = self.tree.selectionModel()
        self._following = True
        model.select(selection, flags.ClearAndSelect | flags.Rows)
        if last.isValid():
            model.setCurrentIndex(last, flags.NoUpdate)
            self.tree.scrollTo(last)
        self._following = False

    # eyes and locks

    def _press(self, index: QModelIndex) -> None:
        source = self.proxy.mapToSource(index)
        node = self.model.node(source)
        if node is None:
            return
        scene = self.context.document.scene
        field = FIELDS[source.column()]
        value = not getattr(scene[node], field)
        if not self.context.editing.begin(self, f"{_VERBS[field][value]} {scene[node].name}"):
            return
        self._sweeping = (field, value)
        chosen = [n for n in self.context.session.selection if n in scene.nodes]
        self._swept = chosen if node in chosen else [node]
        self._preview()

    def _sweep(self, index: QModelIndex) -> None:
        node = self.model.node(self.proxy.mapToSource(index))
        if self._sweeping is not None and node is not None and node not in self._swept:
            self._swept.append(node)
            self._preview()

    def _preview(self) -> None:
        assert self._sweeping is not None
        field, value = self._sweeping
        self.context.editing.preview(self, _set_all(self._swept, field, value, ""))
        scene = self.context.document.scene
        what = scene[self._swept[0]].name if len(self._swept) == 1 else f"{len(self._swept)} things"
        self.context.editing.call(self, f"{_VERBS[field][value]} {what}")

    def _let_go(self) -> None:
        self._sweeping = None
        self.context.editing.commit(self)

    def _set(self, nodes: list[NodeId], field: str, value: bool) -> None:
        scene = self.context.document.scene
        what = scene[nodes[0]].name if len(nodes) == 1 else f"{len(nodes)} things"
        self.context.editing.apply(_set_all(nodes, field, value, f"{_VERBS[field][value]} {what}"))

    # the menu

    def _ask_menu(self, place: QPoint) -> None:
        self.menu().popup(self.tree.viewport().mapToGlobal(place))

    def menu(self) -> QMenu:
        """What can be done with what is chosen."""
        made = QMenu(self)
        made.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        scene = self.context.document.scene
        chosen = [n for n in self.context.session.selection if n in scene.nodes]
        if not chosen:
            made.addAction("Unfold everything", self.tree.expandAll)
            made.addAction("Fold everything", self.tree.collapseAll)
            return made
        made.addAction("Rename\tF2", self.rename)
        for field, verbs in _VERBS.items():
            value = not all(getattr(scene[n], field) for n in chosen)
            made.addAction(verbs[value], lambda f=field, v=value: self._set(chosen, f, v))
        for names in _MENU:
            made.addSeparator()
            made.addActions([self._actions[name] for name in names if name in self._actions])
        return made


def _selection(indices: list[QModelIndex]) -> QItemSelection:
    """One range for rows that follow each other: Qt is slow with thousands of ranges."""
    made = QItemSelection()
    rows: dict[tuple[int, int], list[QModelIndex]] = {}
    for index in indices:
        above = index.parent()
        rows.setdefault((above.internalId(), above.row()), []).append(index)
    for siblings in rows.values():
        siblings.sort(key=QModelIndex.row)
        start = siblings[0]
        for one, other in itertools.zip_longest(siblings, siblings[1:]):
            if other is None or other.row() != one.row() + 1:
                made.append(QItemSelectionRange(start, one))
                start = other
    return made


def _set_all(nodes: Iterable[NodeId], field: str, value: bool, label: str) -> Edit:
    return Compound(label, tuple(SetFields(n, {field: value}) for n in nodes))
