"""The lighting panel: lights in a list, their form, and the shelf of environments."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PySide6.QtCore import QPoint, Qt
from ui_support import Driver, Make, move_mouse, room

from studio_core.document import Step
from studio_core.edits import Add
from studio_core.imaging.encode import write_exr
from studio_core.project.records import History
from studio_core.project.store import save
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, PointLamp, Scene, SpotLamp
from studio_ui.panels.dial import wrapped
from studio_ui.panels.environment_shelf import (
    EnvironmentShelf,
    kept_thumbnail,
    set_environment,
    small_picture,
)
from studio_ui.panels.lamps import LAMPS
from studio_ui.panels.lighting import LightingPanel

SKY = Environment(id="sky", name="Sky", image=Image(np.ones((8, 16, 3), np.float32)))
LAMPS_THERE = (PointLamp(id="left", name="Left"), PointLamp(id="right", name="Right", hidden=True))


@pytest.fixture(autouse=True)
def own_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr("studio_ui.panels.environment_shelf.user_cache", lambda: tmp_path / "cache")
    return tmp_path / "cache"


def panel_of(driver: Driver) -> LightingPanel:
    found: LightingPanel = driver.window.panels["lighting"]
    return found


def sky(value: float) -> npt.NDArray[np.float32]:
    made = np.full((16, 32, 3), value, np.float32)
    made[4, 8] = 50 * value
    return made


def gradient(path: Path, value: float) -> Path:
    write_exr(path, sky(value) * np.linspace(0.2, 1, 32, dtype=np.float32)[None, :, None])
    return path


def test_the_environment_is_turned_by_its_form(driver: Driver) -> None:
    driver.document.apply(Add((SKY,)))
    panel = panel_of(driver)
    driver.until(lambda: panel.lights == ("sky",))
    assert panel.form is not None
    fields: Any = panel.form.fields
    for name, value in (("azimuth", 45.0), ("tilt", 10.0), ("temperature", 3000.0)):
        fields[name].spin.setValue(value)
        assert getattr(driver.document.scene["sky"], name) == value
    fields["intensity"].other.setValue(-1.0)
    assert driver.document.scene["sky"].intensity == 0.5
    assert driver.labels()[2:] == [f"{n} of Sky" for n in ("Rotation", "Tilt", "Temperature", "Intensity")]


def test_the_dial_is_dragged_in_one_step_and_follows_the_picture(driver: Driver) -> None:
    driver.document.apply(Add((SKY,)))
    panel = panel_of(driver)
    driver.until(lambda: panel.lights == ("sky",))
    assert panel.form is not None
    dial: Any = panel.form.fields["azimuth"].dial

    def spot(x: float, y: float) -> QPoint:  # the form may still be laid out
        return QPoint(round(x * dial.width()), round(y * dial.height()))

    driver.bot.mousePress(dial, Qt.MouseButton.LeftButton, pos=spot(0.5, 0.9))
    move_mouse(dial, spot(0.8, 0.8))
    move_mouse(dial, spot(0.9, 0.5))
    assert driver.document.scene["sky"].azimuth == pytest.approx(90.0, abs=1.5)
    assert driver.document.in_gesture
    driver.bot.mouseRelease(dial, Qt.MouseButton.LeftButton, pos=spot(0.9, 0.5))
    assert driver.labels()[2:] == ["Rotation of Sky"]
    middle = QPoint(driver.viewport.width() // 2, driver.viewport.height() // 2)
    keys, button = Qt.KeyboardModifier.ShiftModifier, Qt.MouseButton.RightButton
    driver.press(middle, keys, button)
    driver.move(middle + QPoint(120, 0))
    driver.move(middle + QPoint(180, 0))
    turned = driver.document.scene["sky"].azimuth
    assert turned != pytest.approx(90.0, abs=1)
    driver.until(lambda: dial.degrees == pytest.approx(turned))
    driver.release(middle + QPoint(180, 0), keys, button)
    driver.bot.keyClick(dial, Qt.Key.Key_Right)
    assert driver.document.scene["sky"].azimuth == pytest.approx(wrapped(turned + 5))
    assert [wrapped(d) for d in (190, -190, 180, -180, 540, 0)] == [-170, 170, 180, 180, 180, 0]


def test_lamps_are_added_above_the_scene(driver: Driver) -> None:
    panel = panel_of(driver)
    panel.add_lamp("Spot lamp", LAMPS["Spot lamp"])
    (lamp,) = driver.session.selection
    node = driver.document.scene[lamp]
    assert isinstance(node, SpotLamp)
    assert driver.document.scene.world(lamp).matrix()[:3, :3] @ (0, 0, -1) == pytest.approx(
        (0, -1, 0), abs=1e-6
    )
    assert node.transform.translation[1] > 1.0
    assert driver.labels()[1:] == ["Add spot lamp"]
    panel.copy()
    assert [n.name for n in driver.document.scene.of(SpotLamp)] == ["Spot lamp", "Spot lamp 2"]
    panel.remove()
    assert [n.name for n in driver.document.scene.of(SpotLamp)] == ["Spot lamp"]
    assert driver.labels()[2:] == ["Duplicate", "Delete Spot lamp 2"]


def checks(panel: LightingPanel) -> dict[str, bool]:
    return {item.text(0): item.checkState(0) is Qt.CheckState.Checked for item in panel.list._items.values()}


def test_lights_are_switched_by_their_check_boxes(driver: Driver) -> None:
    driver.document.apply(Add((*LAMPS_THERE, SKY)))
    panel = panel_of(driver)
    driver.until(lambda: checks(panel) == {"Sky": True, "Left": True, "Right": False})
    panel.list._items["right"].setCheckState(0, Qt.CheckState.Checked)
    assert not driver.document.scene["right"].hidden
    assert driver.labels()[2:] == ["Switch Right on"]
    driver.do("edit.undo")
    driver.until(lambda: not checks(panel)["Right"])
    panel.list._items["left"].setText(0, "Door")
    assert driver.document.scene["left"].name == "Door"


def test_a_light_alone_and_the_others_as_they_were(driver: Driver) -> None:
    driver.document.apply(Add((*LAMPS_THERE, SKY)))
    panel = panel_of(driver)

    def on() -> list[str]:
        return [n for n in ("sky", "left", "right") if not driver.document.scene[n].hidden]

    panel.solo("right")
    assert on() == ["right"]
    panel.solo("left")
    assert on() == ["left"], "another one alone"
    panel.solo("left")
    assert on() == ["sky", "left"], "as it was before any was alone"
    panel.solo("sky")
    driver.do("edit.undo")
    assert on() == ["sky", "left"]
    assert driver.labels()[2:] == ["Only Right", "Only Left", "All lights besides Left", "Only Sky"]


def test_lights_chosen_in_the_list_are_edited_together(driver: Driver) -> None:
    driver.document.apply(Add((*LAMPS_THERE, SKY)))
    panel = panel_of(driver)
    driver.until(lambda: len(checks(panel)) == 3)
    for light in ("left", "right"):
        panel.list._items[light].setSelected(True)
    panel.list._items["sky"].setSelected(False)
    assert driver.session.selection == panel.lights == ("left", "right")
    assert panel.form is not None
    fields: Any = panel.form.fields
    fields["intensity"].spin.setValue(7.0)
    assert driver.document.scene["left"].intensity == driver.document.scene["right"].intensity == 7.0
    driver.session.select(["stool", "sky"])
    assert panel.lights == ("sky",)
    assert panel.list.selected == ("sky",)


def background(driver: Driver) -> dict[str, bool]:
    panel = panel_of(driver)
    assert panel.form is not None
    names = ("background", "background_azimuth", "projection", "ground_height", "ground_radius")
    rows = panel.form._rows
    return {n: not rows[n][1].isHidden() for n in names}


def test_the_background_has_its_own_part(driver: Driver) -> None:
    driver.document.apply(Add((SKY,)))
    panel = panel_of(driver)
    driver.until(lambda: panel.lights == ("sky",))
    assert background(driver) == {
        "background": True,
        "background_azimuth": True,
        "projection": True,
        "ground_height": False,
        "ground_radius": False,
    }
    assert panel.form is not None
    combo: Any = panel.form.fields["projection"].combo  # type: ignore[attr-defined]
    combo.activated.emit(combo.findText("on the ground"))
    driver.until(lambda: background(driver)["ground_height"])
    assert driver.document.scene["sky"].projection == "on the ground"


# the shelf


def shelf_of(driver: Driver, samples: dict[str, Path] | None = None) -> EnvironmentShelf:
    """A shelf of its own, with those samples."""
    transfer = driver.window.transfer
    made = EnvironmentShelf(driver.context, driver.window.settings, samples or {}, transfer.load_environment)
    transfer.lit.connect(made.used)
    return made


def marked(shelf: EnvironmentShelf) -> list[bool]:
    return [shelf.is_current(entry) for entry in shelf.entries]


def names(shelf: EnvironmentShelf) -> list[str]:
    return [entry.name for entry in shelf.entries]


def test_what_lit_the_scene_is_at_hand_and_marked(driver: Driver, tmp_path: Path) -> None:
    one, other = gradient(tmp_path / "Morning.exr", 1.0), gradient(tmp_path / "Evening.exr", 0.5)
    shelf = shelf_of(driver)
    shelf.start()
    driver.window.transfer.load_environment(one)
    driver.window.transfer.load_environment(other)
    driver.until(lambda: len(shelf.thumbnails) == 3)
    driver.until(lambda: marked(shelf) == [True, False])
    assert names(shelf) == ["Evening", "Morning"]
    shelf.light(shelf.entries[1])
    driver.until(lambda: names(shelf) == ["Morning", "Evening"])  # the last used first
    driver.until(lambda: marked(shelf) == [True, False])
    assert driver.labels()[1:] == ["Environment Morning", "Environment Evening", "Environment Morning"]
    (environment,) = driver.document.scene.of(Environment)
    assert environment.name == "Morning"
    driver.do("edit.undo")
    driver.until(lambda: marked(shelf) == [False, True])
    shelf.forget(shelf.entries[0])
    assert names(shelf) == ["Evening"]
    shelf.close()


def test_folders_are_listed_and_what_is_no_environment_is_left_out(driver: Driver, tmp_path: Path) -> None:
    folder = tmp_path / "light"
    folder.mkdir()
    gradient(folder / "a.exr", 1.0)
    write_exr(folder / "b.exr", np.ones((5, 7, 3), np.float32))
    (folder / "c.hdr").write_bytes(b"no picture")
    (folder / "notes.txt").write_text("x")
    shelf = shelf_of(driver)
    shelf.add_folder(folder)
    shelf.start()
    driver.until(lambda: names(shelf) == ["a"])
    assert shelf.folders == (folder,)
    assert driver.problems() == []
    again = shelf_of(driver)
    again.start()
    driver.until(lambda: names(again) == ["a"])
    again.forget(again.entries[0])
    assert again.folders == ()
    assert names(again) == []
    shelf.close()
    again.close()


def test_the_environment_of_a_sample_lights_the_scene(driver: Driver, tmp_path: Path) -> None:
    scene = Add((Environment(id="e", name="Noon", image=Image(sky(2.0))),))(Scene())
    path = tmp_path / "sample.lucarne"
    save(path, scene, history=History((Step("Open", scene),), 0))
    shelf = shelf_of(driver, {"Terrace": path})
    shelf.start()
    driver.document.apply(Add((SKY,)))
    driver.until(lambda: len(shelf.thumbnails) == 2)
    assert names(shelf) == ["Sky", "Terrace"], "what lights the scene is there, too"
    assert shelf.is_current(shelf.entries[0])
    shelf.light(shelf.entries[1])
    driver.until(lambda: marked(shelf) == [True])
    (environment,) = driver.document.scene.of(Environment)
    assert environment.name == "Noon"
    assert names(shelf) == ["Terrace"]
    shelf.close()


def test_thumbnails_are_kept_until_the_file_changes(
    tmp_path: Path, own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from studio_core.imaging import environment
    from studio_ui.panels.environment_shelf import Entry

    read: list[Path] = []
    really: Callable[..., Any] = environment.load_environment

    def counted(path: Path, decoder: Any = None) -> Any:
        if decoder is None:
            read.append(path)
        return really(path, decoder)

    monkeypatch.setattr(environment, "load_environment", counted)
    entry = Entry("sky", gradient(tmp_path / "sky.exr", 1.0))
    first, second = kept_thumbnail(entry), kept_thumbnail(entry)
    assert first is not None
    assert second is not None
    assert len(read) == 1
    assert (first.key, first.size) == (second.key, second.size)
    assert second.size == "32 × 16"
    assert first.image.pixelColor(3, 2).rgb() == second.image.pixelColor(3, 2).rgb()
    write_exr(tmp_path / "sky.exr", np.ones((8, 16, 3), np.float32))
    third = kept_thumbnail(entry)
    assert third is not None
    assert third.key != first.key
    no = Entry("no", tmp_path / "no.exr")
    assert kept_thumbnail(no) is None
    write_exr(tmp_path / "no.exr", np.ones((5, 7, 3), np.float32))
    read.clear()
    assert kept_thumbnail(no) is None
    assert kept_thumbnail(no) is None
    assert len(read) == 1, "what is no environment is not read again and again"


def test_the_list_shows_the_shelf_and_a_click_lights(make: Make, tmp_path: Path) -> None:
    driver = make()
    driver.show(room())
    one, other = gradient(tmp_path / "Morning.exr", 1.0), gradient(tmp_path / "Evening.exr", 0.5)
    panel = panel_of(driver)
    driver.window.transfer.load_environment(one)
    driver.window.transfer.load_environment(other)
    driver.idle()
    assert not panel.shelf.thumbnails, "nobody has looked at them"
    panel.shelf._samples = {}
    driver.window.docks["lighting"].raise_()
    driver.until(lambda: len(panel.shelf.thumbnails) == 3)

    def bold() -> list[bool]:
        rows = range(panel.environments.count())
        return [panel.environments.item(i).font().bold() for i in rows]

    driver.until(lambda: bold() == [True, False])
    panel.environments.itemClicked.emit(panel.environments.item(1))
    driver.until(lambda: driver.labels()[-1] == "Environment Morning")
    count = len(driver.labels())
    driver.until(lambda: bold() == [True, False])
    panel.environments.itemClicked.emit(panel.environments.item(0))
    driver.idle()
    assert len(driver.labels()) == count, "it lights the scene already"


def test_a_new_picture_keeps_the_settings() -> None:
    scene = set_environment(Scene(), Image(sky(1.0)), "One")(Scene())
    (made,) = scene.of(Environment)
    turned = Add((Environment(id="x", name="X", image=made.image, azimuth=30.0, hidden=True),))(Scene())
    (after,) = set_environment(turned, Image(sky(2.0)), "Two")(turned).of(Environment)
    assert (after.id, after.name, after.azimuth, after.hidden) == ("x", "Two", 30.0, False)


def test_small_pictures_have_a_middle_grey_mean() -> None:
    made = small_picture(Image(np.full((300, 600, 3), 7.0, np.float32)), 256, 128)
    assert made.shape == (100, 200, 3)
    assert made == pytest.approx(0.25)
