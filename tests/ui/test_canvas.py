"""Choosing, moving and looking around with the mouse in the picture."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from ui_support import Driver, Make, room

from studio_core.edits import Add, Move, SetFields
from studio_core.scene.nodes import PointLamp
from studio_core.scene.transform import Transform
from studio_ui.canvas.projection import bounds, project
from studio_ui.canvas.raster_viewport import outline
from studio_ui.canvas.viewport import Pointer

CHAIR, STOOL = (-1.0, 0.5, 0.5), (1.0, 0.5, 0.5)  # points on the front faces
NONE, SHIFT, CTRL = (
    Qt.KeyboardModifier.NoModifier,
    Qt.KeyboardModifier.ShiftModifier,
    Qt.KeyboardModifier.ControlModifier,
)


def drag(
    driver: Driver, by: QPoint, start: tuple[float, float, float] = STOOL, keys: Qt.KeyboardModifier = NONE
) -> None:
    at = driver.at(start)
    driver.press(at)
    for share in (0.3, 0.7, 1.0):
        driver.move(at + by * share)
    driver.release(at + by, keys)


def test_a_click_chooses_the_topmost_group_and_ctrl_adds(driver: Driver) -> None:
    driver.click(CHAIR)
    assert driver.session.selection == ("chair",)
    driver.click(STOOL, CTRL)
    assert driver.session.selection == ("chair", "stool")
    driver.click(STOOL, CTRL)
    assert driver.session.selection == ("chair",)
    driver.click((0.0, 3.0, 0.0))
    assert driver.session.selection == ()


def test_a_double_click_enters_the_group_and_esc_leaves_it(driver: Driver) -> None:
    driver.bot.mouseDClick(driver.viewport, Qt.MouseButton.LeftButton, NONE, driver.at(CHAIR))
    assert driver.session.selection == ("seat",)
    driver.click((-1.0, 1.25, 0.25))
    assert driver.session.selection == ("back",)
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Escape)
    assert driver.session.selection == ("chair",)
    driver.click((-1.0, 1.25, 0.25))
    assert driver.session.selection == ("chair",)


def test_the_outline_surrounds_what_is_chosen(driver: Driver) -> None:
    assert driver.viewport._outline is None
    driver.click(STOOL)
    picture = driver.feed.last.picture
    mask = picture.node == picture.nodes.index("stool")
    edge = outline(mask)
    assert edge.any()
    assert not (edge & mask).any()
    image = driver.viewport._outline
    row, column = np.argwhere(edge)[0]
    assert image.pixelColor(int(column), int(row)).alpha() == 255
    row, column = np.argwhere(mask)[len(np.argwhere(mask)) // 2]
    assert image.pixelColor(int(column), int(row)).alpha() == 0


def test_a_drag_moves_over_the_floor_as_one_step_that_undoes(driver: Driver) -> None:
    driver.click(CHAIR)
    before, count = driver.document.scene, len(driver.document.history)
    start, target = driver.at(CHAIR), driver.at((-0.6, 0.5, 1.3))
    driver.press(start)
    driver.move(start + (target - start) / 2)
    assert driver.document.in_gesture
    driver.move(target)
    driver.release(target)
    assert len(driver.document.history) == count + 1
    assert driver.labels()[-1] == "Move Chair 89.4 cm"
    moved = np.subtract(driver.document.scene.world("chair").translation, before.world("chair").translation)
    assert moved == pytest.approx((0.4, 0.0, 0.8), abs=0.03)  # a pixel's worth
    driver.settle()
    assert driver.fake.frames[-1].scene is driver.document.scene
    driver.do("edit.undo")
    assert driver.document.scene is before
    driver.do("edit.redo")
    assert driver.document.scene.world("chair") != before.world("chair")


def test_esc_rolls_a_drag_back(driver: Driver) -> None:
    driver.click(STOOL)
    before, steps = driver.document.scene, driver.document.history
    start = driver.at(STOOL)
    driver.press(start)
    driver.move(start + QPoint(60, 30))
    assert driver.document.scene is not before
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Escape)
    assert driver.document.scene is before
    driver.move(start + QPoint(90, 40))
    driver.release(start + QPoint(90, 40))
    assert driver.document.scene is before
    assert driver.document.history == steps
    assert not driver.document.in_gesture


def test_what_is_not_chosen_or_locked_does_not_move(driver: Driver) -> None:
    before = driver.document.scene
    view = driver.session.view
    drag(driver, QPoint(80, 20))
    assert driver.document.scene is before
    assert driver.session.view != view, "a drag on what is not chosen looks around"
    driver.session.look(view)
    driver.document.apply(SetFields("stool", {"locked": True}))
    driver.click(STOOL)
    assert driver.session.selection == ()
    driver.session.select(["stool"])
    locked = driver.document.scene
    drag(driver, QPoint(80, 20))
    assert driver.document.scene is locked


def test_arrow_keys_nudge_in_the_picture_only(driver: Driver) -> None:
    driver.click(STOOL)
    driver.viewport.setFocus()
    driver.until(lambda: not driver.window.following.pending)
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Right)
    assert driver.document.scene.world("stool").translation == pytest.approx((1.05, 0, 0))
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Up)
    assert driver.document.scene.world("stool").translation == pytest.approx((1.05, 0, -0.05))
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Period)
    assert driver.labels()[1:] == ["Nudge Stool", "Nudge Stool", "Turn Stool"]


def test_duplicate_drop_and_delete(driver: Driver) -> None:
    driver.session.select(["chair"])
    driver.do("edit.duplicate")
    (copy,) = driver.session.selection
    scene = driver.document.scene
    assert scene[copy].name == "Chair 2"
    seats = [n for n in scene.nodes.values() if n.name == "Seat"]
    assert seats[0].geometry is seats[1].geometry
    driver.document.apply(SetFields(copy, {"name": "Copy"}))
    driver.document.apply(Move({copy: Transform((0.0, 1.7, 2.0))}))
    driver.do("object.drop")
    assert driver.document.scene.world(copy).translation == pytest.approx((0, 0, 2))
    driver.do("edit.delete")
    assert copy not in driver.document.scene.nodes
    assert driver.session.selection == ()


def test_lamps_are_drawn_and_can_be_clicked(driver: Driver) -> None:

    driver.document.apply(Add((PointLamp(id="lamp", name="Lamp", transform=Transform((0.0, 2.0, 0.0))),)))
    driver.click((0.0, 2.0, 0.0))
    assert driver.session.selection == ("lamp",)
    drag(driver, QPoint(40, 0), (0.0, 2.0, 0.0))
    far = np.linalg.norm(np.subtract(driver.document.scene.world("lamp").translation, (0.0, 2.0, 0.0)))
    assert far == pytest.approx(0.05 * round(far / 0.05)), "on the grid, as fine as this canvas shows it"
    assert 0.2 < far < 0.6
    assert driver.labels()[-1] == f"Move Lamp {round(100 * far)} cm"


def test_the_wheel_zooms_to_the_cursor_and_the_middle_button_orbits(driver: Driver) -> None:

    before = driver.at(STOOL)
    x, y = before.x() / driver.viewport.width(), before.y() / driver.viewport.height()
    driver.window.tools._on_wheel(_pointer(driver, x, y), 2.0)
    assert driver.session.view.focus < 7.2
    after = project(driver.session.view, [STOOL])[0]
    assert after == pytest.approx((x, y), abs=0.01)
    view = driver.session.view
    at = QPoint(200, 200)
    driver.press(at, NONE, Qt.MouseButton.MiddleButton)
    driver.move(at + QPoint(50, 0))
    driver.release(at + QPoint(50, 0), NONE, Qt.MouseButton.MiddleButton)
    assert driver.session.view.transform.rotation != view.transform.rotation
    driver.settle()
    assert driver.fake.frames[-1].view.antialias == 2


def test_the_pixel_under_the_mouse_is_told(driver: Driver) -> None:
    driver.move(driver.at(STOOL))
    assert "Stool" in driver.window.status.pixel.text()
    driver.move(driver.at((0.0, 3.0, 0.0)))
    assert "background" in driver.window.status.pixel.text()


def test_keeping_the_room_in_sight(driver: Driver) -> None:

    driver.session.select(["stool"])
    driver.viewport.setFocus()
    driver.do("view.frame_selection")
    low, high = bounds(driver.document.scene, ("stool",))
    seen = project(driver.session.view, [low, high])
    assert ((seen > 0) & (seen < 1)).all()
    driver.do("view.top")
    assert driver.session.view.transform.matrix()[:3, :3] @ (0, 0, 1) == pytest.approx((0, 1, 0), abs=1e-6)


def _pointer(driver: Driver, x: float, y: float) -> Pointer:

    return Pointer("move", x, y, pixels=(driver.viewport.width(), driver.viewport.height()))


def test_a_room_without_a_picture_is_no_trouble(make: Make) -> None:
    driver = make()
    driver.click((0.0, 0.0, -3.0))
    assert driver.session.selection == ()
    driver.show(room())
    assert driver.feed.last.picture.nodes == ("seat", "back", "stool")
