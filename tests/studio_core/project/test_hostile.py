"""Files made to do harm: each is refused with a ProjectError that names file and part."""

from __future__ import annotations

import json
import sqlite3
import struct
import tracemalloc
import zlib
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from project_support.forge import Forge, Json
from project_support.samples import renamed, small_scene

from studio_core.document import Step
from studio_core.errors import ProjectError
from studio_core.project.codec import scene_digest
from studio_core.project.records import History
from studio_core.project.store import info, load, newest, save


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "victim.lucarne"
    scene = small_scene()
    steps = (Step("Open", renamed(scene, "Before")), Step("Rename", scene))
    save(path, scene, history=History(steps, 1), session={"exposure": 1.0})
    return path


def run(path: Path, *statements: str) -> None:
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA writable_schema=ON")
        for statement in statements:
            connection.execute(statement)


def refused(path: Path, match: str) -> None:
    with pytest.raises(ProjectError, match=match) as caught:
        load(path)
    assert "victim.lucarne" in str(caught.value)
    assert "\n" not in str(caught.value)


def forge(path: Path, kind: str, edit: Callable[[Json], Any]) -> None:
    Forge(path).change(lambda value: edit(value) if value["type"] == kind else None)


def test_the_forge_itself_makes_good_files(path: Path) -> None:
    Forge(path).change(lambda value: None)
    found = {node.name for node in load(path).scene.nodes.values()}
    assert found == {"Dining set", "Chair", "Chair 2", "Eye", "Sky"}


@pytest.mark.parametrize(
    "statement",
    [
        "CREATE VIEW v AS SELECT 1",
        "CREATE TRIGGER t AFTER INSERT ON item BEGIN DELETE FROM item; END",
        "CREATE TABLE extra(x)",
        "CREATE INDEX i ON item(json)",
        "CREATE VIRTUAL TABLE f USING fts5(x)",
        "CREATE VIRTUAL TABLE f USING rtree(a, b, c)",
        "ALTER TABLE item ADD COLUMN more TEXT",
        "ALTER TABLE item RENAME TO items",
        "DROP TABLE meta",
        "UPDATE sqlite_master SET sql = 'CREATE VIEW item AS SELECT 1 AS hash, 2 AS json', type = 'view' "
        "WHERE name = 'item'",
        "UPDATE sqlite_master SET sql = replace(sql, 'NOT NULL)', 'NOT NULL, g AS (randomblob(1e9)))')",
        "UPDATE sqlite_master SET sql = replace(sql, 'json TEXT', 'json TEXT DEFAULT (load_extension(1))')",
        "UPDATE sqlite_master SET rootpage = 2",
        "UPDATE sqlite_master SET rootpage = 999999",
        "UPDATE sqlite_master SET sql = 'gibberish' WHERE name = 'item'",
        "UPDATE sqlite_master SET tbl_name = 'meta'",
        "DELETE FROM sqlite_master WHERE name LIKE 'sqlite_%'",
        "ANALYZE",
    ],
)
def test_other_tables_are_refused(path: Path, statement: str) -> None:
    run(path, statement)
    before = path.read_bytes()
    refused(path, "damaged|tables|missing")
    with pytest.raises(ProjectError):
        save(path, small_scene(3))
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("statement", "cause"),
    [
        ("UPDATE item SET json = replace(json, 'Chair', 'Chaos')", "does not match its address"),
        ("UPDATE blob SET data = zeroblob(length(data))", "does not match its address|wrong size|damaged"),
        ("UPDATE blob SET data = data || x'00'", "does not fit its shape|missing"),
        ("UPDATE blob SET data = 'text' WHERE length(data) > 1000", "does not fit|not made of bytes"),
        ("UPDATE blob SET data = CAST(data AS TEXT)", "damaged"),
        ("UPDATE blob SET part = part + 1", "missing or incomplete"),
        ("UPDATE blob SET part = -1", "missing or incomplete"),
        ("UPDATE blob SET part = 'zero'", "missing or incomplete"),
        ("INSERT INTO blob SELECT hash, 1, data FROM blob", "missing or incomplete"),
        ("DELETE FROM blob", "missing or incomplete"),
        ("DELETE FROM item WHERE json LIKE '%mesh%'", "is missing"),
        ("UPDATE item SET json = x'ff00ff'", "damaged"),
        ("UPDATE item SET json = 5", "does not match its address"),
        ("UPDATE item SET json = NULL", "NOT NULL|damaged"),
        ("UPDATE item SET json = zeroblob(5000000)", "too long"),
        ("UPDATE item SET json = CAST(x'ff' AS TEXT)", "damaged"),
        ("DELETE FROM revision", "list of revisions"),
        ("DELETE FROM meta", "mark of the current revision"),
        ("UPDATE meta SET value = '999' WHERE key = 'head'", "no revision 999"),
        ("UPDATE meta SET value = printf('%.2000c', '9') WHERE key = 'head'", "too long"),
        ("UPDATE meta SET value = '²' WHERE key = 'head'", "mark of the current revision"),
        ("UPDATE revision SET parent = 1", "revision 1"),
        ("UPDATE revision SET id = -5", "revision -5"),
        ("UPDATE revision SET time = 1e999", "revision 1"),
        ("UPDATE revision SET time = 'noon'", "revision 1"),
        ("UPDATE revision SET label = x'00'", "revision 1"),
        ("UPDATE revision SET label = zeroblob(100000)", "too long"),
        ("UPDATE revision SET items = '[]'", "revision 1"),
        ("UPDATE revision SET items = '[1e999,null,null]'", "revision 1"),
        ("UPDATE revision SET items = replace(items, '[', '[[')", "revision 1"),
        ("UPDATE revision SET items = '[\"' || hex(zeroblob(16)) || '\",null,null]'", "is missing"),
        ("UPDATE revision SET items = '{\"a\":1}'", "revision 1"),
        (
            "INSERT INTO revision WITH RECURSIVE n(x) AS "
            "(SELECT 2 UNION ALL SELECT x + 1 FROM n LIMIT 100001) SELECT x, NULL, 'l', 1.0, '[]' FROM n",
            "too long",
        ),
    ],
)
def test_wrong_rows_are_refused(path: Path, statement: str, cause: str) -> None:
    try:
        run(path, statement)
    except sqlite3.IntegrityError:
        run(path, "UPDATE sqlite_master SET sql = replace(sql, 'json TEXT NOT NULL', 'json TEXT')")
        cause = "tables"
    refused(path, cause)


