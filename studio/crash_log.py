"""A report of the interpreter's own when the process dies, and those of runs that died before."""

from __future__ import annotations

import contextlib
import faulthandler
import secrets
from collections.abc import Iterator
from pathlib import Path

from studio_core.errors import LucarneError
from studio_core.project.lock import acquire

_NAME = "crash-*.txt"
_MOST = 64 << 10  # characters of a report that is shown


@contextlib.contextmanager
def crash_log(folder: Path) -> Iterator[str]:
    """Write a report when this process dies; gives what earlier ones wrote that did (empty: none).

    Every process has a file of its own, locked while it lives: another window does not take it for dead. A
    folder that cannot be written is no reason not to start.
    """
    found = _earlier(folder)
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError, LucarneError):
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / _NAME.replace("*", secrets.token_hex(6))
            stack.enter_context(acquire(path))
            stack.callback(path.unlink, missing_ok=True)
            file = stack.enter_context(path.open("w", encoding="utf-8"))
            faulthandler.enable(file)
            stack.callback(faulthandler.disable)
        yield found


def _earlier(folder: Path) -> str:
    """The reports of processes that live no more; they are read once."""
    found = []
    with contextlib.suppress(OSError):
        for path in sorted(folder.glob(_NAME), key=lambda path: path.stat().st_mtime):
            with contextlib.suppress(OSError, LucarneError), acquire(path):  # refused while its process lives
                text = path.read_text("utf-8", "replace").strip()
                path.unlink()
                if text:
                    found.append(text[:_MOST])
    return "\n\n".join(found)
