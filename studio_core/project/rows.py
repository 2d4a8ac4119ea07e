"""Rows of a project file read with suspicion: every text and array is checked against its address."""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Iterator
from typing import Any

import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.errors import ProjectError
from studio_core.project import pages
from studio_core.project.blobs import ArrayRef, check_parts, is_hash, unpack
from studio_core.project.canonical import MAX_TEXT, loads, text_hash
from studio_core.project.codec import Inward
from studio_core.project.records import Revision, SavedHistory, SavedStep
from studio_core.project.validate import check_scene
from studio_core.scene.nodes import Material, Node, Scene

MAX_REVISIONS = 100_000
MAX_LABEL = 1000
MAX_BYTES = 64 << 30  # of all arrays of one project


class Rows:
    """Parsed and checked items of one file by address.

    While the connection is open, `gather` reads whatever lies under a scene or history; afterwards scenes
    are composed from what was gathered.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection: sqlite3.Connection | None = connection
        self._values: dict[str, dict[str, Any]] = {}
        self._items: dict[str, Node | Material] = {}
        self._scenes: dict[str, Scene] = {}
        self._inward = Inward(self._array)
        self._pages: dict[str, tuple[int, tuple[str, ...]]] = {}
        self._gathered: set[str] = set()
        self._blobs: set[str] = set()
        self._bytes = 0

    def close(self) -> None:
        """No more reading: only what was gathered is left."""
        self._connection = None
        for address in self._items:
            del self._values[address]
        self._inward = Inward(self._array)

    def read(self) -> tuple[frozenset[str], frozenset[str]]:
        """Addresses of the items and of the arrays that were read."""
        return frozenset(self._values), frozenset(self._blobs)

    def meta(self) -> dict[str, str]:
        """The table `meta`."""
        part = "the table of general facts"
        self._modest("meta", ("key", "value"), 100, part)
        rows = self._select("SELECT key, value FROM meta LIMIT 100", ())
        if any(type(text) is not str for row in rows for text in row):
            raise ProjectError(f"{part} is damaged")
        return dict(rows)

    def revisions(self) -> tuple[Revision, ...]:
        """Every save, the oldest first; at least one."""
        part = "the list of revisions"
        self._modest("revision", ("label", "items"), MAX_REVISIONS, part)
        query = f"SELECT id, parent, label, time, items FROM revision ORDER BY id LIMIT {MAX_REVISIONS}"
        rows = self._select(query, ())
        if not rows or any(type(row[0]) is not int for row in rows):
            raise ProjectError(f"{part} is damaged")
        return tuple(map(_revision, rows))

    def head(self) -> int:
        """Id of the revision that was saved last."""
        text = self.meta().get("head", "")
        if not text.isascii() or not text.isdigit() or len(text) > 18:
            raise ProjectError("the mark of the current revision is damaged")
        return int(text)

    def value(self, address: str, part: str) -> dict[str, Any]:
        """The JSON object of an item row."""
        if address not in self._values:
            rows = self._select("SELECT length(json) FROM item WHERE hash = ? LIMIT 2", (address,))
            if len(rows) != 1:
                raise ProjectError(f"{part} is damaged: a part of it ({address[:8]}…) is missing")
            if type(rows[0][0]) is not int or rows[0][0] > MAX_TEXT:
                raise ProjectError(f"{part} is damaged: its text is too long")
            ((text,),) = self._select("SELECT json FROM item WHERE hash = ? LIMIT 1", (address,))
            if type(text) is not str or text_hash(text) != address:
                raise ProjectError(f"{part} is damaged: a text does not match its address")
            value = loads(text, part)
            if not isinstance(value, dict):
                raise ProjectError(f"{part} is damaged: an item is no object")
            self._values[address] = value
        return self._values[address]

    def entries(self, root: str | None, part: str) -> list[str]:
        """The addresses in a paged list."""
        return pages.expand(root, lambda address: self._page(address, part), part)

    def lists(self, digest: str) -> tuple[str | None, str | None]:
        """Roots of a scene's nodes and materials."""
        value = self.value(digest, "the scene")
        roots = (value.get("nodes"), value.get("materials"))
        if (
            set(value) != {"type", "nodes", "materials"}
            or value["type"] != "scene"
            or any(root is not None and not is_hash(root) for root in roots)
        ):
            raise ProjectError("the scene is damaged: it has the wrong form")
        return roots

    def gather(self, digest: str) -> None:
        """Read and check everything under a scene."""
        for root, part in zip(
            self.lists(digest), ("the list of nodes", "the list of materials"), strict=True
        ):
            stack = [] if root is None else [root]
            while stack:
                page = stack.pop()
                if page in self._gathered:
                    continue
                self._gathered.add(page)
                level, entries = self._page(page, part)
                if level == 0:
                    for entry in entries:
                        self._item(entry, part)
                else:
                    stack += entries

    def compose(self, digest: str) -> Scene:
        """The scene of gathered items; one digest gives one object."""
        if digest not in self._scenes:
            nodes: dict[str, Node] = {}
            materials: dict[str, Material] = {}
            roots = self.lists(digest)
            for address in self.entries(roots[0], "the list of nodes"):
                node = self._item(address, "the list of nodes")
                if not isinstance(node, Node) or node.id in nodes:
                    raise ProjectError(f"the list of nodes is damaged: {node.name!r} does not belong there")
                nodes[node.id] = node
            for address in self.entries(roots[1], "the list of materials"):
                material = self._item(address, "the list of materials")
                if not isinstance(material, Material) or material.id in materials:
                    raise ProjectError(
                        f"the list of materials is damaged: {material.name!r} does not belong there"
                    )
                materials[material.id] = material
            scene = Scene(frozen_map(nodes), frozen_map(materials))
            check_scene(scene)
            self._scenes[digest] = scene
        return self._scenes[digest]

    def history(self, address: str) -> SavedHistory:
        """The undo history, everything under it gathered."""
        made = self.steps(address)
        for digest in {step.digest for step in made.steps}:
            self.gather(digest)
        return made

    def steps(self, address: str) -> SavedHistory:
        """The undo history, its scenes neither read nor checked."""
        value = self.value(address, "the undo history")
        steps, position = value.get("steps"), value.get("position")
        if set(value) != {"type", "steps", "position"} or value["type"] != "history" or not is_hash(steps):
            raise ProjectError("the undo history is damaged: it has the wrong form")
        entries = self.entries(steps, "the undo history")
        if type(position) is not int or not 0 <= position < len(entries):
            raise ProjectError("the undo history is damaged: it has no such step")
        made = []
        for entry in entries:
            step = self.value(entry, "the undo history")
            label, digest = step.get("label"), step.get("scene")
            if (
                set(step) != {"type", "label", "scene"}
                or step["type"] != "step"
                or not isinstance(label, str)
                or not is_hash(digest)
            ):
                raise ProjectError("the undo history is damaged: a step has the wrong form")
            made.append(SavedStep(label, str(digest), self.compose))
        return SavedHistory(tuple(made), position)

    def session(self, address: str | None) -> dict[str, Any]:
        """What the session left: view, exposure, backend."""
        if address is None:
            return {}
        value = self.value(address, "the session")
        if (
            set(value) != {"type", "values"}
            or value["type"] != "session"
            or type(value["values"]) is not dict
        ):
            raise ProjectError("the session is damaged: it has the wrong form")
        return dict(value["values"])

    def _page(self, address: str, part: str) -> tuple[int, tuple[str, ...]]:
        if address not in self._pages:
            self._pages[address] = pages.parse(self.value(address, part), part)
        return self._pages[address]

    def _item(self, address: str, part: str) -> Node | Material:
        if address not in self._items:
            self._items[address] = self._inward.item(self.value(address, part), part)
        return self._items[address]

    def _array(self, ref: ArrayRef, part: str, squeezed: bool) -> npt.NDArray[Any]:
        count = len(ref.parts())
        query = f"SELECT part, length(data) FROM blob WHERE hash = ? ORDER BY part LIMIT {count + 1}"
        rows = self._select(query, (ref.blob,)) if count else []
        if [row[0] for row in rows] != list(range(count)) or any(type(row[1]) is not int for row in rows):
            raise ProjectError(f"{part} is damaged: an array ({ref.blob[:8]}…) is missing or incomplete")
        check_parts(ref, [row[1] for row in rows], part, squeezed=squeezed)
        self._blobs.add(ref.blob)
        self._bytes += ref.nbytes
        if self._bytes > MAX_BYTES:
            raise ProjectError(f"{part} is too large: the project has over {MAX_BYTES >> 30} GB of arrays")
        try:
            return unpack(ref, self._parts(ref, count, part), part)
        except MemoryError:
            raise ProjectError(
                f"{part} does not fit into memory: it takes {ref.nbytes / 1e6:.0f} MB"
            ) from None

    def _parts(self, ref: ArrayRef, count: int, part: str) -> Iterator[bytes]:
        for index in range(count):
            rows = self._select("SELECT data FROM blob WHERE hash = ? AND part = ?", (ref.blob, index))
            if len(rows) != 1 or type(rows[0][0]) is not bytes:
                raise ProjectError(f"{part} is damaged: an array is not made of bytes")
            yield rows[0][0]

    def _modest(self, table: str, columns: tuple[str, str], most: int, part: str) -> None:
        """ProjectError when a small table has more rows or longer texts than Lucarne writes."""
        longest = ", ".join(f"max(length(CAST({column} AS BLOB)))" for column in columns)
        inner = f"SELECT {', '.join(columns)} FROM {table} LIMIT {most + 1}"
        ((count, *lengths),) = self._select(f"SELECT count(*), {longest} FROM ({inner})", ())
        if count > most or any(length is not None and length > MAX_LABEL for length in lengths):
            raise ProjectError(f"{part} is damaged: it is too long")

    def _select(self, query: str, values: tuple[Any, ...]) -> list[Any]:
        if self._connection is None:
            raise ProjectError("a part of the project was not read when it was opened")
        return self._connection.execute(query, values).fetchall()


def _revision(row: tuple[Any, ...]) -> Revision:
    ident, parent, label, time, items = row
    part = f"revision {ident!r:.20}"
    if (
        type(ident) is not int
        or not 0 < ident < 1 << 62
        or (parent is not None and (type(parent) is not int or not 0 < parent < ident))
        or type(label) is not str
        or type(time) is not float
        or not math.isfinite(time)
        or type(items) is not str
    ):
        raise ProjectError(f"{part} is damaged")
    addresses = loads(items, part)
    if not isinstance(addresses, list) or len(addresses) != 3 or not is_hash(addresses[0]):
        raise ProjectError(f"{part} is damaged: it does not say what it holds")
    if any(address is not None and not is_hash(address) for address in addresses):
        raise ProjectError(f"{part} is damaged: it does not say what it holds")
    return Revision(ident, parent, label, time, *addresses)