TRAPS: list[tuple[str, Callable[[Json], Any], str]] = [
    ("camera", lambda v: json.dumps(v).replace("45.0", "1e999"), "not a finite number"),
    ("camera", lambda v: json.dumps(v).replace("45.0", "NaN"), "not a finite number"),
    ("camera", lambda v: json.dumps(v).replace("45.0", "9" * 5000), "5000 digits"),
    ("camera", lambda v: json.dumps(v).replace("45.0", "[" * 50_000 + "]" * 50_000), "deep"),
    ("camera", lambda v: json.dumps(v)[:-1] + ',"fov":50.0}', "twice"),
    ("camera", lambda v: "[1,2]", "no object"),
    ("camera", lambda v: {**v, "type": "__import__('os')"}, "unknown kind"),
    ("camera", lambda v: {**v, "type": "os.system"}, "unknown kind"),
    ("camera", lambda v: {**v, "__class__": "Camera"}, "'__class__'"),
    ("camera", lambda v: {**v, "parent": "nobody"}, "parent 'nobody' of the node 'Eye'"),
    ("camera", lambda v: {**v, "id": "a"}, "does not belong|own ancestor|'a'"),
    ("camera", lambda v: {**v, "id": ""}, "''"),
    ("group", lambda v: {**v, "parent": v["id"]}, "own ancestor"),
    ("group", lambda v: {**v, "parent": "a"}, "own ancestor"),
    ("mesh", lambda v: {**v, "materials": []}, "uses slot"),
    ("mesh", lambda v: {**v, "materials": ["wood", "gone"]}, "material 'gone' of the mesh"),
    ("mesh", lambda v: {**v, "geometry": {}}, "no mesh"),
    ("mesh", lambda v: {**v, "geometry": v["geometry"]["positions"]}, "no mesh"),
    ("environment", lambda v: {**v, "image": {**v["image"], "encoding": "pq"}}, "encoding"),
    ("environment", lambda v: {**v, "image": []}, "no picture"),
    ("material", lambda v: {**v, "values": {"x": {"y": 1.0}}}, "values ▸ x is not a number"),
    ("material", lambda v: {**v, "values": {"x": [1.0, 2.0]}}, "values ▸ x is not a number"),
    ("material", lambda v: {**v, "values": {"x": 1 << 63}}, "values ▸ x is not a whole number"),
    ("material", lambda v: {**v, "values": {"x\n\x1b[2J": None}}, "x��.2J is not a number"),
    ("material", lambda v: {**v, "values": {"x" * 9000: None}}, "…$"),
    ("material", lambda v: {**v, "textures": {"albedo": None}}, "textures ▸ albedo"),
    ("material", lambda v: {**v, "opacity": None}, "opacity"),
]


