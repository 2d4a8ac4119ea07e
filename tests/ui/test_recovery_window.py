"""After a bad end, in real processes; and what the dialogs show and answer."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from names import nameless
from project_support.disk import environment
from PySide6.QtWidgets import QApplication, QLabel
from ui_support import Answers, Driver, Make, room

from studio_core.edits import SetFields
from studio_core.project.codec import scene_digest
from studio_core.project.lock import Holder, lock_path
from studio_core.project.outline import Outline, outline
from studio_core.project.records import Revision
from studio_core.project.recovery import Recovery, recovery_path
from studio_core.project.store import load, save
from studio_ui.files.leftovers import Leftover
from studio_ui.files.opening import ReadOnly
from studio_ui.files.read_only_bar import sentence
from studio_ui.files.recovery_dialog import LeftoversDialog, RecoveryDialog
from studio_ui.files.versions_dialog import VersionsDialog

PATIENCE = 120  # seconds until a child is given up


@contextmanager
def window(what: str, state: Path, project: Path) -> Iterator[subprocess.Popen[str]]:
    child = subprocess.Popen(
        [sys.executable, "-m", "window_child", what, str(state), str(project)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(QT_QPA_PLATFORM="offscreen"),
    )
    try:
        yield child
    finally:
        child.kill()
        child.communicate(timeout=PATIENCE)


def told(child: subprocess.Popen[str]) -> dict[str, Any]:
    line = child.stdout.readline()
    if not line:
        child.wait(PATIENCE)
        raise AssertionError(child.stderr.read())
    return dict(json.loads(line))


@pytest.mark.skipif(os.name == "nt", reason="kills with POSIX signals")
@pytest.mark.parametrize("deadly", ["SIGKILL", "SIGSEGV"])
def test_a_killed_window_loses_nothing(tmp_path: Path, deadly: str) -> None:
    state, project = tmp_path / "state", tmp_path / "flat.lucarne"
    save(project, room())
    with window("work", state, project) as child:
        before = told(child)
        child.send_signal(getattr(signal, deadly))
        child.wait(PATIENCE)
    assert recovery_path(project).exists()
    with window("recover", state, project) as child:
        after, saved = told(child), told(child)
        assert child.wait(PATIENCE) == 0
    assert after["asked"] == ["recover"]
    assert after["digest"] == before["digest"] == saved["digest"]
    assert after["labels"] == ["Open", "Rename", "Delete Back"]
    assert after["versions"] == [2, 3]
    assert after["modified"]
    assert not after["read_only"]
    assert ("Segmentation fault" in after["crashed"]) == (deadly == "SIGSEGV")
    assert scene_digest(load(project).scene) == before["digest"]
    with window("look", state, project) as child:
        again = told(child)
    assert again["asked"] == []
    assert again["crashed"] == "", "a report is offered once"
    assert again["digest"] == before["digest"]


@pytest.mark.skipif(os.name == "nt", reason="kills with POSIX signals")
def test_what_was_never_saved_is_offered_unless_its_window_lives(tmp_path: Path) -> None:
    state, project = tmp_path / "state", tmp_path / "later.lucarne"
    with window("unsaved", state, project) as child:
        before = told(child)
        with window("ask", state, project) as second:
            assert told(second)["asked"] == []
    with window("recover", state, project) as child:
        after = told(child)
        told(child)
        assert child.wait(PATIENCE) == 0
    assert after["asked"] == ["leftovers"]
    assert after["digest"] == before["digest"]
    assert scene_digest(load(project).scene) == before["digest"]


def saved(driver: Driver, path: Path) -> Path:
    driver.answers.target = path
    driver.do("file.save_as")
    driver.until(lambda: driver.window.files.path == path)
    return path


def rename(driver: Driver, name: str) -> None:
    driver.document.apply(SetFields("stool", {"name": name}, f"Rename to {name}"))


def test_deciding_later_opens_nothing_and_keeps_all(make: Make, tmp_path: Path) -> None:
    path = tmp_path / "flat.lucarne"
    save(path, room())
    recovery = recovery_path(path)
    save(recovery, SetFields("stool", {"name": "Kept"})(room()))
    content = recovery.read_bytes()
    driver = make(answers=Answers(recover_="later"))
    driver.window.files.open(path)
    driver.until(lambda: driver.answers.asked == ["recover"])
    driver.idle()
    assert driver.window.files.path is None
    assert recovery.read_bytes() == content
    driver.until(lambda: not lock_path(path).exists())


def leftover(*, with_saved: bool = True) -> Leftover:
    late, early = Revision(2, 1, "Autosave", time.time(), "a"), Revision(1, None, "Saved", 1e9, "b")
    path = Path("/x/flat.lucarne") if with_saved else None
    found = Recovery(Path("/x/r"), path, early if with_saved else None, late)
    recovered = Outline(late, {"mesh": 5, "camera": 1}, 3, ("Move chair", "Turn light"))
    return Leftover(found, recovered, Outline(early, {"mesh": 3, "camera": 2}, 3) if with_saved else None)


def words(dialog: object) -> str:
    return "\n".join(label.text() for label in dialog.findChildren(QLabel))  # type: ignore[attr-defined]


def test_the_dialog_tells_both_versions_apart(qapp: QApplication) -> None:
    dialog = RecoveryDialog(None, leftover())
    assert nameless(dialog) == []
    text = words(dialog)
    for part in ("flat", "5 objects", "3 objects", "Done last: Move chair", "Turn light", "9 September 2001"):
        assert part in text
    assert "2 objects more, 1 camera fewer" in text
    assert dialog.answer == "later"
    dialog.saved.click()
    assert dialog.answer == "saved"
    other = RecoveryDialog(None, leftover(with_saved=False))
    assert other.saved is None
    other.recovered.click()
    assert other.answer == "recovered"
    for made in (dialog, other):
        made.show()
        assert nameless(made) == []
        made.deleteLater()


def test_several_leftovers_are_opened_discarded_or_kept(qapp: QApplication) -> None:
    found = [leftover(with_saved=False) for _ in range(3)]
    dialog = LeftoversDialog(None, found)
    assert nameless(dialog) == []
    dialog.show()
    assert nameless(dialog) == []
    assert "3 scenes" in words(dialog)
    dialog.rows[1][3].click()
    assert dialog.rows[1][1].isHidden()
    dialog.rows[2][2].click()
    assert dialog.choice.open is found[2]
    assert dialog.choice.discard == (found[1],)
    dialog.deleteLater()
    other = LeftoversDialog(None, found[:1])
    other.later.click()
    assert (other.choice.open, other.choice.discard) == (None, ())
    other.deleteLater()


def test_discarded_leftovers_are_gone(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "state"
    state.mkdir()
    path = state / "unsaved-0123456789ab.lucarne-recovery"
    save(path, room())
    driver = make(state=state, answers=Answers(recover_="saved"))
    driver.window.files.offer_unsaved()
    driver.until(lambda: not path.exists())
    assert driver.document.scene.nodes == {}


# a second window


def test_trying_again_makes_it_savable_and_keeps_changes(make: Make, tmp_path: Path) -> None:
    first = make()
    first.show(room())
    path = saved(first, tmp_path / "flat.lucarne")
    second = make(state=tmp_path / "other")
    second.window.files.open(path)
    second.until(lambda: second.window.files.path == path)
    second.settle()
    bar = second.window.front.read_only
    assert bar.isVisible()
    assert not bar.over.isVisible()
    rename(second, "Mine")
    bar.again.click()
    second.until(lambda: bool(second.problems()))
    assert "is open by" in second.problems()[0]
    assert second.window.files.read_only
    first.close()
    bar.again.click()
    second.until(lambda: not second.window.files.read_only)
    assert bar.isHidden()
    assert second.document.scene["stool"].name == "Mine"
    second.do("file.save")
    second.until(lambda: not second.document.modified)
    assert load(path).scene["stool"].name == "Mine"


def test_what_somebody_else_saved_meanwhile_is_not_overwritten(make: Make, tmp_path: Path) -> None:
    first = make()
    first.show(room())
    path = saved(first, tmp_path / "flat.lucarne")
    second = make(state=tmp_path / "other")
    second.window.files.open(path)
    second.until(lambda: second.window.files.path == path)
    second.settle()
    rename(first, "Theirs")
    first.do("file.save")
    first.until(lambda: not first.document.modified)
    first.close()
    rename(second, "Mine")
    second.window.files.try_again()
    second.until(lambda: bool(second.problems()))
    assert "changed by somebody else" in second.problems()[0]
    assert second.window.files.read_only
    second.do("edit.undo")
    second.window.files.try_again()
    second.until(lambda: not second.window.files.read_only)
    assert second.document.scene["stool"].name == "Theirs"


def test_a_lock_of_another_machine_can_be_taken_over(make: Make, tmp_path: Path) -> None:
    path = tmp_path / "flat.lucarne"
    save(path, room())
    held = {"host": "studio-3", "user": "anna", "pid": 7, "started": "", "since": time.time() - 60}
    lock_path(path).write_text(json.dumps(held))
    driver = make()
    driver.window.files.open(path)
    driver.until(lambda: driver.window.files.path == path)
    driver.settle()
    bar = driver.window.front.read_only
    assert "anna on studio-3 has had flat open since" in bar.text.text()
    bar.over.click()
    driver.until(lambda: not driver.window.files.read_only)
    assert driver.answers.asked == ["take over from studio-3"]


def test_reasons_for_read_only() -> None:
    now = Holder("studio-3", "", 7, "", time.time())
    assert sentence("Flat", ReadOnly(now)).startswith("Read-only: Somebody on studio-3 has had Flat open")
    assert "access is denied" in sentence("Flat", ReadOnly(problem="flat.lucarne: access is denied"))
    assert sentence("Flat", ReadOnly()).startswith("Flat was opened read-only")


def test_the_same_project_can_be_opened_once_more(make: Make, tmp_path: Path) -> None:
    driver = make()
    driver.show(room())
    path = saved(driver, tmp_path / "flat.lucarne")
    rename(driver, "Dropped")
    driver.window.files.open(path)
    driver.until(lambda: not driver.document.modified)
    assert driver.document.scene["stool"].name == "Stool"
    assert not driver.window.files.read_only
    rename(driver, "Kept")
    driver.do("file.save")
    driver.until(lambda: not driver.document.modified)
    assert load(path).scene["stool"].name == "Kept"


# versions


def test_an_earlier_version_opens_as_a_copy(make: Make, tmp_path: Path) -> None:
    driver = make(answers=Answers(version_=1))
    driver.show(room())
    path = saved(driver, tmp_path / "flat.lucarne")
    rename(driver, "Later")
    driver.do("file.save")
    driver.until(lambda: not driver.document.modified)
    driver.do("file.versions")
    driver.until(lambda: driver.window.files.path is None)
    assert [one.steps[:1] for one in driver.answers.versions] == [("Rename to Later",), ()]
    assert driver.document.scene["stool"].name == "Stool"
    assert load(path).scene["stool"].name == "Later"


def test_a_copy_for_clients_holds_no_history(driver: Driver, tmp_path: Path) -> None:
    path = saved(driver, tmp_path / "flat.lucarne")
    rename(driver, "SecretName")
    rename(driver, "Public")
    driver.answers.target = path
    driver.do("file.copy_clean")
    driver.until(lambda: bool(driver.problems()))
    assert "choose another name" in driver.problems()[0]
    copy = tmp_path / "client.lucarne"
    driver.answers.target = copy
    driver.do("file.copy_clean")
    driver.until(copy.exists)
    driver.idle()
    assert b"SecretName" not in copy.read_bytes()
    assert load(copy).scene["stool"].name == "Public"
    assert driver.window.files.path == path
    assert driver.document.modified


@pytest.mark.parametrize("yes", [True, False])
def test_compacting_drops_earlier_versions_after_asking(make: Make, tmp_path: Path, yes: bool) -> None:
    driver = make(answers=Answers(compact_=yes))
    driver.show(room())
    path = saved(driver, tmp_path / "flat.lucarne")
    rename(driver, "Later")
    driver.do("file.save")
    driver.until(lambda: not driver.document.modified)
    driver.do("file.compact")
    driver.until(lambda: driver.answers.asked == ["compact 1"])
    if yes:
        driver.until(lambda: any("smaller" in entry.text for entry in driver.context.journal.entries))
    driver.idle()
    assert len(load(path).revisions) == (1 if yes else 2)
    assert outline(path).steps == ("Rename to Later",)
    rename(driver, "Afterwards")
    driver.do("file.save")
    driver.until(lambda: not driver.document.modified)
    assert load(path).scene["stool"].name == "Afterwards"


def test_the_versions_dialog_lists_the_newest_first(qapp: QApplication) -> None:
    late, early = Revision(2, 1, "Saved", 2e9, "a"), Revision(1, None, "Saved", 1e9, "b")
    found = [Outline(late, {"mesh": 2}, 1, ("Move",)), Outline(early, {"mesh": 1}, 1)]
    dialog = VersionsDialog(None, "flat", found)
    assert nameless(dialog) == []
    assert dialog.tree.topLevelItem(0).text(0).endswith("(newest)")
    assert dialog.chosen is found[1], "the newest is what is open"
    empty = VersionsDialog(None, "flat", [])
    assert empty.chosen is None
    assert not empty.open_button.isEnabled()
    for made in (dialog, empty):
        made.show()
        assert nameless(made) == []
        made.deleteLater()


def test_recovered_pictures_are_forgotten_with_the_file(make: Make, tmp_path: Path) -> None:
    driver = make()
    driver.show(room())
    rename(driver, "Other")
    keeper = driver.window.files.keeper
    driver.until(lambda: keeper.autosaver.due(time.monotonic()) or keeper.kept.where == "autosaved")
    driver.window.files.tick()
    driver.until(lambda: keeper.kept.where == "autosaved")
    path = keeper.path
    assert keeper.thumbnails.find(path) is not None
    shutil.copy(path, tmp_path / "kept")
    driver.do("file.new")
    driver.until(lambda: not path.exists())
    assert keeper.thumbnails.find(path) is None


def test_work_that_was_kept_before_it_was_seen_gets_its_picture_later(make: Make) -> None:
    driver = make(threads=True)
    driver.fake.gate = threading.Event()
    driver.open(room())
    rename(driver, "Other")
    keeper = driver.window.files.keeper
    driver.until(lambda: keeper.autosaver.due(time.monotonic()) or keeper.kept.where == "autosaved")
    driver.window.files.tick()
    driver.until(lambda: keeper.kept.where == "autosaved")
    path = keeper.path
    assert keeper.thumbnails.find(path) is None
    driver.fake.gate.set()
    driver.settle()
    driver.window.files.tick()
    driver.until(lambda: keeper.thumbnails.find(path) is not None)
