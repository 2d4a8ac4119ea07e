"""The view cube: every field looks from where it says, drags turn the view, both canvases have it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import QPoint, QPointF, Qt
from ui_support import Driver, move_mouse
from views import views

from studio_core.edits import Add, SetFields
from studio_core.imaging.latlong import direction_to_uv
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import DirectionalLamp, Environment
from studio_core.scene.transform import Transform, axis_angle
from studio_core.session import View
from studio_ui.canvas.cube_shape import FACES, faces, field_at, spoken, ways
from studio_ui.canvas.navigation import from_direction
from studio_ui.canvas.projection import axes_of
from studio_ui.canvas.raster_viewport import RasterViewport
from studio_ui.canvas.view_cube import ViewCube
from studio_ui.views.main_light import brightest

LEFT = Qt.MouseButton.LeftButton


@given(views())
def test_what_is_seen_of_the_cube_is_what_faces_the_eye(view: View) -> None:
    axes = axes_of(view)
    seen = faces(axes)
    assert 1 <= len(seen) <= 3
    for face in seen:
        assert np.dot(axes[2], face.way) > 0
        assert {field.way for field in face.fields} == {w for w in ways() if np.dot(w, face.way) == 1}
        for field in face.fields:
            middle = field.corners.mean(axis=0)
            assert field_at(axes, *middle) == field.way
    assert field_at(axes, 3.0, 0.0) is None


@given(views(), st.sampled_from(sorted(FACES)))
def test_names_are_upright_for_who_looks_from_there(view: View, way: tuple[int, int, int]) -> None:
    (face,) = (f for f in faces(axes_of(from_direction(view, way))) if f.way == way)
    top_left, top_right, bottom_right, _ = face.corners
    assert top_right[0] > top_left[0]
    assert top_right[1] == pytest.approx(top_left[1], abs=1e-9)
    assert bottom_right[1] > top_right[1]


def test_every_side_edge_and_corner_has_a_name() -> None:
    told = [spoken(way) for way in ways()]
    assert len(set(told)) == 26
    assert spoken((1, 1, 1)) == "Top front right"
    assert spoken((0, 1, 0)) == "Top"


@pytest.fixture
def cube(driver: Driver) -> ViewCube:
    made: ViewCube = driver.window.aids.cube
    assert made.isVisible()
    return made


def spot(cube: ViewCube, way: tuple[int, int, int]) -> QPoint:
    place = cube.place_of(way)
    assert place is not None
    return place.toPoint()


@pytest.mark.parametrize("way", [(1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 0), (0, 0, 1)])
def test_a_click_looks_from_there(driver: Driver, cube: ViewCube, way: tuple[int, int, int]) -> None:
    driver.window.viewing.home()
    driver.bot.mouseClick(cube, LEFT, pos=spot(cube, way))
    back = axes_of(driver.session.view)[2]
    assert back == pytest.approx(np.array(way) / np.linalg.norm(way), abs=1e-6)
    assert driver.session.selection == (), "the click was not one on the picture"


def test_the_mouse_lights_what_it_is_over(driver: Driver, cube: ViewCube) -> None:
    driver.window.viewing.home()
    before = cube.grab().toImage()
    move_mouse(cube, spot(cube, (0, 0, 1)))
    assert cube.hovered == (0, 0, 1)
    lit = cube.grab().toImage()
    assert lit != before
    move_mouse(cube, spot(cube, (1, 1, 1)))
    assert cube.hovered == (1, 1, 1)
    move_mouse(cube, QPoint(12, 12))
    assert cube.hovered == "home"
    assert cube.part_at(QPointF(cube.width() - 2.0, 2.0)) is None


def test_a_drag_turns_about_what_is_looked_at(driver: Driver, cube: ViewCube) -> None:
    view = driver.session.view
    at = spot(cube, (0, 0, 1))
    driver.bot.mousePress(cube, LEFT, pos=at)
    move_mouse(cube, at + QPoint(20, 5))
    assert driver.feed.moving
    move_mouse(cube, at + QPoint(40, 5))
    driver.bot.mouseRelease(cube, LEFT, pos=at + QPoint(40, 5))
    assert not driver.feed.moving
    turned = driver.session.view
    assert turned.target == pytest.approx(view.target, abs=1e-6)
    assert axes_of(turned)[2][0] < -0.3, "the right side of the room came nearer to the left"
    driver.settle()


def test_home_shows_everything(driver: Driver, cube: ViewCube) -> None:
    driver.bot.mouseClick(cube, LEFT, pos=QPoint(12, 12))
    back = axes_of(driver.session.view)[2]
    assert (back > 0.2).all()


def test_beside_the_cube_the_picture_is_in_reach(driver: Driver, cube: ViewCube) -> None:
    driver.session.select(["stool"])
    driver.bot.mouseClick(cube, LEFT, pos=QPoint(cube.width() - 2, 2))
    assert driver.session.view.transform.matrix()[2, 2] > 0.9


def test_it_can_be_hidden_and_that_is_remembered(driver: Driver, cube: ViewCube) -> None:
    driver.do("view.cube")
    assert cube.isHidden()
    assert driver.window.settings.get("view_cube", True) is False
    driver.do("view.cube")
    assert cube.isVisible()


def test_it_stays_on_top_of_another_canvas(driver: Driver, cube: ViewCube) -> None:
    viewport = driver.window.viewport
    viewport.use(RasterViewport())
    children = [child for child in viewport.children() if child.isWidgetType()]
    assert children.index(cube) > children.index(viewport.inner)
    assert cube.geometry().right() < viewport.width()
    driver.window.resize(900, 600)
    driver.until(lambda: viewport.rect().right() - cube.geometry().right() < 10)
    assert viewport.rect().contains(cube.geometry())


def test_light_is_marked_where_it_comes_from(driver: Driver, cube: ViewCube) -> None:
    assert cube._sun is None
    pixels = np.full((32, 64, 3), 0.1, np.float32)
    way = np.array([0.6, 0.5, -0.62])
    u, v = direction_to_uv(way)
    pixels[int(v * 32), int(u * 64)] = 50.0
    found = brightest(pixels)
    assert found is not None
    assert found @ way / np.linalg.norm(way) > 0.99
    assert brightest(np.full((32, 64, 3), 0.1, np.float32)) is None
    driver.document.apply(Add((Environment(id="sky", image=Image(pixels)),)))
    driver.idle()
    driver.until(lambda: cube._sun is not None)
    assert cube._sun == pytest.approx(found, abs=1e-6)
    driver.document.apply(SetFields("sky", {"azimuth": 90.0}))
    x, y, z = found
    assert cube._sun == pytest.approx((z, y, -x), abs=1e-6)
    sun = DirectionalLamp(id="sun", transform=Transform(rotation=axis_angle((1, 0, 0), -30)))
    driver.document.apply(Add((sun,)))
    assert cube._sun == pytest.approx((0, 0.5, np.sqrt(0.75)), abs=1e-6)


def test_what_turns_under_a_mouse_at_rest_is_lit(driver: Driver, cube: ViewCube) -> None:
    driver.window.viewing.home()
    at = spot(cube, (1, 0, 0))
    move_mouse(cube, at)
    driver.do("view.front")
    assert cube.hovered == cube.part_at(QPointF(at))
    assert cube.hovered != (1, 0, 0)
