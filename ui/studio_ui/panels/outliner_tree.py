"""The outliner's tree: a press on an eye or a lock goes on over all rows that the mouse is dragged over."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QModelIndex, QSize, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTreeView

from studio_ui.panels.outliner_model import EYE, LOCK, NAME

_CELL = 26  # pixels


class OutlinerTree(QTreeView):
    """`pressed_cell(index)`, `swept(index)` and `let_go()` tell of the columns beside the name."""

    def __init__(self) -> None:
        super().__init__()
        self.pressed_cell: Callable[[QModelIndex], object] = lambda index: None
        self.swept: Callable[[QModelIndex], object] = lambda index: None
        self.let_go: Callable[[], object] = lambda: None
        self._column: int | None = None  # that is swept
        self.setAccessibleName("Outliner")
        self.setHeaderHidden(True)
        self.setUniformRowHeights(True)
        self.setIndentation(14)
        self.setIconSize(QSize(17, 17))
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        triggers = QAbstractItemView.EditTrigger
        self.setEditTriggers(triggers.DoubleClicked | triggers.EditKeyPressed)
        self.setDragDropMode(QAbstractItemView.DragDropMode.DragDrop)
        self.setDefaultDropAction(Qt.DropAction.MoveAction)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)

    def size_columns(self) -> None:
        """The name takes the room; once there is a model."""
        header = self.header()
        header.setStretchLastSection(False)
        header.setMinimumSectionSize(24)
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)
        for column in (EYE, LOCK):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.Fixed)
            header.resizeSection(column, _CELL)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """On an eye or lock the choice stays as it is."""
        index = self.indexAt(event.position().toPoint())
        if event.button() == Qt.MouseButton.LeftButton and index.column() in (EYE, LOCK):
            self._column = index.column()
            self.pressed_cell(index)
            event.accept()
            return
        super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """While it is held: the same for every row on the way."""
        if self._column is None:
            super().mouseMoveEvent(event)
            return
        place = event.position().toPoint()
        index = self.indexAt(place)
        if index.isValid():
            self.swept(index.siblingAtColumn(self._column))
        self.scrollTo(index, QAbstractItemView.ScrollHint.EnsureVisible)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """The end of it."""
        if self._column is not None and event.button() == Qt.MouseButton.LeftButton:
            self._column = None
            self.let_go()
            return
        super().mouseReleaseEvent(event)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """A quick second press on an eye is a press."""
        if self.indexAt(event.position().toPoint()).column() in (EYE, LOCK):
            self.mousePressEvent(event)
            return
        super().mouseDoubleClickEvent(event)
