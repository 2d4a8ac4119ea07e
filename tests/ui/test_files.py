"""Projects on the disk: save, reopen, autosave, recover, read-only, import, export."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from ui_support import Answers, Driver, Make, room

from studio_core.edits import SetFields
from studio_core.project.codec import scene_digest
from studio_core.project.recovery import recovery_path
from studio_core.project.store import load
from studio_core.scene.nodes import Environment

CUBE = """o cube
v 0 0 0\nv 45 0 0\nv 45 90 0\nv 0 90 0\nv 0 0 50\nv 45 0 50\nv 45 90 50\nv 0 90 50
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8
"""


def rename(driver: Driver, name: str) -> None:
    driver.document.apply(SetFields("stool", {"name": name}))


def saved(driver: Driver, path: Path) -> Path:
    driver.answers.target = path
    driver.do("file.save_as")
    driver.until(lambda: driver.window.files.path is not None)
    return driver.window.files.path


@pytest.mark.parametrize("threads", [False, True])
def test_save_and_reopen_with_history_and_view(make: Make, tmp_path: Path, threads: bool) -> None:
    driver = make(threads=threads)
    driver.show(room())
    rename(driver, "Taboret")
    assert driver.window.isWindowModified()
    driver.session.display(exposure=1.5, tonemap="filmic")
    path = saved(driver, tmp_path / "room")
    assert path.name == "room.lucarne"
    assert not driver.window.isWindowModified()
    assert driver.window.windowTitle() == "room[*] – Lucarne"
    view, scene, labels = driver.session.view, driver.document.scene, driver.labels()
    driver.close()
    other = make(threads=threads)
    other.window.files.open(path)
    other.until(lambda: other.window.files.path == path)
    assert scene_digest(other.document.scene) == scene_digest(scene)
    assert other.labels() == labels
    assert other.session.view.transform == view.transform
    assert (other.session.exposure, other.session.tonemap) == (1.5, "filmic")
    other.settle()
    other.do("edit.undo")
    assert other.document.scene["stool"].name == "Stool"
    assert other.window.settings.recent[0] == path


def test_a_second_window_opens_read_only_and_says_who_holds_it(make: Make, tmp_path: Path) -> None:
    first = make()
    first.show(room())
    path = saved(first, tmp_path / "room.lucarne")
    second = make(state=tmp_path / "other")
    second.window.files.open(path)
    second.until(lambda: second.window.files.path == path)
    assert second.window.files.read_only
    assert "(read-only)" in second.window.windowTitle()
    assert second.answers.asked == []
    assert "has had room open since" in second.window.front.read_only.text.text()
    rename(second, "Mine")
    second.answers.target = tmp_path / "copy.lucarne"
    second.do("file.save")
    second.until(lambda: not second.window.files.read_only)
    assert load(tmp_path / "copy.lucarne").scene["stool"].name == "Mine"
    assert load(path).scene["stool"].name == "Stool"


def test_what_cannot_be_opened_is_told_and_changes_nothing(driver: Driver, tmp_path: Path) -> None:
    bad = tmp_path / "bad.lucarne"
    bad.write_bytes(b"no project at all" * 100)
    before = driver.document.scene
    driver.window.files.open(bad)
    driver.until(lambda: bool(driver.problems()))
    assert "bad.lucarne" in driver.problems()[0]
    assert driver.document.scene is before
    assert not list(tmp_path.glob(".bad*")), "the lock was given back"


def autosaved(driver: Driver, path: Path) -> None:
    driver.until(lambda: driver.window.files.keeper.autosaver.due(time.monotonic()) or path.exists())
    driver.window.files.tick()
    driver.until(path.exists)
    driver.until(lambda: driver.window.files.keeper.autosaver._running is None)


@pytest.mark.parametrize("answer", ["recovered", "saved"])
def test_autosave_and_both_versions_after_a_crash(make: Make, tmp_path: Path, answer: str) -> None:
    driver = make()
    driver.show(room())
    path = saved(driver, tmp_path / "room.lucarne")
    rename(driver, "Autosaved")
    recovery = recovery_path(path)
    autosaved(driver, recovery)
    kept = tmp_path / "kept"
    shutil.copy(recovery, kept)
    driver.close()
    assert not recovery.exists(), "closing on purpose leaves nothing behind"
    shutil.copy(kept, recovery)  # as after a crash
    other = make(answers=Answers(recover_=answer))
    other.window.files.open(path)
    other.until(lambda: other.window.files.path == path)
    name = other.document.scene["stool"].name
    assert other.answers.asked == ["recover"]
    assert name == ("Autosaved" if answer == "recovered" else "Stool")
    assert other.document.modified == (answer == "recovered")
    if answer == "recovered":
        other.do("file.save")
        other.until(lambda: not other.document.modified)
        assert load(path).scene["stool"].name == "Autosaved"
        assert not recovery.exists()


def test_a_project_that_was_never_saved_is_offered_again(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "state"
    driver = make(state=state)
    driver.show(room())
    rename(driver, "Unsaved")
    recovery = driver.window.files.keeper.path
    autosaved(driver, recovery)
    kept = tmp_path / "kept"
    shutil.copy(recovery, kept)
    driver.close()
    shutil.copy(kept, recovery)
    other = make(state=state)
    other.window.files.offer_unsaved()
    other.until(lambda: "stool" in other.document.scene.nodes)
    assert other.document.scene["stool"].name == "Unsaved"
    assert other.document.modified
    assert other.window.files.path is None


@pytest.mark.parametrize(("answer", "closes"), [("cancel", False), ("discard", True), ("save", True)])
def test_closing_asks_about_unsaved_changes(make: Make, tmp_path: Path, answer: str, closes: bool) -> None:
    driver = make(answers=Answers(unsaved_=answer, target=tmp_path / "kept.lucarne"))
    driver.show(room())
    rename(driver, "Changed")
    driver.window.close()
    driver.until(lambda: driver.window.isVisible() != closes)
    assert driver.answers.asked == ["unsaved"]
    assert (tmp_path / "kept.lucarne").exists() == (answer == "save")


def test_new_forgets_the_file(make: Make, tmp_path: Path) -> None:
    driver = make()
    driver.show(room())
    saved(driver, tmp_path / "room.lucarne")
    driver.do("file.new")
    assert driver.document.scene.nodes == {}
    assert driver.window.files.path is None
    assert not driver.document.modified
    assert driver.window.front.start_page.isVisible()
    assert driver.window.status.vertices.text() == ""


def test_an_absurd_size_asks_for_the_unit(driver: Driver, tmp_path: Path) -> None:
    path = tmp_path / "cupboard.obj"
    path.write_text(CUBE)
    driver.answers.files = [path]
    driver.do("file.import")
    driver.idle()
    driver.until(lambda: "cupboard" in driver.labels()[-1])
    from studio_ui.canvas.projection import bounds

    low, high = bounds(driver.document.scene, driver.session.selection)
    assert high - low == pytest.approx((0.45, 0.9, 0.5))
    assert low[1] == pytest.approx(0)
    assert len(driver.answers.asked) == 1
    driver.do("edit.undo")
    assert len(driver.document.scene.nodes) == 4


def test_a_measured_material_waits_among_the_materials(driver: Driver, tmp_path: Path) -> None:
    from studio_core.brdfs import merl

    path = tmp_path / "felt.binary"
    merl.write(path, np.full((*merl.SHAPE, 3), 0.1))
    nodes = driver.document.scene.nodes
    driver.window.take_files([path])
    driver.until(lambda: driver.labels()[-1] == "Import felt")
    made = list(driver.document.scene.materials.values())[-1]
    assert (made.name, made.model, driver.answers.asked) == ("felt", "measured", [])
    assert driver.document.scene.nodes == nodes


def test_what_cannot_be_imported_is_told(driver: Driver, tmp_path: Path) -> None:
    path = tmp_path / "model.xyz"
    path.write_text("nothing")
    before = driver.document.scene
    driver.window.take_files([path])
    driver.until(lambda: bool(driver.problems()))
    assert driver.problems()[0].startswith("model.xyz ")
    assert driver.document.scene is before


def test_a_picture_of_light_lights_the_scene(make: Make, tmp_path: Path) -> None:
    from studio_core.imaging.encode import write_exr

    driver = make(threads=True)
    driver.show(room())
    path = tmp_path / "dusk.exr"
    write_exr(path, np.full((16, 32, 3), 0.5, np.float32))
    driver.window.take_files([path])
    driver.until(lambda: any(True for _ in driver.document.scene.of(Environment)))
    (sky,) = driver.document.scene.of(Environment)
    assert sky.name == "dusk"
    again = tmp_path / "dawn.exr"
    write_exr(again, np.full((16, 32, 3), 0.7, np.float32))
    driver.window.take_files([again])
    driver.until(lambda: driver.document.scene[sky.id].name == "dawn")
    assert driver.document.scene[sky.id].image.pixels[0, 0, 0] == np.float32(0.7)
