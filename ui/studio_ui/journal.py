"""What the program has to say: notes and problems in a designer's words, kept for the log panel."""

from __future__ import annotations

import time
import traceback
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from studio_core.errors import LucarneError
from studio_core.signal import Signal

Level = Literal["note", "warning", "problem"]


def cause_of(error: BaseException) -> str:
    """Its first line, or of one that says nothing its kind."""
    told = str(error).strip()
    return told.splitlines()[0] if told else type(error).__name__


@dataclass(frozen=True)
class Entry:
    """One line; `detail` is for whoever looks closer (a traceback)."""

    level: Level
    text: str
    detail: str
    time: float


class Journal:
    """`added(entry)` after every line. The window's thread only."""

    def __init__(self, limit: int = 500) -> None:
        self.entries: deque[Entry] = deque(maxlen=limit)
        self.added: Signal[[Entry]] = Signal()
        self.cleared: Signal[[]] = Signal()
        self.seen: Signal[[]] = Signal()
        self._unseen: Counter[Level] = Counter()
        self.blame: Callable[[str, BaseException], str] = lambda doing, error: ""
        """Notes an error where a plugin made it; the plugin's name, or nothing."""

    def write(self, text: str, level: Level = "note", detail: str = "") -> None:
        """Add a line."""
        entry = Entry(level, text, detail, time.time())
        self.entries.append(entry)
        self._unseen[level] += 1
        self.added.emit(entry)

    def problem(self, doing: str, error: BaseException) -> str:
        """Add what went wrong while `doing`; the sentence that was written.

        Errors made for people are shown as they stand, others are introduced and kept as a traceback.
        """
        if isinstance(error, LucarneError):
            text = str(error)
        else:
            plugin = self.blame(doing, error)
            fault = f"the plugin {plugin}" if plugin else "the program or a plugin"
            text = f"{doing} did not work because of a fault in {fault} ({cause_of(error)})."
        self.write(text, "problem", "".join(traceback.format_exception(error)))
        return text

    def unseen(self, level: Level) -> int:
        """How many lines of a level nobody has looked at."""
        return self._unseen[level]

    def see(self) -> None:
        """Somebody looks at the lines."""
        if self._unseen.total():
            self._unseen.clear()
            self.seen.emit()

    def clear(self) -> None:
        """Forget all lines."""
        self.entries.clear()
        self.cleared.emit()
        self.see()
