"""`lucarne copy` and `lucarne compact`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from project_support.samples import renamed, small_scene

from studio.cli import main
from studio_core.document import Document
from studio_core.edits import SetFields
from studio_core.project.codec import scene_digest
from studio_core.project.lock import acquire
from studio_core.project.outline import revisions
from studio_core.project.records import History
from studio_core.project.store import load, save


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Two versions, and a name that was given up between them."""
    path = tmp_path / "room.lucarne"
    document = Document(renamed(small_scene(), "First"))
    save(path, document.scene)
    document.apply(SetFields("a", {"name": "SecretName"}))
    document.apply(SetFields("a", {"name": "Public"}))
    save(path, document.scene, history=History(document.history, document.position))
    return path


def test_a_copy_holds_the_newest_version_alone(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = project.read_bytes()
    copy = tmp_path / "client.lucarne"
    assert main(["copy", str(project), "-o", str(copy), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["bytes"] == copy.stat().st_size
    assert scene_digest(load(copy).scene) == scene_digest(load(project).scene)
    assert load(copy).history is None
    assert len(revisions(copy)) == 1
    assert b"SecretName" not in copy.read_bytes()
    assert project.read_bytes() == before
    assert main(["copy", str(project), "-o", str(copy)]) == 2
    assert "is there already" in capsys.readouterr().err


def test_a_copy_of_an_earlier_version(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = revisions(project)[0].id
    copy = tmp_path / "old.lucarne"
    assert main(["copy", str(project), "-o", str(copy), "--revision", str(first)]) == 0
    assert scene_digest(load(copy).scene) == scene_digest(load(project, revision=first).scene)
    assert main(["copy", str(project), "-o", str(tmp_path / "x.lucarne"), "--revision", "99"]) == 2
    assert "no revision 99" in capsys.readouterr().err
    assert not (tmp_path / "x.lucarne").exists()


def test_compacting_drops_earlier_versions_unless_it_is_open(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = load(project)
    with acquire(project):
        assert main(["compact", str(project)]) == 2
    assert "is open by" in capsys.readouterr().err
    assert len(revisions(project)) == 2
    assert main(["compact", str(project), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["dropped"] == 1
    after = load(project)
    assert len(after.revisions) == 1
    assert scene_digest(after.scene) == scene_digest(before.scene)
    assert [step.label for step in after.history.steps] == [step.label for step in before.history.steps]
    assert main(["compact", str(tmp_path / "none.lucarne")]) == 2
    assert list(tmp_path.glob(".*")) == [], "no lock is left"
