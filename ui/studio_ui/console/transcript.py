"""What was typed and what came of it, coloured by what it is; the oldest lines go."""

from __future__ import annotations

from collections import deque
from typing import Literal

from PySide6.QtGui import QColor, QFontDatabase, QTextCharFormat, QTextCursor
from PySide6.QtWidgets import QPlainTextEdit

from studio_ui.look.theme import DARK, Theme

Role = Literal["command", "output", "error", "note"]
LINES, PIECES = 5_000, 20_000


class Transcript(QPlainTextEdit):
    """Text by roles. `add` keeps what it is given until `flush` shows it, so that a flood costs little."""

    def __init__(self) -> None:
        super().__init__()
        self.setReadOnly(True)
        self.setMaximumBlockCount(LINES)
        self.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self.setAccessibleName("Console output")
        self.setUndoRedoEnabled(False)
        self._theme = DARK
        self._pieces: deque[tuple[Role, str]] = deque(maxlen=PIECES)
        self._waiting: list[tuple[Role, str]] = []
        self._joint = False  # the last line is unfinished
        self._due = ""  # the last line's end, so that no empty line is shown under it

    def add(self, text: str, role: Role) -> None:
        """Text as it comes."""
        if self._waiting and self._waiting[-1][0] == role:
            text = self._waiting.pop()[1] + text
        self._waiting.append((role, text))

    def line(self, text: str, role: Role) -> None:
        """Text on lines of its own."""
        self.add(("\n" if self._unfinished() else "") + text.rstrip("\n") + "\n", role)

    def flush(self) -> None:
        """Show what came."""
        waiting, self._waiting = self._waiting, []
        if not waiting:
            return
        self._joint = not waiting[-1][1].endswith("\n")
        self._pieces.extend(waiting)
        bar = self.verticalScrollBar()
        follow = bar.value() >= bar.maximum() - 2
        self._write(waiting)
        if follow:
            self._to_end()

    def set_theme(self, theme: Theme) -> None:
        """The same text in other colours."""
        self._theme = theme
        self._due = ""
        super().clear()
        self._write(list(self._pieces))
        self._to_end()

    def forget(self) -> None:
        """Show nothing."""
        self._pieces.clear()
        self._waiting.clear()
        self._joint, self._due = False, ""
        self.clear()

    def _unfinished(self) -> bool:
        return not self._waiting[-1][1].endswith("\n") if self._waiting else self._joint

    def _write(self, pieces: list[tuple[Role, str]]) -> None:
        theme = self._theme
        colours = {"command": theme.accent, "output": theme.text, "error": theme.problem, "note": theme.dim}
        cursor = QTextCursor(self.document())
        cursor.movePosition(QTextCursor.MoveOperation.End)
        for role, text in pieces:
            style = QTextCharFormat()
            style.setForeground(QColor(colours[role]))
            text, self._due = self._due + text, ""
            if text.endswith("\n"):
                text, self._due = text[:-1], "\n"
            cursor.insertText(text, style)

    def _to_end(self) -> None:
        if not self.textCursor().hasSelection():
            self.moveCursor(QTextCursor.MoveOperation.End)
            self.moveCursor(QTextCursor.MoveOperation.StartOfLine)
