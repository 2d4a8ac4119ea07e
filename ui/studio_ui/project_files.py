"""Opening, saving, autosaving and recovering the document; everything slow happens on the files' thread."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studio_core.document import Step
from studio_core.errors import LucarneError
from studio_core.project.lock import LockedError, ProjectLock, acquire
from studio_core.project.records import History, LoadedProject
from studio_core.project.recovery import (
    Autosaver,
    Recovery,
    RecoveryFile,
    discard,
    find_recovery,
    find_unsaved,
    recovery_path,
    unsaved_path,
)
from studio_core.project.store import load, save
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Scene
from studio_core.shading.job import Job
from studio_core.shading.scheduler import Executor
from studio_core.signal import Signal
from studio_ui.ask import Ask, Filter
from studio_ui.context import Context
from studio_ui.session_form import session_form, take_session
from studio_ui.settings import Settings

SUFFIX = ".lucarne"
PROJECTS = Filter("Lucarne projects", (SUFFIX,))
Then = Callable[[], object]


@dataclass(frozen=True)
class _Opened:
    loaded: LoadedProject
    steps: tuple[Step, ...]
    position: int
    lock: ProjectLock | None = None
    recovery: Recovery | None = None


class ProjectFiles:
    """The file behind the document. `changed()` when path, name or read-only state change."""

    def __init__(self, context: Context, ask: Ask, settings: Settings, executor: Executor) -> None:
        self.path: Path | None = None
        self.read_only = False
        self.changed: Signal[[]] = Signal()
        self.opened: Signal[[]] = Signal()
        self._context, self._ask, self._settings, self._executor = context, ask, settings, executor
        self._name = "Untitled"
        self._lock: ProjectLock | None = None
        self._recovery: RecoveryFile | None = None
        self._recovery_lock: ProjectLock | None = None
        self._leftover: Path | None = None  # a recovered file, kept until there is a newer one
        self._taking = False
        self._autosaver = Autosaver()
        self._off = context.document.changed.connect(self._edited)

    @property
    def name(self) -> str:
        """What the title bar says."""
        return self.path.stem if self.path is not None else self._name

    @property
    def modified(self) -> bool:
        """Whether something is in no file."""
        return self._context.document.modified

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {
            "file.new": self.new,
            "file.open": self.choose,
            "file.save": self.save,
            "file.save_as": self.save_as,
        }

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name."""
        return {"savable": lambda: self.modified or self.path is None}

    def beside(self, suffix: str) -> Path:
        """A file of that suffix beside the project, to suggest for exports."""
        return (self.path.parent if self.path else Path.home()) / f"{self.name}{suffix}"

    # new and open

    def new(self) -> None:
        """An empty scene, after asking about unsaved changes."""
        self._guarded(lambda: self.start(Scene(), "Untitled"))

    def start(self, scene: Scene, name: str) -> None:
        """A document without a file."""
        self._leave(None)
        self._name = name
        self._restore((Step("New", scene),), 0)
        take_session(self._context.session, {}, scene, [])
        self.opened.emit()

    def choose(self) -> None:
        """Ask for a project and open it."""
        chosen = self._ask.open_files("Open project", [PROJECTS])
        if chosen:
            self.open(chosen[0])

    def open(self, path: Path, *, read_only: bool = False) -> None:
        """Open a project after asking about unsaved changes."""
        self._guarded(lambda: self._open(path, read_only))

    def open_copy(self, path: Path) -> None:
        """Open a project as a new document (samples)."""
        self._guarded(lambda: self._open(path, True, copy=True))

    def offer_unsaved(self) -> None:
        """Offer what was never saved when the program last ended badly."""

        def look(job: Job) -> list[Recovery]:
            return find_unsaved(self._settings.folder)

        def offer(found: list[Recovery]) -> None:
            for recovery in found:
                if recovery.recovered is None:
                    self._context.journal.write(recovery.problem, "warning")
                elif not self.modified and self._ask.recover(recovery) == "recovered":
                    self._recover(recovery)
                    return

        self._context.tasks.run("Looking for unsaved work", look, offer, quiet=True)

    def _open(self, path: Path, read_only: bool, *, copy: bool = False) -> None:
        def work(job: Job) -> _Opened:
            lock = None if read_only else acquire(path)
            try:
                recovery = None if read_only else find_recovery(path)
                opened = _read(path)
            except BaseException:
                if lock is not None:
                    lock.release()
                raise
            return _Opened(opened.loaded, opened.steps, opened.position, lock, recovery)

        def done(opened: _Opened) -> None:
            recovery = opened.recovery
            if recovery is not None and recovery.recovered is not None:
                answer = self._ask.recover(recovery)
                if answer == "recovered":
                    self._recover(recovery, opened.lock)
                    return
                if answer == "later":
                    if opened.lock is not None:
                        opened.lock.release()
                    return
            self._take(path, opened, read_only and not copy, copy)

        def failed(error: Exception) -> None:
            if isinstance(error, LockedError) and self._ask.read_only(str(error)):
                self._open(path, True)
            elif not path.exists():
                self._settings.forget(path)
                self.changed.emit()

        self._context.tasks.run(f"Opening {path.name}", work, done, failed)

    def _recover(self, recovery: Recovery, lock: ProjectLock | None = None) -> None:
        def done(opened: _Opened) -> None:
            path = recovery.project
            if path is not None:
                self._take(path, _Opened(opened.loaded, opened.steps, opened.position, lock), False, False)
            else:
                self._take(recovery.path, opened, False, True)
                self._name = "Recovered"
            self._context.document.saved_scene = None
            if path is None:
                self._leftover = recovery.path
                self._make_recovery(None)
            self._autosaver.changed(time.monotonic())
            self.changed.emit()

        def failed(error: Exception) -> None:
            if lock is not None:
                lock.release()

        self._context.tasks.run("Recovering", lambda job: _read(recovery.path), done, failed)

    def _take(self, path: Path, opened: _Opened, read_only: bool, copy: bool) -> None:
        self._leave(None if copy or read_only else path, opened.lock)
        self.path = None if copy else path
        self.read_only = read_only
        self._name = path.stem.replace("-", " ").capitalize() if copy else "Untitled"
        context = self._context
        self._restore(opened.steps, opened.position)
        backends = list(context.host.names("backend"))
        take_session(context.session, opened.loaded.session, context.document.scene, backends)
        for note in opened.loaded.notes:
            context.journal.write(note)
        if not copy:
            self._settings.opened(path)
        context.journal.write(f"Opened {path.name}{' read-only' if read_only else ''}.")
        self.opened.emit()
        self.changed.emit()

    # save

    def save(self, then: Then | None = None) -> None:
        """Save where the project is, or ask where."""
        if self.path is None or self.read_only:
            self.save_as(then)
        else:
            self._save(self.path, then)

    def save_as(self, then: Then | None = None) -> None:
        """Ask for a file and save there."""
        folder = self.path.parent if self.path is not None else self._last_folder()
        chosen = self._ask.save_file("Save project", folder / f"{self.name}{SUFFIX}", [PROJECTS])
        if chosen is not None:
            path = chosen if chosen.suffix.lower() == SUFFIX else chosen.with_name(chosen.name + SUFFIX)
            self._save(path, then)

    def _save(self, path: Path, then: Then | None) -> None:
        context = self._context
        context.editing.finish()
        scene, history = context.document.scene, self._history()
        form = session_form(context.session)
        elsewhere = path != self.path or self.read_only

        def work(job: Job) -> ProjectLock | None:
            lock = acquire(path) if elsewhere else None
            try:
                save(path, scene, label="Saved", history=history, session=form, fresh=elsewhere)
            except BaseException:
                if lock is not None:
                    lock.release()
                raise
            return lock

        def done(lock: ProjectLock | None) -> None:
            context.document.mark_saved(scene)
            if elsewhere:
                self._leave(path, lock)
                self.path, self.read_only = path, False
            else:
                self._drop_recovery()
                self._make_recovery(path)
            self._autosaver.saved()
            if self.modified:
                self._autosaver.changed(time.monotonic())
            self._settings.opened(path)
            context.journal.write(f"Saved {path.name}.")
            self.changed.emit()
            if then is not None:
                then()

        context.tasks.run(f"Saving {path.name}", work, done)

    def _history(self) -> History:
        document = self._context.document
        return History(document.history, document.position)

    def _last_folder(self) -> Path:
        recent = self._settings.recent
        return recent[0].parent if recent and recent[0].parent.is_dir() else Path.home()

    # autosave

    def tick(self) -> None:
        """Asked by a timer: autosave when it is due."""
        context, recovery = self._context, self._recovery
        now = time.monotonic()
        if recovery is None or not self._autosaver.due(now) or context.document.in_gesture:
            return
        if not self.modified:
            self._autosaver.saved()
            return
        self._autosaver.started(now)
        scene, history, form = context.document.scene, self._history(), session_form(context.session)

        def work(job: Job) -> None:
            recovery.write(scene, history=history, session=form)

        def failed(error: Exception) -> None:
            self._autosaver.failed(time.monotonic(), str(error))

        def done(_: None) -> None:
            self._autosaver.done()
            self._drop_leftover()

        context.tasks.run("Autosaving", work, done, failed, quiet=True)

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if self._taking:
            return
        self._autosaver.changed(time.monotonic())
        if self._recovery is None:
            self._make_recovery(self.path if not self.read_only else None)
        self.changed.emit()

    def _make_recovery(self, project: Path | None) -> None:
        if project is not None:
            self._recovery = RecoveryFile(recovery_path(project), project)
            return
        path = unsaved_path(self._settings.folder)
        self._recovery = RecoveryFile(path)
        with contextlib.suppress(LucarneError, OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._recovery_lock = acquire(path)

    def _drop_recovery(self) -> None:
        """After what the files' thread still has to write."""
        self._drop_leftover()
        recovery, lock = self._recovery, self._recovery_lock
        self._recovery = self._recovery_lock = None

        def drop() -> None:
            if recovery is not None:
                _quietly(recovery.discard)
            if lock is not None:
                lock.release()

        self._executor.submit(drop)

    def _drop_leftover(self) -> None:
        leftover, self._leftover = self._leftover, None
        if leftover is not None:
            self._executor.submit(lambda: _quietly(lambda: discard(leftover)))

    def _restore(self, steps: tuple[Step, ...], position: int) -> None:
        self._taking = True
        try:
            self._context.document.restore(steps, position)
        finally:
            self._taking = False
        self._context.session.select([])

    # leaving

    def leave(self, then: Then) -> None:
        """Ask about unsaved changes, then go on; nothing happens on Cancel."""
        self._guarded(then)

    def close(self) -> None:
        """Give back locks and remove the recovery file: what is lost now was meant to be."""
        self._off()
        self._leave(None)

    def _guarded(self, then: Then) -> None:
        self._context.editing.finish()
        if not self.modified:
            then()
            return
        answer = self._ask.unsaved(self.name)
        if answer == "save":
            self.save(then)
        elif answer == "discard":
            then()

    def _leave(self, path: Path | None, lock: ProjectLock | None = None) -> None:
        """Let go of the file behind the document and take another one."""
        old, self._lock = self._lock, lock
        self._drop_recovery()
        if old is not None:
            self._executor.submit(old.release)
        self.path, self.read_only = None, False
        self._autosaver.saved()
        if path is not None:
            self._make_recovery(path)


def _read(path: Path) -> _Opened:
    loaded = load(path)
    if loaded.history is None:
        return _Opened(loaded, (Step("Open", loaded.scene),), 0)
    steps, position = loaded.history.opened()
    return _Opened(loaded, steps, position)


def _quietly(action: Callable[[], Any]) -> None:
    """A leftover file is no reason to trouble anybody."""
    with contextlib.suppress(LucarneError, OSError):
        action()
