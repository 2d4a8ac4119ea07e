"""The library's view: balls in rows under headings, chosen by mouse and keys, dragged onto things."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from PySide6.QtCore import QModelIndex, QPoint, QRect, QSize, Qt, QTimer
from PySide6.QtGui import QDrag, QDragMoveEvent, QDropEvent, QIcon, QKeyEvent, QResizeEvent
from PySide6.QtWidgets import QAbstractItemView, QListView

from studio_core.library.lucmat import SUFFIX
from studio_core.library.shelf import Entry
from studio_core.scene.nodes import MaterialId
from studio_ui.library.cells import BALL, Cells
from studio_ui.library.model import LibraryModel, Row
from studio_ui.look.theme import Theme
from studio_ui.objects.material_drag import dragged_material

_Keys = Qt.KeyboardModifier


class LibraryView(QListView):
    """`activate()` at a double click or Enter, `remove()` at Delete, `chosen()` when others are chosen.

    `keep(material)` and `put(paths)`: one of the scene's materials, or files of materials, were dropped here.
    `seen(keys)` tells of which entries pictures are still wanted.
    """

    def __init__(self, picture: Callable[[Entry], QIcon]) -> None:
        super().__init__()
        self.activate: Callable[[], object] = lambda: None
        self.remove: Callable[[], object] = lambda: None
        self.chosen: Callable[[], object] = lambda: None
        self.keep: Callable[[MaterialId], object] = lambda material: None
        self.put: Callable[[Sequence[Path]], object] = lambda paths: None
        self.seen: Callable[[frozenset[str]], object] = lambda keys: None
        self.rows = LibraryModel()
        self.cells = Cells(self, picture)
        self.setModel(self.rows)
        self.setItemDelegate(self.cells)
        self.setAccessibleName("Library of materials")
        self.setFlow(QListView.Flow.LeftToRight)
        self.setWrapping(True)
        self.setResizeMode(QListView.ResizeMode.Adjust)
        self.setMovement(QListView.Movement.Static)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOn)  # columns stay as they are
        self.verticalScrollBar().setSingleStep(BALL // 2)
        self.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.EditKeyPressed)
        self.setDragDropMode(QAbstractItemView.DragDropMode.DragDrop)
        self.setDefaultDropAction(Qt.DropAction.CopyAction)
        self.setDropIndicatorShown(False)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.setMinimumHeight(48)
        self.doubleClicked.connect(lambda index: self.activate())  # `activated` comes of one click in places
        self.selectionModel().selectionChanged.connect(lambda *_: self.chosen())
        self._settle = QTimer(self)
        self._settle.setSingleShot(True)
        self._settle.timeout.connect(self._tell_seen)
        self.verticalScrollBar().valueChanged.connect(lambda _: self._settle.start(0))

    @property
    def entries(self) -> tuple[Entry, ...]:
        """The chosen ones in their order, the current one last."""
        current = self.currentIndex()
        found = sorted(self.selectedIndexes(), key=lambda index: (index == current, index.row()))
        return tuple(entry for entry in map(self.rows.entry, found) if entry is not None)

    def set_theme(self, theme: Theme) -> None:
        """Other colours."""
        self.cells.theme = theme
        self.viewport().update()

    def show_rows(self, rows: tuple[Row, ...]) -> None:
        """Other rows; what was chosen stays so where it still is."""
        keys = [entry.key for entry in self.entries]
        if self.rows.show(rows):
            self.choose(keys, scroll=False)
            self._settle.start(0)
            self.chosen()

    def choose(self, keys: Sequence[str], *, scroll: bool = True) -> None:
        """Those entries, the last of them current."""
        found = [index for index in map(self.rows.find, keys) if index.isValid()]
        selection = self.selectionModel()
        for index in found:
            selection.select(index, selection.SelectionFlag.Select)
        if found:
            selection.setCurrentIndex(found[-1], selection.SelectionFlag.NoUpdate)
            if scroll:
                self.scrollTo(self._heading(found[-1].row()))
                self.scrollTo(found[-1])

    def _heading(self, number: int) -> QModelIndex:
        """The heading over a material in the first row below it; else the material itself."""
        near = range(number - 1, max(number - self.cells.columns, 0) - 1, -1)
        above = next((i for i in near if self.rows.rows[i].title), number)
        return self.rows.index(above)

    def choose_first(self) -> None:
        """The first material, as the keys do that lead here from the search."""
        keys = [row.entry.key for row in self.rows.rows if row.entry is not None][:1]
        if keys and not self.entries:
            self.choose(keys)

    def redraw(self, key: str) -> None:
        """The picture of one entry has come."""
        index = self.rows.find(key)
        if index.isValid():
            self.update(index)

    def rename(self) -> None:
        """Type another name for the current one."""
        index = self.currentIndex()
        if index.isValid() and self.rows.flags(index) & Qt.ItemFlag.ItemIsEditable:
            self.edit(index)

    # geometry and keys

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Another number of columns."""
        across = self.viewport().width() - 1
        if across != self.cells.across:
            self.cells.across = across
            self.scheduleDelayedItemsLayout()
        super().resizeEvent(event)
        self._settle.start(0)

    def minimumSizeHint(self) -> QSize:
        """One column."""
        return QSize(BALL + 60, self.minimumHeight())

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Home and End lead to materials, not to headings."""
        key = event.key()
        editing = self.state() == self.State.EditingState
        if key == Qt.Key.Key_Delete and self.entries and not editing:
            self.remove()
        elif key in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and self.entries and not editing:
            self.activate()
        elif key in (Qt.Key.Key_Home, Qt.Key.Key_End) and self._to_end(key == Qt.Key.Key_End):
            event.accept()
        else:
            super().keyPressEvent(event)

    def _to_end(self, last: bool) -> bool:
        keys = [row.entry.key for row in self.rows.rows if row.entry is not None]
        if not keys:
            return False
        self.clearSelection()
        self.choose([keys[-1 if last else 0]])
        if not last:
            self.scrollToTop()
        return True

    def _tell_seen(self) -> None:
        frame = self.viewport().rect()
        found = []
        for number, row in enumerate(self.rows.rows):
            if row.entry is not None and frame.intersects(self._place(number)):
                found.append(row.entry.key)
        self.seen(frozenset(found))

    def _place(self, number: int) -> QRect:
        return self.visualRect(self.rows.index(number))

    # dragging

    def startDrag(self, supportedActions: Qt.DropAction) -> None:
        """The ball goes with the mouse, so that what is below can be seen."""
        index = self.currentIndex()
        entry = self.rows.entry(index)
        if entry is None or entry.kept is None:
            return
        drag = QDrag(self)
        drag.setMimeData(self.rows.mimeData([index]))
        drag.setPixmap(self.cells.shown(entry).pixmap(QSize(BALL // 2, BALL // 2)))
        drag.setHotSpot(QPoint(-6, -6))
        drag.exec(Qt.DropAction.CopyAction)

    def dragEnterEvent(self, event: QDragMoveEvent) -> None:
        """Materials of the scene, and files of materials."""
        self.dragMoveEvent(event)

    def dragMoveEvent(self, event: QDragMoveEvent) -> None:
        """The same all over the view."""
        if _dropped(event) is None:
            event.ignore()
            return
        event.setDropAction(Qt.DropAction.CopyAction)
        event.accept()

    def dropEvent(self, event: QDropEvent) -> None:
        """They are kept for all projects."""
        found = _dropped(event)
        if found is None:
            event.ignore()
            return
        event.setDropAction(Qt.DropAction.CopyAction)
        event.accept()
        if isinstance(found, str):
            QTimer.singleShot(0, self, lambda: self.keep(found))
        else:
            QTimer.singleShot(0, self, lambda: self.put(found))


def _dropped(event: QDropEvent) -> MaterialId | list[Path] | None:
    """A material of the scene, or files of materials and nothing else."""
    material = dragged_material(event.mimeData())
    if material is not None:
        return material
    urls = event.mimeData().urls()
    paths = [Path(url.toLocalFile()) for url in urls if url.isLocalFile()]
    fitting = bool(paths) and len(paths) == len(urls) and all(p.suffix.lower() == SUFFIX for p in paths)
    return paths if fitting else None


__all__ = ["LibraryView"]
