"""What the window remembers: a small JSON file in the user's state folder."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any

import platformdirs

from studio_core.signal import Signal

RECENT = 12


def state_folder() -> Path:
    """Where the window keeps its own things; LUCARNE_STATE says otherwise."""
    chosen = os.environ.get("LUCARNE_STATE")
    return Path(chosen) if chosen else platformdirs.user_state_path("lucarne", appauthor=False)


class Settings:
    """A mapping that is written when it changes. A damaged or unwritable file is as good as none."""

    def __init__(self, folder: Path) -> None:
        self.changed: Signal[[str]] = Signal()  # the name of what has another value
        self.folder = folder
        self._file = folder / "window.json"
        self._values: dict[str, Any] = {}
        with contextlib.suppress(OSError, ValueError, RecursionError):
            found = json.loads(self._file.read_text("utf-8"))
            self._values = found if isinstance(found, dict) else {}

    def get(self, name: str, default: Any = None) -> Any:
        """What was remembered, if it is of the default's type."""
        found = self._values.get(name, default)
        return found if default is None or isinstance(found, type(default)) else default

    def set(self, name: str, value: Any) -> None:
        """Remember; None forgets."""
        if self._values.get(name) == value:
            return
        if value is None:
            self._values.pop(name, None)
        else:
            self._values[name] = value
        with contextlib.suppress(OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
            fresh = self._file.with_suffix(".new")
            fresh.write_text(json.dumps(self._values, indent=1), "utf-8")
            fresh.replace(self._file)
        self.changed.emit(name)

    @property
    def recent(self) -> list[Path]:
        """Projects opened lately, the newest first."""
        return [Path(name) for name in self.get("recent", []) if isinstance(name, str)]

    def opened(self, path: Path) -> None:
        """Put a project first among the recent ones."""
        names = [str(path.absolute()), *(str(p) for p in self.recent)]
        self.set("recent", list(dict.fromkeys(names))[:RECENT])

    def forget(self, path: Path) -> None:
        """Take a project off the list."""
        self.set("recent", [str(p) for p in self.recent if p != path])
