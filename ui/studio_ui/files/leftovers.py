"""What a session that ended badly left: both versions, how they look and how they differ."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtGui import QImage

from studio_core.errors import ProjectError
from studio_core.project.outline import Outline, outline
from studio_core.project.recovery import Recovery, find_recovery, find_unsaved
from studio_ui.files.thumbnails import Thumbnails


@dataclass(frozen=True)
class Leftover:
    """A recovery with what a person needs to choose; an outline is None where a version cannot be read."""

    found: Recovery
    recovered: Outline | None = None
    saved: Outline | None = None
    recovered_image: QImage | None = None
    saved_image: QImage | None = None

    @property
    def name(self) -> str:
        """Of the project."""
        return self.found.project.stem if self.found.project is not None else "Never saved"

    def difference(self) -> str:
        """How the recovered version differs from the saved one, in a sentence; empty when in nothing told."""
        if self.recovered is None or self.saved is None:
            return ""
        parts = []
        kinds = {**self.saved.nodes, **self.recovered.nodes}
        for kind in kinds:
            change = self.recovered.nodes.get(kind, 0) - self.saved.nodes.get(kind, 0)
            if change:
                word = _KINDS.get(kind, kind.replace("_", " "))
                parts.append(f"{counted(abs(change), word)} {_way(change)}")
        change = self.recovered.materials - self.saved.materials
        if change:
            parts.append(f"{counted(abs(change), 'material')} {_way(change)}")
        return f"The recovered version has {', '.join(parts)}." if parts else ""


_KINDS = {"mesh": "object", "point_lamp": "lamp", "spot_lamp": "spot lamp", "directional_lamp": "sun"}


def counted(number: int, what: str) -> str:
    """`1 object`, `1,200 objects`."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def _way(change: int) -> str:
    return "more" if change > 0 else "fewer"


def beside(project: Path, thumbnails: Thumbnails) -> Leftover | None:
    """What can be recovered of a project; for the files' thread, once the project's lock is held."""
    found = find_recovery(project)
    return None if found is None else _told(found, thumbnails)


def never_saved(state: Path, thumbnails: Thumbnails) -> list[Leftover]:
    """What can be recovered of documents without a file, the newest first."""
    return [_told(found, thumbnails) for found in find_unsaved(state)]


def _told(found: Recovery, thumbnails: Thumbnails) -> Leftover:
    recovered = _outline(found.path) if found.recovered is not None else None
    saved = _outline(found.project) if found.project is not None and found.saved is not None else None
    return Leftover(
        found,
        recovered,
        saved,
        thumbnails.find(found.path),
        thumbnails.find(found.project) if found.project is not None else None,
    )


def _outline(path: Path) -> Outline | None:
    with contextlib.suppress(ProjectError):
        return outline(path)
    return None