@pytest.mark.parametrize(("kind", "edit", "cause"), TRAPS)
def test_well_addressed_nonsense_is_refused(
    path: Path, kind: str, edit: Callable[[Json], Any], cause: str
) -> None:
    forge(path, kind, edit)
    refused(path, cause)


def resized(part: str, shape: list[Any]) -> Callable[[Json], Any]:
    def edit(value: Json) -> Json:
        reference = value["geometry"][part] if part in value.get("geometry", {}) else value["image"]["pixels"]
        reference["shape"] = shape
        return value

    return edit


@pytest.mark.parametrize(
    ("kind", "part", "shape"),
    [
        ("mesh", "positions", [2**31 - 1, 3]),
        ("mesh", "positions", [100_000_000, 3]),
        ("mesh", "positions", [0, 3]),
        ("mesh", "positions", [101, 3]),
        ("mesh", "faces", [10**18, 3]),
        ("mesh", "faces", [-200, 3]),
        ("mesh", "slots", [200.0]),
        ("mesh", "slots", [[200]]),
        ("environment", "pixels", [30_000, 30_000, 1]),
        ("environment", "pixels", [16, 32, 3, 1]),
        ("environment", "pixels", [0, 32, 3]),
        ("environment", "pixels", [16, 48, 2]),
        ("environment", "pixels", [32, 16, 3]),
    ],
)
def test_absurd_shapes_cost_no_memory(path: Path, kind: str, part: str, shape: list[Any]) -> None:
    forge(path, kind, resized(part, shape))
    tracemalloc.start()
    refused(path, "damaged|large")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20_000_000


def test_a_compressed_bomb_is_stopped_at_its_declared_size(path: Path) -> None:
    bomb = zlib.compress(bytes(200 << 20), 9)
    forged = Forge(path)

    def edit(value: Json) -> Any:
        if value["type"] != "environment":
            return None
        pixels = np.zeros((1000, 1000, 4), np.uint8)
        assert len(bomb) < pixels.nbytes
        value["image"]["pixels"] = forged.blob(pixels, bomb)
        return value

    forged.change(edit)
    tracemalloc.start()
    refused(path, "wrong size")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20_000_000


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_arrays_that_are_not_finite_are_refused(path: Path, bad: float) -> None:
    for kind in ("mesh", "environment"):
        forged = Forge(path)

        def edit(value: Json, forged: Forge = forged, kind: str = kind) -> Any:
            if value["type"] != kind:
                return None
            if kind == "mesh":
                value["geometry"]["positions"] = forged.blob(np.full((100, 3), bad, np.float32))
            else:
                value["image"]["pixels"] = forged.blob(np.full((2, 4, 3), bad, np.float32))
            return value

        forged.change(edit)
        refused(path, "finite")


def test_faces_beyond_the_positions_are_refused(path: Path) -> None:
    forged = Forge(path)

    def edit(value: Json) -> Any:
        if value["type"] == "mesh":
            value["geometry"]["faces"] = forged.blob(np.full((200, 3), 100, np.uint32))
            return value
        return None

    forged.change(edit)
    refused(path, "position that does not exist")


def test_pages_that_multiply_are_refused(path: Path) -> None:
    forged = Forge(path)
    leaf = next(a for a, text in forged.items.items() if json.loads(text)["type"] == "group")
    below = forged.put(json.dumps({"type": "page", "level": 0, "of": [leaf] * 256}))
    for level in range(1, 13):
        below = forged.put(json.dumps({"type": "page", "level": level, "of": [below] * 256}))
    scene = forged.put(json.dumps({"type": "scene", "nodes": below, "materials": None}))
    history = forged.put(json.dumps({"type": "history", "steps": below, "position": 0}))
    forged.head([scene, history, None])
    refused(path, "more than")  # an honest reader of 256^13 entries would never come back
    with pytest.raises(ProjectError, match="more than"):
        info(path)


