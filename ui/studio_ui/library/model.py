"""Rows of the library's view: a heading for every kind, then its materials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QAbstractListModel, QMimeData, QModelIndex, QPersistentModelIndex, Qt

from studio_core.library.shelf import Entry, folded
from studio_ui.objects.material_drag import LIBRARY_MIME, entry_data

Index = QModelIndex | QPersistentModelIndex
ROW = int(Qt.ItemDataRole.UserRole)
OWN = "My materials"
_ROOT = QModelIndex()
_NONE_YET = "None yet. Drag a material from the Materials panel here, or import one."


@dataclass(frozen=True)
class Row:
    """A material, or a heading (`title`) with how many are below it, or a remark (`note`)."""

    entry: Entry | None = None
    title: str = ""
    count: int = 0
    note: str = ""


def rows_of(entries: Sequence[Entry], *, all_of_them: bool) -> tuple[Row, ...]:
    """One's own first, then what is built in by kind: the first tag; by name in each.

    `all_of_them`: nothing is searched, so it is said how one's own come there.
    """
    groups: dict[str, list[Entry]] = {OWN: []}
    for entry in entries:
        kind = OWN if entry.path is not None else entry.tags[0].capitalize() if entry.tags else "Other"
        groups.setdefault(kind, []).append(entry)
    made: list[Row] = []
    for title, found in groups.items():
        if found or all_of_them:
            made.append(Row(title=title, count=len(found)))
        if not found and all_of_them:
            made.append(Row(note=_NONE_YET))
        made += [Row(entry) for entry in sorted(found, key=lambda one: (folded(one.name), one.key))]
    return tuple(made)


class LibraryModel(QAbstractListModel):
    """`renamed(entry, name)` when one of one's own is given another name in place."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: tuple[Row, ...] = ()
        self.renamed: Callable[[Entry, str], object] = lambda entry, name: None

    def show(self, rows: tuple[Row, ...]) -> bool:
        """Other rows; False where they are the same."""
        if rows == self.rows:
            return False
        self.beginResetModel()
        self.rows = rows
        self.endResetModel()
        return True

    def entry(self, index: Index) -> Entry | None:
        """The material of a row."""
        return self.rows[index.row()].entry if index.isValid() else None

    def find(self, key: str) -> QModelIndex:
        """The row of an entry; invalid where it is not shown."""
        found = (i for i, row in enumerate(self.rows) if row.entry is not None and row.entry.key == key)
        number = next(found, -1)
        return self.index(number) if number >= 0 else _ROOT

    def rowCount(self, parent: Index = _ROOT) -> int:
        """Headings count."""
        return 0 if parent.isValid() else len(self.rows)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Names, and what is said about them."""
        row = self.rows[index.row()]
        roles = Qt.ItemDataRole
        if role == ROW:
            return row
        if role in (roles.DisplayRole, roles.EditRole):
            return row.entry.name if row.entry is not None else row.title or row.note
        if role == roles.AccessibleTextRole:
            return _spoken(row)
        if role in (roles.ToolTipRole, roles.AccessibleDescriptionRole) and row.entry is not None:
            return told(row.entry)
        return None

    def setData(self, index: Index, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        """Another name; the row follows when its file has it."""
        entry = self.entry(index)
        if entry is None or role != Qt.ItemDataRole.EditRole:
            return False
        self.renamed(entry, str(value).strip())
        return True

    def flags(self, index: Index) -> Qt.ItemFlag:
        """Headings are no place to be."""
        entry = self.entry(index)
        flag = Qt.ItemFlag
        if entry is None:
            return flag.ItemNeverHasChildren
        made = flag.ItemIsEnabled | flag.ItemIsSelectable | flag.ItemNeverHasChildren
        if entry.kept is not None:
            made |= flag.ItemIsDragEnabled
            if entry.path is not None:
                made |= flag.ItemIsEditable
        return made

    def mimeTypes(self) -> list[str]:
        """One material of the library."""
        return [LIBRARY_MIME]

    def mimeData(self, indexes: Sequence[QModelIndex]) -> QMimeData:
        """The last of them."""
        found = [self.entry(index) for index in indexes]
        return entry_data(next((one.key for one in reversed(found) if one is not None), ""))

    def supportedDragActions(self) -> Qt.DropAction:
        """It stays in the library."""
        return Qt.DropAction.CopyAction


def told(entry: Entry) -> str:
    """What is said about an entry, in lines."""
    if entry.kept is None:
        return f"{entry.name}\n{entry.problem}"
    lines = [entry.name, entry.kept.about, ", ".join(entry.tags)]
    if entry.path is not None:
        lines.append(str(entry.path))
    return "\n".join(line for line in lines if line)


def _spoken(row: Row) -> str:
    if row.entry is None:
        return f"{row.title}, {row.count}" if row.title else row.note
    if row.entry.kept is None:
        return f"{row.entry.name}, cannot be read"
    return row.entry.name


__all__ = ["OWN", "ROW", "LibraryModel", "Row", "rows_of", "told"]
