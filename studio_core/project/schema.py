"""The tables of a project file, and opening one without trusting it.

Format 1: one SQLite file, application id "LUCN", user version = format.

- `blob(hash, part, data)`: arrays (see `blobs`).
- `item(hash, json)`: canonical JSON by its hash: nodes and materials, pages of long lists, and
  `scene` (two lists), `step` (label and scene), `history` (list of steps, position), `session`.
- `revision(id, parent, label, time, items)`: one a save; `items` is a JSON list of the addresses of its
  scene, history and session (null for none).
- `meta(key, value)`: `head` (the revision last saved), `program` (who saved it).

Whatever a row refers to is in the file: rows are written in one transaction and never deleted one by one.
"""

from __future__ import annotations

import sqlite3
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from urllib.parse import quote

from studio_core.errors import ProjectError
from studio_core.project.blobs import PART_BYTES
from studio_core.project.faults import explained

APPLICATION_ID = int.from_bytes(b"LUCN")
FORMAT = 1
TABLES: Mapping[int, tuple[str, ...]] = {
    1: (
        "CREATE TABLE meta(key TEXT PRIMARY KEY NOT NULL, value TEXT NOT NULL)",
        "CREATE TABLE blob(hash TEXT NOT NULL, part INTEGER NOT NULL, data BLOB NOT NULL, "
        "PRIMARY KEY(hash, part))",
        "CREATE TABLE item(hash TEXT PRIMARY KEY NOT NULL, json TEXT NOT NULL)",
        "CREATE TABLE revision(id INTEGER PRIMARY KEY NOT NULL, parent INTEGER, label TEXT NOT NULL, "
        "time REAL NOT NULL, items TEXT NOT NULL)",
    ),
}
_MAGIC = b"SQLite format 3\x00"
_JOURNAL_MAGIC = bytes.fromhex("d9d505f920a163d7")
_BUSY_SECONDS = 10.0
_STEPS, _MOST_CALLS = 1_000_000, 20_000  # SQLite's virtual machine: an honest project needs far fewer
_LIMITS = {
    sqlite3.SQLITE_LIMIT_LENGTH: PART_BYTES + (1 << 20),
    sqlite3.SQLITE_LIMIT_SQL_LENGTH: 10_000,
    sqlite3.SQLITE_LIMIT_COLUMN: 20,
    sqlite3.SQLITE_LIMIT_EXPR_DEPTH: 20,
    sqlite3.SQLITE_LIMIT_COMPOUND_SELECT: 2,
    sqlite3.SQLITE_LIMIT_VDBE_OP: 5_000,
    sqlite3.SQLITE_LIMIT_FUNCTION_ARG: 8,
    sqlite3.SQLITE_LIMIT_ATTACHED: 0,
    sqlite3.SQLITE_LIMIT_LIKE_PATTERN_LENGTH: 50,
    sqlite3.SQLITE_LIMIT_VARIABLE_NUMBER: 16,
    sqlite3.SQLITE_LIMIT_TRIGGER_DEPTH: 1,
    sqlite3.SQLITE_LIMIT_WORKER_THREADS: 0,
}
_READ = {sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ, sqlite3.SQLITE_TRANSACTION}
_WRITE = _READ | {sqlite3.SQLITE_INSERT, sqlite3.SQLITE_UPDATE, sqlite3.SQLITE_DELETE}
_FUNCTIONS = {"length", "count", "sum", "max"}


Migration = Callable[[sqlite3.Connection], None]


@dataclass(frozen=True)
class Formats:
    """The formats a program knows: the one it writes, tables by format, and for each older format the
    function that turns a file of it, opened for writing, into the next.
    """

    current: int = FORMAT
    tables: Mapping[int, tuple[str, ...]] = field(default_factory=lambda: TABLES)
    migrations: Mapping[int, Migration] = field(default_factory=dict)


FORMATS = Formats()


def file_format(path: Path, formats: Formats = FORMATS) -> int:
    """Format of a project file by its first bytes; ProjectError when it is none or too new."""
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ProjectError(f"{path.name} is not a file")
    with path.open("rb") as file:
        head = file.read(100)
    if len(head) < 100 or head[:16] != _MAGIC or int.from_bytes(head[68:72]) != APPLICATION_ID:
        raise ProjectError(f"{path.name} is not a Lucarne project")
    found = int.from_bytes(head[60:64])
    if found > formats.current:
        raise ProjectError(
            f"{path.name} was saved by a newer Lucarne (format {found}; this one reads up to "
            f"{formats.current}): update Lucarne to open it"
        )
    if found not in formats.tables:
        raise ProjectError(f"{path.name} is damaged: there is no format {found}")
    if head[18:20] != b"\x01\x01" or int.from_bytes(head[56:60]) != 1:
        raise ProjectError(f"{path.name} is damaged: its header is not one that Lucarne writes")
    return found


@contextmanager
def reading(path: Path, formats: Formats = FORMATS) -> Iterator[tuple[sqlite3.Connection, int]]:
    """A connection that can only read, inside one transaction, and the file's format.

    An interrupted save is rolled back first. Every failure inside leaves as a ProjectError naming the file.
    """
    with explained(path, "read"):
        settle(path)
        found = file_format(path, formats)
        connection = _connect(path, "ro")
        try:
            connection.execute("PRAGMA query_only=ON")
            _guard(connection, found, formats, _READ)
            connection.execute("BEGIN")
            yield connection, found
        finally:
            connection.close()