@pytest.mark.parametrize(
    ("history", "session"),
    [
        ({"type": "history", "steps": None, "position": 0}, None),
        ({"type": "history", "steps": "0" * 32, "position": 0}, None),
        ({"type": "history", "position": 0}, None),
        ({"type": "session", "values": {}}, None),
        (None, {"type": "session", "values": []}),
        (None, {"type": "history"}),
    ],
)
def test_wrong_histories_and_sessions_are_refused(path: Path, history: Json, session: Json) -> None:
    forged = Forge(path)
    ((items,),) = forged.connection.execute("SELECT items FROM revision").fetchall()
    scene = json.loads(items)[0]
    forged.head([scene, *(value and forged.put(json.dumps(value)) for value in (history, session))])
    refused(path, "history is damaged|session is damaged")


def test_a_history_that_leads_elsewhere_is_refused(path: Path) -> None:
    forged = Forge(path)
    for address, text in forged.items.items():
        if json.loads(text)["type"] == "history":
            moved = forged.put(json.dumps({**json.loads(text), "position": 0}))
            ((items,),) = forged.connection.execute("SELECT items FROM revision").fetchall()
            forged.connection.execute("UPDATE revision SET items = ?", (items.replace(address, moved),))
    forged.close()
    refused(path, "does not lead to the scene")


def test_scenes_inside_the_history_are_checked(path: Path) -> None:
    run(path, "UPDATE item SET json = replace(json, 'Before', 'Beware')")
    refused(path, "does not match its address")


@pytest.mark.parametrize(
    ("offset", "value", "cause"),
    [
        (0, b"X", "not a Lucarne project"),
        (68, b"EVIL", "not a Lucarne project"),
        (60, struct.pack(">I", 7), r"newer Lucarne \(format 7; this one reads up to 1\)"),
        (60, struct.pack(">I", 0), "no format 0"),
        (18, b"\x02\x02", "header"),
        (56, struct.pack(">I", 2), "header"),
        (16, b"\x00\x00", "damaged|not a database"),
    ],
)
def test_other_headers_are_refused(path: Path, offset: int, value: bytes, cause: str) -> None:
    data = bytearray(path.read_bytes())
    data[offset : offset + len(value)] = value
    path.write_bytes(data)
    refused(path, cause)


def test_a_truncated_file_is_refused(path: Path) -> None:
    data = path.read_bytes()
    for length in [*range(0, 200, 20), *range(512, len(data), 2731)]:
        path.write_bytes(data[:length])
        refused(path, "victim")


def test_a_journal_cannot_delete_other_files(path: Path, tmp_path: Path) -> None:
    """SQLite removes the super-journal that a hot journal names after rolling it back."""
    precious = tmp_path / "precious.txt"
    precious.write_text("do not lose")
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("PRAGMA cache_size=1")
    connection.execute("BEGIN EXCLUSIVE")
    connection.execute("UPDATE item SET json = json || ' '")
    journal = path.with_name("victim.lucarne-journal")
    data = journal.read_bytes()
    connection.execute("ROLLBACK")
    connection.close()
    name = str(precious).encode()
    record = struct.pack(">I", (1 << 30) // 4096 + 1) + name
    record += struct.pack(">II", len(name), sum(name)) + bytes.fromhex("d9d505f920a163d7")
    journal.write_bytes(data + record)
    for act in (load, info, newest):
        with pytest.raises(ProjectError, match=r"victim\.lucarne"):
            act(path)
    with pytest.raises(ProjectError, match=r"victim\.lucarne"):
        save(path, small_scene(2))
    assert precious.read_text() == "do not lose"
    save(path, small_scene(2), fresh=True)
    assert precious.read_text() == "do not lose"
    assert scene_digest(load(path).scene) == scene_digest(small_scene(2))


def test_opening_never_writes(path: Path) -> None:
    before, status = path.read_bytes(), path.stat()
    for act in (load, info, newest):
        act(path)
    assert path.read_bytes() == before
    assert path.stat().st_mtime_ns == status.st_mtime_ns
    assert [p.name for p in path.parent.iterdir()] == ["victim.lucarne"]
