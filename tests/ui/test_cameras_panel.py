"""The cameras panel: rows with small pictures; what it does can be undone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QImage
from ui_support import Driver, Make, room

from studio_core.edits import Add, Move, SetFields
from studio_core.scene.nodes import Camera, PointLamp
from studio_core.scene.transform import Transform, looking
from studio_ui.panels.camera_list import ID, IMAGE, LENS, SEEN
from studio_ui.panels.cameras import CamerasPanel
from studio_ui.views.camera_pictures import as_image

NAMES = ("Front", "Side", "Above")
PLACES = ((0.0, 1.5, 6.0), (6.0, 1.5, 1.0), (0.5, 7.0, 0.5))


@pytest.fixture
def panel(driver: Driver) -> CamerasPanel:
    """Of a window on a room with three cameras and a lamp among them."""
    cameras = [
        Camera(id=name.lower(), name=name, transform=looking(place, (0.0, 0.5, 0.0)), fov=30.0)
        for name, place in zip(NAMES, PLACES, strict=True)
    ]
    lamp = PointLamp(id="lamp", name="Lamp", transform=Transform((0.0, 2.0, 0.0)))
    driver.document.apply(Add((*cameras[:2], lamp, cameras[2]), label="Cameras"))
    driver.window.docks["cameras"].raise_()
    made: CamerasPanel = driver.window.panels["cameras"]
    driver.until(lambda: made.list.count() == 3)
    return made


def shown(panel: CamerasPanel, role: int = Qt.ItemDataRole.DisplayRole) -> list[object]:
    return [panel.list.item(row).data(role) for row in range(panel.list.count())]


def middle(panel: CamerasPanel, row: int) -> QPoint:
    return panel.list.visualItemRect(panel.list.item(row)).center()


def click(driver: Driver, panel: CamerasPanel, row: int) -> None:
    panel.list.scrollToItem(panel.list.item(row))
    driver.bot.mouseClick(panel.list.viewport(), Qt.MouseButton.LeftButton, pos=middle(panel, row))


def test_a_click_goes_there_and_the_picture_is_kept(driver: Driver, panel: CamerasPanel) -> None:
    assert shown(panel) == list(NAMES)
    assert shown(panel, IMAGE) == [None, None, None]
    assert shown(panel, LENS)[0] == "45 mm · 30°"
    click(driver, panel, 1)
    assert driver.window.cameras.through == "side"
    driver.settle()
    driver.until(lambda: panel.list.item(1).data(IMAGE) is not None)
    assert shown(panel, SEEN) == [False, True, False]
    image: QImage = panel.list.item(1).data(IMAGE)
    assert image.width() / image.height() == pytest.approx(16 / 9, rel=0.03), "what is in the frame"
    assert panel.list.item(0).data(IMAGE) is None


def test_enter_goes_there_too(driver: Driver, panel: CamerasPanel) -> None:
    panel.list.setCurrentRow(2)
    driver.bot.keyClick(panel.list, Qt.Key.Key_Return)
    assert driver.window.cameras.through == "above"


def test_small_pictures_outlive_the_window(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "mine"
    camera = Camera(id="eye", name="Eye", transform=looking((0.0, 1.5, 6.0), (0.0, 0.5, 0.0)))

    def start() -> tuple[Driver, CamerasPanel]:
        driver = make(state=state)
        driver.show(room())
        driver.document.apply(Add((camera,)))
        panel: CamerasPanel = driver.window.panels["cameras"]
        driver.until(lambda: panel.list.count() == 1)
        return driver, panel

    driver, panel = start()
    driver.window.cameras.look("eye")
    driver.settle()
    driver.until(lambda: panel.list.item(0).data(IMAGE) is not None)
    driver.close()
    driver, panel = start()
    assert panel.list.item(0).data(IMAGE) is not None
    driver.document.apply(Move({"eye": Transform((1.0, 2.0, 3.0))}))
    driver.until(lambda: not panel._soon.isActive())
    assert panel.list.item(0).data(IMAGE) is not None, "the old one until there is another"
    (kept,) = (state / "cameras").iterdir()
    kept.write_bytes(b"no picture")
    driver.close()
    _, panel = start()
    assert panel.list.item(0).data(IMAGE) is None


def test_names_and_lenses_are_edited_in_place(driver: Driver, panel: CamerasPanel) -> None:
    panel.list.item(0).setText("  Entrance ")
    assert driver.labels()[-1] == "Rename Front"
    assert driver.document.scene["front"].name == "Entrance"
    panel.list.item(0).setText("  ")
    assert panel.list.item(0).text() == "Entrance", "a name is not taken away"
    panel.list.setCurrentRow(0)
    panel.lens.angle.setValue(50.0)
    assert driver.document.scene["front"].fov == 50.0
    assert driver.labels()[-1] == "Lens of Entrance"
    assert panel.lens.lens.value() == pytest.approx(25.73, abs=0.01)
    panel.lens.lens.setValue(24.0)
    assert driver.document.scene["front"].fov == pytest.approx(53.13, abs=0.01)
    assert panel.lens.angle.value() == pytest.approx(53.13, abs=0.01)
    driver.do("edit.undo")
    driver.until(lambda: panel.lens.angle.value() == 50.0)
    driver.do("edit.undo")
    driver.do("edit.undo")
    driver.until(lambda: shown(panel) == list(NAMES))


@pytest.mark.parametrize(
    ("camera", "before", "order"),
    [
        ("front", None, ["side", "above", "front"]),
        ("above", "front", ["above", "front", "side"]),
        ("side", None, ["front", "above", "side"]),
        ("side", "front", ["side", "front", "above"]),
    ],
)
def test_rows_change_places_and_back(
    driver: Driver, panel: CamerasPanel, camera: str, before: str | None, order: list[str]
) -> None:
    scene = driver.document.scene
    others = [node for node in scene.nodes if not isinstance(scene[node], Camera)]
    panel.list.moved(camera, before)
    assert shown(panel, ID) == order
    after = driver.document.scene
    assert [node for node in after.nodes if not isinstance(after[node], Camera)] == others
    panel.list.moved(camera, camera)
    driver.do("edit.undo")
    assert driver.document.scene is scene


def test_something_dropped_on_a_half_of_a_row_comes_before_or_after_it(
    driver: Driver, panel: CamerasPanel
) -> None:
    panel.list.resize(220, 400)
    box = panel.list.visualItemRect(panel.list.item(1))
    assert panel.list.row_at(box.center() - QPoint(0, 10)) == 1
    assert panel.list.row_at(box.center() + QPoint(0, 10)) == 2
    assert panel.list.row_at(QPoint(20, 390)) == 3


def test_buttons_make_aim_keep_and_delete(driver: Driver, panel: CamerasPanel) -> None:
    panel.add.click()
    assert len(driver.window.cameras.all()) == 4
    driver.until(lambda: panel.list.count() == 4)
    driver.until(lambda: panel.list.camera == driver.window.cameras.through)
    assert panel.keep.isEnabled()
    panel.keep.click()
    assert driver.window.cameras.kept
    panel.list.choose("side")
    view = driver.session.view
    panel.aim.click()
    assert driver.document.scene.world("side").translation == pytest.approx(view.transform.translation)
    assert driver.window.cameras.through == "side"
    assert not panel.keep.isChecked()
    panel.delete.click()
    assert "side" not in driver.document.scene.nodes
    assert driver.window.cameras.through is None
    assert driver.labels()[-1] == "Delete Side"


def test_the_frame_is_chosen_here_as_in_the_menu(driver: Driver, panel: CamerasPanel) -> None:
    driver.do("view.frame_1_1")
    assert panel.frame.currentData() == "1:1"
    panel.frame.setCurrentIndex(panel.frame.findData("3:2"))
    panel.frame.activated.emit(panel.frame.currentIndex())
    assert driver.window.cameras.frame == "3:2"


def test_a_menu_offers_what_can_be_done(driver: Driver, panel: CamerasPanel) -> None:
    menu = panel.menu_at(middle(panel, 1))
    assert menu is not None
    actions = {action.text(): action for action in menu.actions()}
    actions["Select in the scene"].trigger()
    assert driver.session.selection == ("side",)
    actions["Look through"].trigger()
    assert driver.window.cameras.through == "side"
    assert panel.menu_at(QPoint(5, 3000)) is None
    menu.deleteLater()


def test_without_cameras_it_says_how_to_make_one(driver: Driver) -> None:
    panel: CamerasPanel = driver.window.panels["cameras"]
    assert not panel._empty.isHidden()
    assert "Ctrl+Alt+0" in panel._empty.text()
    assert not panel.delete.isEnabled()
    driver.document.apply(Add((Camera(id="c"),)))
    driver.document.apply(SetFields("c", {"name": "Late"}))
    driver.until(lambda: panel._empty.isHidden())


def test_an_image_owns_its_pixels() -> None:
    pixels = np.zeros((3, 5, 3), np.uint8)
    pixels[1, 2] = (10, 20, 30)
    image = as_image(pixels)
    pixels[:] = 255
    assert image.pixelColor(2, 1).getRgb()[:3] == (10, 20, 30)
