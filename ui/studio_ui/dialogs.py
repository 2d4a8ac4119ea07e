"""The dialogs that answer `Ask`, and Help's windows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QInputDialog,
    QMessageBox,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from studio_core.project.lock import Holder
from studio_core.project.outline import Outline
from studio_ui.ask import Filter, LeftoverChoice, Recover, Unsaved
from studio_ui.files.import_dialog import ImportDialog
from studio_ui.files.import_question import ImportChoice, ImportQuestion
from studio_ui.files.leftovers import Leftover
from studio_ui.files.recovery_dialog import LeftoversDialog, RecoveryDialog
from studio_ui.files.versions_dialog import VersionsDialog


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
        return self._sure(
            QMessageBox.Icon.Warning,
            "Open for saving",
            f"Is {name} really not open on {holder.host} any more?",
            "If it is, whoever saves last overwrites what the other one did.",
            ("Open for saving", QMessageBox.ButtonRole.AcceptRole),
        )

    def version(self, name: str, found: Sequence[Outline]) -> Outline | None:
        """One of the saved versions."""
        dialog = VersionsDialog(self._parent, name, found)
        accepted = dialog.exec()
        dialog.deleteLater()
        return dialog.chosen if accepted else None

    def compact(self, name: str, versions: int) -> bool:
        """Whether earlier versions may go."""
        what = {0: "There is no earlier version", 1: "One earlier version goes"}
        text = what.get(versions, f"{versions} earlier versions go")
        return self._sure(
            QMessageBox.Icon.Question,
            "Compact project",
            f"Save {name} and make its file smaller?",
            f"{text}; the undo history stays.",
            ("Compact", QMessageBox.ButtonRole.AcceptRole),
        )

    def delete(self, name: str) -> bool:
        """Whether something goes for good."""
        return self._sure(
            QMessageBox.Icon.Warning,
            "Delete for good",
            f"Delete {name} for good?",
            "There is no trash here that could keep it.",
            ("Delete", QMessageBox.ButtonRole.DestructiveRole),
        )

    def _sure(
        self,
        icon: QMessageBox.Icon,
        title: str,
        text: str,
        more: str,
        button: tuple[str, QMessageBox.ButtonRole],
    ) -> bool:
        """Whether the button is pressed; Enter and Escape cancel."""
        box = QMessageBox(self._parent)
        box.setIcon(icon)
        box.setWindowTitle(title)
        box.setText(text)
        box.setInformativeText(more)
        chosen = box.addButton(*button)
        box.setDefaultButton(box.addButton(QMessageBox.StandardButton.Cancel))
        box.exec()
        return box.clickedButton() is chosen

    def import_options(self, question: ImportQuestion) -> ImportChoice | None:
        """Unit, axis and place, with a preview beside a person."""
        dialog = ImportDialog(self._parent, question)
        accepted = dialog.exec()
        choice = dialog.choice()
        dialog.deleteLater()
        return choice if accepted else None

    def photograph(self, name: str) -> bool:
        """Whether a picture without bright lights will do."""
        box = QMessageBox(self._parent)
        box.setIcon(QMessageBox.Icon.Question)
        box.setWindowTitle("Light from a photograph")
        box.setText(f"Light the room with {name}?")
        box.setInformativeText("It holds no bright light as HDR pictures do: shadows will be soft.")
        use = box.addButton("Light the room", QMessageBox.ButtonRole.AcceptRole)
        box.addButton(QMessageBox.StandardButton.Cancel)
        box.setDefaultButton(use)
        box.exec()
        return box.clickedButton() is use

    def capture(self, count: int) -> bool:
        """Whether these are a room's photographs."""
        box = QMessageBox(self._parent)
        box.setIcon(QMessageBox.Icon.Question)
        box.setWindowTitle("Capture a room's light")
        box.setText(f"Capture the room's light from {count} photograph{'s' * (count > 1)}?")
        box.setInformativeText(
            "They should show one room at several exposures: to the front and to the back through a fisheye, "
            "or all around. The project keeps them without their position."
        )
        use = box.addButton("Capture", QMessageBox.ButtonRole.AcceptRole)
        box.addButton(QMessageBox.StandardButton.Cancel)
        box.setDefaultButton(use)
        box.exec()
        return box.clickedButton() is use

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

    def text(self, title: str, label: str, suggested: str) -> str | None:
        """A short text."""
        found, accepted = QInputDialog.getText(self._parent, title, label, text=suggested)
        return found if accepted else None

    def folder(self, title: str) -> Path | None:
        """A folder to write into."""
        name = QFileDialog.getExistingDirectory(self._parent, title, self._folder)
        return Path(name) if name else None


class KeysDialog(QDialog):
    """Help ▸ Keys and mouse."""

    def __init__(self, parent: QWidget | None, keys: Sequence[tuple[str, str]]) -> None:
        super().__init__(parent)
        self.setWindowTitle("Keys and mouse")
        self.resize(760, 600)
        tree = QTreeWidget()
        tree.setAccessibleName("Keys and mouse")
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
