"""Where a project lies: complete, durable replacement of a file, and folders where SQLite must not write.

On network folders locks and the order of writes cannot be relied on, and programs that synchronise a
folder copy a file while it is written: there a project is written whole and put in place by a rename.
"""

from __future__ import annotations

import os
import secrets
import shutil
import sqlite3
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Literal

from studio_core.errors import ProjectError
from studio_core.project.schema import journal_of, settle

FolderKind = Literal["local", "network", "synced"]

_CHUNK = 4 << 20
_LEFTOVER_SECONDS = 3600.0
_NETWORK = {"nfs", "nfs4", "cifs", "smb3", "smbfs", "9p", "afs", "ceph", "glusterfs", "lustre", "davfs"}
_SYNCED = {"dropbox", "onedrive", "google drive", "googledrive", "icloud", "mobile documents"}
_SYNCED |= {"nextcloud", "owncloud", "syncthing", "pcloud", "mega", "seafile"}
_SYNC_MARKS = (".stfolder", ".dropbox", ".owncloudsync.log", ".nextcloudsync.log")


def folder_kind(folder: Path, mounts: str | None = None) -> FolderKind:
    """Whether a folder is local, on a network, or kept in step by a synchronising program.

    `mounts` is the text of Linux' /proc/mounts (read when not given).
    """
    whole = folder.absolute()
    if any(part.lower().split(" - ")[0].strip() in _SYNCED for part in whole.parts):
        return "synced"
    if any((parent / mark).exists() for parent in (whole, *whole.parents) for mark in _SYNC_MARKS):
        return "synced"
    if str(whole).startswith(("\\\\", "//")):
        return "network"
    if mounts is None:
        mounts = _linux_mounts()
    best = ("", "")
    for line in mounts.splitlines():
        fields = line.split(" ")
        if len(fields) >= 3:
            point = fields[1].replace("\\040", " ")
            if whole.is_relative_to(point) and len(point) >= len(best[0]):
                best = (point, fields[2])
    kind = best[1]
    fuse = kind.startswith("fuse.") and kind not in {"fuse.portal", "fuse.fuse-overlayfs"}
    return "network" if kind in _NETWORK or fuse else "local"


def _linux_mounts() -> str:
    if not sys.platform.startswith("linux"):
        return ""
    try:
        return Path("/proc/mounts").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def replace_whole(path: Path, fill: Callable[[Path], None], *, scratch: Path | None = None) -> None:
    """Put a new file at `path`: all of it or nothing, durable when this returns.

    `fill` makes the file at the path it is given, in `scratch` (a local folder) when given, else beside
    `path`. Raises what goes wrong; then the old file stands.
    """
    _sweep(path)
    beside = path.with_name(f".{path.name}.{secrets.token_hex(4)}.new")
    made = beside
    folder: str | None = None
    try:
        if scratch is not None:
            folder = tempfile.mkdtemp(prefix="lucarne-", dir=scratch)
            made = Path(folder) / "project"
        fill(made)
        if made is not beside:
            copy_file(made, beside)
        if path.exists():
            shutil.copymode(path, beside)
        _flush(beside)
        _drop_journal(path)
        os.replace(beside, path)  # noqa: PTH105 - named as in the promise
        flush_folder(path.parent)
    finally:
        for leftover in (beside, journal_of(beside)):
            with suppress(OSError):
                leftover.unlink()
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)


def _drop_journal(path: Path) -> None:
    """A journal left beside the old file would be rolled back into the new one."""
    journal = journal_of(path)
    if not journal.exists():
        return
    if path.exists():
        with suppress(ProjectError, sqlite3.Error):
            settle(path)
    journal.unlink(missing_ok=True)
    flush_folder(path.parent)


def copy_file(source: Path, target: Path) -> None:
    """Copy the bytes of a file to a new one; every write is checked."""
    with source.open("rb", buffering=0) as reader, target.open("xb", buffering=0) as writer:
        while chunk := reader.read(_CHUNK):
            rest = memoryview(chunk)
            while rest:
                written = writer.write(rest)
                rest = rest[written:]


def _flush(path: Path) -> None:
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def flush_folder(folder: Path) -> None:
    """Make a rename or removal in `folder` durable (Windows does so by itself)."""
    if os.name == "nt":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _sweep(path: Path) -> None:
    """Remove what a killed program left half made here long ago."""
    oldest = time.time() - _LEFTOVER_SECONDS
    with suppress(OSError):
        for entry in path.parent.iterdir():
            if entry.name.startswith(f".{path.name}.") and entry.name.endswith(".new"):
                with suppress(OSError):
                    if entry.stat().st_mtime < oldest:
                        entry.unlink()
