"""BTFs as pictures: folders, and zip files as the University of Bonn gave them away in 2003.

A name tells four angles in degrees: `tl` and `pl` (θ, φ of the light), `tv` and `pv` (of the view), as in
`tv030_pv060/00008 tl015 pl120 tv030 pv060.jpg` (UBO2003, and UTIA's `tl015_pl120_tv030_pv060.png`); or four
bare numbers in that order; or two in the folder (the view) and two in the file (the light). Pictures are read
when they are asked for, two at a time.
"""

from __future__ import annotations

import re
import threading
import zipfile
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path, PurePosixPath

import numpy as np

from studio_core.errors import InputError
from studio_core.imaging.io import ImageDecoder
from studio_core.imaging.photograph import Photograph
from studio_core.imaging.photograph_read import PHOTOGRAPHS, read_photograph
from studio_plugins.residual.brackets import AUTOMATIC, linear
from studio_plugins.residual.btf import Block, Indices, block_size, directions, parts
from studio_plugins.residual.samples import F32, F64, Flags

_NUMBER = r"(\d+(?:\.\d+)?)"
_NAMED = {
    key: re.compile(rf"(?<![a-z]){word}[_=]?{_NUMBER}", re.IGNORECASE)
    for key, word in (
        ("tl", "(?:tl|theta_?l|thetai|ti)"),
        ("pl", "(?:pl|phi_?l|phii|pi)"),
        ("tv", "(?:tv|theta_?v|thetao|to)"),
        ("pv", "(?:pv|phi_?v|phio|po)"),
    )
}
_BARE = re.compile(rf"(?<![\d.]){_NUMBER}")
_FEWEST = 12
_MOST = 200_000
_LARGEST = 64_000_000  # bytes of a picture in a zip file
_AT_ONCE = 2
_Photographs = Callable[[str, ImageDecoder], Photograph]


def angles_of(name: str) -> tuple[float, float, float, float] | None:
    """θ, φ of the light and θ, φ of the view in degrees that a path tells, None when it tells none."""
    path = PurePosixPath(name.replace("\\", "/"))
    stem = path.with_suffix("").name
    found = [
        _NAMED[key].search(stem) or _NAMED[key].search(path.parent.name) for key in ("tl", "pl", "tv", "pv")
    ]
    if all(found):
        numbers = [float(one[1]) for one in found if one is not None]
    else:
        numbers = [float(text) for text in _BARE.findall(stem)]
        folder = [float(text) for text in _BARE.findall(path.parent.name)]
        if len(numbers) == 2 and len(folder) == 2:
            numbers += folder
    if len(numbers) != 4:
        return None
    tl, pl, tv, pv = numbers
    return (tl, pl, tv, pv) if max(tl, tv) < 90 and max(pl, pv) <= 360 else None


def looks_like(folder: Path) -> bool:
    """Whether a folder holds pictures that name two directions each."""
    count = 0
    for seen, path in enumerate(folder.rglob("*")):
        if path.suffix.lower() in PHOTOGRAPHS and angles_of(path.relative_to(folder).as_posix()) is not None:
            count += 1
        if count >= _FEWEST:
            return True
        if seen > 20 * _FEWEST:
            return False
    return False


