"""The command palette: every command of the menus, found by a few letters, run by Enter.

The menus are its only source: what another feature puts into a menu (cameras, samples, recent files,
panels, layouts) can be found here too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QAbstractListModel, QEvent, QModelIndex, QObject, QPersistentModelIndex, QPoint, Qt
from PySide6.QtGui import QAction, QKeyEvent
from PySide6.QtWidgets import QFrame, QLabel, QLineEdit, QListView, QMainWindow, QMenu, QMenuBar, QVBoxLayout

from studio_ui.palette import fuzzy
from studio_ui.palette.rows import RowDelegate
from studio_ui.settings import Settings

RECENT = 6
_WIDTH, _ROWS = 620, 12
_KEPT = "palette_recent"
ENTRY, HITS = Qt.ItemDataRole.UserRole, Qt.ItemDataRole.UserRole + 1
_KEYS = {Qt.Key.Key_Down: 1, Qt.Key.Key_Up: -1, Qt.Key.Key_PageDown: _ROWS - 1, Qt.Key.Key_PageUp: 1 - _ROWS}


@dataclass(frozen=True)
class Entry:
    """One command: `place` is its menu, `reason` says why it cannot be run now (empty when it can).

    `rank` is added to how well it fits; `kept` tells whether it is remembered among those used lately.
    """

    name: str
    title: str
    place: str
    run: Callable[[], object]
    shortcut: str = ""
    reason: str = ""
    hint: str = ""
    checked: bool = False
    rank: float = 0.0
    kept: bool = True

    @property
    def spoken(self) -> str:
        """What a screen reader says."""
        parts = (self.title, self.place, self.shortcut, self.reason and f"not now: {self.reason}")
        return ", ".join(part for part in parts if part)


Found = tuple[Entry, tuple[int, ...]]


def menu_entries(bar: QMenuBar, reasons: Mapping[QAction, tuple[str, str]]) -> list[Entry]:
    """What the menus offer now. `reasons`: an action's id, and why it is disabled if it is."""
    found = _walk(bar.actions(), "")
    # what is disabled and no action of the window is a remark, such as "None yet"
    return [_entry(a, place, reasons) for place, a in found if a.isEnabled() or a in reasons]


def _walk(actions: Iterable[QAction], place: str) -> Iterator[tuple[str, QAction]]:
    for action in actions:
        menu = action.menu()
        if isinstance(menu, QMenu):
            if menu.isEnabled():
                menu.aboutToShow.emit()  # menus whose entries change are filled now
                yield from _walk(menu.actions(), f"{place} ▸ {_plain(action.text())}".removeprefix(" ▸ "))
        elif not action.isSeparator() and action.isVisible() and action.text():
            yield place, action


def _entry(action: QAction, place: str, reasons: Mapping[QAction, tuple[str, str]]) -> Entry:
    title = _plain(action.text())
    name, reason = reasons.get(action, (f"{place} ▸ {title}", ""))
    shortcut = action.shortcut().toString(action.shortcut().SequenceFormat.NativeText)
    return Entry(
        name,
        title,
        place,
        action.trigger,
        shortcut,
        "" if action.isEnabled() else reason or "Cannot be done now",
        action.statusTip(),
        action.isCheckable() and action.isChecked(),
    )


def _plain(text: str) -> str:
    """Without the mark of the mnemonic."""
    return text.replace("&&", "\0").replace("&", "").replace("\0", "&")


def search(entries: Sequence[Entry], query: str, recent: Sequence[str] = ()) -> list[Found]:
    """The entries that fit, the best first; all of them, lately used ones first, when nothing is asked."""
    rank = {name: number for number, name in enumerate(recent)}
    if not query.strip():
        order = sorted(entries, key=lambda entry: rank.get(entry.name, len(rank)))
        return [(entry, ()) for entry in order]
    found: list[tuple[float, Found]] = []
    for entry in entries:
        text = f"{entry.title} {entry.place}"
        hit = fuzzy.match(query, text)
        score = 0.0
        if hit is not None:
            title = fuzzy.match(query, entry.title)
            score = hit.score + (10.0 if title is not None else 0.0)
        elif entry.hint and all(word in fuzzy.folded(entry.hint) for word in fuzzy.folded(query).split()):
            hit = fuzzy.Match(-10.0, ())  # what it does, where its name does not fit
            score = -10.0
        if hit is None:
            continue
        score += entry.rank + 2.0 * (entry.name in rank) - 3.0 * bool(entry.reason)
        found.append((score, (entry, tuple(i for i in hit.at if i < len(entry.title)))))
    found.sort(key=lambda pair: -pair[0])
    return [pair for _, pair in found]


