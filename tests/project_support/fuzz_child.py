"""Opens damaged copies of projects, under limits of memory and time and watched by an audit hook.

Reads one path a line from stdin, answers one JSON object a line: `refused` with the message, `opened` with
the digest and the digests of the history, or `wrong` with what else happened.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import traceback
from pathlib import Path
from typing import Any

from studio_core.errors import ProjectError
from studio_core.project import store
from studio_core.project.codec import scene_digest

WATCHED = ("exec", "compile", "import", "subprocess", "os.system", "os.exec", "os.fork", "os.posix_spawn")
WATCHED += ("os.spawn", "os.startfile", "pty.", "socket.", "ctypes.", "pickle.", "marshal.", "code.__new__")
WATCHED += ("sqlite3.load_extension", "sqlite3.enable_load_extension", "webbrowser.", "urllib.", "ftplib.")
WRITES = ("os.remove", "os.rename", "os.truncate", "os.mkdir", "os.chmod", "os.link", "os.symlink", "shutil.")
MEMORY = 1 << 30

events: list[str] = []
watching = False


def hook(event: str, arguments: tuple[Any, ...]) -> None:
    """Note what opening a project never does."""
    if not watching:
        return
    if event.startswith((*WATCHED, *WRITES)):
        events.append(f"{event} {arguments!r:.200}")
    elif event == "open" and isinstance(arguments[1], str) and set(arguments[1]) & set("wax+"):
        events.append(f"open for writing {arguments[0]!r:.200}")


def attempt(path: Path) -> dict[str, Any]:
    """Open one file."""
    global watching
    events.clear()
    watching = True
    try:
        loaded = store.load(path)
        steps = [] if loaded.history is None else [scene_digest(s.scene) for s in loaded.history.steps]
        found: dict[str, Any] = {"opened": scene_digest(loaded.scene), "steps": steps}
        found["session"] = dict(loaded.session)
    except ProjectError as error:
        found = {"refused": str(error)}
    except BaseException as error:
        watching = False
        return {"wrong": "".join(traceback.format_exception(error))}
    try:
        store.info(path)
    except ProjectError:
        pass
    except BaseException as error:
        watching = False
        return {"wrong": "".join(traceback.format_exception(error))}
    watching = False
    if events:
        found = {"wrong": "; ".join(events)}
    return found


def main() -> None:
    """Answer until stdin ends."""
    warm = Path(sys.argv[1])
    for _ in range(2):
        attempt(warm)
        attempt(warm.with_suffix(".missing"))
        json.dumps({})
    with Path("/proc/self/statm").open() as file:
        used = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    sys.addaudithook(hook)
    for line in sys.stdin:
        print(json.dumps(attempt(Path(line.rstrip("\n")))), flush=True)


if __name__ == "__main__":
    main()
