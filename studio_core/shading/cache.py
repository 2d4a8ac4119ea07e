"""Computed arrays kept on disk by content: bounded, shared between projects, safe to delete at any time.

An entry's name is a hash of everything it was computed from and of the code's own version of the method, so
that it is never out of date. A damaged or half-written entry is a miss.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import time
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

_DAMAGED = (ValueError, KeyError, EOFError, RuntimeError, MemoryError, zipfile.BadZipFile, zlib.error)
_ABANDONED_S = 3600.0  # no entry takes so long to write
Arrays = Mapping[str, npt.NDArray[Any]]


class DiskCache:
    """Named arrays in `folder`, at most `limit` bytes, least recently used first out; for any thread."""

    def __init__(self, folder: Path, limit: int = 1 << 30) -> None:
        self._folder = folder
        self._limit = limit

    def get(self, method: str, *inputs: object) -> dict[str, npt.NDArray[Any]] | None:
        """What was kept for these inputs, or None."""
        path = self._path(method, inputs)
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as found:
                made = {name: found[name] for name in found.files}
            os.utime(path)
        except (*_DAMAGED, OSError):
            return None
        return made

    def put(self, arrays: Arrays, method: str, *inputs: object) -> None:
        """Keep arrays; a disk that refuses is no error, the next start computes again."""
        path = self._path(method, inputs)
        beside = path.with_suffix(f".{secrets.token_hex(4)}.part")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            with beside.open("wb") as file:
                np.savez(file, allow_pickle=False, **dict(arrays))
            beside.replace(path)
            self._shrink()
        except OSError:
            with contextlib.suppress(OSError):
                beside.unlink()

    def _path(self, method: str, inputs: tuple[object, ...]) -> Path:
        text = "\n".join([method, *(repr(value) for value in inputs)])
        return self._folder / f"{hashlib.blake2b(text.encode(), digest_size=16).hexdigest()}.npz"

    def _shrink(self) -> None:
        for part in self._folder.glob("*.part"):
            with contextlib.suppress(OSError):
                if time.time() - part.stat().st_mtime > _ABANDONED_S:
                    part.unlink()
        entries = []
        for path in self._folder.glob("*.npz"):
            with contextlib.suppress(OSError):
                found = path.stat()
                entries.append((found.st_mtime, found.st_size, path))
        total = sum(size for _, size, _ in entries)
        for _, size, path in sorted(entries):
            if total <= self._limit:
                return
            with contextlib.suppress(OSError):
                path.unlink()
                total -= size
