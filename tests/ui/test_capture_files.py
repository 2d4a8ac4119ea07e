"""Photographs on their way into a capture: chosen, dropped, added, missing, and back from the project."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from capture_support import FakeCapturer, FakeRun, bracket, plugin
from drag_support import Drag, files, on_canvas
from PIL import Image as Pillow
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from ui_support import Driver, Make, room

from studio_core.imaging.photograph_read import PHOTOGRAPHS as READABLE
from studio_core.scene.capture import Capture
from studio_core.scene.nodes import Environment
from studio_core.shading.scheduler import InlineExecutor
from studio_plugins.brdfs import plugin as brdfs
from studio_ui.files.drop_intent import CAMERAS, HDR, PHOTOGRAPHS, intent_of


@pytest.fixture
def driver(make: Make, monkeypatch: pytest.MonkeyPatch) -> Driver:
    monkeypatch.setattr(FakeCapturer, "current", FakeRun())
    made = make(plugins=(brdfs, plugin))
    made.window.settings.set("capture_placed", True)
    made.window.capture_panel.desk.executor = InlineExecutor()
    made.show(room())
    return made


@pytest.fixture
def shots(tmp_path: Path) -> list[Path]:
    """Six JPEGs."""
    paths = []
    for photograph in bracket():
        paths.append(tmp_path / photograph.facts.name)
        Pillow.fromarray(photograph.pixels).save(paths[-1], quality=95)
    return paths


def captures(driver: Driver) -> list[Capture]:
    return list(driver.document.scene.of(Capture))


def test_dropped_photographs_become_a_capture(driver: Driver, shots: list[Path]) -> None:
    drag = Drag(driver, files(*shots))
    at = on_canvas(driver, (0.0, 0.0, 2.0))
    assert drag.over(at)
    assert driver.window.drops.overlay.text == "Capture the room's light from 6 photographs"
    assert drag.drop(at)
    desk, panel = driver.window.capture_panel.desk, driver.window.capture_panel
    driver.until(lambda: panel.work is not None and "captured" in desk.fresh)
    assert "capture 6" in driver.answers.asked
    (made,) = captures(driver)
    assert [kept.facts.name for kept in made.photographs] == [path.name for path in shots]
    assert all(kept.data is not None and not kept.path for kept in made.photographs)
    assert panel.isVisible()
    assert driver.session.selection == (made.id,)
    assert driver.labels()[-1] == "Add capture"
    driver.do("edit.undo")
    assert captures(driver) == []


def test_more_photographs_are_dropped_on_the_panel(driver: Driver, shots: list[Path]) -> None:
    driver.window.take_files(shots[:3])
    panel = driver.window.capture_panel
    driver.until(lambda: len(captures(driver)) == 1 and panel.work is not None)
    for paths, taken in ((shots, True), ([shots[0], Path("chair.obj")], False)):
        data = files(*paths)
        enter = QDragEnterEvent(
            QPoint(20, 20), Qt.DropAction.CopyAction, data, Qt.MouseButton.LeftButton, Qt.KeyboardModifier(0)
        )
        panel.dragEnterEvent(enter)
        assert enter.isAccepted() is taken
    data = files(*shots)  # an event does not keep it
    drop = QDropEvent(
        QPointF(20, 20),
        Qt.DropAction.CopyAction,
        data,
        Qt.MouseButton.LeftButton,
        Qt.KeyboardModifier(0),
    )
    panel.dropEvent(drop)
    driver.until(lambda: len(captures(driver)[0].photographs) == 6)
    assert len(captures(driver)) == 1


def test_a_no_leaves_everything_as_it_is(driver: Driver, shots: list[Path]) -> None:
    driver.answers.capture_ = False
    driver.window.take_files(shots)
    assert captures(driver) == []
    assert driver.window.docks["capture"].isHidden()


def test_chosen_added_twice_and_damaged(driver: Driver, shots: list[Path], tmp_path: Path) -> None:
    broken, twin = tmp_path / "broken.jpg", tmp_path / "twin.jpg"
    broken.write_bytes(b"no picture")
    twin.write_bytes(shots[0].read_bytes())
    driver.answers.files = [*shots[:2], twin, broken]
    driver.do("file.capture")
    driver.until(lambda: len(captures(driver)) == 1)
    assert len(captures(driver)[0].photographs) == 2
    told = [entry.text for entry in driver.context.journal.entries if entry.level == "warning"]
    assert any("broken.jpg" in text for text in told)
    assert any("twin.jpg is the same as front0.jpg" in text for text in told)
    driver.until(lambda: driver.window.capture_panel.work is not None)
    driver.answers.files = shots
    reading = driver.window.capture_panel.reading
    reading.choose(captures(driver)[0].id)
    driver.until(lambda: len(captures(driver)[0].photographs) == 6)
    assert len(captures(driver)) == 1
    driver.answers.files = [broken]
    reading.choose()
    driver.until(lambda: bool(driver.problems()))
    assert "broken.jpg" in driver.problems()[0]
    assert len(captures(driver)) == 1


def test_a_capture_comes_back_from_its_file(driver: Driver, shots: list[Path], tmp_path: Path) -> None:
    driver.answers.files = shots
    driver.do("file.capture")
    desk = driver.window.capture_panel.desk
    driver.until(lambda: "captured" in desk.fresh)
    desk.apply("lens", "Field of view", fov=203.0)
    driver.until(lambda: not desk.busy)
    before = {digest: photograph.pixels for digest, photograph in desk.photographs.items()}
    driver.answers.target = tmp_path / "room.lucarne"
    driver.do("file.save")
    driver.until(lambda: driver.window.files.path is not None)
    for path in shots:
        path.unlink()
    driver.show(room())
    assert desk.capture is None
    assert desk.photographs == {}
    driver.window.files.open(tmp_path / "room.lucarne")
    driver.until(lambda: "captured" in desk.fresh)
    assert desk.settings.lens.fov == 203.0
    assert desk.missing == ()
    assert desk.photographs.keys() == before.keys()
    assert all((p.pixels == before[digest]).all() for digest, p in desk.photographs.items())


def test_a_photograph_that_is_gone_is_told(driver: Driver, tmp_path: Path) -> None:
    paths = []
    for photograph in bracket()[:3]:
        paths.append(tmp_path / photograph.facts.name.replace("jpg", "tif"))
        Pillow.fromarray(photograph.pixels).save(paths[-1])
    driver.window.take_files(paths)
    desk, panel = driver.window.capture_panel.desk, driver.window.capture_panel
    driver.until(lambda: "captured" in desk.fresh)
    paths[0].unlink()
    node = desk.node
    desk.open(None)
    desk.open(node)
    driver.until(lambda: not desk.busy and "captured" in desk.fresh)
    assert len(desk.missing) == 1
    driver.until(lambda: "front0.tif" in panel.work.warnings.text())
    assert panel.work.told()["photographs"].mark == "warning"


def test_what_a_drop_of_pictures_means(tmp_path: Path) -> None:
    def put(*names: str) -> list[Path]:
        paths = [tmp_path / name for name in names]
        for path in paths:
            path.write_bytes(b"x")
        return paths

    assert intent_of(put("a.jpg", "b.JPG", "c.png"), ()).capture
    assert intent_of(put("a.tif", "b.tiff"), ()).capture
    assert intent_of(put("a.heic"), ()).capture
    assert intent_of(put("a.dng", "b.jpg"), ()).capture
    assert intent_of(put("a.exr"), ()).light is not None
    assert intent_of(put("a.tif"), ()).light is not None
    assert intent_of(put("a.exr", "b.jpg"), ()).problem
    assert intent_of(put("a.exr", "b.hdr"), ()).problem
    assert not intent_of(put("a.jpg", "b.jpg", "chair.obj"), (".obj",)).capture
    assert set(CAMERAS) <= set(READABLE)
    assert not set(CAMERAS) & {*HDR, *PHOTOGRAPHS}


def test_two_circles_in_one_picture_are_no_environment(tmp_path: Path) -> None:
    around = np.random.default_rng(1).integers(60, 255, (100, 200, 3)).astype(np.uint8)
    Pillow.fromarray(around).save(tmp_path / "around.jpg")
    y, x = np.mgrid[:100, :200] + 0.5
    inside = (np.hypot(x - 50, y - 50) < 46) | (np.hypot(x - 150, y - 50) < 46)
    Pillow.fromarray(around * inside[..., None].astype(np.uint8)).save(tmp_path / "dual.jpg")
    assert intent_of([tmp_path / "around.jpg"], ()).light is not None
    meant = intent_of([tmp_path / "dual.jpg"], ())
    assert meant.capture
    assert meant.told(here=False, options=False) == "Capture the room's light from 1 photograph"


def test_an_environment_knows_its_capture(driver: Driver, shots: list[Path]) -> None:
    driver.answers.files = shots
    driver.do("file.capture")
    desk, panel = driver.window.capture_panel.desk, driver.window.capture_panel
    driver.until(lambda: "captured" in desk.fresh and panel.work is not None)
    panel.work.go("result")
    panel.work.forms["result"].use.click()
    lit = next(driver.document.scene.of(Environment))
    driver.window.docks["capture"].hide()
    driver.session.select([lit.id])
    driver.window.layout_.show("properties")
    properties = driver.window.panels["properties"]
    driver.until(lambda: properties.edit_capture is not None)
    driver.until(lambda: driver.window.actions_["object.edit_capture"].isEnabled())
    properties.edit_capture.click()
    assert panel.isVisible()
    driver.session.select(["stool"])
    driver.until(lambda: not driver.window.actions_["object.edit_capture"].isEnabled())
    assert properties.edit_capture is None
