"""The scene's materials in a list: ball, name, how many objects have it; dragged onto what shall."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

from PySide6.QtCore import QItemSelectionModel, QMimeData, QPoint, QSignalBlocker, QSize, Qt, QTimer
from PySide6.QtGui import QColor, QDrag, QDragEnterEvent, QDragMoveEvent, QDropEvent, QIcon, QShowEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTreeWidget, QTreeWidgetItem

from studio_core.scene.nodes import Material, MaterialId, MeshObject, Scene
from studio_ui.look.theme import DARK, Theme
from studio_ui.objects.material_drag import LIBRARY_MIME, MIME, dragged_entry, material_data
from studio_ui.panels.swatch import SIZE, swatch

_NAME, _USERS = 0, 1
_ROLE = Qt.ItemDataRole.UserRole


class MaterialList(QTreeWidget):
    """`chosen(materials)` and `renamed(material, name)` tell of the hand.

    `picture(material, ratio)` is asked while the list is seen; where it has none a swatch stands in.
    `dropped(key)`: an entry of the library was dropped here.
    """

    def __init__(self) -> None:
        super().__init__()
        self.chosen: Callable[[tuple[MaterialId, ...]], object] = lambda materials: None
        self.renamed: Callable[[MaterialId, str], object] = lambda material, name: None
        self.dropped: Callable[[str], object] = lambda key: None
        self.picture: Callable[[Material, float], QIcon | None] = lambda material, ratio: None
        self.rows: dict[MaterialId, QTreeWidgetItem] = {}
        self._wanted = ""
        self._shown: dict[MaterialId, tuple[Material, int]] = {}
        self._theme = DARK
        self.setAccessibleName("Materials")
        self.setHeaderHidden(True)
        self.setRootIsDecorated(False)
        self.setUniformRowHeights(True)
        self.setColumnCount(2)
        self.setIconSize(QSize(SIZE, SIZE))
        self.setMinimumHeight(96)
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        triggers = QAbstractItemView.EditTrigger
        self.setEditTriggers(triggers.DoubleClicked | triggers.EditKeyPressed)
        self.setDragDropMode(QAbstractItemView.DragDropMode.DragDrop)
        self.setDropIndicatorShown(False)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        header = self.header()
        header.setStretchLastSection(False)
        header.setSectionResizeMode(_NAME, QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(_USERS, QHeaderView.ResizeMode.ResizeToContents)
        self.itemChanged.connect(self._changed)
        self.itemSelectionChanged.connect(lambda: self.chosen(self.selected))

    @property
    def selected(self) -> tuple[MaterialId, ...]:
        """The chosen materials; the one that the keyboard is at last."""
        current = self.currentItem()
        made = [material for material, item in self.rows.items() if item.isSelected()]
        return tuple(sorted(made, key=lambda material: self.rows[material] is current))

    def set_theme(self, theme: Theme) -> None:
        """Other colours."""
        self._theme = theme
        self._shown = {material: (value, -1) for material, (value, _) in self._shown.items()}

    def show_scene(self, scene: Scene) -> None:
        """The materials as they are now; only what changed is drawn anew."""
        users = users_of(scene)
        with QSignalBlocker(self):
            if list(self.rows) != list(scene.materials):
                kept = self.selected
                self.clear()
                self._shown = {}
                self.rows = {material: QTreeWidgetItem(self) for material in scene.materials}
                self.select_materials(kept)
            for material, item in self.rows.items():
                value = (scene.materials[material], users[material])
                if self._shown.get(material) != value:
                    self._shown[material] = value
                    self._draw(item, *value)

    def redraw(self, materials: Iterable[MaterialId] | None = None) -> None:
        """The pictures of those, or of all, as they are now."""
        with QSignalBlocker(self):
            for material in self.rows if materials is None else materials:
                if material in self._shown and material in self.rows:
                    self._picture(self.rows[material], self._shown[material][0])

    def showEvent(self, event: QShowEvent) -> None:
        """Pictures are wanted now."""
        super().showEvent(event)
        self.redraw()

    def narrow(self, text: str) -> None:
        """Only materials whose names hold `text`."""
        self._wanted = text.strip().casefold()
        for item in self.rows.values():
            self._hide(item)

    def _hide(self, item: QTreeWidgetItem) -> None:
        item.setHidden(self._wanted not in item.text(_NAME).casefold())

    def select_materials(self, materials: Iterable[MaterialId]) -> None:
        """Those rows, without telling."""
        with QSignalBlocker(self):
            self.clearSelection()
            for material in materials:
                item = self.rows.get(material)
                if item is not None:
                    self.setCurrentItem(item, _NAME, QItemSelectionModel.SelectionFlag.NoUpdate)
                    item.setSelected(True)
                    self.scrollToItem(item)
        self.viewport().update()

    def edit_name(self) -> None:
        """Type another name for the current row."""
        item = self.currentItem()
        if item is not None:
            self.editItem(item, _NAME)

    def mimeTypes(self) -> list[str]:
        """One material."""
        return [MIME]

    def mimeData(self, items: Sequence[QTreeWidgetItem]) -> QMimeData:
        """The material that was taken hold of."""
        current = self.currentItem()
        item = current if current in items or not items else items[0]
        return material_data(item.data(_NAME, _ROLE))

    def startDrag(self, supportedActions: Qt.DropAction) -> None:
        """Its swatch goes with the mouse, so that what is below can be seen."""
        item = self.currentItem()
        if item is None:
            return
        drag = QDrag(self)
        drag.setMimeData(self.mimeData([item]))
        drag.setPixmap(item.icon(_NAME).pixmap(QSize(SIZE, SIZE)))
        drag.setHotSpot(QPoint(-6, -6))
        drag.exec(Qt.DropAction.CopyAction)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Materials of the library."""
        self.dragMoveEvent(event)

    def dragMoveEvent(self, event: QDragMoveEvent) -> None:
        """The same, wherever in the list."""
        if event.mimeData().hasFormat(LIBRARY_MIME):
            event.setDropAction(Qt.DropAction.CopyAction)
            event.accept()
        else:
            event.ignore()

    def dropEvent(self, event: QDropEvent) -> None:
        """They come into the scene."""
        key = dragged_entry(event.mimeData())
        if key is None:
            event.ignore()
            return
        event.setDropAction(Qt.DropAction.CopyAction)
        event.accept()
        QTimer.singleShot(0, self, lambda: self.dropped(key))

    def supportedDropActions(self) -> Qt.DropAction:
        """It stays in the list."""
        return Qt.DropAction.CopyAction

    def _draw(self, item: QTreeWidgetItem, material: Material, users: int) -> None:
        flags = item.flags() | Qt.ItemFlag.ItemIsEditable | Qt.ItemFlag.ItemIsDragEnabled
        item.setFlags(flags & ~Qt.ItemFlag.ItemIsDropEnabled)
        item.setData(_NAME, _ROLE, material.id)
        item.setText(_NAME, material.name)
        self._hide(item)
        self._picture(item, material)
        item.setText(_USERS, str(users) if users else "unused")
        item.setTextAlignment(_USERS, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        item.setForeground(_USERS, QColor(self._theme.dim))
        told = {0: "No object has it", 1: "One object has it"}.get(users, f"{users} objects have it")
        for column in (_NAME, _USERS):
            item.setToolTip(column, f"{material.name}\n{told}\nDrag it onto an object in the picture")

    def _picture(self, item: QTreeWidgetItem, material: Material) -> None:
        ratio = self.devicePixelRatioF()
        made = self.picture(material, ratio) if self.isVisible() else None
        item.setIcon(_NAME, made if made is not None else swatch(material, ratio))

    def _changed(self, item: QTreeWidgetItem, column: int) -> None:
        if column == _NAME:
            self.renamed(item.data(_NAME, _ROLE), item.text(_NAME).strip())


def users_of(scene: Scene) -> Mapping[MaterialId, int]:
    """How many objects have each material; 0 for those that none has."""
    return Counter(material for mesh in scene.of(MeshObject) for material in set(mesh.materials))