class _Model(QAbstractListModel):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[Found] = []

    def show(self, found: list[Found]) -> None:
        self.beginResetModel()
        self.found = found
        self.endResetModel()

    def rowCount(self, parent: QModelIndex | QPersistentModelIndex = QModelIndex()) -> int:  # noqa: B008
        return 0 if parent.isValid() else len(self.found)

    def data(self, index: QModelIndex | QPersistentModelIndex, role: int = 0) -> object:
        entry, hits = self.found[index.row()]
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return entry.title
            case Qt.ItemDataRole.AccessibleTextRole:
                return entry.spoken
            case Qt.ItemDataRole.ToolTipRole:
                return entry.hint or None
            case int() if role == ENTRY:
                return entry
            case int() if role == HITS:
                return hits
        return None


class Palette(QFrame):
    """A popup over the top of a window. `sources` are asked each time it opens."""

    def __init__(
        self, window: QMainWindow, settings: Settings, sources: Sequence[Callable[[], Iterable[Entry]]]
    ) -> None:
        super().__init__(window, Qt.WindowType.Popup)
        self.setObjectName("palette")
        self.setAccessibleName("Find a command")
        self._window, self._settings, self._sources = window, settings, sources
        self._entries: list[Entry] = []
        self._model = _Model()
        self.edit, self.list, self._none = QLineEdit(), QListView(), QLabel("No command fits")
        self.edit.setPlaceholderText("Find a command")
        self.edit.setAccessibleName("Find a command")
        self.edit.textChanged.connect(self._search)
        self.edit.installEventFilter(self)
        self.list.setModel(self._model)
        self.list.setItemDelegate(RowDelegate(self.list, ENTRY, HITS))
        self.list.setAccessibleName("Commands")
        self.list.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.list.setUniformItemSizes(True)
        self.list.setMouseTracking(True)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.clicked.connect(self._run)
        self._none.setProperty("role", "dim")
        self._none.setContentsMargins(8, 8, 8, 8)
        column = QVBoxLayout(self)
        column.setContentsMargins(8, 8, 8, 8)
        column.setSpacing(6)
        for widget in (self.edit, self.list, self._none):
            column.addWidget(widget)

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {"help.palette": self.open}

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """None."""
        return {}

    def open(self) -> None:
        """Show it with nothing typed."""
        self._entries = [entry for source in self._sources for entry in source()]
        self.edit.clear()
        self._search("")
        width = min(_WIDTH, self._window.width() - 40)
        rows = min(_ROWS, max(len(self._entries), 1))
        self.list.setFixedHeight(rows * self.list.sizeHintForRow(0) + 2 * self.list.frameWidth())
        self.setFixedWidth(width)
        self.adjustSize()
        self.move(self._window.mapToGlobal(QPoint((self._window.width() - width) // 2, 60)))
        self.show()
        self.edit.setFocus(Qt.FocusReason.PopupFocusReason)

    @property
    def found(self) -> list[Entry]:
        """What is listed."""
        return [entry for entry, _ in self._model.found]

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Keys of the list while the cursor stays in the line."""
        if isinstance(event, QKeyEvent) and event.type() is QEvent.Type.KeyPress:
            key = Qt.Key(event.key())
            if key in _KEYS:
                self._go(_KEYS[key])
                return True
            if key in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
                self._run(self.list.currentIndex())
                return True
        return super().eventFilter(watched, event)

    def _search(self, query: str) -> None:
        recent = [name for name in self._settings.get(_KEPT, []) if isinstance(name, str)]
        self._model.show(search(self._entries, query, recent))
        self.list.setVisible(bool(self._model.found))
        self._none.setVisible(not self._model.found)
        self._go(0)

    def _go(self, by: int) -> None:
        count = len(self._model.found)
        if count:
            at = max(self.list.currentIndex().row(), 0) + by
            at = at % count if abs(by) == 1 else min(max(at, 0), count - 1)
            self.list.setCurrentIndex(self._model.index(at))

    def _run(self, index: QModelIndex) -> None:
        if not index.isValid():
            return
        entry, _ = self._model.found[index.row()]
        if entry.reason:
            return
        self.close()
        if entry.kept:
            before = [name for name in self._settings.get(_KEPT, []) if isinstance(name, str)]
            self._settings.set(_KEPT, list(dict.fromkeys([entry.name, *before]))[:RECENT])
        entry.run()
