"""The lights of the scene in a list: on or off by check box, alone by the column beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from PySide6.QtCore import QItemSelectionModel, QSignalBlocker, QSize, Qt
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTreeWidget, QTreeWidgetItem

from studio_core.scene.nodes import Light, NodeId
from studio_ui.look.icons import icon
from studio_ui.look.theme import Theme
from studio_ui.panels.node_kinds import kind_icon

_NAME, _SOLO = 0, 1
_ROW = 28  # pixels
_MOST = 8  # rows before it scrolls


class LightList(QTreeWidget):
    """`switched(light, on)`, `soloed(light)`, `chosen(lights)`, `renamed(light, name)` tell of the hand."""

    def __init__(self) -> None:
        super().__init__()
        self.switched: Callable[[NodeId, bool], object] = lambda light, on: None
        self.soloed: Callable[[NodeId], object] = lambda light: None
        self.chosen: Callable[[tuple[NodeId, ...]], object] = lambda lights: None
        self.renamed: Callable[[NodeId, str], object] = lambda light, name: None
        self._items: dict[NodeId, QTreeWidgetItem] = {}
        self.setAccessibleName("Lights")
        self.setHeaderHidden(True)
        self.setRootIsDecorated(False)
        self.setUniformRowHeights(True)
        self.setColumnCount(2)
        self.setIconSize(QSize(17, 17))
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        triggers = QAbstractItemView.EditTrigger
        self.setEditTriggers(triggers.DoubleClicked | triggers.EditKeyPressed)
        header = self.header()
        header.setStretchLastSection(False)
        header.setMinimumSectionSize(24)
        header.setSectionResizeMode(_NAME, QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(_SOLO, QHeaderView.ResizeMode.Fixed)
        header.resizeSection(_SOLO, 28)
        self.itemChanged.connect(self._changed)
        self.itemClicked.connect(self._clicked)
        self.itemSelectionChanged.connect(lambda: self.chosen(self.selected))

    @property
    def selected(self) -> tuple[NodeId, ...]:
        """The chosen lights, in the list's order."""
        return tuple(node for node, item in self._items.items() if item.isSelected())

    def show_lights(self, lights: Iterable[Light], solo: NodeId | None, theme: Theme) -> None:
        """Those lights, without telling."""
        with QSignalBlocker(self):
            self.clear()
            self._items = {}
            for light in lights:
                item = QTreeWidgetItem(self, [light.name])
                item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable | Qt.ItemFlag.ItemIsEditable)
                item.setCheckState(_NAME, Qt.CheckState.Unchecked if light.hidden else Qt.CheckState.Checked)
                item.setIcon(_NAME, icon(kind_icon(light), theme.text, selected=theme.on_accent))
                alone = light.id == solo
                colour = theme.accent if alone else theme.dim
                item.setIcon(_SOLO, icon("solo", colour, selected=theme.on_accent))
                item.setToolTip(_NAME, f"{light.name}\nThe check box switches it on and off")
                item.setToolTip(_SOLO, "Alone: click to have the others again" if alone else "Only this one")
                item.setData(_NAME, Qt.ItemDataRole.UserRole, light.id)
                self._items[light.id] = item
        rows = min(max(len(self._items), 2), _MOST)
        self.setFixedHeight(rows * _ROW + 2 * self.frameWidth() + 2)

    def select_lights(self, lights: Iterable[NodeId]) -> None:
        """Those rows, without telling."""
        wanted = list(lights)
        with QSignalBlocker(self):
            self.clearSelection()
            for node in wanted:
                if node in self._items:
                    item = self._items[node]
                    self.setCurrentItem(item, _NAME, QItemSelectionModel.SelectionFlag.NoUpdate)
                    item.setSelected(True)
                    self.scrollToItem(item)
        self.viewport().update()

    def _changed(self, item: QTreeWidgetItem, column: int) -> None:
        light = item.data(_NAME, Qt.ItemDataRole.UserRole)
        if column != _NAME or light is None:
            return
        self.switched(light, item.checkState(_NAME) is Qt.CheckState.Checked)
        self.renamed(light, item.text(_NAME).strip())

    def _clicked(self, item: QTreeWidgetItem, column: int) -> None:
        if column == _SOLO:
            self.soloed(item.data(_NAME, Qt.ItemDataRole.UserRole))
