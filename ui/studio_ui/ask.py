"""Questions to the person, as a protocol: dialogs answer in the program, tests answer in tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from studio_core.project.lock import Holder
from studio_core.project.outline import Outline
from studio_ui.files.import_question import ImportChoice, ImportQuestion
from studio_ui.files.leftovers import Leftover

Unsaved = Literal["save", "discard", "cancel"]
Recover = Literal["recovered", "saved", "later"]


@dataclass(frozen=True)
class Filter:
    """Files by extension: `.glb`, lower case."""

    label: str
    extensions: tuple[str, ...]

    def text(self) -> str:
        """As file dialogs want it."""
        return f"{self.label} ({' '.join('*' + e for e in self.extensions)})"


@dataclass(frozen=True)
class LeftoverChoice:
    """What to open of several leftovers, and which nobody wants; all others wait for another time."""

    open: Leftover | None = None
    discard: tuple[Leftover, ...] = ()


class Ask(Protocol):
    """Every answer may be None or "cancel": nothing happens then."""

    def unsaved(self, name: str) -> Unsaved:
        """What to do with changes that are in no file."""
        ...

    def recover(self, found: Leftover) -> Recover:
        """Which version to open after the program ended badly."""
        ...

    def leftovers(self, found: Sequence[Leftover]) -> LeftoverChoice:
        """Which of the documents to open that were never saved when the program ended badly."""
        ...

    def take_over(self, name: str, holder: Holder) -> bool:
        """Whether to disregard the lock of another machine, which may be at work on the project."""
        ...

    def version(self, name: str, found: Sequence[Outline]) -> Outline | None:
        """Which saved version to open as a copy; the newest is first."""
        ...

    def compact(self, name: str, versions: int) -> bool:
        """Whether to drop a project's earlier versions for good."""
        ...

    def delete(self, name: str) -> bool:
        """Whether to delete files for good that no trash takes."""
        ...

    def import_options(self, question: ImportQuestion) -> ImportChoice | None:
        """Unit, axis and place of a model that comes in."""
        ...

    def photograph(self, name: str) -> bool:
        """Whether an ordinary picture that reaches all around is to light the scene."""
        ...

    def capture(self, count: int) -> bool:
        """Whether so many photographs are those of a room, whose light they are to become."""
        ...

    def open_files(self, title: str, filters: Sequence[Filter], *, many: bool = False) -> list[Path]:
        """Files to read."""
        ...

    def save_file(self, title: str, suggested: Path, filters: Sequence[Filter]) -> Path | None:
        """A file to write; whether it may be replaced has been asked."""
        ...

    def text(self, title: str, label: str, suggested: str) -> str | None:
        """A name or another short text."""
        ...

    def folder(self, title: str) -> Path | None:
        """A folder to write into."""
        ...
