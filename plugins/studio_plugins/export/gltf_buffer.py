"""The container of glTF 2.0: one binary buffer with its views and accessors, and the GLB file."""

from __future__ import annotations

import json
import os
import secrets
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

VERTICES, INDICES = 34962, 34963
_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}


class Buffer:
    """Collects bytes; every view starts at a multiple of four."""

    def __init__(self) -> None:
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self._parts: list[bytes] = []
        self._length = 0

    def view(self, data: bytes, target: int | None = None) -> int:
        """Index of a new buffer view."""
        made: dict[str, Any] = {"buffer": 0, "byteOffset": self._length, "byteLength": len(data)}
        if target is not None:
            made["target"] = target
        padding = -len(data) % 4
        self._parts += [data, bytes(padding)]
        self._length += len(data) + padding
        self.views.append(made)
        return len(self.views) - 1

    def vertices(self, values: npt.NDArray[np.float32], bounded: bool = False) -> int:
        """Index of an accessor of float32 (N, 2 or 3); `bounded` writes min and max, as positions need."""
        values = np.ascontiguousarray(values, "<f4")
        made: dict[str, Any] = {
            "bufferView": self.view(values.tobytes(), VERTICES),
            "componentType": _FLOAT,
            "count": len(values),
            "type": _KINDS[values.shape[1]],
        }
        if bounded:
            made["min"] = [float(v) for v in values.min(axis=0)]
            made["max"] = [float(v) for v in values.max(axis=0)]
        self.accessors.append(made)
        return len(self.accessors) - 1

    def indices(self, faces: npt.NDArray[np.uint32]) -> int:
        """Index of an accessor of triangle corners (F, 3), 16-bit where they fit (65535 restarts)."""
        small = int(faces.max()) < 65535
        data = np.ascontiguousarray(faces.reshape(-1), "<u2" if small else "<u4")
        made = {
            "bufferView": self.view(data.tobytes(), INDICES),
            "componentType": _UINT16 if small else _UINT32,
            "count": len(data),
            "type": "SCALAR",
        }
        self.accessors.append(made)
        return len(self.accessors) - 1

    def data(self) -> bytes:
        """Everything, a multiple of four long."""
        return b"".join(self._parts)


def write_glb(path: Path, document: Mapping[str, Any], buffer: Buffer) -> None:
    """Write the document, whose empty lists are left out, with its buffer. OSError when the disk refuses.

    The file appears whole or not at all.
    """
    data = buffer.data()
    made: dict[str, Any] = {key: value for key, value in document.items() if value not in ([], {})}
    if data:
        made |= {"buffers": [{"byteLength": len(data)}], "bufferViews": buffer.views}
    if buffer.accessors:
        made["accessors"] = buffer.accessors
    text = json.dumps(made, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if data:
        chunks += struct.pack("<II", len(data), 0x004E4942) + data
    beside = path.with_name(f".{path.stem[:40]}-{secrets.token_hex(6)}.glb")
    try:
        with beside.open("wb") as file:
            file.write(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)))
            file.write(chunks)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)
