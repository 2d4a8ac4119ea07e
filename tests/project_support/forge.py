"""Project files changed by somebody who knows the format: every address fits."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from studio_core.arrays import content_hash
from studio_core.project.canonical import text_hash

Json = dict[str, Any]


class Forge:
    """Rewrites items of a file and every address above them, as somebody would who knows the format."""

    def __init__(self, path: Path) -> None:
        self.connection = sqlite3.connect(path, isolation_level=None)
        self.connection.execute("PRAGMA synchronous=OFF")
        self.connection.execute("BEGIN")
        self.items: dict[str, str] = dict(self.connection.execute("SELECT hash, json FROM item"))

    def put(self, text: str) -> str:
        address = text_hash(text)
        self.connection.execute("INSERT OR REPLACE INTO item VALUES (?, ?)", (address, text))
        return address

    def blob(self, array: np.ndarray[Any, Any], data: bytes | None = None) -> Json:
        address = content_hash(array)
        stored = array.tobytes() if data is None else data
        self.connection.execute("INSERT OR REPLACE INTO blob VALUES (?, 0, ?)", (address, stored))
        return {"blob": address, "dtype": array.dtype.str, "shape": list(array.shape)}

    def scene(self, nodes: list[str], materials: list[str], **more: Any) -> None:
        roots = [
            self.put(json.dumps({"type": "page", "level": 0, "of": hashes})) if hashes else None
            for hashes in (nodes, materials)
        ]
        text = json.dumps({"type": "scene", "nodes": roots[0], "materials": roots[1], **more})
        self.head([self.put(text), None, None])

    def head(self, addresses: list[str | None]) -> None:
        self.connection.execute("UPDATE revision SET items = ?", (json.dumps(addresses),))
        self.close()

    def close(self) -> None:
        """Keep what was changed."""
        self.connection.execute("COMMIT")
        self.connection.close()

    def change(self, edit: Callable[[Json], Any]) -> None:
        """Put `edit(item)` in the place of every node and material; it may return raw text."""
        made: dict[str, list[str]] = {"nodes": [], "materials": []}
        for text in self.items.values():
            value = json.loads(text)
            if value["type"] in ("page", "scene", "step", "history", "session"):
                continue
            if value["name"] == "Before":
                continue
            kind = "materials" if value["type"] == "material" else "nodes"
            new = edit(value)
            made[kind].append(self.put(new if isinstance(new, str) else json.dumps(new or value)))
        self.scene(made["nodes"], made["materials"])
