"""The materials that a designer keeps: a folder of `.lucmat` files, searched by name and tag.

The folder is only looked into when it is asked; files that others put there, or took away, are noticed then.
A file that cannot be read is listed with the reason, and never in the way of the others. Large pictures and
tables stay in their files until a material is used: a folder of captured ones would fill the memory.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from studio_core.arrays import frozen_map
from studio_core.errors import InputError, LucarneError
from studio_core.library.lucmat import SUFFIX, Kept, alike, read, write
from studio_core.scene.nodes import Material

_LONGEST_STEM = 80
_HELD = 4 * 2**20  # bytes of one material's pictures and tables that stay in memory
_RESERVED = re.compile(r"^(con|prn|aux|nul|com\d|lpt\d)$", re.IGNORECASE)


@dataclass(frozen=True)
class Entry:
    """One material on the shelf: `kept`, or why its file cannot be read. `path` is None for what is built in.

    `stamp`: changes with the file (modification time in nanoseconds, bytes). Where it is not `whole`, `kept`
    is without pictures and tables, and `Shelf.fetch` has them.
    """

    kept: Kept | None
    path: Path | None = None
    stamp: tuple[int, int] = (0, 0)
    problem: str = ""
    whole: bool = True

    @property
    def key(self) -> str:
        """The same for the same file or preset, and for no other."""
        if self.path is not None:
            return f"file:{self.path}"
        return f"preset:{self.kept.material.id if self.kept is not None else ''}"

    @property
    def name(self) -> str:
        """The material's, or the file's where it cannot be read."""
        return self.kept.name if self.kept is not None else self.path.stem if self.path else ""

    @property
    def tags(self) -> tuple[str, ...]:
        """What it is found by beside its name."""
        return self.kept.tags if self.kept is not None else ()


class Shelf:
    """What is built in first, then the folder's files by name."""

    def __init__(self, folder: Path, built_in: Iterable[Kept] = ()) -> None:
        self.folder = folder
        self.built_in = tuple(Entry(kept) for kept in built_in)
        self._known: dict[Path, Entry] = {}

    def entries(self) -> tuple[Entry, ...]:
        """All of them as they are now; only files that changed are read."""
        known: dict[Path, Entry] = {}
        for path in sorted(self.folder.glob(f"*{SUFFIX}"), key=lambda p: folded(p.stem)):
            try:
                stat = path.stat()
            except OSError:
                continue
            stamp = stat.st_mtime_ns, stat.st_size
            before = self._known.get(path)
            known[path] = before if before is not None and before.stamp == stamp else _entry(path, stamp)
        self._known = known
        return (*self.built_in, *known.values())

    def find(self, text: str = "", tags: Iterable[str] = ()) -> tuple[Entry, ...]:
        """Entries with all of the tags, and with words that begin with each word of `text`."""
        return matching(self.entries(), text, tags)

    def tags(self) -> dict[str, int]:
        """Every tag with how many have it, the commonest first."""
        return counted(self.entries())

    def fetch(self, entry: Entry) -> Kept:
        """The whole material; ProjectError where its file cannot be read."""
        if entry.kept is not None and entry.whole:
            return entry.kept
        if entry.path is None:
            raise InputError(f"{entry.name} is not on the shelf.")
        return read(entry.path)

    def add(self, material: Material, tags: Iterable[str] = (), about: str = "") -> Path:
        """Keep a material in a new file that is named like it."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"The folder {self.folder} cannot be made: {error.strerror}.") from None
        stem = file_stem(material.name)
        path = self.folder / f"{stem}{SUFFIX}"
        number = 2
        while path.exists():
            path = self.folder / f"{stem} {number}{SUFFIX}"
            number += 1
        write(path, Kept(material, tuple(tags), about))
        return path

    def put(self, kept: Kept) -> Path:
        """Keep a material in a new file, unless one of that name that looks the same is kept already."""
        named = [entry for entry in self.entries() if entry.kept is not None and entry.name == kept.name]
        for entry in named:
            if entry.path is not None and alike(self.fetch(entry).material, kept.material):
                return entry.path
        return self.add(kept.material, kept.tags, kept.about)

    def change(self, entry: Entry, name: str | None = None, tags: Iterable[str] | None = None) -> Path:
        """Another name, or other tags, for a kept material; where it is now.

        With the name its file gets another one; the old file goes when the new one is there.
        """
        if entry.path is None:
            raise InputError(f"{entry.name} belongs to the program: keep a copy of it and change that.")
        kept = self.fetch(entry)
        if tags is not None:
            kept = replace(kept, tags=tuple(tags))
        if name is None or name == kept.name:
            write(entry.path, kept)
            return entry.path
        made = self.add(replace(kept.material, name=name), kept.tags, kept.about)
        self.remove(entry)
        return made

    def remove(self, entry: Entry) -> None:
        """Delete an entry's file; what is built in stays."""
        if entry.path is None:
            raise InputError(f"{entry.name} belongs to the program and cannot be deleted.")
        try:
            entry.path.unlink(missing_ok=True)
        except OSError as error:
            raise InputError(f"{entry.path.name} cannot be deleted: {error.strerror}.") from None


