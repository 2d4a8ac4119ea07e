"""Older and newer formats, with a made-up format 2 in the place of the current one."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

import pytest
from project_support.samples import renamed, small_scene

from studio_core.document import Step
from studio_core.errors import ProjectError
from studio_core.project.codec import scene_digest
from studio_core.project.migrate import rewrite_items
from studio_core.project.records import History
from studio_core.project.schema import FORMATS, TABLES, Formats, file_format
from studio_core.project.store import load, save


def shout(item: dict[str, Any]) -> dict[str, Any]:
    if item["type"] == "camera":
        return {**item, "name": item["name"].upper()}
    return item


def from_one(connection: sqlite3.Connection) -> None:
    rewrite_items(connection, shout)
    connection.execute("CREATE TABLE extra(x)")


TWO = Formats(
    current=2,
    tables={1: TABLES[1], 2: (*TABLES[1], "CREATE TABLE extra(x)")},
    migrations={1: from_one},
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "old.lucarne"
    scene = small_scene()
    save(path, renamed(scene, "First"), label="One")
    steps = (Step("Open", renamed(scene, "First")), Step("Edit", scene))
    save(path, scene, label="Two", history=History(steps, 1), session={"exposure": 3.0})
    return path


def test_an_older_file_is_opened_through_a_copy(path: Path) -> None:
    before = path.read_bytes()
    loaded = load(path, formats=TWO)
    assert loaded.scene["eye"].name == "EYE"
    assert loaded.scene["a"].name == "Chair"
    assert (loaded.format, loaded.session, len(loaded.revisions)) == (1, {"exposure": 3.0}, 2)
    assert "format 1" in loaded.notes[0]
    assert loaded.history is not None
    assert [step.scene["eye"].name for step in loaded.history.steps] == ["EYE", "EYE"]
    assert load(path, revision=1, formats=TWO).scene["a"].name == "First"
    assert path.read_bytes() == before
    assert [p.name for p in path.parent.iterdir()] == ["old.lucarne"]


@pytest.mark.parametrize("way", ["auto", "in place", "whole"])
def test_saving_brings_the_file_up_to_date(path: Path, way: Any) -> None:
    report = save(path, small_scene(5), label="Three", formats=TWO, way=way)
    assert report.whole
    assert file_format(path, TWO) == 2
    loaded = load(path, formats=TWO)
    assert scene_digest(loaded.scene) == scene_digest(small_scene(5))
    assert [r.label for r in loaded.revisions] == ["One", "Two", "Three"]
    assert loaded.notes == ()
    assert load(path, revision=2, formats=TWO).scene["eye"].name == "EYE"
    with pytest.raises(ProjectError, match=r"old\.lucarne was saved by a newer Lucarne \(format 2"):
        load(path, formats=FORMATS)


@pytest.mark.parametrize("trouble", [sqlite3.OperationalError("no"), ProjectError("no"), OSError(28, "no")])
def test_a_failing_migration_leaves_the_file(path: Path, trouble: Exception) -> None:
    def fail(connection: sqlite3.Connection) -> None:
        connection.execute("DELETE FROM item")
        raise trouble

    before = path.read_bytes()
    formats = Formats(2, TWO.tables, {1: fail})
    for act in (lambda: load(path, formats=formats), lambda: save(path, small_scene(), formats=formats)):
        with pytest.raises(ProjectError, match=r"old\.lucarne"):
            act()
    assert path.read_bytes() == before
    assert [p.name for p in path.parent.iterdir()] == ["old.lucarne"]


def test_a_migration_that_forgets_a_table_is_noticed(path: Path) -> None:
    formats = Formats(2, TWO.tables, {1: lambda connection: rewrite_items(connection, shout)})
    with pytest.raises(ProjectError, match=r"old\.lucarne.*tables"):
        load(path, formats=formats)


@pytest.mark.parametrize("statement", ["CREATE VIEW v AS SELECT 1", "UPDATE item SET json = json || ' '"])
def test_hostile_older_files_are_refused(path: Path, statement: str) -> None:
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute(statement)
    connection.close()
    with pytest.raises(ProjectError, match=r"old\.lucarne"):
        load(path, formats=TWO)


def test_every_older_format_has_a_migration() -> None:
    assert set(FORMATS.migrations) == set(range(1, FORMATS.current))
    assert FORMATS.current in FORMATS.tables
