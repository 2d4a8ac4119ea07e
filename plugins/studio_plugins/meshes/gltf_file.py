"""The container of glTF 2.0: JSON, buffers, accessors, with every index and size checked.

Read by hand because the reader of trimesh rounds colour factors to 8 bits, knows no texture
transforms, and allocates what a hostile accessor asks for. Section numbers are those of the
Khronos glTF 2.0 specification.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.exchange.pictures import beside
from studio_plugins.meshes.common import MOST_BYTES, refuse

Json = dict[str, Any]
MOST_VALUES = 1 << 28
"""Numbers in all accessors that are read."""
_TYPES: dict[int, type[Any]] = {
    5120: np.int8,
    5121: np.uint8,
    5122: np.int16,
    5123: np.uint16,
    5125: np.uint32,
    5126: np.float32,
}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_UNDERSTOOD = (
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_lights_punctual",
    "KHR_materials_",
    "KHR_xmp",
    "EXT_texture_webp",
    "KHR_node_visibility",
)


def as_index(value: object) -> object:
    """A whole number that was written as 1.0 as an int; anything else as it is."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


class GltfFile:
    """A parsed glTF or GLB file; every access raises InputError when it leads nowhere."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        self.binary: bytes | None = None
        text = self._glb(data) if data[:4] == b"glTF" else data
        self.json = self._parse(text)
        asset = self.json.get("asset")
        version = asset.get("version") if isinstance(asset, dict) else None
        if not isinstance(version, str) or not version.startswith("2."):
            raise refuse(path, f"it is glTF of version {version!r}, not 2.0")
        for name in self.list_of("extensionsRequired", str):
            if not name.startswith(_UNDERSTOOD):
                raise refuse(path, f"it needs the extension {name[:60]}, which is not known here")
        self._values_read = 0
        self._buffers: dict[int, bytes] = {}
        self._accessors: dict[int, npt.NDArray[Any]] = {}

    def bad(self, cause: str) -> InputError:
        """The error for a damaged part of the file."""
        return refuse(self.path, cause)

    def list_of(self, key: str, kind: type = dict) -> list[Any]:
        """A top-level array of objects; empty when absent."""
        found = self.json.get(key, [])
        if not isinstance(found, list) or not all(isinstance(item, kind) for item in found):
            raise self.bad(f"its {key} are damaged")
        return found

    def item(self, key: str, index: object) -> Json:
        """An element of a top-level array."""
        items = self.list_of(key)
        index = as_index(index)
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(items):
            raise self.bad(f"it refers to {key} {str(index)[:40]}, which does not exist")
        found: Json = items[index]
        return found

    def view(self, index: object) -> tuple[memoryview, int]:
        """The bytes of a buffer view, and its stride (0: packed)."""
        view = self.item("bufferViews", index)
        data = self._buffer(view.get("buffer"))
        start = self.whole(view, "byteOffset", 0)
        length = self.whole(view, "byteLength", -1)
        if length < 1 or start + length > len(data):
            raise self.bad(f"buffer view {index} reaches beyond its buffer")
        return memoryview(data)[start : start + length], self.whole(view, "byteStride", 0)

    def whole(self, source: Json, key: str, default: int) -> int:
        """A whole number ≥ 0 (or the default) of an object."""
        value = as_index(source.get(key, default))
        if not isinstance(value, int) or isinstance(value, bool) or (value < 0 and value != default):
            raise self.bad(f"a {key} of {str(value)[:40]} makes no sense")
        return value

    def floats(self, source: Json, key: str, default: tuple[float, ...]) -> tuple[float, ...]:
        """As many finite numbers as the default has."""
        value = source.get(key, default)
        if isinstance(value, int | float) and len(default) == 1:
            value = (value,)
        if not isinstance(value, list | tuple) or len(value) != len(default):
            raise self.bad(f"a {key} must have {len(default)} numbers")
        try:
            made = tuple(float(v) for v in value if not isinstance(v, bool | str))
        except (TypeError, ValueError, OverflowError):
            made = ()
        if len(made) != len(default) or not np.isfinite(made).all():
            raise self.bad(f"a {key} holds what is no number")
        return made

    def accessor(self, index: object, kinds: tuple[str, ...]) -> npt.NDArray[Any]:
        """(count,) or (count, width) values; normalised integers become floats (3.6.2)."""
        accessor = self.item("accessors", index)
        kind = accessor.get("type")
        if kind not in kinds:
            raise self.bad(f"accessor {index} is {str(kind)[:20]} where {' or '.join(kinds)} is needed")
        place = int(str(as_index(index)))
        if place not in self._accessors:
            self._accessors[place] = self._values(accessor, place, _WIDTHS[str(kind)])
        return self._accessors[place]

    def _values(self, accessor: Json, index: int, width: int) -> npt.NDArray[Any]:
        code = accessor.get("componentType")
        if not isinstance(code, int) or code not in _TYPES:
            raise self.bad(f"accessor {index} has an unknown type of numbers")
        dtype = np.dtype(_TYPES[code]).newbyteorder("<")
        count = self.whole(accessor, "count", -1)
        self._values_read += count * width
        if count < 1 or self._values_read > MOST_VALUES:
            raise self.bad(f"accessor {index} has an impossible count of {count}")
        if "bufferView" in accessor:
            start = self.whole(accessor, "byteOffset", 0)
            made = self._packed(accessor["bufferView"], start, dtype, count, width, f"accessor {index}")
        elif "sparse" in accessor:
            made = np.zeros((count, width), dtype)
        else:
            raise self.bad(f"accessor {index} has no data")
        sparse = accessor.get("sparse")
        if isinstance(sparse, dict):
            made = self._sparse(sparse, made, dtype, index)
        if accessor.get("normalized") is True and dtype.kind in "iu":
            made = np.maximum(made / float(np.iinfo(_TYPES[code]).max), -1.0)
        return made[:, 0] if width == 1 else made

    def _sparse(
        self, sparse: Json, dense: npt.NDArray[Any], dtype: np.dtype[Any], index: int
    ) -> npt.NDArray[Any]:
        count = self.whole(sparse, "count", -1)
        where, what = sparse.get("indices"), sparse.get("values")
        if not isinstance(where, dict) or not isinstance(what, dict) or not 0 < count <= len(dense):
            raise self.bad(f"accessor {index} has damaged sparse values")
        code = where.get("componentType")
        if code not in (5121, 5123, 5125):
            raise self.bad(f"accessor {index} has damaged sparse values")
        name = f"accessor {index}"
        index_type = np.dtype(_TYPES[code]).newbyteorder("<")
        start = self.whole(where, "byteOffset", 0)
        places = self._packed(where.get("bufferView"), start, index_type, count, 1, name)[:, 0]
        if int(places.max()) >= len(dense):
            raise self.bad(f"accessor {index} has sparse values outside of it")
        made = dense.copy()
        start = self.whole(what, "byteOffset", 0)
        made[places] = self._packed(what.get("bufferView"), start, dtype, count, dense.shape[1], name)
        return made

    def _packed(
        self, view: object, start: int, dtype: np.dtype[Any], count: int, width: int, name: str
    ) -> npt.NDArray[Any]:
        data, stride = self.view(view)
        element = dtype.itemsize * width
        stride = stride or element
        if stride < element or start + (count - 1) * stride + element > len(data):
            raise self.bad(f"{name} reaches beyond its buffer view")
        rows = np.ndarray((count, width), dtype, data, start, (stride, dtype.itemsize))
        return np.ascontiguousarray(rows)

    def _buffer(self, index: object) -> bytes:
        buffer = self.item("buffers", index)
        index = int(str(as_index(index)))
        if index not in self._buffers:
            length = self.whole(buffer, "byteLength", -1)
            if "uri" in buffer:
                data = self.resource(buffer["uri"])
            elif index == 0 and self.binary is not None:
                data = self.binary
            else:
                raise self.bad(f"buffer {index} has no data")
            if not 0 < length <= len(data):
                raise self.bad(f"buffer {index} is shorter than it says")
            self._buffers[index] = data
        return self._buffers[index]

    def resource(self, uri: object) -> bytes:
        """The bytes of a data URI or of a file beside the model."""
        if not isinstance(uri, str):
            raise self.bad("a reference to a file is damaged")
        if uri.startswith("data:"):
            head, comma, body = uri.partition(",")
            try:
                if not comma or not head.endswith(";base64"):
                    raise ValueError
                return base64.b64decode(body)
            except (ValueError, binascii.Error):
                raise self.bad("a buffer inside of it is damaged") from None
        found = beside(self.path.parent, unquote(uri))
        if found is None:
            raise self.bad(f"the file {uri[:100]!r} that it needs is missing")
        try:
            if found.stat().st_size > MOST_BYTES:
                raise self.bad(f"{found.name} is larger than what is accepted")
            return found.read_bytes()
        except OSError as error:
            raise self.bad(f"{found.name} cannot be read: {error.strerror}") from None

    def _glb(self, data: bytes) -> bytes:
        """The JSON of a GLB; sets `binary` (4.4)."""
        if len(data) < 20:
            raise self.bad("it is cut off")
        version, total = struct.unpack_from("<II", data, 4)
        if version != 2:
            raise self.bad(f"it is GLB of version {version}, not 2")
        if total > len(data):
            raise self.bad("it is cut off")
        at, text = 12, None
        while at + 8 <= min(total, len(data)):
            length, kind = struct.unpack_from("<I4s", data, at)
            chunk = data[at + 8 : at + 8 + length]
            if len(chunk) < length:
                raise self.bad("it is cut off")
            if kind == b"JSON" and text is None:
                text = chunk
            elif kind == b"BIN\0" and self.binary is None:
                self.binary = chunk
            at += 8 + length
        if text is None:
            raise self.bad("it holds no description (JSON)")
        return text

    def _parse(self, text: bytes) -> Json:
        def refuse_constant(name: str) -> float:
            raise ValueError(f"{name} is no number")

        try:
            made = json.loads(text.decode("utf-8-sig"), parse_constant=refuse_constant)
        except RecursionError:
            raise self.bad("its JSON is nested too deeply") from None
        except ValueError as error:
            raise self.bad(f"its JSON is damaged ({str(error)[:100]})") from None
        if not isinstance(made, dict):
            raise self.bad("its JSON is no object")
        return made
