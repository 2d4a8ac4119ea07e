"""Small glTF files for tests, written from scratch."""

from __future__ import annotations

import base64
import json
import struct
from typing import Any

import numpy as np

CODES = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)


class Writer:
    """Collects arrays as accessors of one buffer."""

    def __init__(self, **top: Any) -> None:
        self.data = bytearray()
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "bufferViews": [], "accessors": [], **top}

    def view(self, data: bytes) -> int:
        """A buffer view of bytes."""
        while len(self.data) % 4:
            self.data.append(0)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, array: np.ndarray, **more: Any) -> int:
        """An accessor of an array (N,) or (N, k)."""
        width = 1 if array.ndim == 1 else array.shape[1]
        self.json["accessors"].append(
            {
                "bufferView": self.view(array.tobytes()),
                "componentType": CODES[str(array.dtype)],
                "count": len(array),
                "type": KINDS[width],
                **more,
            }
        )
        return len(self.json["accessors"]) - 1

    def whole(self) -> dict[str, Any]:
        """The JSON with its buffer's length."""
        return {**self.json, "buffers": [{"byteLength": len(self.data)}]} if self.data else self.json

    def glb(self) -> bytes:
        """The file as GLB."""
        text = json.dumps(self.whole()).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.data) + b"\0" * (-len(self.data) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def gltf(self) -> bytes:
        """The file as text with its buffer inside."""
        uri = "data:application/octet-stream;base64," + base64.b64encode(bytes(self.data)).decode()
        whole = self.whole()
        whole["buffers"] = [{"byteLength": len(self.data), "uri": uri}]
        return json.dumps(whole).encode()


def square(**primitive: Any) -> Writer:
    """One node with one mesh: a square of indexed triangles."""
    made = Writer()
    position = made.accessor(SQUARE)
    indices = made.accessor(np.array([0, 1, 2, 0, 2, 3], np.uint16))
    entry = {"attributes": {"POSITION": position}, "indices": indices, **primitive}
    made.json |= {
        "meshes": [{"primitives": [entry]}],
        "nodes": [{"mesh": 0, "name": "seat"}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    return made