def matching(entries: Iterable[Entry], text: str = "", tags: Iterable[str] = ()) -> tuple[Entry, ...]:
    """Those with all of the tags, and with words that begin with each word of `text`."""
    wanted, needed = re.findall(r"\w+", folded(text)), {folded(tag) for tag in tags}
    return tuple(
        entry
        for entry in entries
        if needed <= {folded(tag) for tag in entry.tags} and _matches(entry, wanted)
    )


def counted(entries: Iterable[Entry]) -> dict[str, int]:
    """Every tag with how many have it, the commonest first; spelled as by the first that has it."""
    count: dict[str, int] = {}
    spelled: dict[str, str] = {}
    for entry in entries:
        for plain in {folded(tag): tag for tag in entry.tags}.items():
            tag = spelled.setdefault(*plain)
            count[tag] = count.get(tag, 0) + 1
    return dict(sorted(count.items(), key=lambda item: (-item[1], folded(item[0]))))


def folded(text: str) -> str:
    """Without case and accents, so that `Chêne` is found as `chene`."""
    for _ in range(3):  # folding case may give other accents, and the other way round
        apart = unicodedata.normalize("NFKD", text.casefold())
        text = "".join(c for c in apart if not unicodedata.combining(c))
    return text


def file_stem(name: str) -> str:
    """A name as a file may be called on every system."""
    made = "".join("-" if c in '<>:"/\\|?*' or ord(c) < 32 else c for c in name).strip(" .")
    made = made.encode("utf-8")[:_LONGEST_STEM].decode("utf-8", "ignore").strip(" .")
    return f"{made}-" if _RESERVED.match(made) else made or "Material"


def _entry(path: Path, stamp: tuple[int, int]) -> Entry:
    try:
        kept = read(path)
    except LucarneError as error:
        return Entry(None, path, stamp, str(error))
    material = kept.material
    pictures = sum(texture.image.nbytes for texture in material.textures.values())
    if pictures + sum(table.values.nbytes for table in material.tables.values()) <= _HELD:
        return Entry(kept, path, stamp)
    light = replace(material, textures=frozen_map(), tables=frozen_map())
    return Entry(replace(kept, material=light), path, stamp, whole=False)


def _matches(entry: Entry, wanted: list[str]) -> bool:
    own = entry.kept
    said = " ".join((entry.name, *entry.tags, own.about if own else "", own.material.model if own else ""))
    words = re.findall(r"\w+", folded(said))
    return all(any(word.startswith(part) for word in words) for part in wanted)


__all__ = ["Entry", "Shelf", "counted", "file_stem", "folded", "matching"]
