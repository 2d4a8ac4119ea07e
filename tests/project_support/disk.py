"""The failing disk of `faults.c`, and what is left of a logged one after a power cut."""

from __future__ import annotations

import ctypes
import os
import random
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

SOURCE = Path(__file__).with_name("faults.c")
ROOT = Path(__file__).parents[2]
_HEAD = struct.Struct("<cQQI")
_SECTOR = 512


def compiler() -> str | None:
    """The C compiler, where there is one and the disk can be preloaded."""
    return shutil.which("cc") if sys.platform.startswith("linux") else None


def build(folder: Path) -> Path:
    """Compile the disk."""
    library = folder / "faults.so"
    command = ["cc", "-shared", "-fPIC", "-O1", "-w", "-o", str(library), str(SOURCE), "-ldl"]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    return library


def environment(**more: str) -> dict[str, str]:
    """The environment of a child that imports from this checkout."""
    paths = os.pathsep.join(str(ROOT / part) for part in (".", "ui", "plugins", "tests"))
    return {**os.environ, "PYTHONPATH": paths, **more}


class Disk:
    """The preloaded disk, from inside the process."""

    def __init__(self, folder: Path) -> None:
        self._library = ctypes.CDLL(None)
        self._folder = os.fsencode(folder)

    def arm(self, nth: int = 0, error: int = 0, *, always: bool = False) -> None:
        """Fail the `nth` change from now (0: none), or all from it on; error 0 is a short write."""
        self._library.fault_arm(self._folder, nth, error, int(always))

    def disarm(self) -> int:
        """Stop failing; how many changes there were."""
        return int(self._library.fault_disarm())

    def log(self, path: Path | None) -> None:
        """Note every change in a new file, or stop."""
        self._library.fault_log(None if path is None else os.fsencode(path))


@dataclass(frozen=True)
class Change:
    """One logged call: w(rite), t(runcate), s(ync), c(reate), u(nlink), r(ename)."""

    kind: str
    inode: int
    offset: int
    data: bytes

    @property
    def names(self) -> tuple[Path, Path]:
        """Paths of a change of names."""
        one, _, two = self.data.partition(b"\0")
        return Path(os.fsdecode(one)), Path(os.fsdecode(two))


def read_log(path: Path) -> list[Change]:
    """All logged changes in order; a file gets a number of its own, also where an inode is used again."""
    data, at, made = path.read_bytes(), 0, []
    numbers: dict[int, int] = {}
    while at < len(data):
        kind, inode, offset, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        if kind == b"c":
            numbers[inode] = -len(made) - 1
        made.append(Change(kind.decode(), numbers.get(inode, inode), offset, data[at : at + length]))
        at += length
    return made


@dataclass
class PowerCut:
    """What a disk may hold after the power failed: `names` to inodes, inodes to content.

    Data of a file is sure once the file was flushed; names are sure once their folder was flushed. Of what
    is not sure, any subset of writes (also torn in sectors) and any beginning of the changes of names may
    have reached the disk.
    """

    names: dict[Path, int]
    contents: dict[int, bytes]
    folder_inode: int

    def after(self, changes: list[Change], cut: int, rng: random.Random) -> dict[Path, bytes]:
        """One possible state when the power fails after `cut` changes."""
        done = changes[:cut]
        last_flush: dict[int, int] = {}
        for index, change in enumerate(done):
            if change.kind == "s":
                last_flush[change.inode] = index
        names_sure = last_flush.get(self.folder_inode, -1)
        loose = [i for i, c in enumerate(done) if c.kind in "cur" and i > names_sure]
        names_until = rng.choice([names_sure, *loose])
        chance = rng.choice([0.0, 0.5, 1.0])
        names, contents = dict(self.names), dict(self.contents)
        for index, change in enumerate(done):
            if change.kind in "wt":
                sure = index <= last_flush.get(change.inode, -1)
                if sure or rng.random() < chance:
                    old = contents.get(change.inode, b"")
                    contents[change.inode] = _changed(old, change, sure, rng)
            elif change.kind in "cur" and index <= names_until:
                one, two = change.names
                if change.kind == "c":
                    names[one] = change.inode
                    contents.setdefault(change.inode, b"")
                elif change.kind == "u":
                    names.pop(one, None)
                elif one in names:
                    names[two] = names.pop(one)
        return {path: contents.get(inode, b"") for path, inode in names.items()}


def _changed(old: bytes, change: Change, sure: bool, rng: random.Random) -> bytes:
    if change.kind == "t":
        return old[: change.offset].ljust(change.offset, b"\0")
    made = bytearray(old.ljust(change.offset + len(change.data), b"\0"))
    torn = not sure and rng.random() < 0.3
    for start in range(0, len(change.data), _SECTOR):
        if not torn or rng.random() < 0.5:
            piece = change.data[start : start + _SECTOR]
            made[change.offset + start : change.offset + start + len(piece)] = piece
    return bytes(made)


def cuts(changes: list[Change]) -> Iterator[int]:
    """Every moment between two changes."""
    return iter(range(len(changes) + 1))
