"""Library: the materials that are kept for all projects, with pictures, to be searched and used."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QEvent, QObject, QPoint, QSize, Qt, QUrl
from PySide6.QtGui import QDesktopServices, QIcon, QKeyEvent, QResizeEvent, QShowEvent
from PySide6.QtWidgets import QLineEdit, QMenu, QPushButton, QToolButton, QWidget

from studio_core.library.shelf import Entry, matching
from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.nodes import Material, MaterialId, Scene
from studio_ui.context import Context
from studio_ui.library.cells import BALL
from studio_ui.library.library import MaterialLibrary, with_key
from studio_ui.library.model import rows_of
from studio_ui.library.tag_bar import TagBar, kinds_first
from studio_ui.library.taking import Taking
from studio_ui.library.view import LibraryView
from studio_ui.look.theme import GAP, Theme
from studio_ui.material_view.thumbnails import MaterialThumbnails
from studio_ui.material_view.work import PreviewWork
from studio_ui.panels.panel import Panel, note, row
from studio_ui.panels.swatch import swatch

_LOW = 300  # pixels
_DOWN = (Qt.Key.Key_Down, Qt.Key.Key_Return, Qt.Key.Key_Enter)


class LibraryPanel(Panel):
    """A double click gives a material to what is chosen, or adds it to the scene where nothing is."""

    id = "library"
    title = "Library"

    def __init__(self, context: Context, library: MaterialLibrary, taking: Taking, work: PreviewWork) -> None:
        super().__init__(context)
        self.library, self.taking = library, taking
        self.thumbnails = MaterialThumbnails(context, work, BALL, neutral=True)
        self.thumbnails.came = lambda material: self.view.redraw(material)
        self.search = QLineEdit()
        self.search.setPlaceholderText("Find by name or tag")
        self.search.setAccessibleName("Find in the library")
        self.search.setClearButtonEnabled(True)
        self.search.textChanged.connect(lambda _: self.refresh())
        self.search.installEventFilter(self)
        self.tags = TagBar()
        self.tags.changed = self.refresh
        self.view = LibraryView(self._picture)
        self.view.activate = lambda: taking.use(self.view.entries)
        self.view.remove = lambda: library.remove(self.view.entries)
        self.view.chosen = self._offer
        self.view.keep = self._keep
        self.view.put = library.import_files
        self.view.seen = self.thumbnails.only
        self.view.rows.renamed = library.rename
        self.view.customContextMenuRequested.connect(self._menu)
        self.nothing = QWidget()
        self.why = note("")
        everything = QPushButton("Show all materials")
        everything.clicked.connect(self.show_all)
        empty = self.column_of(self.nothing)
        empty.addWidget(self.why)
        empty.addLayout(row(everything))
        empty.addStretch(1)
        self.told = note("")
        self.use = QPushButton("Add to scene")
        self.use.clicked.connect(self.view.activate)
        self.column.addLayout(row(self.search, self._more(), stretch=0))
        self.column.addWidget(self.tags)
        self.column.addWidget(self.view, 1)
        self.column.addWidget(self.nothing, 1)
        self.column.addWidget(self.told)
        self.column.addWidget(self.use)
        self._awaited: set[Path] = set()
        self._low = False
        self.subscriptions.add(
            library.changed.connect(self._changed),
            library.came.connect(self._came),
            library.opened.connect(self.show_all),
            context.document.changed.connect(self._edited),
            context.session.selected.connect(self._offer),
            context.session.displayed.connect(self._redraw),
            context.editing.settled.connect(self._redraw),
            context.warmed.connect(self._redraw),
        )
        self.refresh()

    def _more(self) -> QToolButton:
        made = self.tool("add", "Put materials into the library")
        menu = QMenu(made)
        menu.addAction("Import…", self.library.ask_import).setToolTip(
            "Materials of .lucmat files, measured ones, and those of models"
        )
        menu.addAction("Keep the scene's materials", self._keep_all)
        menu.addSeparator()
        menu.addAction("Show my materials' folder", self._show_folder)
        made.setMenu(menu)
        made.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        return made

    def set_theme(self, theme: Theme) -> None:
        """Other colours."""
        super().set_theme(theme)
        self.view.set_theme(theme)

    # what is shown

    def minimumSizeHint(self) -> QSize:
        """Search, and some of the materials."""
        high = sum(part.minimumSizeHint().height() for part in (self.search, self.view)) + 3 * GAP
        return QSize(self.view.minimumSizeHint().width() + 2 * GAP, high)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Where it is low, all that keys and menus do as well makes room."""
        super().resizeEvent(event)
        if self._low != (event.size().height() < _LOW):
            self._low = not self._low
            self.tags.setVisible(not self._low)
            self.use.setVisible(not self._low)
            self._offer()

    def showEvent(self, event: QShowEvent) -> None:
        """Look what other programs did to the folder."""
        super().showEvent(event)
        self.library.read()

    def changeEvent(self, event: QEvent) -> None:
        """The same when the person comes back from them."""
        super().changeEvent(event)
        if event.type() is QEvent.Type.ActivationChange and self.isVisible() and self.isActiveWindow():
            self.library.read()

    def refresh(self) -> None:
        """What is found by the text and the tags."""
        text, tags = self.search.text(), self.tags.chosen
        found = matching(self.library.entries, text, tags)
        searched = bool(text.strip() or tags)
        self.tags.show_tags(kinds_first(found))
        self.view.show_rows(rows_of(found, all_of_them=not searched))
        self.view.setVisible(bool(found) or not searched)
        self.nothing.setVisible(searched and not found)
        if not found:
            named = f" is called “{text.strip()}”" if text.strip() else ""
            tagged = f" has the tag{'s' * (len(tags) > 1)} {' and '.join(tags)}" if tags else ""
            self.why.setText(f"No material{named}{' and' * bool(named and tagged)}{tagged}.")
        self._offer()

    def show_all(self) -> None:
        """Forget what was searched."""
        self.tags.clear()
        self.search.clear()
        self.refresh()
        self.view.setFocus()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """From the search down to what was found."""
        if watched is self.search and event.type() is QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            if event.key() in _DOWN and self.view.isVisible():
                self.view.choose_first()
                self.view.setFocus()
                return True
            if event.key() == Qt.Key.Key_Escape and self.search.text():
                self.search.clear()
                return True
        return super().eventFilter(watched, event)

    def _changed(self) -> None:
        self.refresh()
        self._show_awaited()

    def _came(self, paths: tuple[Path, ...]) -> None:
        self._awaited = set(paths)
        self._show_awaited()

    def _show_awaited(self) -> None:
        """What was put on the shelf is chosen when it is listed."""
        keys = [e.key for e in self.library.entries if e.path is not None and e.path in self._awaited]
        if keys:
            self._awaited.clear()
            self.view.clearSelection()
            self.view.choose(keys)

    def _picture(self, entry: Entry) -> QIcon:
        ratio = self.view.devicePixelRatioF()
        material = with_key(entry)
        if material is None:
            return QIcon()
        whole = None if entry.whole else lambda: self._whole(entry)
        return self.thumbnails.icon(material, ratio, whole, entry.stamp) or swatch(material, ratio, BALL)

    def _whole(self, entry: Entry) -> Material:
        return self.library.shelf.fetch(entry).material

    def _redraw(self) -> None:
        self.view.viewport().update()

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if changes.aspects & (Aspect.STRUCTURE | Aspect.NAME):
            self._offer()

    def _offer(self) -> None:
        """What can be done with what is chosen, and what it is."""
        entries, whom = self.view.entries, self.taking.whom
        good = [entry for entry in entries if entry.kept is not None]
        one = entries[-1] if entries else None
        self.use.setEnabled(bool(good))
        self.use.setText(f"Give to {whom}" if whom and good else "Add to scene")
        self.use.setToolTip("Or double-click it, or drag it onto an object in the picture")
        if one is None:
            self.told.setText("")
        elif one.kept is None:
            self.told.setText(one.problem)
        elif len(entries) > 1:
            self.told.setText(f"{len(entries)} materials")
        else:
            self.told.setText(" · ".join(part for part in (one.kept.about, ", ".join(one.tags)) if part))
        self.told.setVisible(bool(self.told.text()) and not self._low)

    # what is done

    def keep(self, materials: tuple[MaterialId, ...]) -> None:
        """Put materials of the scene on the shelf."""
        scene = self.context.document.scene
        self.library.keep([scene.materials[m] for m in materials if m in scene.materials])

    def _keep(self, material: MaterialId) -> None:
        self.keep((material,))

    def _keep_all(self) -> None:
        self.keep(tuple(self.context.document.scene.materials))

    def _show_folder(self) -> None:
        folder = self.library.shelf.folder
        if folder.is_dir():
            QDesktopServices.openUrl(QUrl.fromLocalFile(str(folder)))
        else:
            self.context.journal.write("There are no materials of your own yet.")

    def menu(self) -> QMenu:
        """What can be done with the chosen ones."""
        made = QMenu(self)
        made.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        library, entries = self.library, self.view.entries
        good = tuple(entry for entry in entries if entry.kept is not None)
        own = tuple(entry for entry in entries if entry.path is not None)
        if good:
            made.addAction("Add to scene", lambda: self.taking.add(good))
            give = made.addAction("Use for selection", lambda: self.taking.use(good[-1:]))
            give.setEnabled(bool(self.taking.whom))
            made.addSeparator()
            if len(own) == len(entries) == len(good) == 1:
                made.addAction("Rename\tF2", self.view.rename)
            if own and all(entry in good for entry in own):
                made.addAction("Edit tags…" if len(own) == 1 else "Add tags…", lambda: library.ask_tags(own))
            made.addAction("Copy to my materials", lambda: library.copy(good))
            made.addAction("Export…", lambda: library.export(good))
        if own:
            path = own[-1].path
            assert path is not None
            made.addAction("Show file", lambda: self._show_file(path))
            made.addSeparator()
            made.addAction("Delete\tDel", lambda: library.remove(own))
        if entries:
            made.addSeparator()
        made.addAction("Import…", library.ask_import)
        return made

    def _show_file(self, path: Path) -> None:
        QDesktopServices.openUrl(QUrl.fromLocalFile(str(path.parent)))

    def _menu(self, place: QPoint) -> None:
        self.menu().popup(self.view.viewport().mapToGlobal(place))


__all__ = ["LibraryPanel"]
