"""Runs inside the failing disk: saves while the N-th change fails, N = 1, 2, … and checks what is left.

Arguments: the folder to work in and the way (see `saver`). Prints one JSON object.
"""

from __future__ import annotations

import errno
import json
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from project_support.disk import Disk
from project_support.samples import renamed, small_scene
from studio_core.document import Step
from studio_core.errors import ProjectError
from studio_core.project import store
from studio_core.project.codec import scene_digest
from studio_core.project.records import History
from studio_core.project.recovery import RecoveryFile

ERRORS = {"ENOSPC": errno.ENOSPC, "EIO": errno.EIO, "short": 0}
CAUSES = ("the disk is full", "the disk reports an error", "cannot be opened", "cannot be written")
MOST = 2000

OLD = small_scene(1)
NEW = renamed(small_scene(2), "New")
HISTORY = History((Step("Open", OLD), Step("Change", NEW)), 1)


def saver(way: str, folder: Path) -> tuple[Path, Callable[[], None], Callable[[], Any]]:
    """The file that is written, how it is set back, and one save."""
    project = folder / "p.lucarne"
    if way == "recovery":
        recovery = RecoveryFile(folder / ".p.lucarne.recovery", project)
        store.save(project, OLD)
        recovery.write(OLD)
        path = recovery.path
        act: Callable[[], Any] = lambda: recovery.write(NEW, history=HISTORY)  # noqa: E731
    elif way == "first recovery":
        store.save(project, OLD)
        path = folder / ".p.lucarne.recovery"
        act = lambda: RecoveryFile(path, project).write(NEW, history=HISTORY)  # noqa: E731
    else:
        path = project
        how: Any = {"in place": "in place", "whole": "whole", "new": "auto"}[way]
        if way != "new":
            store.save(path, OLD)
        act = lambda: store.save(path, NEW, history=HISTORY, way=how)  # noqa: E731
    base = path.read_bytes() if path.exists() else None

    def reset() -> None:
        for entry in folder.iterdir():
            if entry.name.startswith(path.name) or entry.suffix == ".new":
                entry.unlink()
        if base is not None:
            path.write_bytes(base)

    return path, reset, act


def main() -> None:
    """All injection points of one way."""
    folder, way = Path(sys.argv[1]), sys.argv[2]
    path, reset, act = saver(way, folder)
    disk = Disk(folder)
    old, new = scene_digest(OLD), scene_digest(NEW)
    outcomes: Counter[str] = Counter()
    messages: Counter[str] = Counter()
    for name, code in ERRORS.items():
        for always in (False, True):
            for nth in range(1, MOST):
                where = f"{way}, {name}, {'always' if always else 'once'}, change {nth}"
                reset()
                disk.arm(nth, code, always=always)
                try:
                    act()
                    failed = ""
                except ProjectError as error:
                    failed = str(error)
                count = disk.disarm()
                if failed:
                    assert path.name in failed, (where, failed)
                    assert "\n" not in failed, (where, failed)
                    assert any(cause in failed for cause in CAUSES), (where, failed)
                    messages[failed.split(": ", 1)[1]] += 1
                if not path.exists():
                    assert way in ("new", "first recovery"), where
                    assert failed, where
                    outcomes["nothing"] += 1
                else:
                    found = scene_digest(store.load(path).scene)
                    assert found == new or (failed and found == old), (where, failed)
                    outcomes[("failed" if failed else "saved") + (", new" if found == new else ", old")] += 1
                left = [e.name for e in folder.iterdir() if e.suffix == ".new"]
                assert always or not left, (where, left)
                if count < nth:
                    break
            else:
                raise AssertionError(f"{way}: more than {MOST} changes")
    print(json.dumps({"outcomes": outcomes, "messages": messages}))


if __name__ == "__main__":
    main()
