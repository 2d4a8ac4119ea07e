"""The strokes of the project in a list: counted or not by check box, with their weight beside the name."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from PySide6.QtCore import QSignalBlocker, QSize, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTreeWidget, QTreeWidgetItem

from studio_core.scene.nodes import NodeId
from studio_core.strokes.stroke import Stroke
from studio_ui.look.icons import icon
from studio_ui.look.theme import Theme

_NAME, _WEIGHT = 0, 1
_ROW = 26  # pixels
_LEAST, _MOST = 1, 7  # rows before it scrolls
_ROLE = Qt.ItemDataRole.UserRole


class StrokeList(QTreeWidget):
    """`switched(stroke, on)`, `chosen(stroke)`, `renamed(stroke, name)`, `deleted()` tell of the hand."""

    def __init__(self) -> None:
        super().__init__()
        self.switched: Callable[[NodeId, bool], object] = lambda stroke, on: None
        self.chosen: Callable[[NodeId | None], object] = lambda stroke: None
        self.renamed: Callable[[NodeId, str], object] = lambda stroke, name: None
        self.deleted: Callable[[], object] = lambda: None
        self._items: dict[NodeId, QTreeWidgetItem] = {}
        self.setAccessibleName("Strokes")
        self.setHeaderHidden(True)
        self.setRootIsDecorated(False)
        self.setUniformRowHeights(True)
        self.setColumnCount(2)
        self.setIconSize(QSize(16, 16))
        triggers = QAbstractItemView.EditTrigger
        self.setEditTriggers(triggers.DoubleClicked | triggers.EditKeyPressed)
        header = self.header()
        header.setStretchLastSection(False)
        header.setSectionResizeMode(_NAME, QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(_WEIGHT, QHeaderView.ResizeMode.ResizeToContents)
        self.itemChanged.connect(self._changed)
        self.itemSelectionChanged.connect(lambda: self.chosen(self.stroke))

    @property
    def stroke(self) -> NodeId | None:
        """The chosen one."""
        chosen = self.selectedItems()
        return str(chosen[0].data(_NAME, _ROLE)) if chosen else None

    def show_strokes(self, strokes: Iterable[Stroke], chosen: NodeId | None, theme: Theme) -> None:
        """Those strokes, without telling."""
        with QSignalBlocker(self):
            self.clear()
            self._items = {}
            for stroke in strokes:
                item = QTreeWidgetItem(
                    self, [stroke.name, "" if stroke.weight == 1 else f"× {stroke.weight:g}"]
                )
                item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable | Qt.ItemFlag.ItemIsEditable)
                item.setCheckState(_NAME, Qt.CheckState.Unchecked if stroke.hidden else Qt.CheckState.Checked)
                name = "bounce" if stroke.indirect else "stroke"
                item.setIcon(_NAME, icon(name, theme.text, selected=theme.on_accent))
                what = "Changes what is reflected" if stroke.indirect else "Changes the surface"
                item.setToolTip(_NAME, f"{stroke.name}\n{what}. The check box lets it count or not")
                item.setData(_NAME, _ROLE, stroke.id)
                self._items[stroke.id] = item
            if chosen in self._items:
                self.setCurrentItem(self._items[chosen])
        rows = min(max(len(self._items), _LEAST), _MOST)
        self.setFixedHeight(rows * _ROW + 2 * self.frameWidth() + 2)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Delete takes the chosen one out."""
        if event.key() in (Qt.Key.Key_Delete, Qt.Key.Key_Backspace) and self.stroke is not None:
            self.deleted()
        else:
            super().keyPressEvent(event)

    def _changed(self, item: QTreeWidgetItem, column: int) -> None:
        stroke = item.data(_NAME, _ROLE)
        if column != _NAME or stroke is None:
            return
        on, name = item.checkState(_NAME) is Qt.CheckState.Checked, item.text(_NAME).strip()
        self.switched(stroke, on)
        self.renamed(stroke, name)


__all__ = ["StrokeList"]
