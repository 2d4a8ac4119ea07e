"""Looking through cameras of the scene: their frame on any canvas, leaving them, taking them along."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import QPoint, Qt
from ui_support import Driver, Make, room

from studio_core.edits import Add, Compound, Move, Remove, Reparent, SetFields
from studio_core.scene.nodes import Camera, Group
from studio_core.scene.transform import Transform, looking
from studio_core.session import View
from studio_ui.canvas.framing import ASPECTS, fitted, frame_in, unfitted
from studio_ui.canvas.projection import extent, project
from studio_ui.canvas.viewport import Pointer
from studio_ui.views.cameras import Cameras

NONE, MIDDLE = Qt.KeyboardModifier.NoModifier, Qt.MouseButton.MiddleButton
FRONT = Camera(
    id="front", name="From the front", transform=looking((0.0, 1.5, 6.0), (0.0, 0.6, 0.0)), fov=35.0
)
SIDE = Camera(id="side", name="From the side", transform=looking((6.0, 1.5, 1.0), (0.0, 0.6, 0.0)), fov=50.0)
SIZES = st.tuples(st.integers(100, 3000), st.integers(100, 3000))
FRAMES = st.sampled_from([aspect for _, aspect in ASPECTS.values()])


@given(st.floats(5, 120), FRAMES, SIZES)
def test_a_canvas_shows_all_of_the_frame_and_no_more_than_it_must(
    fov: float, aspect: float, size: tuple[int, int]
) -> None:
    wide = fitted(fov, aspect, *size)
    right, top = extent(View(fov=wide, width=size[0], height=size[1]))
    half = float(np.tan(np.radians(fov) / 2))
    assert top >= half * (1 - 1e-9)
    assert right >= half * aspect * (1 - 1e-9)
    assert min(top / half, right / (half * aspect)) == pytest.approx(1.0)
    assert unfitted(wide, aspect, *size) == pytest.approx(fov)
    left, above, across, high = frame_in(aspect, *size)
    assert across / high == pytest.approx(aspect)
    assert high / size[1] == pytest.approx(half / top), "the frame drawn is what the camera sees"
    assert (left, above) == (pytest.approx((size[0] - across) / 2), pytest.approx((size[1] - high) / 2))


@pytest.fixture
def cameras(driver: Driver) -> Cameras:
    """Of a window on a room with two cameras."""
    driver.document.apply(Add((FRONT, SIDE), label="Cameras"))
    driver.settle()
    made: Cameras = driver.window.cameras
    return made


def drag(driver: Driver, by: QPoint) -> None:
    at = QPoint(300, 200)
    driver.press(at, NONE, MIDDLE)
    for share in (0.4, 1.0):
        driver.move(at + by * share)
    driver.release(at + by, NONE, MIDDLE)


def test_keys_look_through_the_first_cameras(driver: Driver, cameras: Cameras) -> None:
    driver.do("view.camera_2")
    assert cameras.through == "side"
    assert driver.session.view.transform == SIDE.transform
    assert driver.window.aids.frame.isVisible()
    assert "From the side" in driver.window.aids.frame.text
    driver.do("view.camera_1")
    assert cameras.through == "front"
    driver.until(lambda: not driver.window.actions_["view.camera_2"].isChecked())
    assert driver.window.actions_["view.camera_1"].isChecked()
    assert not driver.window.actions_["view.camera_3"].isEnabled()
    assert driver.window.view_controls.camera.currentText() == "From the front"


def test_what_the_camera_sees_stays_in_the_frame_of_any_canvas(driver: Driver, cameras: Cameras) -> None:
    cameras.look("front")
    half = np.tan(np.radians(35.0) / 2)
    axes = FRONT.transform.matrix()[:3, :3]
    corner = np.array(FRONT.transform.translation) + axes @ (-half * 16 / 9, half, -1.0)  # of the frame
    for size in ((1100, 700), (700, 680), (1300, 500)):
        driver.window.resize(*size)
        driver.until(lambda: cameras.camera() is not None)
        driver.settle()
        frame = driver.window.aids.frame
        at = project(driver.session.view, corner)[0] * (frame.width(), frame.height())
        assert at == pytest.approx((frame.frame().left(), frame.frame().top()), abs=1.5)
        assert cameras.through == "front"
    shot = cameras.shot(1600, 900)
    assert (shot.fov, shot.transform) == (pytest.approx(35.0), FRONT.transform)


def test_another_frame_shows_as_much(driver: Driver, cameras: Cameras) -> None:
    cameras.look("front")
    driver.do("view.frame_9_16")
    assert driver.window.settings.get("camera_frame") == "9:16"
    assert driver.session.view.fov == pytest.approx(35.0)
    assert cameras.through == "front"
    assert driver.window.aids.frame.aspect == pytest.approx(9 / 16)
    assert cameras.shot(900, 1600).fov == pytest.approx(35.0)


def test_moving_the_view_leaves_the_camera(driver: Driver, cameras: Cameras) -> None:
    cameras.look("front")
    steps = driver.document.history
    drag(driver, QPoint(60, 10))
    assert cameras.through is None
    assert not driver.window.aids.frame.isVisible()
    assert driver.document.history == steps
    assert driver.window.view_controls.camera.currentText() == "Free view"


def test_a_camera_taken_along_moves_in_one_step_that_undoes(driver: Driver, cameras: Cameras) -> None:
    cameras.look("front")
    driver.do("view.keep_camera")
    count, view = len(driver.document.history), driver.session.view
    drag(driver, QPoint(60, 10))
    driver.until(lambda: not driver.document.in_gesture)
    assert driver.labels()[count:] == ["Move From the front"]
    assert driver.document.scene.world("front").matrix() == pytest.approx(
        driver.session.view.transform.matrix()
    )
    assert cameras.through == "front"
    assert driver.document.scene["front"].fov == 35.0, "turning does not change the lens"
    driver.do("edit.undo")
    assert driver.document.scene["front"] == FRONT
    assert np.allclose(driver.session.view.transform.matrix(), view.transform.matrix())
    driver.do("edit.redo")
    assert driver.document.scene["front"] != FRONT
    assert cameras.through == "front"


def test_steps_of_the_wheel_are_one_movement(driver: Driver, cameras: Cameras) -> None:
    cameras.look("front")
    cameras.keep(True)
    count = len(driver.document.history)
    looking_around = driver.window.tools.looking
    pointer = dataclasses.replace(_pointer(driver), x=0.5, y=0.6)
    for _ in range(4):
        looking_around.wheel(pointer, 1.0)
    assert driver.document.in_gesture
    driver.do("view.top")
    driver.until(lambda: not driver.document.in_gesture)
    assert len(driver.document.history) == count + 1
    assert driver.document.scene.world("front").matrix()[:3, 2] == pytest.approx((0, 1, 0), abs=1e-6)


def test_esc_takes_a_movement_back(driver: Driver, cameras: Cameras) -> None:
    cameras.look("front")
    cameras.keep(True)
    scene, view = driver.document.scene, driver.session.view
    at = QPoint(300, 200)
    driver.press(at, NONE, MIDDLE)
    driver.move(at + QPoint(80, 20))
    assert driver.document.scene is not scene
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Escape)
    driver.move(at + QPoint(120, 20))
    driver.release(at + QPoint(120, 20), NONE, MIDDLE)
    assert driver.document.scene is scene
    assert np.allclose(driver.session.view.transform.matrix(), view.transform.matrix())
    assert not driver.document.in_gesture
    assert not driver.feed._moving


def test_a_locked_camera_is_left_rather_than_moved(driver: Driver, cameras: Cameras) -> None:
    driver.document.apply(SetFields("front", {"locked": True}))
    cameras.look("front")
    cameras.keep(True)
    scene = driver.document.scene
    drag(driver, QPoint(60, 10))
    assert driver.document.scene is scene
    assert cameras.through is None


def test_the_view_follows_what_is_done_to_its_camera(driver: Driver, cameras: Cameras) -> None:
    cameras.look("front")
    driver.document.apply(SetFields("front", {"fov": 20.0}))
    assert cameras.shot(1600, 900).fov == pytest.approx(20.0)
    assert driver.session.view == cameras.seen(driver.document.scene["front"])
    driver.document.apply(Move({"front": SIDE.transform}))
    assert driver.session.view.transform == SIDE.transform
    driver.document.apply(Remove(("front",)))
    assert cameras.through is None
    assert driver.session.view.transform == SIDE.transform


def test_a_new_camera_sees_what_is_seen(driver: Driver, cameras: Cameras) -> None:
    driver.window.resize(800, 750)  # narrower than the frame
    driver.settle()
    view = driver.session.view
    driver.do("view.new_camera")
    assert driver.labels()[-1] == "New Camera"
    made = driver.document.scene[cameras.through]
    assert made.fov < view.fov
    assert np.allclose(cameras.seen(made).transform.matrix(), view.transform.matrix())
    assert cameras.seen(made).fov == pytest.approx(view.fov)
    assert driver.session.view == view, "nothing jumps"
    driver.do("view.new_camera")
    assert driver.document.scene[cameras.through].name == "Camera 2"


def test_a_camera_in_a_scaled_group_is_aimed_in_the_world(driver: Driver, cameras: Cameras) -> None:
    group = Group(id="stand", transform=Transform((1.0, 2.0, 3.0), scale=2.5))
    driver.document.apply(Compound("Hang", (Add((group,)), Reparent(("side",), "stand"))))
    scale = driver.document.scene.world("side").scale
    view = driver.session.view
    driver.session.select(["side"])
    driver.do("view.aim_camera")
    assert driver.labels()[-1] == "Aim From the side"
    world = driver.document.scene.world("side")
    assert world.translation == pytest.approx(view.transform.translation)
    assert world.scale == pytest.approx(scale)
    assert cameras.through == "side"


def test_opening_looks_through_the_camera_that_stands_there(driver: Driver, cameras: Cameras) -> None:
    cameras.adopt()
    assert cameras.through is None
    view = driver.session.view
    driver.session.view = View.of(SIDE, driver.document.scene, view.width, view.height)
    cameras.adopt()
    assert cameras.through == "side"
    assert driver.session.view.fov == pytest.approx(fitted(50.0, 16 / 9, view.width, view.height))


def test_the_menu_names_all_cameras(driver: Driver, cameras: Cameras) -> None:
    more = tuple(dataclasses.replace(SIDE, id=f"c{i}", name=f"R&D {i}") for i in range(9))
    driver.document.apply(Add(more))
    driver.window.menus.fill_cameras()
    menu = driver.window.menus.cameras
    shown = [action.text() for action in menu.actions() if action.isVisible()]
    assert len(shown) == 11
    assert shown[:3] == ["From the front", "From the side", "R&&D 0"]
    menu.actions()[-1].trigger()
    assert cameras.through == "c8"
    driver.document.apply(Remove(tuple(c.id for c in (FRONT, SIDE, *more))))
    driver.window.menus.fill_cameras()
    shown = [action.text() for action in menu.actions() if action.isVisible()]
    assert shown == ["None yet"]


def test_pictures_of_a_free_view_show_what_the_canvas_shows(driver: Driver, cameras: Cameras) -> None:
    view = driver.session.view
    for size in ((400, 1000), (1000, 400), (500, 500)):
        shot = cameras.shot(*size)
        seen, made = extent(view), extent(shot)
        assert made[0] >= seen[0] * (1 - 1e-9)
        assert made[1] >= seen[1] * (1 - 1e-9)


def test_an_unknown_frame_is_the_usual_one(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "mine"
    state.mkdir()
    (state / "window.json").write_text('{"camera_frame": "5:1"}')
    driver = make(state=state)
    driver.show(room())
    assert driver.window.cameras.aspect == pytest.approx(16 / 9)


def _pointer(driver: Driver) -> Pointer:
    return Pointer("move", 0.5, 0.5, pixels=(driver.viewport.width(), driver.viewport.height()))
