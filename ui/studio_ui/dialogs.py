"""The dialogs that answer `Ask`, and Help's windows."""

from __future__ import annotations

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

from studio_core.project.lock import Holder
from studio_core.project.outline import Outline
from studio_core.registry import PluginHost
from studio_ui.ask import UNITS, Filter, LeftoverChoice, Recover, Unsaved
from studio_ui.files.leftovers import Leftover
from studio_ui.files.recovery_dialog import LeftoversDialog, RecoveryDialog
from studio_ui.files.versions_dialog import VersionsDialog
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

    def recover(self, found: Leftover) -> Recover:
        """Both versions, with their pictures and times."""
        dialog = RecoveryDialog(self._parent, found)
        dialog.exec()
        dialog.deleteLater()
        return dialog.answer

    def leftovers(self, found: Sequence[Leftover]) -> LeftoverChoice:
        """Documents that were never saved."""
        dialog = LeftoversDialog(self._parent, found)
        dialog.exec()
        dialog.deleteLater()
        return dialog.choice

    def take_over(self, name: str, holder: Holder) -> bool:
        """Whether the other machine really has it open no more."""
        box = QMessageBox(self._parent)
        box.setIcon(QMessageBox.Icon.Warning)
        box.setWindowTitle("Open for saving")
        box.setText(f"Is {name} really not open on {holder.host} any more?")
        box.setInformativeText("If it is, whoever saves last overwrites what the other one did.")
        take = box.addButton("Open for saving", QMessageBox.ButtonRole.AcceptRole)
        box.setDefaultButton(box.addButton(QMessageBox.StandardButton.Cancel))
        box.exec()
        return box.clickedButton() is take

    def version(self, name: str, found: Sequence[Outline]) -> Outline | None:
        """One of the saved versions."""
        dialog = VersionsDialog(self._parent, name, found)
        accepted = dialog.exec()
        dialog.deleteLater()
        return dialog.chosen if accepted else None

    def compact(self, name: str, versions: int) -> bool:
        """Whether earlier versions may go."""
        box = QMessageBox(self._parent)
        box.setIcon(QMessageBox.Icon.Question)
        box.setWindowTitle("Compact project")
        what = {0: "There is no earlier version", 1: "One earlier version goes"}
        box.setText(f"Save {name} and make its file smaller?")
        text = what.get(versions, f"{versions} earlier versions go")
        box.setInformativeText(f"{text}; the undo history stays.")
        shrink = box.addButton("Compact", QMessageBox.ButtonRole.AcceptRole)
        box.setDefaultButton(box.addButton(QMessageBox.StandardButton.Cancel))
        box.exec()
        return box.clickedButton() is shrink

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
