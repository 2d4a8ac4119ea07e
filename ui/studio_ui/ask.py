"""Questions to the person, as a protocol: dialogs answer in the program, tests answer in tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from studio_core.project.recovery import Recovery

Unsaved = Literal["save", "discard", "cancel"]
Recover = Literal["recovered", "saved", "later"]
UNITS = {"metres": 1.0, "centimetres": 0.01, "millimetres": 0.001, "inches": 0.0254, "feet": 0.3048}


@dataclass(frozen=True)
class Filter:
    """Files by extension: `.glb`, lower case."""

    label: str
    extensions: tuple[str, ...]

    def text(self) -> str:
        """As file dialogs want it."""
        return f"{self.label} ({' '.join('*' + e for e in self.extensions)})"


class Ask(Protocol):
    """Every answer may be None or "cancel": nothing happens then."""

    def unsaved(self, name: str) -> Unsaved:
        """What to do with changes that are in no file."""
        ...

    def recover(self, found: Recovery) -> Recover:
        """Which version to open after the program ended badly."""
        ...

    def read_only(self, problem: str) -> bool:
        """Whether to open a project read-only that somebody else has open."""
        ...

    def unit(self, name: str, size: tuple[float, float, float], question: str) -> float | None:
        """Metres of a file's unit; `size` is width, depth, height at 1."""
        ...

    def open_files(self, title: str, filters: Sequence[Filter], *, many: bool = False) -> list[Path]:
        """Files to read."""
        ...

    def save_file(self, title: str, suggested: Path, filters: Sequence[Filter]) -> Path | None:
        """A file to write; whether it may be replaced has been asked."""
        ...

    def folder(self, title: str) -> Path | None:
        """A folder to write into."""
        ...
