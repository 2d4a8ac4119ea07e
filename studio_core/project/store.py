"""Saving and opening projects.

A save writes what is new in one transaction; where that cannot be trusted (new file, network or
synchronised folder, locking fails) a complete file is put in place by a rename. Either way the file holds
the old content or the new one, never anything between.
"""

from __future__ import annotations

import sqlite3
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from studio_core.arrays import frozen_map
from studio_core.errors import ProjectError
from studio_core.project.canonical import dumps
from studio_core.project.faults import explained
from studio_core.project.lock import holder_of
from studio_core.project.migrate import migrated_copy
from studio_core.project.place import copy_file, folder_kind, replace_whole
from studio_core.project.records import History, LoadedProject, ProjectInfo, Revision, SaveReport
from studio_core.project.rows import Rows
from studio_core.project.schema import (
    FORMATS,
    Formats,
    creating,
    error_name,
    file_format,
    reading,
    settle,
    writing,
)
from studio_core.project.writer import Content, Writer, now
from studio_core.scene.nodes import Scene

Way = Literal["auto", "in place", "whole"]
_LOCKING_FAILED = {
    "SQLITE_PROTOCOL",
    "SQLITE_NOLFS",
    "SQLITE_IOERR_LOCK",
    "SQLITE_IOERR_RDLOCK",
    "SQLITE_IOERR_UNLOCK",
    "SQLITE_IOERR_CHECKRESERVEDLOCK",
}


def save(
    path: Path,
    scene: Scene,
    *,
    label: str = "Saved",
    history: History | None = None,
    session: Mapping[str, Any] | None = None,
    fresh: bool = False,
    keep_revisions: bool = True,
    way: Way = "auto",
    time: float | None = None,
    base: Path | None = None,
    formats: Formats = FORMATS,
) -> SaveReport:
    """Save a scene as the newest revision of the project at `path`, durable when this returns.

    `history` is the undo history (`Document.history`, `.position`); `session` any JSON (view, exposure,
    backend). `fresh` replaces whatever is at `path` by a project without earlier revisions;
    `keep_revisions=False` forgets the earlier revisions but keeps their rows; a new file starts as a copy of
    `base` where given, which spares packing what is packed there. ProjectError when it cannot
    be saved; the file then holds what it held, or (when only the last confirmation failed) the new content.
    """
    path = path.resolve()
    content = Content(scene, label, now() if time is None else time, history, session)
    with explained(path, "saved"):
        if not fresh and path.exists():
            settle(path)
            current = file_format(path, formats) == formats.current
            if current and way != "whole" and (way == "in place" or folder_kind(path.parent) == "local"):
                try:
                    return _save_in_place(path, content, keep_revisions, formats)
                except sqlite3.Error as error:
                    if way == "in place" or error_name(error) not in _LOCKING_FAILED:
                        raise
            return _save_whole(path, content, keep_revisions, formats, base=path)
        return _save_whole(path, content, keep_revisions, formats, base)


def _save_in_place(path: Path, content: Content, keep_revisions: bool, formats: Formats) -> SaveReport:
    with writing(path, formats) as connection:
        writer = Writer(connection)
        ident = writer.save(content, keep_revisions=keep_revisions)
    return SaveReport(ident, writer.rows, writer.bytes, whole=False)


def _save_whole(
    path: Path, content: Content, keep_revisions: bool, formats: Formats, base: Path | None
) -> SaveReport:
    reports: list[SaveReport] = []

    def fill(target: Path) -> None:
        if base is None:
            with creating(target, formats) as connection:
                writer = Writer(connection)
                ident = writer.save(content, keep_revisions=keep_revisions)
            reports.append(SaveReport(ident, writer.rows, writer.bytes, whole=True))
            return
        if file_format(base, formats) == formats.current:
            copy_file(base, target)
        else:
            migrated_copy(base, target, formats)
        with writing(target, formats) as connection:
            writer = Writer(connection)
            ident = writer.save(content, keep_revisions=keep_revisions)
        reports.append(SaveReport(ident, writer.rows, writer.bytes, whole=True))

    local = folder_kind(path.parent) == "local"
    replace_whole(path, fill, scratch=None if local else Path(tempfile.gettempdir()))
    return reports[0]


def load(path: Path, *, revision: int | None = None, formats: Formats = FORMATS) -> LoadedProject:
    """Open a project, or one of its earlier revisions, checking everything that is read.

    ProjectError naming file and part for whatever is damaged, hostile, too new or unreadable. A file of an
    older format is brought up to date in a copy; the file stays as it is until it is saved.
    """
    path = path.resolve()
    with explained(path, "opened"), current(path, formats) as (source, found):
        with reading(source, formats) as (connection, _):
            rows = Rows(connection)
            revisions = rows.revisions()
            chosen = revision_of(revisions, rows.head() if revision is None else revision)
            rows.gather(chosen.scene)
            scene = rows.compose(chosen.scene)
            history = None if chosen.history is None else rows.history(chosen.history)
            session = rows.session(chosen.session)
            rows.close()
        if history is not None and history.steps[history.position].digest != chosen.scene:
            raise ProjectError("the undo history is damaged: it does not lead to the scene")
        return LoadedProject(
            path, scene, chosen, revisions, history, frozen_map(session), _notes(found, formats), found
        )


