"""Gizmos, typed amounts, bands, copies and arranging, by mouse and keys in the window."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from ui_support import Driver

from studio_core.edits import Add, Move, SetFields
from studio_core.scene.nodes import MeshObject, PointLamp
from studio_core.scene.transform import Transform
from studio_ui.canvas.gizmos import Handle
from studio_ui.canvas.overlay import Band, Label
from studio_ui.canvas.projection import project
from studio_ui.forms.number_style import NumberStyle, set_number_style

CHAIR, STOOL = (-1.0, 0.5, 0.5), (1.0, 0.5, 0.5)  # points on the front faces
NONE, SHIFT, CTRL, ALT = (
    Qt.KeyboardModifier.NoModifier,
    Qt.KeyboardModifier.ShiftModifier,
    Qt.KeyboardModifier.ControlModifier,
    Qt.KeyboardModifier.AltModifier,
)


def choose(driver: Driver, *nodes: str) -> None:
    driver.session.select(nodes)
    driver.viewport.setFocus()
    driver.until(driver.viewport.hasFocus)


def arm(driver: Driver, axis: int) -> QPoint:
    """Where the end of an arm of the gizmo is."""
    gizmo = driver.window.tools.gizmo()
    assert gizmo is not None
    return driver.at(gizmo.frame.pivot + gizmo.frame.axes[axis] * gizmo.arm * 0.9)


def press_keys(driver: Driver, keys: str) -> None:
    for key in keys:
        driver.bot.keyClicks(driver.viewport, key)


def place(driver: Driver, node: str = "stool") -> tuple[float, float, float]:
    return driver.document.scene.world(node).translation


def words(driver: Driver) -> list[str]:
    return [mark.text for mark in driver.viewport._overlay.marks if isinstance(mark, Label)]


def test_an_arrow_lights_up_and_moves_along_its_axis_as_one_step(driver: Driver) -> None:
    choose(driver, "stool")
    at = arm(driver, 0)
    driver.move(at)
    assert driver.window.tools._lit == Handle("axis", 0)
    assert driver.viewport.cursor().shape() is Qt.CursorShape.PointingHandCursor
    assert "along X" in driver.window.status.message.text()
    before = driver.document.scene
    driver.press(at)
    driver.move(at + QPoint(40, -30))
    driver.move(at + QPoint(80, 25))
    assert driver.document.in_gesture
    assert words(driver)[-1].startswith("X ")
    driver.release(at + QPoint(80, 25))
    x, y, z = place(driver)
    assert (y, z) == (0.0, 0.0)
    assert x > 1.2
    assert x / 0.05 == pytest.approx(round(x / 0.05)), "on the grid"
    (label,) = driver.labels()[1:]
    assert label.startswith("Move Stool ")
    assert label.endswith(" cm along X")
    assert driver.session.selection == ("stool",)
    driver.do("edit.undo")
    assert driver.document.scene is before


def test_a_click_on_a_handle_chooses_nothing_else(driver: Driver) -> None:
    choose(driver, "stool")
    driver.bot.mouseClick(driver.viewport, Qt.MouseButton.LeftButton, NONE, arm(driver, 0))
    assert driver.session.selection == ("stool",)
    assert driver.labels() == ["Open"]


def test_what_is_typed_while_dragging_counts_and_enter_keeps_it(driver: Driver) -> None:
    choose(driver, "stool")
    view, at = driver.session.view, arm(driver, 0)
    driver.press(at)
    driver.move(at + QPoint(60, 0))
    press_keys(driver, "137 cm")
    assert words(driver)[-1].startswith("X 137 cm")
    assert place(driver)[0] == pytest.approx(2.37)
    assert driver.session.view == view, "1, 3 and 7 look from nowhere meanwhile"
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Return)
    driver.move(at + QPoint(90, 0))
    driver.release(at + QPoint(90, 0))
    assert place(driver)[0] == pytest.approx(2.37)
    assert driver.labels()[1:] == ["Move Stool 1.37 m along X"]


def test_what_cannot_be_read_is_told_and_backspace_mends_it(driver: Driver) -> None:
    choose(driver, "stool")
    press_keys(driver, "z")
    assert driver.document.in_gesture
    press_keys(driver, "40kg")
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Return)
    assert driver.document.in_gesture
    assert "kg" in driver.window.status.message.text()
    for _ in range(2):
        driver.bot.keyClick(driver.viewport, Qt.Key.Key_Backspace)
    press_keys(driver, "cm")
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Enter)
    assert place(driver) == pytest.approx((1.0, 0.0, 0.4))
    assert driver.labels()[1:] == ["Move Stool 40 cm along Z"]


def test_axis_keys_without_a_button_follow_the_mouse_until_a_click(driver: Driver) -> None:
    choose(driver, "stool")
    start = driver.at(STOOL)
    driver.move(start)
    press_keys(driver, "x")
    assert driver.document.in_gesture
    driver.move(start + QPoint(50, 0))
    moved = place(driver)
    assert moved[0] > 1.1
    driver.bot.mouseClick(driver.viewport, Qt.MouseButton.LeftButton, NONE, start + QPoint(50, 0))
    assert not driver.document.in_gesture
    assert len(driver.labels()) == 2
    press_keys(driver, "x")
    driver.move(start + QPoint(-90, 0))
    assert place(driver) != moved
    driver.press(start, NONE, Qt.MouseButton.RightButton)
    driver.release(start, NONE, Qt.MouseButton.RightButton)
    assert place(driver) == moved
    assert len(driver.labels()) == 2


def test_going_elsewhere_keeps_what_the_keys_began(driver: Driver) -> None:
    choose(driver, "stool")
    press_keys(driver, "z25cm")
    panel = driver.window.panels["outliner"]
    panel.filter.setFocus()
    driver.until(lambda: not driver.document.in_gesture)
    assert place(driver) == pytest.approx((1.0, 0.0, 0.25))
    assert driver.labels()[1:] == ["Move Stool 25 cm along Z"]


def test_a_drag_changes_its_axis_on_the_way(driver: Driver) -> None:
    choose(driver, "stool")
    at = driver.at(STOOL)
    driver.press(at)
    driver.move(at + QPoint(60, 10))
    press_keys(driver, "y")
    driver.move(at + QPoint(60, -60))
    x, y, z = place(driver)
    assert (x, z) == (1.0, 0.0)
    assert y > 0.2
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Y, SHIFT)
    driver.move(at + QPoint(60, 30))
    assert place(driver)[1] == 0.0
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Escape)
    assert place(driver) == (1.0, 0.0, 0.0)
    driver.release(at)
    assert driver.labels() == ["Open"]


@pytest.mark.parametrize("tool", ["move", "rotate", "scale"])
def test_esc_leaves_the_document_as_it_was(driver: Driver, tool: str) -> None:
    choose(driver, "chair", "stool")
    driver.do(f"tool.{tool}")
    before, steps = driver.document.scene, driver.document.history
    at = driver.at(STOOL)
    driver.press(at, ALT)
    driver.move(at + QPoint(70, -20))
    assert driver.document.scene is not before
    press_keys(driver, "2")
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Escape)
    assert driver.document.scene is before
    assert driver.document.history == steps
    assert driver.session.selection == ("chair", "stool")
    driver.release(at + QPoint(70, -20))
    assert driver.document.scene is before


def test_rings_and_knobs_turn_and_scale(driver: Driver) -> None:
    choose(driver, "stool")
    driver.do("tool.rotate")
    press_keys(driver, "y90")
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Return)
    assert driver.document.scene.world("stool").matrix()[:3, 0] == pytest.approx((0, 0, -1), abs=1e-6)
    driver.do("tool.scale")
    at = arm(driver, 0)
    driver.press(at)
    driver.move(at + (at - driver.at((1.0, 0.0, 0.0))))
    driver.release(at + (at - driver.at((1.0, 0.0, 0.0))))
    assert driver.document.scene.world("stool").scale == pytest.approx(2.0, abs=0.06)
    assert driver.labels()[1:] == ["Turn Stool 90°", f"Scale Stool to {driver.labels()[-1].split()[-1]}"]


def test_a_drag_across_the_thing_turns_it_about_the_vertical(driver: Driver) -> None:
    choose(driver, "chair")
    driver.do("tool.rotate")
    at = driver.at((-1.1, 1.45, 0.25))  # outside of the rings
    by = QPoint(driver.viewport.width() // 4, 0)
    driver.press(at)
    driver.move(at + by)
    driver.release(at + by)
    turned = driver.document.scene.world("chair").matrix()[:3, :3]
    assert turned @ (1, 0, 0) == pytest.approx((0, 0, -1), abs=1e-6)
    assert driver.labels()[-1] == "Turn Chair 90°"


def test_alt_drags_copies_as_one_step(driver: Driver) -> None:
    choose(driver, "chair")
    before = driver.document.scene
    at = arm(driver, 0)
    driver.press(at, ALT)
    driver.move(at + QPoint(-60, 0))
    driver.release(at + QPoint(-60, 0), ALT)
    (copy,) = driver.session.selection
    scene = driver.document.scene
    assert copy != "chair"
    assert scene["chair"] is before["chair"]
    assert scene.world(copy).translation[0] < -1.2
    assert driver.labels()[-1].startswith("Copy Chair ")
    assert len(driver.labels()) == 2
    driver.do("edit.undo")
    assert driver.document.scene is before


def test_own_axes_turn_the_gizmo(driver: Driver) -> None:
    choose(driver, "stool")
    driver.do("tool.rotate")
    press_keys(driver, "y90")
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Return)
    driver.do("tool.move")
    driver.do("tool.local_axes")
    press_keys(driver, "x1")
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Return)
    assert place(driver) == pytest.approx((1.0, 0.0, -1.0))
    assert driver.labels()[-1] == "Move Stool 1 m along its X"
    driver.do("tool.local_axes")
    press_keys(driver, "x1")
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Return)
    assert place(driver) == pytest.approx((2.0, 0.0, -1.0))


# choosing


def band(driver: Driver, start: QPoint, end: QPoint, keys: Qt.KeyboardModifier = NONE) -> None:
    driver.press(start, keys)
    driver.move(start + (end - start) / 2)
    driver.move(end)
    assert any(isinstance(mark, Band) for mark in driver.viewport._overlay.marks)
    driver.release(end, keys)


def test_a_band_to_the_right_catches_what_lies_inside_to_the_left_what_it_touches(driver: Driver) -> None:
    lamps = [PointLamp(id=f"lamp{x}", name="Lamp", transform=Transform((x, 2.2, 0.0))) for x in (1.0, -3.5)]
    driver.document.apply(Add(tuple(lamps)))
    driver.do("tool.select")
    view = driver.session.view
    whole = driver.at((0.2, 2.6, 0.5)), driver.at((1.9, -0.2, 0.8))
    band(driver, *whole)
    assert set(driver.session.selection) == {"stool", "lamp1.0"}
    part = driver.at((-1.0, 0.6, 0.5)), driver.at((1.0, 0.3, 0.5))
    band(driver, *part)
    assert driver.session.selection == ()
    band(driver, *reversed(part))
    assert set(driver.session.selection) == {"chair", "stool"}
    band(driver, driver.at((-3.9, 2.6, 0.0)), driver.at((-3.2, 2.0, 0.0)), CTRL)
    assert set(driver.session.selection) == {"chair", "stool", "lamp-3.5"}
    assert driver.session.view == view


def test_what_is_hidden_behind_another_is_not_caught(driver: Driver) -> None:
    wall = MeshObject(
        id="wall",
        name="Wall",
        geometry=driver.document.scene["seat"].geometry,
        materials=("blue",),
        transform=Transform((-1.0, -0.2, 1.2), scale=2.4),
        locked=True,
    )
    driver.document.apply(Add((wall,)))
    driver.settle()
    driver.do("edit.select_box")
    band(driver, driver.at((1.9, 2.0, 0.5)), driver.at((-2.2, 0.1, 0.5)))
    assert driver.session.selection == ("stool",), "the chair is behind the wall, and the wall is locked"
    start = driver.at((0.0, 3.0, 0.0))
    driver.press(start)
    driver.move(start + QPoint(40, 0))
    driver.release(start + QPoint(40, 0))
    assert driver.labels()[-1] == "Add", "one band only: this looked around"


def test_esc_looks_from_where_it_was_looked(driver: Driver) -> None:
    view = driver.session.view
    driver.viewport.setFocus()
    at = QPoint(200, 200)
    driver.press(at, NONE, Qt.MouseButton.MiddleButton)
    driver.move(at + QPoint(80, 20))
    assert driver.session.view != view
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Escape)
    assert driver.session.view == view
    driver.move(at + QPoint(120, 30))
    driver.release(at + QPoint(120, 30), NONE, Qt.MouseButton.MiddleButton)
    assert driver.session.view == view
    driver.settle()


def test_esc_drops_a_band(driver: Driver) -> None:
    driver.do("tool.select")
    driver.viewport.setFocus()
    start = driver.at((-3.0, 3.0, 0.0))
    driver.press(start)
    driver.move(driver.at((3.0, -0.5, 1.0)))
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Escape)
    driver.release(driver.at((3.0, -0.5, 1.0)))
    assert driver.session.selection == ()


# arranging


def test_aligning_and_spreading_as_it_is_seen(driver: Driver) -> None:
    cube = driver.document.scene["stool"].geometry
    more = MeshObject(
        id="box", name="Box", geometry=cube, materials=("blue",), transform=Transform((3.4, 0.0, -1.0))
    )
    driver.document.apply(Add((more,)))
    choose(driver, "chair", "stool", "box")
    driver.do("object.align_front")
    assert [place(driver, n)[2] for n in ("chair", "stool", "box")] == pytest.approx([0.0, 0.0, 0.0])
    driver.do("object.spread_across")
    assert [place(driver, n)[0] for n in ("chair", "stool", "box")] == pytest.approx([-1.0, 1.2, 3.4])
    assert driver.labels()[2:] == ["Align 3 objects: front", "Distribute 3 objects"]
    driver.do("view.back")
    driver.until(lambda: driver.session.view.transform.matrix()[2, 2] < -0.99)
    driver.do("object.align_left")
    assert [place(driver, n)[0] for n in ("stool", "box")] == pytest.approx([3.4, 3.4]), "left from behind"


def test_duplicating_with_own_materials(driver: Driver) -> None:
    choose(driver, "stool")
    driver.do("edit.duplicate")
    (shared,) = driver.session.selection
    assert driver.document.scene[shared].materials == ("blue",)
    assert driver.labels()[-1] == "Duplicate Stool"
    driver.do("object.own_material")
    (own,) = driver.document.scene[shared].materials
    assert own != "blue"
    driver.do("edit.duplicate_own")
    (copy,) = driver.session.selection
    assert driver.document.scene[copy].materials[0] not in ("blue", own)
    assert driver.document.scene[copy].geometry is driver.document.scene["stool"].geometry


def test_lengths_are_told_and_typed_in_the_windows_unit(driver: Driver) -> None:
    set_number_style(driver.window, NumberStyle("cm", ","))
    choose(driver, "stool")
    press_keys(driver, "x140,5")
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Return)
    assert place(driver)[0] == pytest.approx(2.405)
    assert driver.labels()[-1] == "Move Stool 140,5 cm along X"


def test_the_magnet_is_switched_and_remembered(driver: Driver) -> None:
    choose(driver, "stool")
    driver.do("snap.on")
    assert not driver.window.actions_["snap.on"].isChecked()
    at = arm(driver, 0)
    driver.press(at)
    driver.move(at + QPoint(61, 0))
    driver.release(at + QPoint(61, 0))
    x = place(driver)[0]
    assert abs(x / 0.05 - round(x / 0.05)) > 1e-3
    assert driver.window.settings.get("snap", True) is False
    driver.window.settings.set("snap_step", 0.5)
    driver.do("snap.on")
    at = arm(driver, 0)
    driver.press(at)
    driver.move(at + QPoint(70, 0))
    driver.release(at + QPoint(70, 0))
    assert place(driver)[0] * 2 == pytest.approx(round(place(driver)[0] * 2))


def test_locked_things_have_no_gizmo(driver: Driver) -> None:
    choose(driver, "stool")
    assert driver.window.tools.gizmo() is not None
    driver.document.apply(SetFields("stool", {"locked": True}))
    assert driver.window.tools.gizmo() is None
    driver.document.apply(Move({"stool": Transform((1.0, 1.0, 0.0))}))
    press_keys(driver, "x")
    assert not driver.document.in_gesture


def test_the_gizmo_keeps_its_size_and_place_while_the_view_goes(driver: Driver) -> None:
    choose(driver, "stool")
    gizmo = driver.window.tools.gizmo()
    driver.do("view.right")
    driver.until(lambda: driver.session.view.transform.matrix()[0, 2] > 0.99)
    after = driver.window.tools.gizmo()
    assert after.frame.pivot == pytest.approx(gizmo.frame.pivot)
    size = np.array([driver.viewport.width(), driver.viewport.height()])
    for made in (gizmo, after):
        up = made.frame.pivot + np.array([0.0, made.arm, 0.0])
        ends = project(made._view, [made.frame.pivot, up]) * size
        assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(86, rel=0.25)
