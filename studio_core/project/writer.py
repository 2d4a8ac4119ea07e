"""Writing rows that a file does not have yet.

An address that is in the file has everything under it there too, so that unchanged pages are not looked
into: what a save costs follows the edit.
"""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import studio_core
from studio_core.errors import ProjectError
from studio_core.project import pages
from studio_core.project.blobs import pack
from studio_core.project.canonical import dumps, loads, text_hash
from studio_core.project.codec import Blob, encode_item, known_digest, scene_digest, scene_form
from studio_core.project.records import History, SavedStep, StepLike
from studio_core.project.rows import MAX_LABEL
from studio_core.project.validate import check_scene
from studio_core.scene.nodes import Scene


@dataclass(frozen=True)
class Content:
    """What one save keeps. `scene` is the one on the screen, also in the middle of a gesture."""

    scene: Scene
    label: str
    time: float
    history: History | None = None
    session: Mapping[str, Any] | None = None


class Writer:
    """Puts new rows into the open transaction and counts them."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        self.rows = 0
        self.bytes = 0

    def save(self, content: Content, *, keep_revisions: bool = True) -> int:
        """Write what is new and the revision; its id. Nothing is added when the last save was the same."""
        addresses = [
            self.scene(content.scene),
            None if content.history is None else self._history(content.history, content.scene),
            None if not content.session else self._session(content.session),
        ]
        items = dumps(addresses, "the revision")
        label = shown(content.label)
        newest = self._one("SELECT max(id) FROM revision")
        parent = self._one("SELECT value FROM meta WHERE key = 'head'")
        head = None if parent is None else int(parent)
        same = "SELECT id FROM revision WHERE id = ? AND items = ? AND label = ?"
        ident = self._one(same, head, items, label)
        if ident is None:
            ident = (newest or 0) + 1
            row = (ident, head if keep_revisions else None, label, float(content.time), items)
            self._insert("INSERT INTO revision VALUES (?, ?, ?, ?, ?)", row)
            self._insert("INSERT OR REPLACE INTO meta VALUES ('head', ?)", (str(ident),))
        program = f"Lucarne {studio_core.__version__}"
        if self._one("SELECT value FROM meta WHERE key = 'program'") != program:
            self._insert("INSERT OR REPLACE INTO meta VALUES ('program', ?)", (program,))
        if not keep_revisions:
            self._connection.execute("DELETE FROM revision WHERE id <> ?", (ident,))
        return int(ident)

    def scene(self, scene: Scene) -> str:
        """Write a scene; its digest. ProjectError when it could not be read back."""
        digest = known_digest.known(scene)
        if digest is not None and self._has(digest):
            return digest
        form = scene_form(scene)
        digest = form.digest
        known_digest.remember(scene, digest)
        if self._has(digest):
            return digest
        check_scene(scene)
        waiting = [digest]
        while waiting:
            address = waiting.pop()
            if self._has(address):
                continue
            if address in form.items:
                text, blobs = encode_item(form.items[address])
                if text_hash(text) != address:
                    raise ProjectError(f"{form.items[address].name!r} changed while it was saved")
                for blob in blobs:
                    self._blob(blob)
                self._item(address, text)
            else:
                text = form.texts[address]
                self._item(address, text)
                value = json.loads(text)
                below = value["of"] if value["type"] == "page" else [value["nodes"], value["materials"]]
                waiting += [entry for entry in below if entry is not None]
        return digest

    def _history(self, history: History, shown_scene: Scene) -> str:
        steps: list[StepLike] = list(history.steps)
        position = history.position
        if not 0 <= position < len(steps):
            raise ProjectError("the undo history does not hold the step that is shown")
        hashes = [self._step(step.label, self._digest(step)) for step in steps]
        digest = scene_digest(shown_scene)
        if self._digest(steps[position]) != digest:  # an unfinished gesture
            hashes[position + 1 :] = [self._step("Unfinished change", digest)]
            position += 1
        root, texts = pages.build(hashes)
        for address, text in texts.items():
            self._item(address, text)
        return self._text({"type": "history", "steps": root, "position": position}, "the undo history")

    def _digest(self, step: StepLike) -> str:
        if isinstance(step, SavedStep) and self._has(step.digest):
            return step.digest
        return self.scene(step.scene)

    def _step(self, label: str, digest: str) -> str:
        return self._text({"type": "step", "label": shown(label), "scene": digest}, "the undo history")

    def _session(self, session: Mapping[str, Any]) -> str:
        value = {"type": "session", "values": dict(session)}
        loads(dumps(value, "the session"), "the session")
        return self._text(value, "the session")

    def _text(self, value: dict[str, Any], part: str) -> str:
        text = dumps(value, part)
        address = text_hash(text)
        self._item(address, text)
        return address

    def _item(self, address: str, text: str) -> None:
        if not self._has(address):
            self._insert("INSERT INTO item VALUES (?, ?)", (address, text))

    def _blob(self, blob: Blob) -> None:
        if self._one("SELECT 1 FROM blob WHERE hash = ? LIMIT 1", blob.ref.blob) is None:
            for part, data in enumerate(pack(blob.array, blob.ref, squeeze=blob.squeeze)):
                self._insert("INSERT INTO blob VALUES (?, ?, ?)", (blob.ref.blob, part, data))

    def _has(self, address: str) -> bool:
        return self._one("SELECT 1 FROM item WHERE hash = ?", address) is not None

    def _one(self, query: str, *values: Any) -> Any:
        row = self._connection.execute(query, values).fetchone()
        return None if row is None else row[0]

    def _insert(self, statement: str, row: tuple[Any, ...]) -> None:
        self._connection.execute(statement, row)
        self.rows += 1
        self.bytes += sum(len(cell) for cell in row if isinstance(cell, str | bytes | memoryview))


def now() -> float:
    """Seconds since 1970."""
    return time.time()


def shown(label: str) -> str:
    """A label as it is kept: one that every encoding has, not endless."""
    return label.encode("utf-8", "replace").decode("utf-8")[:MAX_LABEL]
