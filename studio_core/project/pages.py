"""Long lists of hashes as a tree of short pages, so that changing one entry changes a few pages.

A page ends after an entry whose hash begins with a small byte (about one in 32): the cut depends on the
content alone, so an insertion moves no other cut. Lists with the same entries have the same root.
(Prolly trees: Noms, 2016.)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from studio_core.errors import ProjectError
from studio_core.project.blobs import is_hash
from studio_core.project.canonical import dumps, text_hash

CUT_BELOW = "08"
SHORTEST, LONGEST = 2, 256
MAX_LEVEL = 12
MAX_ENTRIES = 1_000_000


def build(hashes: Sequence[str]) -> tuple[str | None, dict[str, str]]:
    """Root address (None for an empty list) and the canonical text of every page by address."""
    if not hashes:
        return None, {}
    texts: dict[str, str] = {}
    row, level = list(hashes), 0
    while True:
        made = []
        for group in _groups(row):
            text = dumps({"type": "page", "level": level, "of": group}, "a page")
            address = text_hash(text)
            texts[address] = text
            made.append(address)
        if len(made) == 1:
            return made[0], texts
        row, level = made, level + 1


def _groups(row: list[str]) -> list[list[str]]:
    groups: list[list[str]] = []
    group: list[str] = []
    for entry in row:
        group.append(entry)
        if len(group) == LONGEST or (len(group) >= SHORTEST and entry < CUT_BELOW):
            groups.append(group)
            group = []
    if group:
        groups.append(group)
    return groups


def parse(value: dict[str, Any], part: str) -> tuple[int, tuple[str, ...]]:
    """Level and entries of a page; ProjectError naming `part` when it is none."""
    level, entries = value.get("level"), value.get("of")
    if (
        set(value) != {"type", "level", "of"}
        or value["type"] != "page"
        or type(level) is not int
        or not 0 <= level <= MAX_LEVEL
        or not isinstance(entries, list)
        or not 1 <= len(entries) <= LONGEST
        or not all(map(is_hash, entries))
    ):
        raise ProjectError(f"{part} is damaged: a page of a list has the wrong form")
    return level, tuple(entries)


def expand(root: str | None, page: Callable[[str], tuple[int, tuple[str, ...]]], part: str) -> list[str]:
    """The entries under `root`, in order; `page` gives level and entries of an address.

    ProjectError when levels do not go down one by one or when there are over a million entries, so that
    a page that names one page many times costs no more than an honest list.
    """
    if root is None:
        return []
    found: list[str] = []
    level, entries = page(root)
    stack = [(level, iter(entries))]
    while stack:
        level, rest = stack[-1]
        if level == 0:
            found.extend(rest)
            stack.pop()
            if len(found) > MAX_ENTRIES:
                raise ProjectError(f"{part} is damaged: more than {MAX_ENTRIES} entries")
            continue
        entry = next(rest, None)
        if entry is None:
            stack.pop()
            continue
        below, entries = page(entry)
        if below != level - 1:
            raise ProjectError(f"{part} is damaged: a page of a list stands at the wrong level")
        stack.append((below, iter(entries)))
    return found
