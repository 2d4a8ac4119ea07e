"""Outliner: everything in the scene as a tree."""

from __future__ import annotations

from PySide6.QtCore import (
    QItemSelection,
    QItemSelectionModel,
    QModelIndex,
    QSignalBlocker,
    QSize,
    QSortFilterProxyModel,
    Qt,
)
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QLineEdit, QTreeView

from studio_core.edits import Compound, SetFields
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import NodeId, Scene
from studio_ui.context import Context
from studio_ui.panels.outliner_model import EYE, LOCK, NAME, OutlinerModel
from studio_ui.panels.panel import Panel
from studio_ui.theme import Theme


class OutlinerPanel(Panel):
    """The tree follows the selection and makes it."""

    id = "outliner"
    title = "Outliner"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.model = OutlinerModel(context.document.scene, context.editing)
        self.proxy = QSortFilterProxyModel(self)
        self.proxy.setSourceModel(self.model)
        self.proxy.setRecursiveFilteringEnabled(True)
        self.proxy.setAutoAcceptChildRows(True)
        self.proxy.setFilterCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
        self.filter = QLineEdit()
        self.filter.setPlaceholderText("Find by name")
        self.filter.setClearButtonEnabled(True)
        self.filter.textChanged.connect(self._filter)
        self.tree = QTreeView()
        self.tree.setModel(self.proxy)
        self.tree.setHeaderHidden(True)
        self.tree.setUniformRowHeights(True)
        self.tree.setIndentation(14)
        self.tree.setIconSize(QSize(17, 17))
        self.tree.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.tree.setEditTriggers(
            QAbstractItemView.EditTrigger.DoubleClicked | QAbstractItemView.EditTrigger.EditKeyPressed
        )
        self.tree.setDragDropMode(QAbstractItemView.DragDropMode.InternalMove)
        header = self.tree.header()
        header.setStretchLastSection(False)
        header.setMinimumSectionSize(24)
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)
        for column in (EYE, LOCK):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.Fixed)
            header.resizeSection(column, 26)
        self.tree.clicked.connect(self._clicked)
        self.tree.selectionModel().selectionChanged.connect(lambda *_: self._chosen())
        self.column.addWidget(self.filter)
        self.column.addWidget(self.tree, 1)
        self._open: set[NodeId] = set()
        self._following = False
        self.tree.expanded.connect(lambda i: self._remember(i, True))
        self.tree.collapsed.connect(lambda i: self._remember(i, False))
        self.subscriptions.add(
            context.document.changed.connect(self._edited), context.session.selected.connect(self._selected)
        )
        self._selected()

    def set_theme(self, theme: Theme) -> None:
        """Icons of another theme."""
        super().set_theme(theme)
        self._following = True
        self.model.set_theme(theme)
        self._following = False
        self._unfold()

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if not changes:
            return
        self._following = True
        rebuilt = self.model.follow(after, changes)
        self._following = False
        if rebuilt:
            self._unfold()

    def _unfold(self) -> None:
        """After a rebuild: what was open, what was chosen."""
        with QSignalBlocker(self.tree):
            for node in self._open:
                self.tree.expand(self.proxy.mapFromSource(self.model.of(node)))
        self._selected()

    def _remember(self, index: QModelIndex, is_open: bool) -> None:
        node = self.model.node(self.proxy.mapToSource(index))
        if node is not None and not self.filter.text():
            (self._open.add if is_open else self._open.discard)(node)

    def _filter(self, text: str) -> None:
        self.proxy.setFilterFixedString(text)
        if text:
            self.tree.expandAll()

    def _clicked(self, index: QModelIndex) -> None:
        source = self.proxy.mapToSource(index)
        node = self.model.node(source)
        if node is None or source.column() == NAME:
            return
        field = "hidden" if source.column() == EYE else "locked"
        scene = self.context.document.scene
        value = not getattr(scene[node], field)
        chosen = self.context.session.selection
        nodes = [n for n in chosen if n in scene.nodes] if node in chosen else [node]
        verb = {"hidden": ("Show", "Hide"), "locked": ("Unlock", "Lock")}[field][value]
        label = f"{verb} {scene[nodes[0]].name}" if len(nodes) == 1 else f"{verb} {len(nodes)} objects"
        self.context.editing.apply(Compound(label, tuple(SetFields(n, {field: value}) for n in nodes)))

    def _chosen(self) -> None:
        """The tree's selection becomes the session's, unless it only follows that."""
        if self._following:
            return
        rows = self.tree.selectionModel().selectedRows(NAME)
        nodes = [self.model.node(self.proxy.mapToSource(row)) for row in rows]
        self.context.session.select(n for n in nodes if n is not None)

    def _selected(self) -> None:
        chosen = self.context.session.selection
        selection, last = QItemSelection(), QModelIndex()
        for node in chosen:
            index = self.proxy.mapFromSource(self.model.of(node))
            if index.isValid():
                selection.select(index, index)
                last = index
        flags = QItemSelectionModel.SelectionFlag
        model = self.tree.selectionModel()
        self._following = True
        model.select(selection, flags.ClearAndSelect | flags.Rows)
        self._following = False
        if last.isValid():
            self.tree.scrollTo(last)
