"""The rows of the cameras panel: a small picture, the name, the lens; dragged into another order."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QPoint, QRect, QSize, Qt
from PySide6.QtGui import QColor, QDropEvent, QImage, QKeyEvent, QPainter, QPalette
from PySide6.QtWidgets import (
    QAbstractItemView,
    QListWidget,
    QListWidgetItem,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QWidget,
)

from studio_core.scene.nodes import NodeId
from studio_ui.look.theme import DARK, Theme

PICTURE = QSize(96, 54)
"""Logical pixels that a small picture has at most."""
ID, LENS, IMAGE, SEEN = (Qt.ItemDataRole.UserRole + n for n in range(4))
_GAP = 8
_Index = QModelIndex | QPersistentModelIndex


class CameraRows(QStyledItemDelegate):
    """Paints a row; the name is edited in place."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.theme = DARK

    def sizeHint(self, option: QStyleOptionViewItem, index: _Index) -> QSize:
        """All rows are alike."""
        return QSize(PICTURE.width() + 90, PICTURE.height() + 8)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        """Ground, picture, name over lens; a bar beside the camera that is looked through."""
        box: QRect = option.rect  # type: ignore[attr-defined]
        widget: QWidget = option.widget  # type: ignore[attr-defined]
        state: QStyle.StateFlag = option.state  # type: ignore[attr-defined]
        palette: QPalette = option.palette  # type: ignore[attr-defined]
        widget.style().drawPrimitive(QStyle.PrimitiveElement.PE_PanelItemViewItem, option, painter, widget)
        chosen = bool(state & QStyle.StateFlag.State_Selected)
        role = QPalette.ColorRole.HighlightedText if chosen else QPalette.ColorRole.Text
        picture = self._picture(box)
        image: QImage | None = index.data(IMAGE)
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        if image is None:
            painter.fillRect(picture, QColor(self.theme.canvas))
            painter.setPen(QColor(self.theme.dim))
            painter.drawText(picture, int(Qt.AlignmentFlag.AlignCenter), "not seen yet")
        else:
            size = image.size().scaled(PICTURE, Qt.AspectRatioMode.KeepAspectRatio)
            middle = picture.center() - QPoint(size.width() // 2, size.height() // 2)
            painter.drawImage(QRect(middle, size), image)
        if index.data(SEEN):
            mark = palette.color(QPalette.ColorRole.HighlightedText) if chosen else QColor(self.theme.accent)
            painter.fillRect(QRect(box.left() + 1, box.top() + 5, 3, box.height() - 10), mark)
        words = self._words(box)
        high = painter.fontMetrics().height()
        top = QRect(words.left(), words.center().y() - high, words.width(), high)
        painter.setPen(palette.color(role))
        self._line(painter, top, index.data(Qt.ItemDataRole.DisplayRole))
        if not chosen:
            painter.setPen(QColor(self.theme.dim))
        self._line(painter, top.translated(0, high + 2), index.data(LENS))
        painter.restore()

    def updateEditorGeometry(self, editor: QWidget, option: QStyleOptionViewItem, index: _Index) -> None:
        """Over the name."""
        words = self._words(option.rect)  # type: ignore[attr-defined]
        high = editor.sizeHint().height()
        editor.setGeometry(QRect(words.left() - 4, words.center().y() - high // 2, words.width() + 4, high))

    @staticmethod
    def _picture(box: QRect) -> QRect:
        return QRect(QPoint(box.left() + _GAP, box.top() + 4), PICTURE)

    @staticmethod
    def _words(box: QRect) -> QRect:
        return box.adjusted(PICTURE.width() + 2 * _GAP, 0, -4, 0)

    @staticmethod
    def _line(painter: QPainter, box: QRect, text: str) -> None:
        shown = painter.fontMetrics().elidedText(text, Qt.TextElideMode.ElideRight, box.width())
        painter.drawText(box, int(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter), shown)


class CameraList(QListWidget):
    """`went(camera)` at a click or Enter, `renamed(camera, name)`, `moved(camera, before)`, `removed()`."""

    def __init__(self) -> None:
        super().__init__()
        self.went: Callable[[NodeId], object] = lambda camera: None
        self.renamed: Callable[[NodeId, str], object] = lambda camera, name: None
        self.moved: Callable[[NodeId, NodeId | None], object] = lambda camera, before: None
        self.removed: Callable[[], object] = lambda: None
        self.rows = CameraRows(self)
        self.setItemDelegate(self.rows)
        self.setAccessibleName("Cameras")
        self.setUniformItemSizes(True)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        triggers = QAbstractItemView.EditTrigger
        self.setEditTriggers(triggers.DoubleClicked | triggers.EditKeyPressed)
        self.setDragDropMode(QAbstractItemView.DragDropMode.InternalMove)
        self.setDefaultDropAction(Qt.DropAction.MoveAction)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.itemClicked.connect(lambda item: self.went(item.data(ID)))
        self.itemChanged.connect(self._changed)
        self._filling = False

    @property
    def camera(self) -> NodeId | None:
        """The current row's."""
        item = self.currentItem()
        return None if item is None else str(item.data(ID))

    def set_theme(self, theme: Theme) -> None:
        """Colours of another theme."""
        self.rows.theme = theme
        self.viewport().update()

    def show_cameras(self, rows: list[tuple[NodeId, str, str, QImage | None, bool]]) -> None:
        """A row for each: camera, name, lens, small picture, whether it is looked through."""
        self._filling = True
        current = self.camera
        while self.count() > len(rows):
            self.takeItem(self.count() - 1)
        for number, (camera, name, lens, image, seen) in enumerate(rows):
            if number >= self.count():
                self.addItem(QListWidgetItem())
            item = self.item(number)
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsEditable)
            key = f"Ctrl+Alt+{number + 1}" if number < 9 else ""
            told = f"{name}\n{lens}" + (f"\n{key}" if key else "")
            values = {ID: camera, LENS: lens, IMAGE: image, SEEN: seen}
            values |= {Qt.ItemDataRole.DisplayRole: name, Qt.ItemDataRole.ToolTipRole: told}
            for role, value in values.items():
                if item.data(role) != value:
                    item.setData(role, value)
            if camera == current:
                self.setCurrentItem(item)
        self._filling = False

    def choose(self, camera: NodeId) -> None:
        """Make its row the current one."""
        for number in range(self.count()):
            if self.item(number).data(ID) == camera:
                self.setCurrentRow(number)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Enter goes there, Delete removes."""
        camera = self.camera
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and camera is not None:
            self.went(camera)
        elif event.key() == Qt.Key.Key_Delete:
            self.removed()
        else:
            super().keyPressEvent(event)

    def dropEvent(self, event: QDropEvent) -> None:
        """The dragged row comes before the one it was dropped on, or after it in its lower half."""
        camera, row = self.camera, self.row_at(event.position().toPoint())
        event.setDropAction(Qt.DropAction.IgnoreAction)
        event.accept()
        if camera is not None and event.source() is self:
            self.moved(camera, None if row >= self.count() else str(self.item(row).data(ID)))

    def row_at(self, place: QPoint) -> int:
        """The number of the row that something dropped there comes before."""
        item = self.itemAt(place)
        if item is None:
            return self.count()
        below = place.y() > self.visualItemRect(item).center().y()
        return self.row(item) + below

    def _changed(self, item: QListWidgetItem) -> None:
        if not self._filling:
            self.renamed(item.data(ID), item.text())
