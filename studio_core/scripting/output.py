"""What a command prints: handed on as it comes, up to a limit."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TextIO

MOST = 200_000  # characters of one command
LINE = 4_000  # characters handed on of one line


class Limited:
    """A stream that hands text to `write` and counts what is beyond the limit.

    What other threads print meanwhile, or `write` itself, goes to `beside`.
    """

    def __init__(self, write: Callable[[str], object], beside: TextIO | None, most: int = MOST) -> None:
        self._write, self._beside, self._left = write, beside, most
        self._thread = threading.get_ident()
        self._column = 0
        self._busy = False
        self.dropped = 0

    encoding = "utf-8"

    def flush(self) -> None:
        """Nothing is held back."""

    def isatty(self) -> bool:
        """No."""
        return False

    def write(self, text: str) -> int:
        """Hand on what the limit leaves room for."""
        if self._busy or threading.get_ident() != self._thread:
            return self._beside.write(text) if self._beside is not None else len(text)
        kept = self._shortened(text[: self._left])
        self.dropped += max(0, len(text) - self._left)
        self._left -= min(len(text), self._left)
        if kept:
            self._busy = True
            try:
                self._write(kept)
            finally:
                self._busy = False
        return len(text)

    def _shortened(self, text: str) -> str:
        """Without the ends of lines that nobody could read."""
        made = []
        for line in text.splitlines(keepends=True):
            end = "\n" if line.endswith("\n") else ""
            body = line.removesuffix("\n")
            room = max(0, LINE - self._column)
            if len(body) > room:
                body = body[:room] + (" …" if room else "")
            made.append(body + end)
            self._column = 0 if end else self._column + len(line)
        return "".join(made)
