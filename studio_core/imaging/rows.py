"""Pictures written row after row, so that nobody has to hold them whole.

A file appears whole or not at all: it is written beside its place, then put there.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError

Numbers = Literal["uint8", "uint16", "half", "float"]
Facts = Mapping[str, str | float | int]
LARGEST_HALF = np.float32(65504)


class RowWriter:
    """One file under way: `write` rows from the top down inside a `with`.

    `names` are the channels, `numbers` what each is stored as; halves take float32 and end at their largest.
    `suffix` says what kind of file it is where its name does not. Leaving the `with` puts the file in its
    place; an exception in it leaves nothing. InputError when the disk refuses, ValueError when rows do not
    fit or are missing.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        width: int,
        height: int,
        names: tuple[str, ...],
        numbers: Numbers,
        facts: Facts | None = None,
        *,
        suffix: str = "",
    ) -> None:
        self.path = Path(path)
        self.written = 0
        self._size, self._names, self._numbers, self._facts = (width, height), names, numbers, facts or {}
        suffix = suffix or self.path.suffix.lower()
        self._beside = self.path.with_name(f".{self.path.stem[:40]}-{secrets.token_hex(6)}{suffix}")
        self._output: Any = None

    def __enter__(self) -> RowWriter:
        return self

    def _open(self) -> None:
        import OpenImageIO as oiio  # noqa: N813 - its customary name

        if not self.path.parent.is_dir():
            raise InputError(f"{self.path} cannot be written: there is no folder {self.path.parent}")
        kinds = {"uint8": oiio.UINT8, "uint16": oiio.UINT16, "half": oiio.HALF, "float": oiio.FLOAT}
        spec = oiio.ImageSpec(*self._size, len(self._names), kinds[self._numbers])
        spec.channelnames = self._names
        for key, value in self._facts.items():
            spec.attribute(key, value)
        self._output = oiio.ImageOutput.create(str(self._beside))
        if self._output is None:
            raise self._refused(oiio.geterror())
        if not self._output.open(str(self._beside), spec):
            raise self._refused(self._output.geterror())

    def write(self, rows: npt.NDArray[Any]) -> None:
        """The next rows (h, W, C)."""
        width, height = self._size
        if rows.shape[1:] != (width, len(self._names)) or self.written + len(rows) > height:
            raise ValueError(f"rows of shape {rows.shape} do not fit a picture of {width} × {height}")
        if self._output is None:
            self._open()
        if self._numbers == "half":
            rows = np.clip(rows, -LARGEST_HALF, LARGEST_HALF)
        first, self.written = self.written, self.written + len(rows)
        if not self._output.write_scanlines(first, self.written, 0, np.ascontiguousarray(rows)):
            raise self._refused(self._output.geterror())

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            done = self._output is not None and self._output.close()
            if kind is not None:
                return
            if self.written != self._size[1]:
                raise ValueError(f"{self.path.name} has {self.written} of {self._size[1]} rows")
            failure = self._output.geterror()
            if failure or not done:
                raise self._refused(failure)
            with self._beside.open("rb+") as file:
                os.fsync(file.fileno())
            self._beside.replace(self.path)
        except OSError as refused:
            raise InputError(f"{self.path} cannot be written: {refused.strerror or refused}") from None
        finally:
            self._output = None
            self._beside.unlink(missing_ok=True)

    def _refused(self, why: str) -> InputError:
        reason = " ".join(str(why).split()).rstrip(".")
        return InputError(f"{self.path} cannot be written: {reason or 'the disk may be full'}")
