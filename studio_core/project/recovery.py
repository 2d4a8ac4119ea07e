"""Autosave: when it is due, where it goes, and what is offered after a crash.

A recovery file is a project file of its own, whole and readable without the project it stands beside. It is
removed after a good save or when it is no longer wanted; one that is found on opening means that the
program ended without either.
"""

from __future__ import annotations

import secrets
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studio_core.errors import ProjectError
from studio_core.project.faults import explained
from studio_core.project.lock import holder_of
from studio_core.project.place import flush_folder
from studio_core.project.records import History, Revision, SaveReport
from studio_core.project.schema import journal_of
from studio_core.project.store import newest, save
from studio_core.scene.nodes import Scene

_SPARE = 256 << 20
_UNSAVED = "unsaved-*.lucarne-recovery"


class Autosaver:
    """Says when to autosave; whoever owns the clock and the thread asks it. Times in seconds, any origin.

    An edit is due `interval` after the first one that is not kept yet, so that with `interval` = 1 and
    saves shorter than a second at most two seconds of work are lost. After a failure it waits longer each
    time, up to a minute; `problem` then says what failed.
    """

    def __init__(self, interval: float = 1.0) -> None:
        self.interval = interval
        self.problem = ""
        self._edited: float | None = None
        self._running: float | None = None
        self._wait = 0.0

    def changed(self, now: float) -> None:
        """The document changed."""
        if self._edited is None:
            self._edited = now

    def next_due(self) -> float | None:
        """When to start the next autosave; None while there is nothing to keep or one is running."""
        if self._edited is None or self._running is not None:
            return None
        return self._edited + max(self.interval, self._wait)

    def due(self, now: float) -> bool:
        """Whether to start one now."""
        at = self.next_due()
        return at is not None and now >= at

    def started(self, now: float) -> None:
        """An autosave of the document as it is now was started; later edits wait for the next one."""
        self._running, self._edited = now, None

    def done(self) -> None:
        """It succeeded."""
        self._running, self._wait, self.problem = None, 0.0, ""

    def failed(self, now: float, problem: str) -> None:
        """It failed; what it held is still to be kept."""
        self._running, self._edited = None, now
        self._wait = min(60.0, max(5.0, 2 * self._wait))
        self.problem = problem

    def saved(self) -> None:
        """The project itself was saved or closed: nothing is left to keep."""
        self._edited = None
        self.done()


class RecoveryFile:
    """Where one open document is autosaved; `project` is its file, None while it was never saved."""

    def __init__(self, path: Path, project: Path | None = None) -> None:
        self.path = path
        self._project = project
        self._whole_bytes = 0

    def write(
        self,
        scene: Scene,
        *,
        label: str = "Autosave",
        history: History | None = None,
        session: Mapping[str, Any] | None = None,
        time: float | None = None,
    ) -> SaveReport:
        """Autosave: only what is new since the last one; ProjectError when it fails."""
        with explained(self.path, "written"):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            mine = self._whole_bytes > 0 and self.path.exists()
            fresh = not mine or self.path.stat().st_size > 2 * self._whole_bytes + _SPARE
        base = self._project if not mine and self._project and self._project.exists() else None
        while True:
            try:
                report = save(
                    self.path,
                    scene,
                    label=label,
                    history=history,
                    session=session,
                    fresh=fresh,
                    keep_revisions=False,
                    time=time,
                    base=base,
                )
                break
            except ProjectError:
                if base is None:
                    raise
                base = None  # the project itself may be what is damaged
        if report.whole:
            self._whole_bytes = self.path.stat().st_size
        return report

    def discard(self) -> None:
        """Remove the file, after a good save or when it is not wanted."""
        self._whole_bytes = 0
        discard(self.path)


@dataclass(frozen=True)
class Recovery:
    """What is left of a session that ended badly: the newest revision of the project (None: never saved or
    unreadable) and of the recovery file (None: unreadable, `problem` says why).
    """

    path: Path
    project: Path | None
    saved: Revision | None
    recovered: Revision | None
    problem: str = ""


def recovery_path(project: Path) -> Path:
    """The recovery file beside a project."""
    project = project.resolve()
    return project.with_name(f".{project.name}.recovery")


def unsaved_path(state: Path) -> Path:
    """A new recovery file in the user's state folder, for a document that was never saved.

    Lock it (`lock.acquire`) while the document is open, so that no other instance offers it.
    """
    return state / _UNSAVED.replace("*", secrets.token_hex(6))


def find_recovery(project: Path) -> Recovery | None:
    """What can be recovered beside a project; None when there is nothing that the project does not have.

    To be asked after the project's lock was taken: otherwise the file may be another instance's.
    """
    path = recovery_path(project)
    if not path.exists():
        return None
    saved: Revision | None = None
    if project.exists():
        with suppress(ProjectError):
            saved = newest(project)
    found = _found(path, project.resolve(), saved)
    if saved is not None and found.recovered is not None and found.recovered.scene == saved.scene:
        return None
    return found


def find_unsaved(state: Path) -> list[Recovery]:
    """What can be recovered of documents that were never saved and that no running program has open."""
    paths = sorted(state.glob(_UNSAVED)) if state.is_dir() else []
    found = [_found(path, None, None) for path in paths if holder_of(path) is None]
    return sorted(found, key=lambda r: r.recovered.time if r.recovered else 0.0, reverse=True)


def _found(path: Path, project: Path | None, saved: Revision | None) -> Recovery:
    try:
        return Recovery(path, project, saved, newest(path))
    except ProjectError as error:
        return Recovery(path, project, saved, None, str(error))


def discard(path: Path) -> None:
    """Remove a recovery file; ProjectError when it cannot be removed. None there is no error."""
    with explained(path, "removed"):
        path.unlink(missing_ok=True)
        journal_of(path).unlink(missing_ok=True)
        if path.parent.is_dir():
            flush_folder(path.parent)
