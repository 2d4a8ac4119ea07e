"""Looking around with the mouse, the wheel and two fingers in the window."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QNativeGestureEvent, QPointingDevice, QWheelEvent
from PySide6.QtWidgets import QApplication
from ui_support import Driver

from studio_core.edits import Move
from studio_core.scene.transform import Transform
from studio_core.session import View
from studio_ui.canvas import navigation
from studio_ui.canvas.projection import eye_of, project
from studio_ui.canvas.viewport import Pointer

STOOL = (1.0, 0.5, 0.5)  # a point on its front face
NONE, SHIFT, CTRL = (
    Qt.KeyboardModifier.NoModifier,
    Qt.KeyboardModifier.ShiftModifier,
    Qt.KeyboardModifier.ControlModifier,
)
MIDDLE, RIGHT = Qt.MouseButton.MiddleButton, Qt.MouseButton.RightButton


def turn_wheel(
    driver: Driver,
    at: QPoint,
    *,
    steps: float = 0.0,
    slid: QPoint | None = None,
    keys: Qt.KeyboardModifier = NONE,
) -> None:
    """Steps of a wheel, or pixels on a touchpad."""
    phase = Qt.ScrollPhase.ScrollUpdate if slid is not None else Qt.ScrollPhase.NoScrollPhase
    where = QPointF(at)
    angle = QPoint(0, round(120 * steps))
    none = Qt.MouseButton.NoButton
    event = QWheelEvent(where, where, slid or QPoint(), angle, none, keys, phase, False)
    QApplication.sendEvent(driver.viewport, event)


def pinch(driver: Driver, at: QPoint, share: float) -> None:
    where = QPointF(at)
    event = QNativeGestureEvent(
        Qt.NativeGestureType.ZoomNativeGesture,
        QPointingDevice.primaryPointingDevice(),
        2,
        where,
        where,
        where,
        share,
        QPointF(),
    )
    QApplication.sendEvent(driver.viewport, event)


def drag(
    driver: Driver, at: QPoint, by: QPoint, button: Qt.MouseButton, keys: Qt.KeyboardModifier = NONE
) -> None:
    driver.press(at, keys, button)
    for share in (0.3, 0.6, 1.0):
        driver.move(at + by * share)
    driver.release(at + by, keys, button)


def seen(driver: Driver, point: tuple[float, float, float] = STOOL) -> np.ndarray:
    """Logical pixels."""
    size = (driver.viewport.width(), driver.viewport.height())
    return np.asarray(project(driver.session.view, point)[0] * size)


def close(a: View, b: View) -> None:
    assert np.allclose(a.transform.matrix(), b.transform.matrix(), atol=1e-9)
    assert a.focus == pytest.approx(b.focus)


def test_the_wheel_goes_to_the_cursor_and_back(driver: Driver) -> None:
    before, at = driver.session.view, driver.at(STOOL)
    under = driver.window.tools.looking.touched(
        at.x() / driver.viewport.width(), at.y() / driver.viewport.height()
    )
    for _ in range(6):
        turn_wheel(driver, at, steps=1)
        driver.settle()
        assert seen(driver, tuple(under)) == pytest.approx((at.x(), at.y()), abs=0.01)
    near = np.linalg.norm(eye_of(driver.session.view) - under)
    assert near == pytest.approx(0.86**6 * np.linalg.norm(eye_of(before) - under))
    for _ in range(6):
        turn_wheel(driver, at, steps=-1)
    close(driver.session.view, before)


def test_many_steps_before_a_picture_do_not_go_through(driver: Driver) -> None:
    at = driver.at(STOOL)
    for _ in range(60):  # no picture comes in between
        turn_wheel(driver, at, steps=1)
    eye = eye_of(driver.session.view)
    assert eye[2] > 0.5, "still before the front face"
    assert driver.session.view.focus > 0


def test_what_moved_away_is_not_where_the_wheel_leads(driver: Driver) -> None:
    at = driver.at(STOOL)
    turn_wheel(driver, at, steps=1)
    driver.document.apply(Move({"stool": Transform((1.0, 0.0, -3.0))}))
    driver.settle()
    far = driver.viewport.probe(at.x() / driver.viewport.width(), at.y() / driver.viewport.height())
    before = eye_of(driver.session.view)
    turn_wheel(driver, at, steps=1)
    gone = np.linalg.norm(eye_of(driver.session.view) - before)
    reach = far.distance if np.isfinite(far.distance) else driver.session.view.focus / 0.86
    assert gone == pytest.approx(0.14 * reach, rel=0.1)


def test_the_wheel_goes_the_other_way_on_request(driver: Driver) -> None:
    before, at = driver.session.view.focus, driver.at(STOOL)
    driver.do("view.invert_wheel")
    turn_wheel(driver, at, steps=1)
    assert driver.session.view.focus > before


def test_the_right_button_slides_what_is_under_it(driver: Driver) -> None:
    at = driver.at(STOOL)
    drag(driver, at, QPoint(60, -30), RIGHT)
    assert seen(driver) == pytest.approx((at.x() + 60, at.y() - 30), abs=1.0)


def test_a_drag_orbits_what_is_chosen_or_what_is_under_it(driver: Driver) -> None:
    at = driver.at(STOOL)
    drag(driver, at, QPoint(90, 20), MIDDLE)
    assert seen(driver) == pytest.approx((at.x(), at.y()), abs=1.5)
    driver.settle()
    driver.session.select(["chair"])
    middle = (-1.0, 0.75, 0.0)
    before = seen(driver, middle)
    drag(driver, driver.at(STOOL), QPoint(90, 20), MIDDLE)
    assert seen(driver, middle) == pytest.approx(before, abs=1e-6)


def test_what_is_chosen_but_out_of_sight_is_not_orbited(driver: Driver) -> None:
    driver.document.apply(Move({"chair": Transform((-60.0, 0.0, 0.0))}))
    driver.settle()
    driver.session.select(["chair"])
    at = driver.at(STOOL)
    drag(driver, at, QPoint(90, 20), MIDDLE)
    assert seen(driver) == pytest.approx((at.x(), at.y()), abs=1.5)


def test_habits_give_buttons_other_meanings(driver: Driver) -> None:
    before = driver.session.view
    driver.do("view.navigation_cad")
    at = driver.at(STOOL)
    drag(driver, at, QPoint(40, 0), MIDDLE)
    assert driver.session.view.transform.rotation == before.transform.rotation, "slid"
    assert seen(driver)[0] == pytest.approx(at.x() + 40, abs=1.0)
    drag(driver, at, QPoint(40, 0), MIDDLE, SHIFT)
    assert driver.session.view.transform.rotation != before.transform.rotation, "orbited"
    view = driver.session.view
    driver.press(at)  # a left drag belongs to the tools
    driver.move(at + QPoint(40, 0))
    driver.release(at + QPoint(40, 0))
    assert driver.session.view == view
    drag(driver, at, QPoint(40, 10), RIGHT, CTRL)
    assert eye_of(driver.session.view) == pytest.approx(eye_of(view)), "the head was turned"
    assert driver.session.view.transform.rotation != view.transform.rotation


def test_two_fingers_orbit_slide_and_pinch(driver: Driver) -> None:
    view, at = driver.session.view, driver.at(STOOL)
    turn_wheel(driver, at, slid=QPoint(0, 30))
    assert driver.session.view.focus < view.focus, "without the preset they are a wheel"
    driver.session.look(view)
    driver.do("view.navigation_touchpad")
    turn_wheel(driver, at, slid=QPoint(25, 5))
    turn_wheel(driver, at, slid=QPoint(25, 5))
    assert driver.session.view.transform.rotation != view.transform.rotation
    assert seen(driver) == pytest.approx((at.x(), at.y()), abs=1.5)
    driver.session.look(view)
    turn_wheel(driver, at, slid=QPoint(25, -15), keys=SHIFT)
    assert driver.session.view.transform.rotation == view.transform.rotation
    assert seen(driver) == pytest.approx((at.x() + 25, at.y() - 15), abs=1.0)
    driver.session.look(view)
    pinch(driver, at, 0.25)
    assert seen(driver) == pytest.approx((at.x(), at.y()), abs=1.5)
    assert driver.session.view.focus == pytest.approx(view.focus / 1.25)
    turn_wheel(driver, at, steps=-1)  # a mouse beside the touchpad still has a wheel
    assert driver.session.view.focus == pytest.approx(view.focus / 1.25 / 0.86)


def test_pictures_are_quick_while_one_looks_and_exact_afterwards(driver: Driver) -> None:
    at = driver.at(STOOL)
    driver.press(at, NONE, MIDDLE)
    driver.move(at + QPoint(30, 0))
    assert driver.feed.moving
    driver.release(at + QPoint(30, 0), NONE, MIDDLE)
    driver.settle()
    assert driver.fake.frames[-1].view.antialias == 2
    assert not driver.feed.moving


def test_keys_look_along_the_axes_at_what_is_chosen(driver: Driver) -> None:
    driver.session.select(["stool"])
    driver.viewport.setFocus()
    driver.until(lambda: not driver.window.following.pending)
    for key, keys, axis in (
        ("1", NONE, "front"),
        ("3", NONE, "right"),
        ("7", NONE, "top"),
        ("7", CTRL, "bottom"),
    ):
        driver.bot.keyClick(driver.viewport, key, keys)
        assert driver.session.view.transform.matrix()[:3, 2] == pytest.approx(navigation.AXES[axis], abs=1e-6)
        assert driver.session.view.target == pytest.approx((1.0, 0.5, 0.0), abs=1e-6)


def test_f_and_home_show_what_is_there(driver: Driver) -> None:
    driver.session.select(["stool"])
    driver.do("view.frame_selection")
    assert driver.session.view.target == pytest.approx((1.0, 0.5, 0.0), abs=1e-6)
    driver.do("view.frame_all")
    corners = [(x, y, z) for x in (-1.5, 1.5) for y in (0.0, 1.5) for z in (-0.5, 0.5)]
    where = project(driver.session.view, corners)
    assert ((where > 0) & (where < 1)).all()
    driver.window.viewing.home()
    where = project(driver.session.view, corners)
    assert ((where > 0) & (where < 1)).all()
    assert driver.session.view.transform.matrix()[1, 2] > 0.2, "from above"


def test_a_point_of_an_old_picture_is_where_it_was(driver: Driver) -> None:
    """The picture on the canvas may be of another view than the present one."""
    at = driver.at(STOOL)
    x, y = at.x() / driver.viewport.width(), at.y() / driver.viewport.height()
    point = driver.viewport.probe(x, y).point
    driver.session.view = navigation.orbit(driver.session.view, 0.1, 0.1)  # nobody heard of it
    assert driver.viewport.probe(x, y).point == point
    assert isinstance(driver.window.tools.looking.mode_of(Pointer("press", x, y, "left")), str)
