"""Arrays as content-addressed rows: what a reference says, how the bytes are packed, how they are checked.

A blob is one array. Its address is the hash of dtype, shape and bytes, so that one address has one
meaning whatever the packing. Parts hold 64 MB of the array at most (SQLite refuses rows over 1e9 bytes);
a part as long as the array's bytes is these bytes; a shorter one is packed.

Pictures are packed as byte planes with left differences (as OpenEXR's ZIP does) under zlib level 1:
lossless for float32 and uint8 alike, and unpacking needs no picture decoder, which must never see
untrusted bytes in this process. Meshes stay raw: they are read without a copy and pack badly.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import content_hash
from studio_core.errors import ProjectError

PART_BYTES = 64 << 20
MAX_ARRAY = 4 << 30
MAX_SIDE = 1 << 31
DEFLATE_RATIO = 1032  # no deflate stream unpacks to more than this times its length


@dataclass(frozen=True)
class ArrayRef:
    """An array by address: `blob` hash, `dtype` as NumPy writes it, `shape`."""

    blob: str
    dtype: str
    shape: tuple[int, ...]

    @property
    def nbytes(self) -> int:
        """Bytes of the array."""
        count = np.dtype(self.dtype).itemsize
        for side in self.shape:
            count *= side
        return count

    @property
    def stride(self) -> int:
        """Bytes of one row of the last axis: a picture's pixel."""
        return int(np.dtype(self.dtype).itemsize) * self.shape[-1]

    def parts(self) -> list[int]:
        """Bytes of the array in each part, in order; nothing for an empty array."""
        whole = max(1, PART_BYTES // max(1, self.stride)) * self.stride
        total = self.nbytes
        return [min(whole, total - start) for start in range(0, total, whole)] if total else []

    def json(self) -> dict[str, Any]:
        """The reference as it stands in an item."""
        return {"blob": self.blob, "dtype": self.dtype, "shape": list(self.shape)}


def array_ref(array: npt.NDArray[Any]) -> ArrayRef:
    """The address of an array."""
    return ArrayRef(content_hash(array), array.dtype.str, array.shape)


def is_hash(value: object) -> bool:
    """Whether `value` is 32 lower-case hex digits."""
    return isinstance(value, str) and len(value) == 32 and all(c in "0123456789abcdef" for c in value)


def parse_ref(value: object, part: str, dtypes: tuple[str, ...], tail: tuple[int | None, ...]) -> ArrayRef:
    """The reference in `value`; its type must be one of `dtypes`, its shape like `tail` (None: any)."""
    if not isinstance(value, dict) or set(value) != {"blob", "dtype", "shape"}:
        raise ProjectError(f"{part} is damaged: no array reference")
    blob, dtype, shape = value["blob"], value["dtype"], value["shape"]
    if not is_hash(blob) or dtype not in dtypes:
        raise ProjectError(f"{part} is damaged: wrong address or number type")
    if (
        not isinstance(shape, list)
        or len(shape) != len(tail)
        or any(type(side) is not int or not 0 <= side < MAX_SIDE for side in shape)
        or any(want is not None and want != side for want, side in zip(tail, shape, strict=True))
    ):
        raise ProjectError(f"{part} is damaged: impossible shape")
    ref = ArrayRef(blob, dtype, tuple(shape))
    if ref.nbytes > MAX_ARRAY:
        raise ProjectError(f"{part} is too large: {ref.nbytes / 1e9:.1f} GB in one array")
    return ref


def pack(array: npt.NDArray[Any], ref: ArrayRef, *, squeeze: bool) -> Iterator[memoryview | bytes]:
    """The data of each part, in order; packed when `squeeze` and when it becomes shorter."""
    raw = array.reshape(-1).view(np.uint8)
    start = 0
    for length in ref.parts():
        piece = raw[start : start + length]
        start += length
        packed = zlib.compress(_planes(piece, ref.stride).data, 1) if squeeze else None
        yield packed if packed is not None and len(packed) < length else piece.data


def check_parts(ref: ArrayRef, lengths: list[int], part: str, *, squeezed: bool) -> None:
    """ProjectError unless stored `lengths` can be the parts of `ref`: asked before anything is allocated."""
    wanted = ref.parts()
    if len(lengths) != len(wanted):
        raise ProjectError(f"{part} is damaged: {len(lengths)} of {len(wanted)} parts of an array")
    for have, want in zip(lengths, wanted, strict=True):
        packed_fits = squeezed and have < want <= have * DEFLATE_RATIO
        if have != want and not packed_fits:
            raise ProjectError(f"{part} is damaged: an array's size does not fit its shape")


def unpack(ref: ArrayRef, parts: Iterator[bytes], part: str) -> npt.NDArray[Any]:
    """The read-only array of checked `parts`; ProjectError when content and address differ."""
    wanted = ref.parts()
    dtype = np.dtype(ref.dtype)
    if not wanted:
        made = np.empty(ref.shape, dtype)
    elif len(wanted) == 1:
        made = _plain(next(parts), wanted[0], ref.stride, part).view(dtype).reshape(ref.shape)
    else:
        flat = np.empty(ref.nbytes, np.uint8)
        start = 0
        for length, data in zip(wanted, parts, strict=True):
            flat[start : start + length] = _plain(data, length, ref.stride, part)
            start += length
        made = flat.view(dtype).reshape(ref.shape)
    made.flags.writeable = False
    if content_hash(made) != ref.blob:
        raise ProjectError(f"{part} is damaged: an array's content does not match its address")
    return made


def _planes(piece: npt.NDArray[np.uint8], stride: int) -> npt.NDArray[np.uint8]:
    planes = np.ascontiguousarray(piece.reshape(-1, stride).T)
    made = planes.copy()
    made[:, 1:] -= planes[:, :-1]
    return made


def _plain(data: bytes, length: int, stride: int, part: str) -> npt.NDArray[np.uint8]:
    if len(data) == length:
        return np.frombuffer(data, np.uint8)
    stream = zlib.decompressobj()
    try:
        out = stream.decompress(data, length + 1)
    except zlib.error as error:
        raise ProjectError(f"{part} is damaged: {error}") from None
    if len(out) != length or not stream.eof or stream.unused_data:
        raise ProjectError(f"{part} is damaged: a packed array has the wrong size")
    planes = np.frombuffer(out, np.uint8).reshape(stride, -1)
    return np.ascontiguousarray(np.cumsum(planes, axis=1, dtype=np.uint8).T).reshape(-1)
