"""Small pictures of projects, kept in the user's cache by the project's path."""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PySide6.QtGui import QImage, QImageReader

from studio_core.kernels.tonemap import tonemap

LONGEST = 320
"""Pixels of the longer side."""
_MOST = 100  # files in the folder
_MOST_BYTES = 1 << 20  # of one that is read: larger is none of ours


def small_picture(linear: npt.NDArray[Any], exposure: float, kind: str) -> npt.NDArray[np.uint8]:
    """8-bit (h, w, 3), at most `LONGEST` pixels long, of scene-linear (H, W, 3): averaged, then mapped."""
    from studio_core.imaging.resample import resize_area, thumbnail_size

    height, width = thumbnail_size(*linear.shape[:2], LONGEST)
    return tonemap(resize_area(linear[:, :, :3], height, width), exposure, kind)


class Thumbnails:
    """A folder of small PNG files; safe to delete, bounded in number."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path_of(self, project: Path) -> Path:
        """Where the picture of a project is, or would be."""
        name = hashlib.sha256(str(project.absolute()).encode("utf-8", "surrogateescape")).hexdigest()
        return self.folder / f"{name[:32]}.png"

    def keep(self, project: Path, linear: npt.NDArray[Any], exposure: float, kind: str) -> None:
        """Make the picture; for the files' thread. A full disk is no reason to trouble anybody."""
        from studio_core.errors import InputError
        from studio_core.imaging.encode import write_png

        with contextlib.suppress(InputError, OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
            write_png(self.path_of(project), small_picture(linear, exposure, kind))
            self._sweep()

    def forget(self, project: Path) -> None:
        """Remove the picture of a project."""
        with contextlib.suppress(OSError):
            self.path_of(project).unlink(missing_ok=True)

    def copy(self, source: Path, target: Path) -> None:
        """The picture of another file that holds the same."""
        with contextlib.suppress(OSError):
            self.path_of(target).write_bytes(self.path_of(source).read_bytes())

    def find(self, project: Path) -> QImage | None:
        """The picture of a project, None without one."""
        return read_small(self.path_of(project))

    def _sweep(self) -> None:
        """The oldest go when there are too many."""
        found = sorted(self.folder.glob("*.png"), key=lambda path: path.stat().st_mtime, reverse=True)
        for path in found[_MOST:]:
            path.unlink(missing_ok=True)


def read_small(path: Path) -> QImage | None:
    """A small picture from a file; None where it is missing, damaged or large."""
    try:
        if not path.is_file() or path.stat().st_size > _MOST_BYTES:
            return None
    except OSError:
        return None
    reader = QImageReader(str(path))
    size = reader.size()
    if not size.isValid() or max(size.width(), size.height()) > 4 * LONGEST:
        return None
    image = reader.read()
    return None if image.isNull() else image
