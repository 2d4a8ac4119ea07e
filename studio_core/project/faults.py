"""Failures of disks, databases and memory as one sentence that names the file and the cause."""

from __future__ import annotations

import errno
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from studio_core.errors import ProjectError

_SQLITE = (
    ("SQLITE_FULL", "the disk is full"),
    ("SQLITE_IOERR_NOMEM", "there is not enough memory"),
    ("SQLITE_IOERR", "the disk reports an error"),
    ("SQLITE_READONLY", "the file or its folder cannot be written"),
    ("SQLITE_CANTOPEN", "the file or its folder cannot be opened"),
    ("SQLITE_PERM", "access is denied"),
    ("SQLITE_BUSY", "another program is using it"),
    ("SQLITE_LOCKED", "another program is using it"),
    ("SQLITE_PROTOCOL", "the folder cannot lock files"),
    ("SQLITE_NOLFS", "the disk cannot hold a file of that size"),
    ("SQLITE_NOMEM", "there is not enough memory"),
    ("SQLITE_INTERRUPT", "it is damaged: reading it finds no end"),
    ("SQLITE_AUTH", "it is damaged: it asks for what a project never needs"),
)
_LONGEST = 500
_ERRNO = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "your disk quota is used up",
    errno.EIO: "the disk reports an error",
    errno.EROFS: "the disk is read-only",
    errno.EACCES: "access is denied",
    errno.EPERM: "access is denied",
    errno.ENOENT: "there is no such file or folder",
    errno.ENOTDIR: "there is no such folder",
    errno.EISDIR: "it is a folder",
    errno.ENAMETOOLONG: "the name is too long",
    errno.EFBIG: "the disk cannot hold a file of that size",
}


def cause(error: BaseException) -> str:
    """Why, in plain words."""
    if isinstance(error, sqlite3.Error):
        name = str(getattr(error, "sqlite_errorname", ""))
        for prefix, text in _SQLITE:
            if name.startswith(prefix):
                return text
        text = str(error)
        return f"it is damaged: {'a text is not UTF-8' if 'UTF-8' in text else text}"
    if isinstance(error, OSError):
        return _ERRNO.get(error.errno or 0, (error.strerror or str(error)).lower())
    if isinstance(error, MemoryError):
        return "there is not enough memory"
    if isinstance(error, RecursionError):
        return "it is damaged: nested too deeply"
    return f"it is damaged: {error}"


def plain(text: str) -> str:
    """A text in one line, whatever a file put into it, and not endless."""
    line = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)
    return line if len(line) <= _LONGEST else f"{line[:_LONGEST]}…"


@contextmanager
def explained(path: Path, verb: str) -> Iterator[None]:
    """Turn what goes wrong inside into a ProjectError "NAME could not be `verb`: cause"."""
    try:
        yield
    except ProjectError as error:
        text = plain(str(error))
        named = path.name in text
        if named and text == str(error):
            raise
        raise ProjectError(text if named else f"{path.name} could not be {verb}: {text}") from error
    except (sqlite3.Error, sqlite3.Warning, OSError, MemoryError, RecursionError, UnicodeError) as error:
        raise ProjectError(f"{path.name} could not be {verb}: {plain(cause(error))}") from error
