"""Reading pictures: every file goes through a decoder in a child process.

Decoders of picture formats are large C libraries, and a damaged or hostile file can crash or hang them.
The child takes the crash; the caller gets an `InputError` that names the file.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.imaging.decode import Facts, Limits
from studio_core.imaging.radiance import HEADER, parse_header, with_format
from studio_core.scene.geometry import Image

_BOOT = (
    "import sys, json; sys.path[:] = json.loads(sys.argv[1]);"
    " from studio_core.imaging.decode_child import main; main(int(sys.argv[2]), int(sys.argv[3]))"
)
_MAGIC: tuple[tuple[bytes, tuple[str, ...]], ...] = (
    (b"\x76\x2f\x31\x01", (".exr", ".sxr", ".mxr")),
    (b"#?", (".hdr", ".rgbe")),
    (b"\x89PNG", (".png",)),
    (b"\xff\xd8\xff", (".jpg", ".jpeg", ".jpe", ".jfif", ".jif", ".jfi")),
    (b"II*\0", (".tif", ".tiff", ".tx")),
    (b"MM\0*", (".tif", ".tiff", ".tx")),
    (b"II+\0", (".tif", ".tiff", ".tx")),
    (b"MM\0+", (".tif", ".tiff", ".tx")),
    (b"BM", (".bmp", ".dib")),
    (b"GIF8", (".gif",)),
    (b"RIFF", (".webp",)),
    (b"\0\0\0\x0cjP  ", (".jp2", ".j2k")),
    (b"\xff\x4f\xff\x51", (".j2k", ".j2c")),
    (b"8BPS", (".psd", ".psb")),
    (b"DDS ", (".dds",)),
    (b"SDPX", (".dpx",)),
    (b"XPDS", (".dpx",)),
    *((f"P{kind}".encode(), (".ppm", ".pgm", ".pbm", ".pnm", ".pfm")) for kind in "123456Ff"),
)
EXTENSIONS = tuple(sorted({e for _, names in _MAGIC for e in names} | {".tga"}))
"""File name extensions of the pictures that can be read, lower case with the dot."""


class ImageDecoder:
    """Decodes pictures in one child process that lives until `close` and is started again when it dies.

    `timeout` bounds each picture, in seconds. Threads may share a decoder; they take turns.
    """

    def __init__(self, limits: Limits | None = None, timeout: float = 120.0) -> None:
        self.limits = limits or Limits()
        self.timeout = timeout
        self._child: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()

    def __enter__(self) -> ImageDecoder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def read(self, path: str | os.PathLike[str], *, plain: bool = False) -> Image:
        """The picture in a file, made finite; InputError naming the file when it cannot be read.

        `plain`: numbers that are no colours (roughness, normals), without any transfer curve.
        """
        return _finite(*self.read_pixels(path, plain=plain), plain)

    def read_pixels(
        self, path: str | os.PathLike[str], *, plain: bool = False
    ) -> tuple[npt.NDArray[Any], Facts]:
        """The pixels as the file holds them, NaN and Inf included, and what it says about them."""
        path = Path(path)
        name = str(path)
        try:
            if not path.is_file():
                raise InputError(f"{name} cannot be read: there is no such file")
            with path.open("rb") as file:
                start = file.read(HEADER)
        except OSError as error:
            raise InputError(f"{name} cannot be read: {error.strerror or error}") from None
        except ValueError as error:
            raise InputError(f"{name!r} cannot be read: {error}") from None
        suffix = suffix_of(start, path.suffix.lower())
        if suffix is None:
            raise InputError(f"{name} cannot be read: it is no picture of a known format")
        if suffix == ".hdr" and not parse_header(start).format:
            return self._ask_bytes(path.read_bytes(), suffix, name, plain)
        if suffix == path.suffix.lower() and _plain(name):
            return self._ask(str(path.resolve()), name, plain=plain)
        with tempfile.TemporaryDirectory(prefix="lucarne-") as folder:
            copy = Path(folder) / f"picture{suffix}"
            try:
                shutil.copyfile(path, copy)
            except OSError as error:
                raise InputError(f"{name} cannot be read: {error.strerror or error}") from None
            return self._ask(str(copy), name, plain=plain)

    def decode(self, data: bytes, name: str, *, plain: bool = False) -> Image:
        """The picture in the bytes of a file, made finite; messages call it `name`. `plain` as for `read`."""
        suffix = suffix_of(data[:HEADER], Path(name).suffix.lower()[:8] if "\0" not in name else "")
        if suffix is None:
            raise InputError(f"{name} cannot be read: it is no picture of a known format")
        return _finite(*self._ask_bytes(data, suffix, name, plain), plain)

    def close(self) -> None:
        """End the child; a later read starts a new one."""
        with self._lock:
            self._stop()

    def _ask_bytes(self, data: bytes, suffix: str, name: str, plain: bool) -> tuple[npt.NDArray[Any], Facts]:
        if suffix == ".hdr" and not parse_header(data).format:
            data = with_format(data)
        with tempfile.TemporaryDirectory(prefix="lucarne-") as folder:
            copy = Path(folder) / f"picture{suffix}"
            copy.write_bytes(data)
            return self._ask(str(copy), name, plain=plain)

    def photograph(self, data: bytes, suffix: str, name: str) -> tuple[npt.NDArray[Any], Facts]:
        """Encoded numbers of a photograph in a file's bytes, and the facts (`photograph_decode`)."""
        with tempfile.TemporaryDirectory(prefix="lucarne-") as folder:
            copy = Path(folder) / f"picture{suffix}"
            copy.write_bytes(data)
            return self._ask(str(copy), name, photograph=True)

    def _ask(
        self, path: str, name: str, *, photograph: bool = False, plain: bool = False
    ) -> tuple[npt.NDArray[Any], Facts]:
        request = {"path": path, "photograph": photograph, "plain": plain}
        with self._lock:
            child = self._start()
            late = threading.Event()

            def end() -> None:
                late.set()
                child.kill()

            timer = threading.Timer(self.timeout, end)
            timer.daemon = True
            timer.start()
            try:
                answer, pixels = self._exchange(child, request)
            except (OSError, EOFError, ValueError, KeyError, TypeError, MemoryError):
                self._stop()
                if late.is_set():
                    cause = f"decoding it took more than {self.timeout:g} s"
                else:
                    cause = "it makes the decoder crash, so it is damaged"
                raise InputError(f"{name} cannot be read: {cause}") from None
            except BaseException:  # interrupted between question and answer: out of step
                self._stop()
                raise
            finally:
                timer.cancel()
        if pixels is None:
            raise InputError(f"{name} cannot be read: {answer['error']}")
        facts = Facts(**answer["facts"])
        pixels.flags.writeable = False
        return pixels, facts

    def _exchange(
        self, child: subprocess.Popen[bytes], request: dict[str, Any]
    ) -> tuple[dict[str, Any], npt.NDArray[Any] | None]:
        assert child.stdin is not None
        assert child.stdout is not None
        child.stdin.write(json.dumps(request).encode() + b"\n")
        child.stdin.flush()
        line = child.stdout.readline(1 << 20)
        answer = json.loads(line)
        if "error" in answer:
            return answer, None
        height, width, channels = (int(n) for n in answer["shape"])
        dtype = np.dtype({"uint8": np.uint8, "uint16": np.uint16, "float32": np.float32}[answer["dtype"]])
        if not (0 < height * width <= self.limits.pixels and channels in (1, 3, 4)):
            raise ValueError("an impossible answer")
        pixels = np.empty((height, width, channels), dtype)
        room = pixels.data.cast("B")
        while room:
            count = child.stdout.readinto(room)  # type: ignore[attr-defined]
            if not count:
                raise EOFError
            room = room[count:]
        return answer, pixels

    def _start(self) -> subprocess.Popen[bytes]:
        if self._child is not None and self._child.poll() is None:
            return self._child
        self._stop()
        where = json.dumps([str(Path(entry).resolve()) for entry in sys.path])
        boot = [sys.executable, "-P", "-c", _BOOT, where, str(self.limits.pixels), str(self.limits.megabytes)]
        self._child = subprocess.Popen(
            boot,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )
        return self._child

    def _stop(self) -> None:
        child, self._child = self._child, None
        if child is None:
            return
        child.kill()
        for pipe in (child.stdin, child.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except OSError:
                    continue
        child.wait()


def _finite(pixels: npt.NDArray[Any], facts: Facts, plain: bool) -> Image:
    """The picture with 0 for NaN and -Inf, and the brightest other number for Inf."""
    if pixels.dtype == np.float32 and not (np.isfinite(pixels.min()) and np.isfinite(pixels.max())):
        brightest = pixels.max(initial=0.0, where=np.isfinite(pixels))
        pixels = np.nan_to_num(pixels, nan=0.0, posinf=brightest, neginf=0.0)
    return Image(pixels, "data" if plain else facts.encoding)


def read_image(
    source: str | os.PathLike[str] | bytes,
    name: str = "",
    decoder: ImageDecoder | None = None,
    *,
    plain: bool = False,
) -> Image:
    """A picture from a file, or from a file's bytes that messages call `name`.

    OpenEXR, Radiance and floating-point TIFF give linear float32 Rec.709; 8 bits stay sRGB-encoded
    uint8; 16 bits are decoded to linear float32. (H, W, C): grey 1, colour 3, with alpha 4. NaN becomes 0,
    Inf the brightest other number.
    `plain` as for `ImageDecoder.read`. Without a `decoder` one is started for this picture alone. Raises
    InputError.
    """
    if decoder is None:
        with ImageDecoder() as made:
            return read_image(source, name, made, plain=plain)
    if isinstance(source, bytes):
        return decoder.decode(source, name or "the picture", plain=plain)
    return decoder.read(source, plain=plain)


def suffix_of(start: bytes, given: str) -> str | None:
    """The extension by which the decoder library finds the format; the content decides."""
    for magic, suffixes in _MAGIC:
        if start.startswith(magic):
            return given if given in suffixes else suffixes[0]
    return given if given == ".tga" and start else None


def _plain(name: str) -> bool:
    """Whether the library can be given this name (# and % are its patterns for sequences)."""
    try:
        name.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return not any(c in name for c in "#%?")
