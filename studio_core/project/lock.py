"""Who has a project open: a lock file beside it that lives no longer than its process.

The operating system's own lock on that file says whether its holder lives; what is written in it (host,
user, process and when that began) says who it is. On folders where the system's locks do not reach other
machines, a lock of another machine is believed, with its age shown, until it is taken over on purpose.
"""

from __future__ import annotations

import errno
import getpass
import json
import os
import socket
import sys
import time as clock
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType

from studio_core.errors import ProjectError
from studio_core.project.faults import explained

_MOST_BYTES = 4096
_TRIES = 20


@dataclass(frozen=True)
class Holder:
    """Who holds a lock: `started` tells a process from a later one with the same number (empty: unknown);
    `since` in seconds since 1970.
    """

    host: str
    user: str
    pid: int
    started: str
    since: float

    def described(self, now: float) -> str:
        """`anna on studio-3 (process 4711), for 2 hours`."""
        age = max(0.0, now - self.since)
        for seconds, unit in ((86400, "day"), (3600, "hour"), (60, "minute")):
            if age >= seconds:
                count = int(age // seconds)
                return f"{self._who()}, for {count} {unit}{'s' if count > 1 else ''}"
        return f"{self._who()}, for less than a minute"

    def _who(self) -> str:
        return f"{self.user or 'someone'} on {self.host} (process {self.pid})"


class LockedError(ProjectError):
    """Somebody else has the project open; `holder` says who (None: unknown), `foreign` whether the lock
    comes from another machine, where this one cannot see if its process still runs.
    """

    def __init__(self, path: Path, holder: Holder | None, *, foreign: bool, now: float) -> None:
        who = holder.described(now) if holder else "another program"
        hint = "; if that machine no longer has it open, take the lock over" if foreign else ""
        super().__init__(f"{path.name} is open by {who}: it can be opened read-only{hint}")
        self.holder = holder
        self.foreign = foreign


class ProjectLock:
    """A held lock; `release` (or leaving the `with`) gives it back."""

    def __init__(self, path: Path, handle: int) -> None:
        self.path = path
        self._handle: int | None = handle

    def release(self) -> None:
        """Give the lock back; a second call does nothing."""
        handle, self._handle = self._handle, None
        if handle is None:
            return
        with suppress(OSError):
            if _same(handle, self.path):
                if os.name == "nt":  # an open file cannot be removed there
                    os.ftruncate(handle, 0)
                else:
                    self.path.unlink()
        os.close(handle)
        if os.name == "nt":
            with suppress(OSError):
                self.path.unlink()

    def __enter__(self) -> ProjectLock:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


def lock_path(project: Path) -> Path:
    """The lock file of a project."""
    project = project.resolve()
    return project.with_name(f".{project.name}.lock")


def acquire(project: Path, *, take_over: bool = False, me: Holder | None = None) -> ProjectLock:
    """Take the lock of a project for this process.

    LockedError when it is held; `take_over` disregards the lock of another machine, never one whose process
    is known to live. ProjectError when the folder cannot be written.
    """
    path = lock_path(project)
    me = me or this_process()
    with explained(project, "opened for saving"):
        for _ in range(_TRIES):
            flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NOFOLLOW", 0)
            handle = os.open(path, flags, 0o644)
            kept = False
            try:
                guarded = _guard(handle)
                if guarded is False:
                    raise LockedError(project, _parse(_read(path)), foreign=False, now=me.since)
                if not _same(handle, path):
                    continue
                holder = _parse(os.read(handle, _MOST_BYTES))
                foreign = holder is not None and holder.host != me.host
                if holder is not None and (not take_over if foreign else _lives(holder)):
                    raise LockedError(project, holder, foreign=foreign, now=me.since)
                _write(handle, me)
                kept = True
                return ProjectLock(path, handle)
            finally:
                if not kept:
                    os.close(handle)
        raise ProjectError(f"{project.name} could not be opened for saving: its lock keeps changing hands")


def holder_of(project: Path) -> Holder | None:
    """Who has a project open, as far as it can be told without taking the lock; None for nobody."""
    path = lock_path(project)
    try:
        handle = os.open(path, os.O_RDWR | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NOFOLLOW", 0))
    except OSError:
        holder = _parse(_read(path))
        return holder if holder and (holder.host != socket.gethostname() or _lives(holder)) else None
    try:
        if _guard(handle, shared=True) is False:
            return _parse(_read(path))
        holder = _parse(_read(path))
        return holder if holder and (holder.host != socket.gethostname() or _lives(holder)) else None
    finally:
        os.close(handle)


def this_process() -> Holder:
    """What this process writes into its locks."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError, ImportError):
        user = ""
    return Holder(socket.gethostname(), user, os.getpid(), process_start(os.getpid()), clock.time())


def process_start(pid: int) -> str:
    """When a process began, in words that differ for a later process of the same number; empty: unknown."""
    if not sys.platform.startswith("linux"):
        return ""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2]
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{boot}:{fields.split()[19]}"
    except (OSError, IndexError):
        return ""


def _lives(holder: Holder) -> bool:
    """Whether the process of a lock on this machine still runs."""
    if sys.platform.startswith("linux"):
        return bool(holder.started) and process_start(holder.pid) == holder.started
    if os.name == "nt":
        return False  # its lock on the file would still be there
    try:
        os.kill(holder.pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _guard(handle: int, *, shared: bool = False) -> bool | None:
    """Take the system's lock: True when taken, False when another holds it, None when there are none here."""
    try:
        if sys.platform == "win32":
            import msvcrt

            os.lseek(handle, 1 << 30, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
            os.lseek(handle, 0, os.SEEK_SET)
        else:
            import fcntl

            fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES, errno.EDEADLK):
            return False
        return None
    return True


def _same(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat(follow_symlinks=False))
    except FileNotFoundError:
        return False


def _write(handle: int, me: Holder) -> None:
    data = json.dumps(asdict(me)).encode()
    os.lseek(handle, 0, os.SEEK_SET)
    os.ftruncate(handle, 0)
    if os.write(handle, data) != len(data):
        raise OSError(errno.ENOSPC, "No space left on device")
    os.fsync(handle)


def _read(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_MOST_BYTES)
    except OSError:
        return b""


def _parse(data: bytes) -> Holder | None:
    try:
        value = json.loads(data)
        holder = Holder(**value)
        if not all(isinstance(text, str) for text in (holder.host, holder.user, holder.started)):
            return None
        known = bool(holder.host) and type(holder.pid) is int and float(holder.since) >= 0
        return holder if known else None
    except (ValueError, TypeError, RecursionError):
        return None
