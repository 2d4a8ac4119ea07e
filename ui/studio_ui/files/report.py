"""What somebody who helps needs to know: versions, what failed, the traceback. Never sent by itself."""

from __future__ import annotations

import platform
import sys
import time
from importlib import metadata
from pathlib import Path

from PySide6.QtCore import Qt, qVersion
from PySide6.QtGui import QFontDatabase, QGuiApplication
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QLabel,
    QPlainTextEdit,
    QVBoxLayout,
    QWidget,
)

from studio_core import __version__

_LIBRARIES = ("PySide6-Essentials", "numpy", "numba", "embreex", "vispy", "trimesh", "OpenImageIO")


def versions() -> str:
    """The program, its libraries and the machine, a line each."""
    lines = [f"Lucarne {__version__}", f"Python {platform.python_version()}, Qt {qVersion()}"]
    found = []
    for name in _LIBRARIES:
        try:
            found.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            continue
    lines += [", ".join(found), f"{platform.platform()}, {QGuiApplication.platformName() or sys.platform}"]
    return "\n".join(lines)


def report_text(what: str, detail: str, moment: float | None = None) -> str:
    """All of it, ready to be pasted."""
    at = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(moment))
    return f"{what.strip()}\n({at})\n\n{versions()}\n\n{detail.strip()}\n"


def copy_text(text: str) -> None:
    """To the clipboard."""
    QGuiApplication.clipboard().setText(text)


class ReportDialog(QDialog):
    """A sentence, what to do, and the report in full."""

    def __init__(self, parent: QWidget | None, title: str, text: str, advice: str, report: str) -> None:
        super().__init__(parent)
        self.setWindowTitle(title)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.resize(680, 440)
        self.report = QPlainTextEdit(report)
        self.report.setReadOnly(True)
        self.report.setAccessibleName("Report")
        self.report.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self.report.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        column = QVBoxLayout(self)
        column.setSpacing(8)
        sentence = QLabel(text)
        sentence.setTextFormat(Qt.TextFormat.PlainText)
        sentence.setProperty("role", "title")
        hint = QLabel(advice)
        hint.setProperty("role", "dim")
        for label in (sentence, hint):
            label.setWordWrap(True)
            column.addWidget(label)
        hint.setVisible(bool(advice))
        column.addWidget(self.report, 1)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        kind = QDialogButtonBox.ButtonRole.ActionRole
        self.copy = buttons.addButton("Copy report", kind)
        self.save = buttons.addButton("Save report…", kind)
        self.copy.clicked.connect(lambda: copy_text(report))
        self.save.clicked.connect(lambda: self._save(report))
        buttons.rejected.connect(self.reject)
        buttons.button(QDialogButtonBox.StandardButton.Close).setDefault(True)
        column.addWidget(buttons)

    def _save(self, report: str) -> None:
        name, _ = QFileDialog.getSaveFileName(self, "Save report", str(Path.home() / "lucarne-report.txt"))
        if name:
            try:
                Path(name).write_text(report, "utf-8")
            except OSError as error:
                self.setWindowTitle(f"{Path(name).name} cannot be written: {error.strerror or error}")
