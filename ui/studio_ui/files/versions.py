"""What the project file keeps besides the newest save: earlier versions, and how to be rid of them."""

from __future__ import annotations

from collections.abc import Callable

from studio_core.errors import ProjectError
from studio_core.project.outline import Outline, outline, revisions
from studio_core.project.store import compact, save_copy_without_history
from studio_core.shading.job import Job
from studio_ui.ask import Ask
from studio_ui.context import Context
from studio_ui.files.project_files import ProjectFiles

_MOST = 200  # versions that are listed


class Versions:
    """Earlier versions, copies without history, compact."""

    def __init__(self, context: Context, ask: Ask, files: ProjectFiles) -> None:
        self._context, self._ask, self._files = context, ask, files

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {
            "file.versions": self.choose,
            "file.copy_clean": self.copy_clean,
            "file.compact": self.compact,
        }

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name."""
        files = self._files
        return {
            "has_file": lambda: files.path is not None,
            "own_file": lambda: files.path is not None and not files.read_only,
        }

    def choose(self) -> None:
        """Ask for an earlier version and open it as a document of its own."""
        path = self._files.path
        if path is None:
            return

        def read(job: Job) -> list[Outline]:
            found = []
            for revision in revisions(path)[-_MOST:]:
                try:
                    found.append(outline(path, revision.id))
                except ProjectError:
                    continue  # the others can still be opened
            return found[::-1]

        def done(found: list[Outline]) -> None:
            chosen = self._ask.version(path.stem, found)
            if chosen is not None:
                self._files.open_copy(path, chosen.revision.id)

        self._context.tasks.run(f"Reading versions of {path.name}", read, done)

    def copy_clean(self) -> None:
        """Save the scene as it is now elsewhere, without undo history and earlier versions."""
        scene = self._context.document.scene
        path = self._files.ask_where("Save a copy without history", f"{self._files.name} for client")
        if path is None:
            return
        if path == self._files.path:
            text = f"{path.name} is the project itself: choose another name for the copy."
            self._context.journal.write(text, "problem")
            return

        def write(job: Job) -> None:
            save_copy_without_history(scene, path)

        def done(_: None) -> None:
            self._context.journal.write(f"Saved {path.name}, without undo history and earlier versions.")

        self._context.tasks.run(f"Saving {path.name}", write, done)

    def compact(self) -> None:
        """Save, then drop earlier versions and all that only they hold, after asking."""
        path = self._files.path
        if path is None or self._files.read_only:
            return

        def shrink(job: Job) -> int:
            return compact(path)

        def done(freed: int) -> None:
            self._context.journal.write(f"{path.name} is {_size(max(freed, 0))} smaller.")

        def ask(count: int) -> None:
            if self._ask.compact(path.name, count - 1):
                run = self._context.tasks.run
                self._files.save(lambda: run(f"Compacting {path.name}", shrink, done))

        self._context.tasks.run(
            f"Reading versions of {path.name}", lambda job: len(revisions(path)), ask, quiet=True
        )


def _size(count: int) -> str:
    """Bytes as people say them."""
    for limit, unit in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if count >= limit:
            return f"{count / limit:.1f} {unit}"
    return f"{count} bytes"
