"""File ▸ Earlier versions: what was saved, when, and what had been done."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QHeaderView,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from studio_core.project.outline import Outline
from studio_ui.files.leftovers import counted
from studio_ui.files.recent import when_title
from studio_ui.panels.panel import note


class VersionsDialog(QDialog):
    """`chosen` is the version to open as a copy."""

    def __init__(self, parent: QWidget | None, name: str, found: Sequence[Outline]) -> None:
        super().__init__(parent)
        self.setWindowTitle(f"Versions of {name}")
        self.resize(620, 400)
        self._found = list(found)
        self.tree = QTreeWidget()
        self.tree.setAccessibleName("Saved versions, the newest first")
        self.tree.setHeaderLabels(["Saved", "In it", "Done last"])
        self.tree.setRootIsDecorated(False)
        self.tree.setUniformRowHeights(True)
        for index, one in enumerate(self._found):
            saved = when_title(one.revision.time) + ("  (newest)" if index == 0 else "")
            item = QTreeWidgetItem([saved, counted(one.objects, "object"), ", ".join(one.steps)])
            item.setToolTip(2, "\n".join(one.steps))
            self.tree.addTopLevelItem(item)
        for column in (0, 1):
            self.tree.header().setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        buttons = QDialogButtonBox()
        self.open_button = buttons.addButton("Open as a copy", QDialogButtonBox.ButtonRole.AcceptRole)
        buttons.addButton("Cancel", QDialogButtonBox.ButtonRole.RejectRole)
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        self.tree.itemActivated.connect(lambda item, column: self.accept())
        self.tree.currentItemChanged.connect(lambda *_: self._follow())
        column = QVBoxLayout(self)
        column.addWidget(note("A version opens as a project of its own; this one stays as it is."))
        column.addWidget(self.tree, 1)
        column.addWidget(buttons)
        if self._found:
            self.tree.setCurrentItem(self.tree.topLevelItem(min(1, len(self._found) - 1)))
        self.tree.setFocus(Qt.FocusReason.OtherFocusReason)
        self._follow()

    @property
    def chosen(self) -> Outline | None:
        """The marked version."""
        index = self.tree.indexOfTopLevelItem(self.tree.currentItem()) if self.tree.currentItem() else -1
        return self._found[index] if index >= 0 else None

    def _follow(self) -> None:
        self.open_button.setEnabled(self.tree.currentItem() is not None)
