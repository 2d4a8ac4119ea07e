"""Older formats: one function a format, applied to a copy until it is of the current one.

A migration is entered in `Formats.migrations` under the format it starts from. It gets a connection to the
copy, whose tables were compared with that format's, and may change tables and rows as it likes;
`rewrite_items` helps where the JSON of items changes, since every address above it changes too.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

from studio_core.errors import ProjectError
from studio_core.project.canonical import dumps, loads, text_hash
from studio_core.project.place import copy_file
from studio_core.project.schema import Formats, altering, file_format, reading

_BELOW = {"scene": ("nodes", "materials"), "step": ("scene",), "history": ("steps",)}
_DEEPEST = 100


def migrated_copy(path: Path, target: Path, formats: Formats) -> int:
    """Write `path` to the new file `target` in the current format; the format it had.

    Raises ProjectError when it cannot be brought up to date.
    """
    with reading(path, formats) as (_, found):
        copy_file(path, target)
    for old in range(found, formats.current):
        with altering(target, old, formats) as connection:
            formats.migrations[old](connection)
    if file_format(target, formats) != formats.current:
        raise ProjectError(f"{path.name} could not be brought to format {formats.current}")
    return found


def rewrite_items(connection: sqlite3.Connection, change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    """Replace every node, material and session by `change` of it, and every address that follows.

    Rows that no revision reaches are dropped. ProjectError when a row is missing or damaged.
    """
    old = dict(connection.execute("SELECT hash, json FROM item").fetchall())
    made: dict[str, str] = {}
    texts: dict[str, str] = {}

    def move(address: str | None, depth: int = 0) -> str | None:
        if address is None:
            return None
        if address not in made:
            if address not in old or depth > _DEEPEST:
                raise ProjectError(f"a part of it ({address[:8]}…) is missing")
            if text_hash(old[address]) != address:
                raise ProjectError("a text does not match its address")
            value = loads(old[address], "an item")
            kind = value["type"]
            if kind == "page":
                value["of"] = [move(entry, depth + 1) for entry in value["of"]]
            elif kind in _BELOW:
                value |= {name: move(value[name], depth + 1) for name in _BELOW[kind]}
            else:
                value = change(value)
            text = dumps(value, "an item")
            made[address] = text_hash(text)
            texts[made[address]] = text
        return made[address]

    revisions = connection.execute("SELECT id, items FROM revision").fetchall()
    moved = [
        (dumps([move(address) for address in loads(items, "a revision")], "a revision"), ident)
        for ident, items in revisions
    ]
    connection.executemany("UPDATE revision SET items = ? WHERE id = ?", moved)
    connection.execute("DELETE FROM item")
    connection.executemany("INSERT INTO item VALUES (?, ?)", texts.items())
