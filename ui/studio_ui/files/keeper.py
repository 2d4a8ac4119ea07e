"""Autosave: a recovery file beside the project (or in the state folder) while something is in no file."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from studio_core.errors import LucarneError
from studio_core.project.lock import ProjectLock, acquire
from studio_core.project.records import History
from studio_core.project.recovery import Autosaver, RecoveryFile, discard, recovery_path, unsaved_path
from studio_core.shading.job import Job
from studio_core.shading.scheduler import Executor
from studio_core.signal import Signal
from studio_ui.context import Context
from studio_ui.files.session_form import session_form
from studio_ui.files.thumbnails import Thumbnails

_PICTURE_EVERY = 20.0  # seconds between pictures of a version that is autosaved


@dataclass(frozen=True)
class Kept:
    """What the status bar says: where the latest work is, and since when (seconds since 1970)."""

    where: Literal["nowhere", "saved", "autosaved", "failed"] = "nowhere"
    time: float = 0.0
    problem: str = ""


class Keeper:
    """Writes the recovery file of one document; `changed()` when `kept` is another."""

    def __init__(self, context: Context, executor: Executor, state: Path, thumbnails: Thumbnails) -> None:
        self.kept = Kept()
        self.changed: Signal[[]] = Signal()
        self.thumbnails = thumbnails
        self.autosaver = Autosaver()
        self._context, self._executor, self._state = context, executor, state
        self._file: RecoveryFile | None = None
        self._lock: ProjectLock | None = None
        self._leftover: Path | None = None  # a recovered file, kept until there is a newer one
        self._pictured = -_PICTURE_EVERY
        self._unpictured: Path | None = None

    @property
    def path(self) -> Path | None:
        """Where it autosaves."""
        return self._file.path if self._file is not None else None

    def edited(self, project: Path | None) -> None:
        """Something is to be kept; `project` is the document's own file (None: it has none)."""
        self.autosaver.changed(time.monotonic())
        if self._file is None:
            self.begin(project)
        if self.kept.where == "saved":
            self._tell(Kept())

    def begin(self, project: Path | None) -> None:
        """Another recovery file, written when it is first needed."""
        if project is not None:
            self._file = RecoveryFile(recovery_path(project), project)
            return
        path = unsaved_path(self._state)
        self._file = RecoveryFile(path)
        with contextlib.suppress(LucarneError, OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._lock = acquire(path)

    def saved(self, project: Path) -> None:
        """All of it is in the project's file."""
        self.drop()
        self.begin(project)
        self.autosaver.saved()
        self._tell(Kept("saved", time.time()))

    def left(self) -> None:
        """Another document comes: what is lost now was meant to be."""
        self.drop()
        self.autosaver.saved()
        self._tell(Kept())

    def hold(self, leftover: Path) -> None:
        """A recovered file is the only one of its kind until the next autosave."""
        self._leftover = leftover

    def drop(self) -> None:
        """Remove the recovery file, after what the files' thread still has to write."""
        self._drop_leftover()
        file, lock = self._file, self._lock
        self._file = self._lock = self._unpictured = None

        def remove() -> None:
            if file is not None:
                _quietly(file.discard)
                self.thumbnails.forget(file.path)
            if lock is not None:
                lock.release()

        self._executor.submit(remove)

    def tick(self) -> None:
        """Asked by a timer: autosave when it is due."""
        context, file = self._context, self._file
        now = time.monotonic()
        if self._unpictured is not None and (late := self.picture(self._unpictured)) is not None:
            self._unpictured, self._pictured = None, now
            self._executor.submit(late)
        if file is None or not self.autosaver.due(now) or context.document.in_gesture:
            return
        if not context.document.modified:
            self.autosaver.saved()
            return
        self.autosaver.started(now)
        scene, form = context.document.scene, session_form(context.session)
        history = History(context.document.history, context.document.position)
        picture = self.picture(file.path) if now - self._pictured >= _PICTURE_EVERY else None

        def work(job: Job) -> None:
            file.write(scene, history=history, session=form)
            if picture is not None:
                picture()

        def failed(error: Exception) -> None:
            self.autosaver.failed(time.monotonic(), str(error))
            self._tell(Kept("failed", time.time(), str(error)))

        def done(_: None) -> None:
            self.autosaver.done()
            self._drop_leftover()
            if picture is not None:
                self._pictured = now
            elif self.kept.where != "autosaved":
                self._unpictured = file.path  # nothing had been seen yet
            if self._file is file:
                self._tell(Kept("autosaved", time.time()))

        context.tasks.run("Autosaving", work, done, failed, quiet=True)

    def picture(self, path: Path) -> Callable[[], None] | None:
        """What writes the small picture of a file, for the files' thread; None while there is no picture."""
        shown, session = self._context.feed.last, self._context.session
        if shown is None:
            return None
        linear = shown.picture.linear
        exposure, kind = shown.picture.shown_with(session.exposure, session.tonemap)
        return lambda: self.thumbnails.keep(path, linear, exposure, kind)

    def _drop_leftover(self) -> None:
        leftover, self._leftover = self._leftover, None
        if leftover is not None:
            self._executor.submit(lambda: _quietly(lambda: discard(leftover)))

    def _tell(self, kept: Kept) -> None:
        self.kept = kept
        self.changed.emit()


def _quietly(action: Callable[[], Any]) -> None:
    """A leftover file is no reason to trouble anybody."""
    with contextlib.suppress(LucarneError, OSError):
        action()
