"""A project as it is opened, and why it may not be saved where it is."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path

from studio_core.document import Step
from studio_core.errors import ProjectError
from studio_core.project.lock import Holder, LockedError, ProjectLock, acquire
from studio_core.project.records import LoadedProject
from studio_core.project.recovery import discard
from studio_core.project.store import load
from studio_ui.files.leftovers import Leftover


@dataclass(frozen=True)
class ReadOnly:
    """Why a project cannot be saved where it is: somebody has it open (`holder`, on another machine when
    `foreign`), its folder refuses (`problem`), or it was asked for (neither).
    """

    holder: Holder | None = None
    foreign: bool = False
    problem: str = ""


@dataclass(frozen=True)
class Opened:
    """What was read, with the lock or why there is none, and what an earlier session left."""

    loaded: LoadedProject
    steps: tuple[Step, ...]
    position: int
    lock: ProjectLock | None = None
    leftover: Leftover | None = None
    read_only: ReadOnly | None = None


def locked(path: Path) -> tuple[ProjectLock | None, ReadOnly | None]:
    """The lock, or why there is none; a missing file is for whoever reads it to tell."""
    try:
        return acquire(path), None
    except LockedError as error:
        return None, ReadOnly(error.holder, error.foreign, str(error))
    except ProjectError as error:
        return None, ReadOnly(problem=str(error))


def read(path: Path, revision: int | None = None) -> Opened:
    """A project (or an earlier revision of it) with its undo history; ProjectError when it cannot be read."""
    loaded = load(path, revision=revision)
    if loaded.history is None:
        return Opened(loaded, (Step("Open", loaded.scene),), 0)
    steps, position = loaded.history.opened()
    return Opened(loaded, steps, position)


def forget(path: Path) -> None:
    """Remove a recovery file that nobody wants."""
    with contextlib.suppress(ProjectError):
        discard(path)
