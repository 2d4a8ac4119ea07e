"""The shelf of environments as a list of thumbnails; the one that lights the scene is marked."""

from __future__ import annotations

from PySide6.QtCore import QPoint, QSignalBlocker, QSize, Qt
from PySide6.QtGui import QColor, QIcon, QPainter, QPen, QPixmap, QResizeEvent
from PySide6.QtWidgets import QListView, QListWidget, QListWidgetItem, QMenu

from studio_ui.look.theme import DARK, Theme
from studio_ui.panels.environment_shelf import Entry, EnvironmentShelf

_ICON = QSize(108, 54)
_GRID = QSize(118, 80)
_MOST = 3  # rows before it scrolls
_ROLE = Qt.ItemDataRole.UserRole


class ShelfList(QListWidget):
    """A click, or Enter, lights the scene with an environment."""

    def __init__(self, shelf: EnvironmentShelf) -> None:
        super().__init__()
        self._shelf = shelf
        self._theme = DARK
        self._shown: tuple[tuple[Entry, str, bool], ...] = ()
        self.setAccessibleName("Environments")
        self.setViewMode(QListView.ViewMode.IconMode)
        self.setResizeMode(QListView.ResizeMode.Adjust)
        self.setMovement(QListView.Movement.Static)
        self.setUniformItemSizes(True)
        self.setWordWrap(False)
        self.setIconSize(_ICON)
        self.setGridSize(_GRID)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._fit()
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.customContextMenuRequested.connect(self._menu)
        self.itemClicked.connect(self._light)
        self.itemActivated.connect(self._light)

    def set_theme(self, theme: Theme) -> None:
        """Another colour of the mark."""
        self._theme, self._shown = theme, ()
        self.refresh()

    def refresh(self) -> None:
        """What the shelf has now."""
        shelf = self._shelf
        shown = tuple(
            (
                entry,
                shelf.thumbnails[entry.id].key if entry.id in shelf.thumbnails else "",
                shelf.is_current(entry),
            )
            for entry in shelf.entries
        )
        if shown == self._shown:
            return
        self._shown = shown
        current_item = self.currentItem()
        at = current_item.data(_ROLE).id if current_item is not None else None
        with QSignalBlocker(self):
            self.clear()
            for entry, _, current in shown:
                item = QListWidgetItem(self._icon(entry, current), entry.name)
                item.setData(_ROLE, entry)
                item.setToolTip(self._tip(entry, current))
                item.setTextAlignment(Qt.AlignmentFlag.AlignHCenter)
                if current:
                    font = item.font()
                    font.setBold(True)
                    item.setFont(font)
                self.addItem(item)
            ids = [entry.id for entry, _, _ in shown]
            self.setCurrentRow(ids.index(at) if at in ids else -1)
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Another width: another number of columns."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """As high as its rows, up to some."""
        across = max(self.viewport().width() // _GRID.width(), 1)
        rows = min(max(-(-self.count() // across), 1), _MOST)
        self.setFixedHeight(rows * _GRID.height() + 8)

    def _tip(self, entry: Entry, current: bool) -> str:
        thumbnail = self._shelf.thumbnails.get(entry.id)
        lines = [entry.name, thumbnail.size if thumbnail is not None else "Reading…"]
        if entry.path is not None:
            lines.append(str(entry.path))
        return "\n".join([*lines, "It lights the scene" if current else "Click to light the scene with it"])

    def _icon(self, entry: Entry, current: bool) -> QIcon:
        ratio = self.devicePixelRatioF()
        pixmap = QPixmap(_ICON * ratio)
        pixmap.fill(Qt.GlobalColor.transparent)
        painter = QPainter(pixmap)
        thumbnail = self._shelf.thumbnails.get(entry.id)
        if thumbnail is not None:
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
            painter.drawImage(pixmap.rect(), thumbnail.image)
        else:
            painter.fillRect(pixmap.rect(), QColor(self._theme.border))
        if current:
            painter.setPen(QPen(QColor(self._theme.accent), 4 * ratio))
            painter.drawRect(pixmap.rect())
        painter.end()
        pixmap.setDevicePixelRatio(ratio)
        made = QIcon(pixmap)
        made.addPixmap(pixmap, QIcon.Mode.Selected)  # not tinted
        return made

    def _light(self, item: QListWidgetItem) -> None:
        entry = item.data(_ROLE)
        if not self._shelf.is_current(entry):
            self._shelf.light(entry)

    def _menu(self, place: QPoint) -> None:
        item = self.itemAt(place)
        entry = item.data(_ROLE) if item is not None else None
        if entry is None or entry.path is None or entry.sample:
            return
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction("Light the scene with it", lambda: self._shelf.light(entry))
        menu.addAction("Take off the list", lambda: self._shelf.forget(entry))
        menu.popup(self.viewport().mapToGlobal(place))
