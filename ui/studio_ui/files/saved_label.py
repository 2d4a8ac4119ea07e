"""In the status bar: whether the latest work is saved, and where."""

from __future__ import annotations

import time

from PySide6.QtWidgets import QLabel

from studio_ui.context import Subscriptions
from studio_ui.files.keeper import Kept
from studio_ui.files.project_files import ProjectFiles
from studio_ui.look.role import set_role


class SavedLabel(QLabel):
    """`Saved 14:32`, `Autosaved 14:33`, `Not saved`."""

    def __init__(self, files: ProjectFiles) -> None:
        super().__init__()
        self._files = files
        self.setAccessibleName("Saved")
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            files.changed.connect(self.refresh),
            files.opened.connect(self.refresh),
            files.keeper.changed.connect(self.refresh),
        )
        self.refresh()

    def close_panel(self) -> None:
        """Stop listening."""
        self._subscriptions.close()

    def refresh(self) -> None:
        """Follow files and autosaves."""
        text, tip, role = told(self._files.keeper.kept, self._files.modified, self._files.read_only)
        if self.text() != text or self.property("role") != role:
            self.setText(text)
            set_role(self, role)
        self.setToolTip(tip)


def told(kept: Kept, modified: bool, read_only: bool) -> tuple[str, str, str]:
    """Text, tooltip and role."""
    clock = time.strftime("%H:%M", time.localtime(kept.time))
    if kept.where == "failed" and modified:
        return "Autosave failed", kept.problem, "problem"
    if not modified:
        if kept.where == "saved":
            return f"Saved {clock}", "All changes are in the project's file", ""
        return (
            ("Read-only", "The project cannot be saved where it is", "warning") if read_only else ("", "", "")
        )
    if kept.where == "autosaved":
        tip = "Kept beside the project, in case the program or the machine fails; save to keep it for good"
        return f"Autosaved {clock}", tip, ""
    return "Not saved", "The latest changes are not in the project's file yet", ""
