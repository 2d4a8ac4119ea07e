"""What a project file holds beside items: revisions, the undo history, the session."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

from studio_core.arrays import frozen_map
from studio_core.document import Step
from studio_core.scene.nodes import Scene


class StepLike(Protocol):
    """One entry of the undo history: what was done and the scene it gave."""

    @property
    def label(self) -> str:
        """What was done."""

    @property
    def scene(self) -> Scene:
        """The scene afterwards."""


@dataclass(frozen=True)
class History:
    """The document's steps, the opening first, and the index of the one that is shown."""

    steps: Sequence[StepLike]
    position: int


@dataclass(frozen=True)
class Revision:
    """One save. `time` is in seconds since 1970 (UTC); `scene` is the scene's digest."""

    id: int
    parent: int | None
    label: str
    time: float
    scene: str
    history: str | None = None
    session: str | None = None


class SavedStep:
    """A step of a saved history; its scene is put together when it is first asked for."""

    def __init__(self, label: str, digest: str, compose: Callable[[str], Scene]) -> None:
        self.label = label
        self.digest = digest
        self._compose = compose

    @cached_property
    def scene(self) -> Scene:
        """The scene after the step; ProjectError when its items do not fit together."""
        return self._compose(self.digest)


@dataclass(frozen=True)
class SavedHistory:
    """The undo history of a file: `steps[position].scene` is the scene that was saved."""

    steps: tuple[SavedStep, ...]
    position: int

    def opened(self) -> tuple[tuple[Step, ...], int]:
        """All steps with their scenes, and the position: what `Document.restore` takes."""
        return tuple(Step(step.label, step.scene) for step in self.steps), self.position


@dataclass(frozen=True)
class LoadedProject:
    """A project as it was read: everything checked, equal meshes and pictures one object.

    `notes` are sentences for the person who opens it; `format` is that of the file.
    """

    path: Path
    scene: Scene
    revision: Revision
    revisions: tuple[Revision, ...]
    history: SavedHistory | None
    session: Mapping[str, Any] = field(default_factory=frozen_map)
    notes: tuple[str, ...] = ()
    format: int = 1


@dataclass(frozen=True)
class SaveReport:
    """What a save did: the revision, the new rows, their bytes, and whether the whole file was rewritten."""

    revision: int
    rows: int
    bytes: int
    whole: bool


@dataclass(frozen=True)
class ProjectInfo:
    """What is in a file, without opening its arrays. Sizes in bytes."""

    path: Path
    format: int
    program: str
    file_bytes: int
    array_bytes: int
    arrays: int
    items: int
    revisions: tuple[Revision, ...]
    steps: int
    nodes: Mapping[str, int]
    materials: Mapping[str, int]
    opened_by: str | None
