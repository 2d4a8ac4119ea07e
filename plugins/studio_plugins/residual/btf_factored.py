"""`.btf` files of the University of Bonn (UBO2014): a matrix of all pictures, factorised, as half floats.

What is in them (little-endian; as read by Bonn's own btflib for Matlab and by two readers in C++ and Python
that others wrote, which agree):

- a signature: `!DFMF08FCR`, or `!FMF12FCER`, `!FMF06FCR`, `!FMF06FC`
- a description: its bytes (u32), version (u32), three texts of 80 bytes, pixels per millimetre (f32), scale
  of the colours (3 f32); from version 2 on whether cosines are in the data (u32), from 3 on a text of XML
  (u32 bytes), from 4 on the names of the channels (u32 count, each u32 bytes)
- directions: views (u32), and of each θ, φ (f32, radians), lights (u32), θ, φ of each
- width and height (u32); where the signature ends in R rotations (u32 count, 9 f32 each)
- DFMF: components (u32), colour model (i32), mean colour (3 f32), colour matrix (9 f32); then each channel:
  bytes a number (u8), components k, rows, columns (u32), k singular values, U (rows × k), S·V (columns × k)
- FMF: with the E a version (u8), from 1 on whether values are logarithms (u32), from 2 on the size of a
  height field (2 u32) and that (f16); components (u32), bytes a number (u8), then one matrix as above, whose
  rows have the three channels next to each other

A row is a pair of directions (lights fastest) and a column a texel (along a line first), or the other way
round. Values without cosines are multiplied by that of the light. The matrices are mapped, not read.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_plugins.residual.btf import Block, Indices, block_size, directions, parts
from studio_plugins.residual.samples import F32, F64

_SIGNATURES = (b"!DFMF08FCR", b"!FMF12FCER", b"!FMF06FCR", b"!FMF06FC")
_EPSILON = 1e-5
_MOST_DIRECTIONS, _WIDEST, _MOST_COMPONENTS = 4096, 1 << 14, 1 << 14
_YUV = np.array([[1, 0, 1.13983], [1, -0.39465, -0.5806], [1, 2.03211, 0]], np.float32)
_YCOCG = np.array([[1, 1, -1], [1, 0, 1], [1, -1, -1]], np.float32)
_MODELS = {0: "RGB", 1: "YUV", 3: "PCA", 4: "YCoCg", 9: "log Y, UV", 11: "log Y, U/Y, V/Y", 12: "log RGB"}
"""Colour models that are understood, by their numbers."""

Matrix = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class _Factors:
    """U (rows, k) and S·V (columns, k) of one channel, or of all."""

    left: Matrix
    right: Matrix


class FactoredBtf:
    """A `.btf` file. InputError in one sentence when it is damaged or of a kind that is not understood."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            with path.open("rb") as file:
                self._read(file)
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
        except (struct.error, ValueError, OverflowError) as error:
            raise InputError(f"{path} cannot be read: it is damaged or incomplete ({error})") from None

    def _read(self, file: BinaryIO) -> None:
        start = file.read(10)
        signature = next((s for s in _SIGNATURES if start.startswith(s)), None)
        if signature is None:
            kind = " of a kind that is not understood" if start[:1] == b"!" else ""
            raise InputError(f"{self._path} cannot be read: it is no BTF file{kind}")
        file.seek(len(signature))
        with_cosine, channels = self._description(file)
        if channels != 3:
            raise InputError(
                f"{self._path} cannot be used: it has {channels} channels instead of three colours"
            )
        views, lights = self._directions(file)
        width, height = _numbers(file, "<2I")
        if not (0 < width <= _WIDEST and 0 < height <= _WIDEST):
            raise ValueError(f"{width} × {height} texels")
        self.size: tuple[int, int] = height, width
        notes = []
        if signature.endswith(b"R"):
            (rotations,) = _numbers(file, "<I")
            if rotations:
                notes.append("Texels have frames of their own in the file; they are taken for the surface's.")
                file.seek(36 * rotations, 1)
        count = len(lights) // len(views)
        self.views: F64 = np.repeat(views, count, axis=0)
        self.lights: F64 = lights
        self._logarithm = False
        self._mean, self._matrix = np.zeros(3, np.float32), np.eye(3, dtype=np.float32)
        self._model = 0
        if signature.startswith(b"!DFMF"):
            _, self._model = _numbers(file, "<Ii")
            self._mean = np.array(_numbers(file, "<3f"), np.float32)
            self._matrix = np.array(_numbers(file, "<9f"), np.float32).reshape(3, 3)
            if self._model not in _MODELS:
                raise InputError(
                    f"{self._path} cannot be used: its colour model {self._model} is not understood"
                )
            self._factors = [self._matrices(file, _numbers(file, "<B")[0]) for _ in range(3)]
        else:
            self._height_field(file, signature)
            _numbers(file, "<I")
            self._factors = [self._matrices(file, _numbers(file, "<B")[0])]
        self._check()
        self._cosine = np.ones(len(lights)) if with_cosine else np.maximum(lights[:, 2], 0)
        self.source = "btf"
        self.notes: tuple[str, ...] = tuple(notes)

    def _description(self, file: BinaryIO) -> tuple[bool, int]:
        """Whether cosines are in the data, and how many channels there are."""
        begin = file.tell()
        size, version = _numbers(file, "<2I")
        file.seek(240 + 16, 1)
        cosine = bool(_numbers(file, "<I")[0]) if version > 1 else False
        if version > 2:
            file.seek(_numbers(file, "<I")[0], 1)
        channels = 3
        if version > 3:
            (channels,) = _numbers(file, "<I")
            for _ in range(min(channels, 1000)):
                file.seek(_numbers(file, "<I")[0], 1)
        if file.tell() != begin + size:
            raise ValueError("its description has another length than it says")
        return cosine, channels

    def _directions(self, file: BinaryIO) -> tuple[F64, F64]:
        """Views (v, 3), and the lights of all of them one after the other (v · l, 3)."""
        (count,) = _numbers(file, "<I")
        if not 0 < count <= _MOST_DIRECTIONS:
            raise ValueError(f"{count} views")
        views, lights, each = [], [], None
        for _ in range(count):
            views.append(_numbers(file, "<2f"))
            (own,) = _numbers(file, "<I")
            each = own if each is None else each
            if own != each or not 0 < own <= _MOST_DIRECTIONS:
                raise ValueError("views have different numbers of lights")
            lights.append(np.array(_numbers(file, f"<{2 * own}f")).reshape(own, 2))
        angles, towards = np.array(views), np.concatenate(lights)
        if not (np.isfinite(angles).all() and np.isfinite(towards).all()):
            raise ValueError("directions that are no numbers")
        return directions(angles[:, 0], angles[:, 1]), directions(towards[:, 0], towards[:, 1])

    def _height_field(self, file: BinaryIO, signature: bytes) -> None:
        if not signature.endswith(b"ER"):
            return
        (version,) = _numbers(file, "<B")
        if version >= 1:
            self._logarithm = bool(_numbers(file, "<I")[0])
        if version >= 2:
            width, height = _numbers(file, "<2I")
            file.seek(2 * width * height, 1)
        if version >= 3:
            raise ValueError(f"version {version} of its format")

    def _matrices(self, file: BinaryIO, scalar: int) -> _Factors:
        kinds: dict[int, str] = {2: "<f2", 4: "<f4", 8: "<f8"}
        if scalar not in kinds:
            raise ValueError(f"numbers of {scalar} bytes")
        components, rows, columns = _numbers(file, "<3I")
        if not 0 < components <= _MOST_COMPONENTS:
            raise ValueError(f"{components} components")
        file.seek(scalar * components, 1)
        made = []
        for count in (rows, columns):
            offset, wanted = file.tell(), scalar * count * components
            here = file.seek(0, 2)
            if offset + wanted > here:
                raise ValueError(f"{math.ceil((offset + wanted - here) / 1000)} kB are missing")
            shape = (count, components)
            made.append(
                np.memmap(self._path, kinds[scalar], "r", offset, shape) if wanted else np.zeros(shape)
            )
            file.seek(offset + wanted)
        return _Factors(*made)

    def _check(self) -> None:
        pairs, texels = len(self.lights), self.size[0] * self.size[1]
        channels = 3 if len(self._factors) == 1 else 1
        sizes = {(len(one.left), len(one.right)) for one in self._factors}
        self._pairs_first = sizes == {(channels * pairs, texels)}
        if not self._pairs_first and sizes != {(channels * texels, pairs)}:
            raise ValueError("its matrices have other sizes than its directions and texels")

    def blocks(self, which: Indices) -> Iterator[Block]:
        """See `Btf`."""
        texels = [np.asarray(self._texels(c), np.float32) for c in range(3)]
        height, width = self.size
        for group in parts(which, block_size(self.size)):
            values = np.empty((len(group), height * width, 3), np.float32)
            with np.errstate(invalid="ignore", over="ignore"):  # of damaged numbers, which become 0
                for c in range(3):
                    values[..., c] = np.asarray(self._pairs(c)[group], np.float32) @ texels[c].T
                values = self._colours(values)
                values *= self._cosine[group, None, None].astype(np.float32)
            values = np.nan_to_num(np.maximum(values, np.float32(0)), copy=False, posinf=0.0)
            yield Block(group, values.reshape(len(group), height, width, 3))

    def _pairs(self, channel: int) -> Matrix:
        """(pairs, k) of a channel."""
        return self._part(channel, self._pairs_first)

    def _texels(self, channel: int) -> Matrix:
        """(texels, k) of a channel."""
        return self._part(channel, not self._pairs_first)

    def _part(self, channel: int, left: bool) -> Matrix:
        if len(self._factors) > 1:
            return self._factors[channel].left if left else self._factors[channel].right
        return self._factors[0].left[channel::3] if left else self._factors[0].right

    def _colours(self, values: F32) -> F32:
        """RGB of what is stored (…, 3)."""
        if self._logarithm:
            return np.asarray(np.exp(values) - np.float32(_EPSILON), np.float32)
        match self._model:
            case 1:
                return np.asarray(values @ _YUV.T, np.float32)
            case 3:
                return np.asarray(values @ self._matrix + self._mean, np.float32)
            case 4:
                return np.asarray(values @ _YCOCG.T, np.float32)
            case 9 | 11:
                y = np.exp(values[..., :1])
                chroma = values[..., 1:] * (y if self._model == 11 else np.float32(1))
                return np.asarray(
                    np.concatenate([y - np.float32(_EPSILON), chroma], axis=-1) @ _YUV.T, np.float32
                )
            case 12:
                return np.asarray(np.exp(values) - np.float32(_EPSILON), np.float32)
            case _:
                return values


def _numbers(file: BinaryIO, form: str) -> tuple[Any, ...]:
    size = struct.calcsize(form)
    data = file.read(size)
    if len(data) < size:
        raise ValueError("it ends too early")
    return struct.unpack(form, data)
