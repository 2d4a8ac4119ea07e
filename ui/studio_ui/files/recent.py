"""Projects that were opened lately: whether they are still there, when they were saved, how they look."""

from __future__ import annotations

import datetime
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtGui import QImage

from studio_core.shading.job import Job
from studio_core.signal import Signal
from studio_ui.files.thumbnails import Thumbnails
from studio_ui.settings import Settings
from studio_ui.tasks import Tasks

_MONTHS = (
    *("January", "February", "March", "April", "May", "June"),
    *("July", "August", "September", "October", "November", "December"),
)


@dataclass(frozen=True)
class RecentProject:
    """One of them; `saved` in seconds since 1970, None when the file cannot be found."""

    path: Path
    saved: float | None = None
    image: QImage | None = None

    @property
    def there(self) -> bool:
        """Whether it can be opened."""
        return self.saved is not None

    @property
    def name(self) -> str:
        """Without folder and ending."""
        return self.path.stem


class RecentProjects:
    """The list, as `settings` remembers it; `changed()` when it is known anew.

    Files are looked at on the files' thread: a folder on a sleeping server answers after minutes.
    """

    def __init__(self, settings: Settings, thumbnails: Thumbnails, tasks: Tasks) -> None:
        self.changed: Signal[[]] = Signal()
        self.thumbnails = thumbnails
        self._settings, self._tasks = settings, tasks
        self.projects = tuple(RecentProject(path, 0.0) for path in settings.recent)

    def opened(self, path: Path) -> None:
        """Put a project first."""
        self._settings.opened(path)
        self.refresh()

    def forget(self, path: Path) -> None:
        """Take a project off the list; the file stays."""
        self._settings.forget(path)
        self.projects = tuple(p for p in self.projects if p.path != path)
        self.changed.emit()

    def clear(self) -> None:
        """Forget all of them."""
        self._settings.set("recent", None)
        self.projects = ()
        self.changed.emit()

    def refresh(self) -> None:
        """Look at the files again."""
        paths = self._settings.recent

        def look(job: Job) -> tuple[RecentProject, ...]:
            return tuple(_look(path, self.thumbnails) for path in paths)

        def done(found: tuple[RecentProject, ...]) -> None:
            known = {project.path: project for project in found}
            self.projects = tuple(known.get(p, RecentProject(p, 0.0)) for p in self._settings.recent)
            self.changed.emit()

        self._tasks.run("Looking at recent projects", look, done, quiet=True)


def _look(path: Path, thumbnails: Thumbnails) -> RecentProject:
    try:
        saved = path.stat().st_mtime if path.is_file() else None
    except OSError:
        saved = None
    return RecentProject(path, saved, thumbnails.find(path))


def when(seconds: float, now: float | None = None) -> str:
    """A past time as people say it: `today, 14:32`, `yesterday, 9:05`, `12 March`, `3 May 2024`."""
    then = time.localtime(seconds)
    today = time.localtime(time.time() if now is None else now)
    clock = f"{then.tm_hour}:{then.tm_min:02}"
    days = _day(today) - _day(then)
    if days == 0:
        return f"today, {clock}"
    if days == 1:
        return f"yesterday, {clock}"
    date = f"{then.tm_mday} {_MONTHS[then.tm_mon - 1]}"
    return date if then.tm_year == today.tm_year else f"{date} {then.tm_year}"


def _day(moment: time.struct_time) -> int:
    return datetime.date(moment.tm_year, moment.tm_mon, moment.tm_mday).toordinal()


def when_title(seconds: float) -> str:
    """The same as the beginning of a line."""
    text = when(seconds)
    return text[:1].upper() + text[1:]


def folder_text(path: Path, home: Path | None = None) -> str:
    """The folder of a file, short: the home folder as `~`."""
    home = home or Path.home()
    folder = path.parent
    if folder.is_relative_to(home):
        return str(Path("~") / folder.relative_to(home))
    return str(folder)


def shared_names(projects: Sequence[RecentProject]) -> set[str]:
    """Names that more than one of the projects has: those need their folder to be told apart."""
    names = [project.name for project in projects]
    return {name for name in names if names.count(name) > 1}
