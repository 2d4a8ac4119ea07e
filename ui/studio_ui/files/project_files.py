"""Opening, saving and recovering the document; everything slow happens on the files' thread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from studio_core.document import Step
from studio_core.library.lucmat import SUFFIX as MATERIAL
from studio_core.project.lock import ProjectLock, acquire
from studio_core.project.records import History
from studio_core.project.store import newest, save
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Scene
from studio_core.shading.job import Job
from studio_core.shading.scheduler import Executor
from studio_core.signal import Signal
from studio_ui.ask import Ask, Filter
from studio_ui.context import Context
from studio_ui.files.keeper import Keeper
from studio_ui.files.leftovers import Leftover, beside, never_saved
from studio_ui.files.opening import Opened, ReadOnly, forget, locked, read
from studio_ui.files.recent import RecentProjects
from studio_ui.files.session_form import session_form, take_session
from studio_ui.files.thumbnails import Thumbnails
from studio_ui.settings import Settings

SUFFIX = ".lucarne"
PROJECTS = Filter("Lucarne projects", (SUFFIX,))
Then = Callable[[], object]


class ProjectFiles:
    """The file behind the document. `changed()` when path, name or read-only state change; `opened()` when
    another document is shown.
    """

    def __init__(
        self, context: Context, ask: Ask, settings: Settings, executor: Executor, thumbnails: Thumbnails
    ) -> None:
        self.path: Path | None = None
        self.locked_out: ReadOnly | None = None
        self.changed: Signal[[]] = Signal()
        self.opened: Signal[[]] = Signal()
        self.material: Callable[[Path], object] = lambda path: None
        self.keeper = Keeper(context, executor, settings.folder, thumbnails)
        self.recent = RecentProjects(settings, thumbnails, context.tasks)
        self._context, self._ask, self._settings, self._executor = context, ask, settings, executor
        self._name = "Untitled"
        self._lock: ProjectLock | None = None
        self._revision = 0  # that was opened or saved last
        self._taking = False
        self._off = context.document.changed.connect(self._edited)

    @property
    def name(self) -> str:
        """What the title bar says."""
        return self.path.stem if self.path is not None else self._name

    @property
    def read_only(self) -> bool:
        """Whether it cannot be saved where it is."""
        return self.locked_out is not None

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

    @property
    def folder(self) -> Path | None:
        """Where the project lies."""
        return self.path.parent if self.path is not None else None

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
        self.changed.emit()

    def choose(self) -> None:
        """Ask for a project and open it."""
        chosen = self._ask.open_files("Open project", [PROJECTS])
        if chosen:
            self.open(chosen[0])

    def open(self, path: Path, *, read_only: bool = False) -> None:
        """Open a project after asking about unsaved changes; read-only when somebody else has it open.

        A material's file is no project, though it is written as one.
        """
        if path.suffix.lower() == MATERIAL:
            self.material(path)
            return
        self._guarded(lambda: self._open(path, read_only))

    def open_copy(self, path: Path, revision: int | None = None) -> None:
        """Open a project, or one of its earlier versions, as a new document (samples)."""
        self._guarded(lambda: self._open(path, True, copy=True, revision=revision))

    def take_over(self) -> None:
        """Open for writing what another machine holds, after asking."""
        path, why = self.path, self.locked_out
        if path is None or why is None or why.holder is None:
            return
        if self._ask.take_over(path.name, why.holder):
            self._regain(path, take_over=True)

    def try_again(self) -> None:
        """Become able to save: at once when nobody saved meanwhile, else by opening what they saved."""
        if self.path is not None and self.read_only:
            self._regain(self.path, take_over=False)

    def offer_unsaved(self) -> None:
        """Offer what was never saved when the program last ended badly."""

        def look(job: Job) -> list[Leftover]:
            return never_saved(self._settings.folder, self.keeper.thumbnails)

        def offer(found: list[Leftover]) -> None:
            for leftover in found:
                if leftover.recovered is None:
                    self._context.journal.write(leftover.found.problem, "warning")
            whole = [leftover for leftover in found if leftover.recovered is not None]
            if not whole or self.modified:
                return
            answer = self._ask.leftovers(whole)
            for leftover in answer.discard:
                self._executor.submit(lambda path=leftover.found.path: forget(path))
                self.keeper.thumbnails.forget(leftover.found.path)
            if answer.open is not None:
                self._recover(answer.open)

        self._context.tasks.run("Looking for unsaved work", look, offer, quiet=True)

    def _open(self, path: Path, read_only: bool, *, copy: bool = False, revision: int | None = None) -> None:
        mine = self._lock if self.path == path else None  # the same project once more

        def work(job: Job) -> Opened:
            if mine is not None and not read_only:
                return replace(read(path, revision), lock=mine)
            lock, why = (None, ReadOnly()) if read_only else locked(path)
            try:
                leftover = beside(path, self.keeper.thumbnails) if lock is not None else None
                return replace(read(path, revision), lock=lock, leftover=leftover, read_only=why)
            except BaseException:
                if lock is not None:
                    lock.release()
                raise

        def done(opened: Opened) -> None:
            leftover = opened.leftover
            if leftover is not None and leftover.recovered is not None:
                answer = self._ask.recover(leftover)
                if answer == "recovered":
                    self._recover(leftover, opened.lock)
                    return
                if answer == "later":
                    if opened.lock is not None:
                        opened.lock.release()
                    return
            self._take(path, opened, copy)

        def failed(error: Exception) -> None:
            self.recent.refresh()

        self._context.tasks.run(f"Opening {path.name}", work, done, failed)

    def _recover(self, leftover: Leftover, lock: ProjectLock | None = None) -> None:
        path, source = leftover.found.project, leftover.found.path

        def done(opened: Opened) -> None:
            self._take(path or source, replace(opened, lock=lock), copy=path is None)
            self._context.document.saved_scene = None
            if path is None:
                self._name = "Recovered"
                self.keeper.hold(source)
            self.keeper.edited(path)
            self.changed.emit()

        def failed(error: Exception) -> None:
            if lock is not None:
                lock.release()

        self._context.tasks.run("Recovering", lambda job: read(source), done, failed)

    def _take(self, path: Path, opened: Opened, copy: bool) -> None:
        why = None if copy else opened.read_only
        self._leave(None if copy or why is not None else path, opened.lock)
        self.path = None if copy else path
        self.locked_out, self._revision = why, opened.loaded.revision.id
        self._name = path.stem.replace("-", " ").capitalize() if copy else "Untitled"
        context = self._context
        self._restore(opened.steps, opened.position)
        backends = list(context.host.names("backend"))
        take_session(context.session, opened.loaded.session, context.document.scene, backends)
        self.opened.emit()
        for note in opened.loaded.notes:
            context.journal.write(note)
        if not copy:
            self.recent.opened(path)
        context.journal.write(f"Opened {path.name}{' read-only' if why is not None else ''}.")
        self.changed.emit()

    def _regain(self, path: Path, *, take_over: bool) -> None:
        revision = self._revision

        def work(job: Job) -> tuple[ProjectLock, bool]:
            lock = acquire(path, take_over=take_over)
            try:
                return lock, newest(path).id == revision
            except BaseException:
                lock.release()
                raise

        def done(found: tuple[ProjectLock, bool]) -> None:
            lock, same = found
            if same:
                self._lock, self.locked_out = lock, None
                self.keeper.drop()
                self.keeper.begin(path)
                if self.modified:
                    self.keeper.edited(path)
                self._context.journal.write(f"{path.name} can be saved again.")
                self.changed.emit()
                return
            lock.release()
            if self.modified:
                text = f"{path.name} was changed by somebody else: save your version as a copy."
                self._context.journal.write(text, "problem")
            else:
                self._open(path, False)

        self._context.tasks.run(f"Trying to open {path.name} again", work, done)

    # save

    def save(self, then: Then | None = None) -> None:
        """Save where the project is, or ask where."""
        if self.path is None or self.read_only:
            self.save_as(then)
        else:
            self._save(self.path, then)

    def save_as(self, then: Then | None = None) -> None:
        """Ask for a file and save there."""
        chosen = self.ask_where("Save project", self.name)
        if chosen is not None:
            self._save(chosen, then)

    def ask_where(self, title: str, name: str) -> Path | None:
        """A project file to write."""
        folder = self.path.parent if self.path is not None else self._last_folder()
        chosen = self._ask.save_file(title, folder / f"{name}{SUFFIX}", [PROJECTS])
        if chosen is None or chosen.suffix.lower() == SUFFIX:
            return chosen
        return chosen.with_name(chosen.name + SUFFIX)

    def _save(self, path: Path, then: Then | None) -> None:
        context = self._context
        context.editing.finish()
        document = context.document
        scene, history = document.scene, History(document.history, document.position)
        form, picture = session_form(context.session), self.keeper.picture(path)
        elsewhere = path != self.path or self.read_only

        def work(job: Job) -> tuple[ProjectLock | None, int]:
            lock = acquire(path) if elsewhere else None
            try:
                report = save(path, scene, label="Saved", history=history, session=form, fresh=elsewhere)
            except BaseException:
                if lock is not None:
                    lock.release()
                raise
            if picture is not None:
                picture()
            return lock, report.revision

        def done(found: tuple[ProjectLock | None, int]) -> None:
            document.mark_saved(scene)
            if elsewhere:
                self._leave(path, found[0])
                self.path = path
            self._revision = found[1]
            self.keeper.saved(path)
            if self.modified:
                self.keeper.edited(path)
            self.recent.opened(path)
            context.journal.write(f"Saved {path.name}.")
            self.changed.emit()
            if then is not None:
                then()

        context.tasks.run(f"Saving {path.name}", work, done)

    def _last_folder(self) -> Path:
        recent = self._settings.recent
        return recent[0].parent if recent and recent[0].parent.is_dir() else Path.home()

    # following and leaving

    def tick(self) -> None:
        """Asked by a timer: autosave when it is due."""
        self.keeper.tick()

    def leave(self, then: Then) -> None:
        """Ask about unsaved changes, then go on; nothing happens on Cancel."""
        self._guarded(then)

    def close(self) -> None:
        """Give back locks and remove the recovery file: what is lost now was meant to be."""
        self._off()
        self._leave(None)

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if not self._taking:
            self.keeper.edited(self.path if not self.read_only else None)
            self.changed.emit()

    def _restore(self, steps: tuple[Step, ...], position: int) -> None:
        self._taking = True
        try:
            self._context.document.restore(steps, position)
        finally:
            self._taking = False
        self._context.session.select([])

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
        picture = self.keeper.picture(self.path) if self.path is not None and not self.modified else None
        if picture is not None:
            self._executor.submit(picture)
        self.keeper.left()
        if old is not None and old is not lock:
            self._executor.submit(old.release)
        self.path, self.locked_out = None, None
        if path is not None:
            self.keeper.begin(path)