def load_revision(path: Path, revision: int) -> LoadedProject:
    """An earlier save, with the undo history and session it had."""
    return load(path, revision=revision)


@contextmanager
def current(path: Path, formats: Formats = FORMATS) -> Iterator[tuple[Path, int]]:
    """A file of today's format with what `path` holds (itself, or a copy brought up to date), and the format
    that was found.
    """
    settle(path)
    found = file_format(path, formats)
    if found == formats.current:
        yield path, found
        return
    with tempfile.TemporaryDirectory(prefix="lucarne-") as folder:
        copy = Path(folder) / path.name
        migrated_copy(path, copy, formats)
        yield copy, found


def _notes(found: int, formats: Formats) -> tuple[str, ...]:
    if found == formats.current:
        return ()
    return (f"The file has the older format {found}; saving brings it to format {formats.current}.",)


def compact(path: Path) -> int:
    """Drop earlier revisions and everything that only they hold; the bytes that were freed.

    The newest revision stays, with its undo history.
    """
    path = path.resolve()
    with explained(path, "compacted"):
        settle(path)
        before = path.stat().st_size
        if file_format(path) != FORMATS.current:
            raise ProjectError("it has an older format: save it first")
        local = folder_kind(path.parent) == "local"
        scratch = None if local else Path(tempfile.gettempdir())
        replace_whole(path, lambda target: _copy_newest(path, target), scratch=scratch)
        return before - path.stat().st_size


def _copy_newest(path: Path, target: Path) -> None:
    with reading(path) as (source, _), creating(target) as made:
        rows = Rows(source)
        head = revision_of(rows.revisions(), rows.head())
        rows.gather(head.scene)
        rows.compose(head.scene)
        if head.history is not None:
            rows.history(head.history)
        rows.session(head.session)
        items, blobs = rows.read()
        for address in sorted(items):
            row = source.execute("SELECT hash, json FROM item WHERE hash = ?", (address,)).fetchone()
            made.execute("INSERT INTO item VALUES (?, ?)", row)
        for address in sorted(blobs):
            for row in source.execute("SELECT hash, part, data FROM blob WHERE hash = ?", (address,)):
                made.execute("INSERT INTO blob VALUES (?, ?, ?)", row)
        made.executemany("INSERT INTO meta VALUES (?, ?)", rows.meta().items())
        text = dumps([head.scene, head.history, head.session], "the revision")
        made.execute("INSERT INTO revision VALUES (?, NULL, ?, ?, ?)", (head.id, head.label, head.time, text))


def save_copy_without_history(source: Path | Scene, target: Path, *, label: str = "Copy") -> SaveReport:
    """A project of the present scene alone at `target`: no earlier revision, no undo, no session.

    The file is made anew, so that nothing discarded is left in unused pages.
    """
    scene = load(source).scene if isinstance(source, Path) else source
    return save(target, scene, label=label, fresh=True)


def newest(path: Path) -> Revision:
    """The revision that was saved last; ProjectError when the file cannot be read."""
    path = path.resolve()
    with explained(path, "read"), current(path, FORMATS) as (source, _), reading(source) as (connection, _):
        rows = Rows(connection)
        return revision_of(rows.revisions(), rows.head())


def revision_of(revisions: tuple[Revision, ...], wanted: int) -> Revision:
    """The revision of that number; ProjectError when there is none."""
    for revision in revisions:
        if revision.id == wanted:
            return revision
    raise ProjectError(f"there is no revision {wanted}")


def info(path: Path) -> ProjectInfo:
    """Facts about a project, arrays unread; ProjectError when it cannot be read."""
    path = path.resolve()
    with (
        explained(path, "read"),
        current(path, FORMATS) as (source, found),
        reading(source) as (connection, _),
    ):
        rows = Rows(connection)
        revisions = rows.revisions()
        chosen = revision_of(revisions, rows.head())
        nodes, materials = rows.lists(chosen.scene)
        ((arrays, data),) = connection.execute(
            "SELECT count(*), sum(length(data)) FROM blob WHERE part >= 0"
        ).fetchall()
        ((items,),) = connection.execute("SELECT count(*) FROM item").fetchall()
        holder = holder_of(path)
        return ProjectInfo(
            path=path,
            format=found,
            program=rows.meta().get("program", ""),
            file_bytes=path.stat().st_size,
            array_bytes=int(data or 0),
            arrays=int(arrays),
            items=int(items),
            revisions=revisions,
            steps=_steps(rows, chosen),
            nodes=kinds(rows, nodes, "the list of nodes", "type"),
            materials=kinds(rows, materials, "the list of materials", "model"),
            opened_by=None if holder is None else holder.described(now()),
        )


def _steps(rows: Rows, revision: Revision) -> int:
    if revision.history is None:
        return 0
    root = rows.value(revision.history, "the undo history").get("steps")
    return len(rows.entries(root if isinstance(root, str) else None, "the undo history"))


def kinds(rows: Rows, root: str | None, part: str, field: str) -> Mapping[str, int]:
    """How many items of a list have each value of a field."""
    found = Counter(str(rows.value(entry, part).get(field)) for entry in rows.entries(root, part))
    return frozen_map(dict(sorted(found.items())))