class PictureBtf(ABC):
    """Pictures by name; the first tells the size."""

    def __init__(self, called: str, names: Sequence[str], response: str, source: str) -> None:
        told = [(name, angles_of(name)) for name in names]
        some = sorted((angles, name) for name, angles in told if angles is not None)
        if len(some) < _FEWEST:
            raise InputError(
                f"{called} cannot be used: its pictures do not name a light and a view, such as"
                " tl015_pl120_tv030_pv060"
            )
        if len(some) > _MOST:
            raise InputError(f"{called} cannot be used: it holds more than {_MOST} pictures")
        by_angles = dict(some[::-1])
        order = sorted(by_angles, key=lambda a: (a[2], a[3], a[0], a[1]))
        self._names = [by_angles[angles] for angles in order]
        radians = np.radians(np.asarray(order, np.float64))
        self.lights: F64 = directions(radians[:, 0], radians[:, 1])
        self.views: F64 = directions(radians[:, 2], radians[:, 3])
        self.source = source
        self.notes: tuple[str, ...] = ()
        left = len(names) - len(order)
        if left:
            self.notes = (
                f"{left} pictures are left out: their names tell no directions, or those of others.",
            )
        self._response = response
        with ImageDecoder() as decoder, self._opened() as photograph:
            height, width = photograph(self._names[0], decoder).pixels.shape[:2]
        self.size: tuple[int, int] = height, width

    def blocks(self, which: Indices) -> Iterator[Block]:
        """See `Btf`."""
        with ExitStack() as stack:
            photograph = stack.enter_context(self._opened())
            decoders = [stack.enter_context(ImageDecoder()) for _ in range(_AT_ONCE)]
            own = threading.local()

            def start() -> None:
                own.decoder = decoders.pop()

            def read(index: int) -> tuple[F32, Flags]:
                name = self._names[index]
                shot = photograph(name, own.decoder)
                if shot.pixels.shape[:2] != self.size:
                    height, width = shot.pixels.shape[:2]
                    raise InputError(
                        f"{name} cannot be used: it is {width} × {height} pixels, others are"
                        f" {self.size[1]} × {self.size[0]}"
                    )
                return linear(shot, self._response, grow=False)

            pool = ThreadPoolExecutor(_AT_ONCE, initializer=start)
            stack.callback(pool.shutdown, cancel_futures=True)
            groups = parts(which, block_size(self.size))
            ahead = [pool.submit(read, int(i)) for i in groups[0]] if groups else []
            for k, group in enumerate(groups):
                now, ahead = ahead, []
                if k + 1 < len(groups):
                    ahead = [pool.submit(read, int(i)) for i in groups[k + 1]]
                done = [one.result() for one in now]
                values, clipped = (np.stack(part) for part in zip(*done, strict=True))
                yield Block(group, values, clipped if clipped.any() else None)

    @abstractmethod
    def _opened(self) -> AbstractContextManager[_Photographs]:
        """What reads a picture by its name, as long as the source is open."""


class FolderBtf(PictureBtf):
    """A folder, nested or not."""

    def __init__(self, folder: Path, response: str = AUTOMATIC) -> None:
        self._folder = folder
        names = [
            path.relative_to(folder).as_posix()
            for path in folder.rglob("*")
            if path.suffix.lower() in PHOTOGRAPHS and not path.name.startswith(".")
        ]
        super().__init__(str(folder), names, response, "pictures")

    @contextmanager
    def _opened(self) -> Iterator[_Photographs]:
        yield lambda name, decoder: read_photograph(self._folder / name, decoder=decoder)


class ZipBtf(PictureBtf):
    """A zip file of pictures, which stays packed."""

    def __init__(self, path: Path, response: str = AUTOMATIC) -> None:
        self._path = path
        with self._file() as file:
            names = [
                info.filename
                for info in file.infolist()
                if PurePosixPath(info.filename).suffix.lower() in PHOTOGRAPHS
                and "__MACOSX" not in info.filename
            ]
        super().__init__(str(path), names, response, "zip")

    def _file(self) -> zipfile.ZipFile:
        try:
            return zipfile.ZipFile(self._path)
        except (OSError, zipfile.BadZipFile, ValueError) as error:
            raise InputError(f"{self._path} cannot be read: it is no zip file ({error})") from None

    @contextmanager
    def _opened(self) -> Iterator[_Photographs]:
        lock = threading.Lock()
        with self._file() as file:

            def photograph(name: str, decoder: ImageDecoder) -> Photograph:
                with lock:
                    data = self._bytes(file, name)
                return read_photograph(data, name, decoder)

            yield photograph

    def _bytes(self, file: zipfile.ZipFile, name: str) -> bytes:
        info = file.getinfo(name)
        if info.file_size > _LARGEST:
            raise InputError(f"{name} in {self._path.name} cannot be read: it is too large for a picture")
        try:
            return file.read(info)
        except (
            OSError,
            zipfile.BadZipFile,
            zlib.error,
            RuntimeError,
            NotImplementedError,
            EOFError,
        ) as error:
            raise InputError(f"{name} in {self._path.name} cannot be read: {error}") from None
