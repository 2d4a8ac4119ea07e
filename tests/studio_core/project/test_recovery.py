"""Autosave: when, where, and what is offered afterwards."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from project_support.samples import renamed, small_scene

from studio_core.document import Step
from studio_core.errors import ProjectError
from studio_core.project.codec import scene_digest
from studio_core.project.lock import acquire
from studio_core.project.records import History
from studio_core.project.recovery import (
    Autosaver,
    RecoveryFile,
    discard,
    find_recovery,
    find_unsaved,
    recovery_path,
    unsaved_path,
)
from studio_core.project.store import load, save


@given(
    st.lists(st.floats(0, 5), min_size=1, max_size=60),
    st.lists(st.floats(0, 1), min_size=1, max_size=20),
)
def test_at_most_two_seconds_are_lost(pauses: list[float], costs: list[float]) -> None:
    """Edits at any times, autosaves of up to a second, asked ten times a second."""
    saver = Autosaver(interval=0.9)
    edits: list[float] = []
    for pause in pauses:
        edits.append((edits[-1] if edits else 0.0) + pause)
    now, waiting, saves = 0.0, list(edits), 0
    unsafe: list[float] = []
    finishing: tuple[float, list[float]] | None = None
    while waiting or unsafe or finishing:
        while waiting and waiting[0] <= now:
            unsafe.append(waiting[0])
            saver.changed(waiting.pop(0))
        if finishing is not None and finishing[0] <= now:
            saver.done()
            unsafe = [edit for edit in unsafe if edit not in finishing[1]]
            finishing = None
        if saver.due(now):
            assert finishing is None
            saver.started(now)
            finishing = (now + costs[saves % len(costs)], list(unsafe))
            saves += 1
        kept = finishing[1] if finishing else []
        assert all(now - edit <= 2.0 + 1e-6 for edit in unsafe if edit not in kept)
        now = round(now + 0.1, 6)
    assert saver.next_due() is None


def test_an_idle_document_is_never_autosaved() -> None:
    saver = Autosaver()
    assert saver.next_due() is None
    assert not saver.due(1e9)
    saver.changed(10.0)
    saver.changed(10.5)
    assert saver.next_due() == 11.0
    saver.saved()
    assert not saver.due(1e9)


def test_failures_are_tried_again_ever_later() -> None:
    saver = Autosaver(interval=1.0)
    saver.changed(0.0)
    now, waits = 1.0, []
    for _ in range(7):
        assert saver.due(now)
        saver.started(now)
        assert not saver.due(now + 1e6)
        saver.failed(now, "the disk is full")
        due = saver.next_due()
        assert due is not None
        waits.append(due - now)
        now = due
    assert waits == [5, 10, 20, 40, 60, 60, 60]
    assert saver.problem == "the disk is full"
    saver.started(now)
    saver.changed(now + 0.5)
    saver.done()
    assert saver.problem == ""
    assert saver.next_due() == now + 1.5


def test_autosaves_cost_what_the_edit_costs(tmp_path: Path) -> None:
    path = tmp_path / "p.lucarne"
    scene = small_scene(faces=60_000)
    save(path, scene)
    before = path.read_bytes()
    recovery = RecoveryFile(recovery_path(path), path)
    first = recovery.write(renamed(scene, "one"))
    assert first.whole
    assert first.bytes < 8000  # the rest is copied, packed as it is
    for number in range(20):
        report = recovery.write(renamed(scene, f"edit {number}"))
        assert not report.whole
        assert report.bytes < 8000
    loaded = load(recovery.path)
    assert loaded.scene["a"].name == "edit 19"
    assert len(loaded.revisions) == 1
    assert path.read_bytes() == before


def test_a_recovery_file_stands_alone(tmp_path: Path) -> None:
    path = tmp_path / "p.lucarne"
    scene = small_scene()
    save(path, scene)
    steps = (Step("Open", scene), Step("Edit", renamed(scene, "edited")))
    recovery = RecoveryFile(recovery_path(path), path)
    recovery.write(steps[1].scene, history=History(steps, 1), session={"exposure": 2.0})
    path.unlink()
    loaded = load(recovery.path)
    assert loaded.session == {"exposure": 2.0}
    assert loaded.history is not None
    assert [scene_digest(s.scene) for s in loaded.history.steps] == [scene_digest(s.scene) for s in steps]


def test_a_damaged_project_does_not_stop_autosaves(tmp_path: Path) -> None:
    path = tmp_path / "p.lucarne"
    path.write_bytes(b"damaged" * 1000)
    recovery = RecoveryFile(recovery_path(path), path)
    recovery.write(small_scene())
    assert scene_digest(load(recovery.path).scene) == scene_digest(small_scene())


def test_both_versions_are_offered(tmp_path: Path) -> None:
    path = tmp_path / "p.lucarne"
    scene = small_scene()
    save(path, scene, label="By hand", time=100.0)
    assert find_recovery(path) is None
    recovery = RecoveryFile(recovery_path(path), path)
    recovery.write(scene, time=101.0)
    assert find_recovery(path) is None  # it has nothing that the project does not have
    recovery.write(renamed(scene, "later"), label="Rename", time=102.0)
    found = find_recovery(path)
    assert found is not None
    assert found.saved is not None
    assert found.recovered is not None
    assert (found.saved.label, found.saved.time) == ("By hand", 100.0)
    assert (found.recovered.label, found.recovered.time) == ("Rename", 102.0)
    assert load(found.path).scene["a"].name == "later"
    recovery.discard()
    assert find_recovery(path) is None
    assert [p.name for p in tmp_path.iterdir()] == ["p.lucarne"]
    recovery.discard()


def test_an_old_recovery_file_is_not_continued(tmp_path: Path) -> None:
    path = tmp_path / "p.lucarne"
    save(path, small_scene(1))
    RecoveryFile(recovery_path(path), path).write(small_scene(2))
    assert RecoveryFile(recovery_path(path), path).write(small_scene(3)).whole
    assert scene_digest(load(recovery_path(path)).scene) == scene_digest(small_scene(3))


def test_a_damaged_recovery_file_is_named_not_hidden(tmp_path: Path) -> None:
    path = tmp_path / "p.lucarne"
    save(path, small_scene(1))
    recovery_path(path).write_bytes(b"nothing of use")
    found = find_recovery(path)
    assert found is not None
    assert found.recovered is None
    assert ".p.lucarne.recovery" in found.problem


def test_a_damaged_project_is_recovered_from_its_autosave(tmp_path: Path) -> None:
    path = tmp_path / "p.lucarne"
    save(path, small_scene(1))
    RecoveryFile(recovery_path(path), path).write(small_scene(2))
    path.write_bytes(b"gone")
    found = find_recovery(path)
    assert found is not None
    assert found.saved is None
    assert found.recovered is not None


def test_documents_that_were_never_saved(tmp_path: Path) -> None:
    state = tmp_path / "state" / "lucarne"
    assert find_unsaved(state) == []
    older, newer, held = (unsaved_path(state) for _ in range(3))
    for number, path in enumerate((older, newer, held)):
        RecoveryFile(path).write(small_scene(number), time=float(number))
    (state / "unsaved-zzz.lucarne-recovery").write_bytes(b"damaged")
    with acquire(held):
        found = find_unsaved(state)
        assert [r.path for r in found[:2]] == [newer, older]
        assert len(found) == 3
        assert sum(bool(r.problem) for r in found) == 1
    assert held in {r.path for r in find_unsaved(state)}
    for recovery in find_unsaved(state):
        discard(recovery.path)
    assert find_unsaved(state) == []


def test_what_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("a file where the folder should be")
    path = unsaved_path(tmp_path / "state")
    with pytest.raises(ProjectError, match=r"lucarne-recovery could not be written"):
        RecoveryFile(path).write(small_scene())