@contextmanager
def writing(path: Path, formats: Formats = FORMATS) -> Iterator[sqlite3.Connection]:
    """A connection inside one write transaction on a file of the current format, committed at the end.

    Rolled back when anything fails inside; raises what failed (the caller explains it).
    """
    settle(path)
    found = file_format(path, formats)
    if found != formats.current:
        raise ProjectError(f"{path.name} has the older format {found}")
    connection = _connect(path, "rw")
    try:
        for pragma in ("journal_mode=DELETE", "synchronous=EXTRA", "fullfsync=ON"):
            connection.execute(f"PRAGMA {pragma}").fetchall()
        _guard(connection, found, formats, _WRITE)
        connection.execute("BEGIN IMMEDIATE")
        yield connection
        connection.execute("COMMIT")
    finally:
        connection.close()


@contextmanager
def creating(path: Path, formats: Formats = FORMATS) -> Iterator[sqlite3.Connection]:
    """A connection inside the transaction that fills a new file; `path` must not exist.

    Not yet safe on its own: the caller makes the file durable and gives it its name.
    """
    connection = _connect(path, "rwc")
    try:
        for pragma in ("page_size=4096", "encoding='UTF-8'", "journal_mode=MEMORY", "synchronous=OFF"):
            connection.execute(f"PRAGMA {pragma}").fetchall()
        connection.execute("BEGIN IMMEDIATE")
        connection.execute(f"PRAGMA application_id={APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version={formats.current}")
        for statement in formats.tables[formats.current]:
            connection.execute(statement)
        yield connection
        connection.execute("COMMIT")
    finally:
        connection.close()


@contextmanager
def altering(path: Path, found: int, formats: Formats) -> Iterator[sqlite3.Connection]:
    """A connection inside the transaction that turns a private copy of format `found` into the next one."""
    connection = _connect(path, "rw")
    try:
        _guard(connection, found, formats, _WRITE)
        connection.set_authorizer(None)
        connection.execute("PRAGMA journal_mode=MEMORY").fetchall()
        connection.execute("BEGIN IMMEDIATE")
        yield connection
        connection.execute(f"PRAGMA user_version={found + 1}")
        connection.execute("COMMIT")
    finally:
        connection.close()


def settle(path: Path) -> None:
    """Roll back what a killed save left unfinished, as SQLite does on the first access that may write.

    A journal that names another file is refused untouched: rolling it back could delete that file.
    """
    journal = journal_of(path)
    try:
        with journal.open("rb") as file:
            size = file.seek(0, 2)
            file.seek(max(0, size - 8))
            end = file.read(8)
    except FileNotFoundError:
        return
    if size == 0:
        return
    if end == _JOURNAL_MAGIC:
        raise ProjectError(f"{journal.name} is not one that Lucarne leaves: remove it to open {path.name}")
    connection = _connect(path, "rw")
    try:
        connection.execute("SELECT count(*) FROM sqlite_master").fetchall()
    except sqlite3.Error as error:
        if error_name(error).startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN")):
            raise ProjectError(
                f"{path.name} was interrupted while it was saved and its folder is read-only: copy it with "
                f" {journal.name} to a folder that can be written, and open it there"
            ) from None
        raise
    finally:
        connection.close()


def journal_of(path: Path) -> Path:
    """SQLite's rollback journal of a file."""
    return path.with_name(f"{path.name}-journal")


def error_name(error: sqlite3.Error) -> str:
    """SQLite's name of an error, empty when it has none."""
    return str(getattr(error, "sqlite_errorname", ""))


def _connect(path: Path, mode: str) -> sqlite3.Connection:
    uri = f"file:{quote(str(path.absolute()))}?mode={mode}"
    connection = sqlite3.connect(
        uri, uri=True, isolation_level=None, timeout=_BUSY_SECONDS, check_same_thread=False
    )
    try:
        for limit, value in _LIMITS.items():
            connection.setlimit(limit, value)
        for pragma in ("trusted_schema=OFF", "cell_size_check=ON", "mmap_size=0", "temp_store=MEMORY"):
            connection.execute(f"PRAGMA {pragma}").fetchall()
    except BaseException:
        connection.close()
        raise
    return connection


def _guard(connection: sqlite3.Connection, found: int, formats: Formats, allowed: set[int]) -> None:
    """Nothing but `allowed` on exactly the tables of the format; ProjectError for any other schema."""
    calls = 0

    def tick() -> int:
        nonlocal calls
        calls += 1
        return int(calls > _MOST_CALLS)

    def authorize(
        action: int, first: str | None, second: str | None, database: str | None, trigger: str | None
    ) -> int:
        if action == sqlite3.SQLITE_FUNCTION:
            return sqlite3.SQLITE_OK if second in _FUNCTIONS else sqlite3.SQLITE_DENY
        return sqlite3.SQLITE_OK if action in allowed and trigger is None else sqlite3.SQLITE_DENY

    connection.set_progress_handler(tick, _STEPS)
    connection.set_authorizer(authorize)
    rows = connection.execute("SELECT type, name, tbl_name, sql FROM sqlite_master LIMIT 100").fetchall()
    if sorted(map(repr, rows)) != list(_expected(formats.tables[found])):
        raise ProjectError("it is damaged: its tables are not those of a Lucarne project")


@cache
def _expected(tables: tuple[str, ...]) -> tuple[str, ...]:
    connection = sqlite3.connect(":memory:")
    try:
        for statement in tables:
            connection.execute(statement)
        rows = connection.execute("SELECT type, name, tbl_name, sql FROM sqlite_master").fetchall()
        return tuple(sorted(map(repr, rows)))
    finally:
        connection.close()
