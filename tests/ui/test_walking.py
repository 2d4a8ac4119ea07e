"""Walking with keys through the room."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import QPoint, Qt
from ui_support import Driver
from views import views

from studio_core.scene.transform import looking
from studio_core.session import View
from studio_ui.canvas.projection import axes_of, eye_of
from studio_ui.canvas.walking import HURRY, SPEED, Walking, walked

STEPS = st.tuples(*[st.floats(-2, 2)] * 3)


@given(views(), STEPS)
def test_steps_are_level_and_as_long_as_they_are(view: View, way: tuple[float, float, float]) -> None:
    there = walked(view, np.array(way))
    gone = eye_of(there) - eye_of(view)
    assert gone[1] == pytest.approx(way[1])
    assert np.linalg.norm(gone) == pytest.approx(np.linalg.norm(way))
    assert there.transform.rotation == view.transform.rotation
    assert gone @ axes_of(view)[0] == pytest.approx(way[0], abs=1e-9), "to the right is to the right"


def test_ahead_is_up_in_a_picture_from_above() -> None:
    for eye, up in (((0.0, 5.0, 0.0), (0, 0, -1)), ((0.0, -5.0, 0.0), (0, 0, 1))):
        view = View(looking(eye, (0.0, 0.0, 0.0), up))
        gone = eye_of(walked(view, np.array([0.0, 0.0, 1.0]))) - eye_of(view)
        assert np.linalg.norm(gone) == pytest.approx(1.0)
        assert gone[1] == 0.0
    assert gone @ axes_of(view)[1] == pytest.approx(-1.0), "seen from below one walks on the ceiling"


def start(driver: Driver) -> Walking:
    driver.viewport.setFocus()
    driver.do("view.walk")
    made: Walking = driver.window.tools.looking.walking
    assert made.active
    return made


def test_keys_that_are_held_walk(driver: Driver) -> None:
    walking, view = start(driver), driver.session.view
    tool = driver.window.tools.tool
    driver.bot.keyPress(driver.viewport, Qt.Key.Key_W)
    assert driver.feed.moving
    walking._timer.stop()
    walking._timer.setInterval(10**6)
    walking._timer.start()
    before = eye_of(driver.session.view)
    walking.step(0.5)
    gone = eye_of(driver.session.view) - before
    assert np.linalg.norm(gone) == pytest.approx(SPEED * 0.5)
    assert gone[2] < 0 < view.transform.translation[2]
    driver.viewport.key.emit("shift+d", True)
    before = eye_of(driver.session.view)
    walking.step(0.5)
    gone = eye_of(driver.session.view) - before
    assert np.linalg.norm(gone) == pytest.approx(SPEED * HURRY * 0.5), "not quicker askew"
    driver.bot.keyRelease(driver.viewport, Qt.Key.Key_D)
    driver.bot.keyRelease(driver.viewport, Qt.Key.Key_W, Qt.KeyboardModifier.ShiftModifier)
    assert not walking._timer.isActive()
    assert not driver.feed._moving
    assert driver.window.tools.tool == tool, "the tools' keys rest meanwhile"
    driver.settle()


def test_esc_ends_it_and_the_keys_are_what_they_were(driver: Driver) -> None:
    walking = start(driver)
    driver.window.tools.use("select")
    driver.bot.keyPress(driver.viewport, Qt.Key.Key_W)
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Escape)
    assert not walking.active
    assert not driver.feed._moving
    driver.bot.keyRelease(driver.viewport, Qt.Key.Key_W)
    driver.until(lambda: not driver.window.actions_["view.walk"].isChecked())
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_W)
    assert driver.window.tools.tool == "move"


def test_a_drag_turns_the_head(driver: Driver) -> None:
    start(driver)
    view, at = driver.session.view, QPoint(300, 200)
    none, right = Qt.KeyboardModifier.NoModifier, Qt.MouseButton.RightButton
    driver.press(at, none, right)
    driver.move(at + QPoint(60, 0))
    driver.release(at + QPoint(60, 0), none, right)
    assert eye_of(driver.session.view) == pytest.approx(eye_of(view))
    assert driver.session.view.transform.rotation != view.transform.rotation
    driver.do("view.walk")
    assert not driver.window.tools.looking.walking.active


def test_who_looks_elsewhere_stands_still(driver: Driver) -> None:
    walking = start(driver)
    driver.bot.keyPress(driver.viewport, Qt.Key.Key_W)
    driver.window.view_controls.camera.setFocus()
    driver.until(lambda: not walking._timer.isActive())
    assert not driver.feed._moving
    assert walking.active
