"""Preferences ▸ Files: how much is kept on disk of what was computed, and a button that deletes it."""

from __future__ import annotations

import contextlib
from pathlib import Path

from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QWidget

from studio_core.shading.job import Job
from studio_ui.tasks import Tasks


class CachePart(QWidget):
    """Looks at `folder` on the files' thread."""

    def __init__(self, tasks: Tasks, folder: Path) -> None:
        super().__init__()
        self._tasks, self._folder = tasks, folder
        self.told = QLabel()
        self.clear = QPushButton("Delete what was computed")
        self.clear.setToolTip("Projects lose nothing; the next pictures take longer")
        self.clear.setAutoDefault(False)
        self.clear.clicked.connect(self._clear)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(self.told, 1)
        row.addWidget(self.clear)

    def refresh(self) -> None:
        """Look how much there is."""
        self.told.setText("Looking how much is kept…")
        self._tasks.run(
            "Looking at the cache", lambda job: size_of(self._folder, job), self._show, quiet=True
        )

    def _clear(self) -> None:
        self.clear.setEnabled(False)
        self._tasks.run("Deleting what was computed", lambda job: empty(self._folder, job), self._show)

    def _show(self, size: int) -> None:
        with contextlib.suppress(RuntimeError):  # the dialog may have gone
            self.told.setText(f"{size / 2**20:,.0f} MB are kept." if size else "Nothing is kept.")
            self.clear.setEnabled(size > 0)


def size_of(folder: Path, job: Job) -> int:
    """Bytes of the files under a folder."""
    total = 0
    for path in folder.rglob("*"):
        job.checkpoint()
        with contextlib.suppress(OSError):
            if path.is_file() and not path.is_symlink():
                total += path.stat().st_size
    return total


def empty(folder: Path, job: Job) -> int:
    """Delete the kept arrays under a folder, and nothing else; bytes that are left."""
    for path in folder.rglob("*.npz"):
        job.checkpoint()
        with contextlib.suppress(OSError):
            path.unlink()
    return size_of(folder, job)
