"""Versions of a project in a few words."""

from __future__ import annotations

from pathlib import Path

import pytest
from project_support.samples import small_scene

from studio_core.document import Document
from studio_core.edits import Remove, SetFields
from studio_core.errors import ProjectError
from studio_core.project.outline import STEPS, outline, revisions
from studio_core.project.records import History
from studio_core.project.store import load_revision, save


def test_each_version_tells_its_counts_and_its_last_steps(tmp_path: Path) -> None:
    document = Document(small_scene())
    path = tmp_path / "room.lucarne"
    save(path, document.scene, history=History(document.history, document.position), time=1.0)
    for number in range(STEPS + 2):
        document.apply(SetFields("b", {"name": f"Chair {number}"}, f"Rename {number}"))
    document.apply(Remove(("b",), "Delete Chair"))
    document.apply(SetFields("a", {"hidden": True}, "Hide"))
    document.undo()
    save(path, document.scene, history=History(document.history, document.position), time=2.0)
    first, last = revisions(path)
    assert (first.time, last.time) == (1.0, 2.0)
    told = outline(path)
    assert told.revision == last
    assert (told.objects, told.nodes["group"], told.materials) == (1, 1, 2)
    assert told.steps == ("Delete Chair", "Rename 5", "Rename 4", "Rename 3")
    earlier = outline(path, first.id)
    assert (earlier.objects, earlier.steps) == (2, ())
    assert load_revision(path, first.id).scene.nodes.keys() == small_scene().nodes.keys()


def test_what_is_no_project_is_told(tmp_path: Path) -> None:
    path = tmp_path / "bad.lucarne"
    path.write_bytes(b"nothing")
    for ask in (outline, revisions):
        with pytest.raises(ProjectError, match=r"bad\.lucarne"):
            ask(path)
