"""The dialogs that answer `Ask`, and Help's windows."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QButtonGroup,
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QLabel,
    QMessageBox,
    QPlainTextEdit,
    QRadioButton,
    QSplitter,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from studio_core.project.recovery import Recovery
from studio_core.registry import PluginHost
from studio_ui.ask import UNITS, Filter, Recover, Unsaved
from studio_ui.panels.panel import heading, note

_GUESS = ((0.2, 5.0), (0.05, 15.0))  # metres that the longest side of furniture probably has


class Dialogs:
    """Satisfies `ask.Ask` with dialogs over a window."""

    def __init__(self, parent: QWidget) -> None:
        self._parent = parent
        self._folder = str(Path.home())

    def unsaved(self, name: str) -> Unsaved:
        """Save, discard or cancel."""
        box = QMessageBox(self._parent)
        box.setIcon(QMessageBox.Icon.Question)
        box.setWindowTitle("Unsaved changes")
        box.setText(f"Save the changes to {name}?")
        box.setInformativeText("Without saving, what was changed since the last save is lost.")
        kinds = QMessageBox.StandardButton
        box.setStandardButtons(kinds.Save | kinds.Discard | kinds.Cancel)
        box.setDefaultButton(kinds.Save)
        answers: dict[int, Unsaved] = {kinds.Save.value: "save", kinds.Discard.value: "discard"}
        return answers.get(box.exec(), "cancel")

    def recover(self, found: Recovery) -> Recover:
        """Both versions, with their times."""
        box = QMessageBox(self._parent)
        box.setIcon(QMessageBox.Icon.Question)
        box.setWindowTitle("Recover")
        box.setText("The program ended without saving everything.")
        name = found.project.name if found.project is not None else "A project that was never saved"
        lines = [name]
        if found.recovered is not None:
            lines.append(f"Recovered version: {_when(found.recovered.time)}")
        lines.append(
            f"Saved version: {_when(found.saved.time)}" if found.saved else "There is no saved version."
        )
        box.setInformativeText("\n".join(lines))
        recovered = box.addButton("Open the recovered version", QMessageBox.ButtonRole.AcceptRole)
        saved = None
        if found.saved is not None:
            saved = box.addButton("Open the saved version", QMessageBox.ButtonRole.DestructiveRole)
        box.addButton("Decide later", QMessageBox.ButtonRole.RejectRole)
        box.setDefaultButton(recovered)
        box.exec()
        if box.clickedButton() is recovered:
            return "recovered"
        return "saved" if saved is not None and box.clickedButton() is saved else "later"

    def read_only(self, problem: str) -> bool:
        """Open it all the same, without being able to save over it?"""
        kinds = QMessageBox.StandardButton
        answer = QMessageBox.question(
            self._parent, "Open read-only", f"{problem}.\n\nOpen it read-only?", kinds.Open | kinds.Cancel
        )
        return answer == kinds.Open

    def unit(self, name: str, size: tuple[float, float, float], question: str) -> float | None:
        """The unit, with what the size would be in each."""
        dialog = UnitDialog(self._parent, name, size, question)
        accepted = dialog.exec()
        chosen = dialog.chosen()
        dialog.deleteLater()
        return chosen if accepted else None

    def open_files(self, title: str, filters: Sequence[Filter], *, many: bool = False) -> list[Path]:
        """Files to read."""
        text = ";;".join([*(f.text() for f in filters), "All files (*)"])
        if many:
            names, _ = QFileDialog.getOpenFileNames(self._parent, title, self._folder, text)
        else:
            name, _ = QFileDialog.getOpenFileName(self._parent, title, self._folder, text)
            names = [name] if name else []
        if names:
            self._folder = str(Path(names[0]).parent)
        return [Path(name) for name in names]

    def save_file(self, title: str, suggested: Path, filters: Sequence[Filter]) -> Path | None:
        """A file to write."""
        text = ";;".join(f.text() for f in filters)
        name, chosen = QFileDialog.getSaveFileName(self._parent, title, str(suggested), text)
        if not name:
            return None
        path = Path(name)
        known = tuple(e for f in filters for e in f.extensions)
        if path.suffix.lower() not in known:
            suffix = next((f.extensions[0] for f in filters if f.text() == chosen), known[0])
            path = path.with_name(path.name + suffix)
        return path

    def folder(self, title: str) -> Path | None:
        """A folder to write into."""
        name = QFileDialog.getExistingDirectory(self._parent, title, self._folder)
        return Path(name) if name else None


class UnitDialog(QDialog):
    """Which unit a model's file has; the likeliest is chosen."""

    def __init__(
        self, parent: QWidget | None, name: str, size: tuple[float, float, float], question: str
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Size of the model")
        column = QVBoxLayout(self)
        column.setSpacing(8)
        column.addWidget(heading(f"Which unit does {name} have?"))
        column.addWidget(note(question))
        self._group = QButtonGroup(self)
        self._units = list(UNITS.values())
        guess = likely_unit(size)
        for index, (unit, factor) in enumerate(UNITS.items()):
            width, depth, height = (f"{side * factor:.3g}" for side in size)
            button = QRadioButton(f"{unit.capitalize()}:  {width} × {depth} × {height} m")
            button.setChecked(factor == guess)
            self._group.addButton(button, index)
            column.addWidget(button)
        column.addWidget(note("Width × depth × height"))
        kinds = QDialogButtonBox.StandardButton
        buttons = QDialogButtonBox(kinds.Ok | kinds.Cancel)
        buttons.button(kinds.Ok).setText("Import")
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        column.addWidget(buttons)

    def chosen(self) -> float:
        """Metres of the chosen unit."""
        return self._units[self._group.checkedId()]


class PluginsDialog(QDialog):
    """Help ▸ Plugins: what is there, and what failed with its traceback."""

    def __init__(self, parent: QWidget | None, host: PluginHost) -> None:
        super().__init__(parent)
        self.setWindowTitle("Plugins")
        self.resize(640, 440)
        self.tree = QTreeWidget()
        self.tree.setHeaderLabels(["Plugin", "Provides"])
        self.tree.setRootIsDecorated(False)
        self.detail = QPlainTextEdit()
        self.detail.setReadOnly(True)
        for plugin in host.plugins:
            kinds = [f"{kind}: {', '.join(names)}" for kind, names in plugin.provides.items()]
            self.tree.addTopLevelItem(QTreeWidgetItem([plugin.label or plugin.id, "; ".join(kinds)]))
        for failure in host.failures:
            item = QTreeWidgetItem([f"{failure.plugin} (failed)", failure.what])
            item.setData(0, Qt.ItemDataRole.UserRole, failure.traceback)
            self.tree.addTopLevelItem(item)
        self.tree.resizeColumnToContents(0)
        self.tree.currentItemChanged.connect(
            lambda item, _: self.detail.setPlainText(item.data(0, Qt.ItemDataRole.UserRole) or "")
        )
        split = QSplitter(Qt.Orientation.Vertical)
        split.addWidget(self.tree)
        split.addWidget(self.detail)
        split.setSizes([280, 140])
        column = QVBoxLayout(self)
        if not host.failures:
            column.addWidget(QLabel("All plugins that were needed so far have loaded."))
        column.addWidget(split)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        buttons.rejected.connect(self.reject)
        column.addWidget(buttons)


class KeysDialog(QDialog):
    """Help ▸ Keys and mouse."""

    def __init__(self, parent: QWidget | None, keys: Sequence[tuple[str, str]]) -> None:
        super().__init__(parent)
        self.setWindowTitle("Keys and mouse")
        self.resize(520, 560)
        tree = QTreeWidget()
        tree.setHeaderLabels(["What", "How"])
        tree.setRootIsDecorated(False)
        for what, how in keys:
            tree.addTopLevelItem(QTreeWidgetItem([what, how]))
        tree.resizeColumnToContents(0)
        column = QVBoxLayout(self)
        column.addWidget(tree)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        buttons.rejected.connect(self.reject)
        column.addWidget(buttons)


def likely_unit(size: tuple[float, float, float]) -> float:
    """Metres of the unit in which the longest side is most like furniture's."""
    for low, high in _GUESS:
        for factor in UNITS.values():
            if low <= max(size) * factor <= high:
                return factor
    return 1.0


def _when(seconds: float) -> str:
    return time.strftime("%d %B %Y, %H:%M:%S", time.localtime(seconds))
