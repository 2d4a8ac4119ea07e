"""Rooms in the window: made round the furniture, changed in the properties panel, opened towards the view."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from ui_support import Driver, box, room

from studio_core.edits import Add, SetFields
from studio_core.rooms import new_room
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import MeshObject, Scene
from studio_core.scene.room import Room
from studio_core.scene.room_plans import l_cut, l_plan
from studio_core.scene.room_shape import Opening
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_core.session import View
from studio_ui.objects.rooms import ROUND, is_above, room_around, walls_before

WINDOW = Opening(width=1.5)


def sheet(size: float, height: float = 0.0) -> Geometry:
    """A square on the floor that faces up."""
    corners = np.array([[x, height, z] for x in (-0.5, 0.5) for z in (-0.5, 0.5)], np.float32) * [
        size,
        1,
        size,
    ]
    return Geometry(corners.astype(np.float32), np.array([[0, 2, 1], [1, 2, 3]], np.uint32))


def with_room(driver: Driver, **changes: Any) -> tuple[str, Any]:
    """A room in the window, chosen: its id, and its form in the properties panel."""
    add = new_room(**{"openings": (WINDOW,), **changes})
    driver.document.apply(add)
    panel = driver.window.panels["properties"]
    driver.session.select([add.nodes[0].id])
    driver.until(lambda: panel.nodes == (add.nodes[0].id,))
    assert panel.room is not None
    return add.nodes[0].id, panel.room


def the_room(driver: Driver, node: str | None = None) -> Room:
    found = next(driver.document.scene.of(Room)) if node is None else driver.document.scene[node]
    assert isinstance(found, Room)
    return found


def followed(driver: Driver, form: Any) -> None:
    """Until the panel shows what the document has."""
    driver.until(lambda: form._room is driver.document.scene[form.node])


def test_a_new_room_stands_round_the_furniture_open_towards_the_view(driver: Driver) -> None:
    driver.show(room())
    driver.do("room.new")
    made = the_room(driver)
    assert driver.session.selection == (made.id,)
    assert driver.labels()[-1] == "New room"
    assert made.without == (2,)
    assert made.ceiling
    assert made.transform.translation[1] == 0
    assert [one.kind for one in made.placed()] == ["window", "door"]
    driver.document.undo()
    assert not list(driver.document.scene.of(Room))
    driver.do("room.new")
    driver.do("room.new")
    assert [node.name for node in driver.document.scene.of(Room)] == ["Room", "Room 2"]


def test_a_floor_that_is_there_gives_way_to_the_room_s(driver: Driver) -> None:
    floor = MeshObject(id="floor", name="Floor", geometry=sheet(6.0), materials=("blue",))
    rug = MeshObject(id="rug", name="Rug", geometry=sheet(3.0, 0.01), materials=("blue",))
    driver.show(Add((floor, rug))(room()))
    driver.do("room.new")
    assert driver.document.scene["floor"].hidden
    assert not driver.document.scene["rug"].hidden
    assert "Floor was hidden" in driver.window.status.message.text()
    driver.document.undo()
    assert not driver.document.scene["floor"].hidden


def test_a_room_has_place_for_what_stands_in_it() -> None:
    seats = [
        MeshObject(
            id=f"m{k}", name="Seat", geometry=box(), materials=("blue",), transform=Transform((x, 0, 3.0))
        )
        for k, x in enumerate((-4.0, 5.0))
    ]
    scene = Add(tuple(seats))(room())
    edit, made, floors = room_around(scene, View())
    found = edit(scene)[made]
    assert isinstance(found, Room)
    assert not floors
    assert found.width == pytest.approx(10 + 2 * ROUND)
    assert found.transform.translation[0] == pytest.approx(0.5)
    low = found.transform.translation[2] - found.depth / 2
    assert low <= -0.5 - ROUND + 0.01
    assert low + found.depth >= 3.5 + ROUND - 0.01
    far = MeshObject(
        id="far", name="Far", geometry=box(), materials=("blue",), transform=Transform((90, 0, 0))
    )
    edit, made, _ = room_around(Add((far,))(scene), View())
    assert edit(Add((far,))(scene))[made].width == 5  # type: ignore[attr-defined]
    edit, made, _ = room_around(Scene(), View())
    assert edit(Scene())[made].transform == Transform()


@pytest.mark.parametrize(
    ("eye", "walls", "above"),
    [
        ((0, 1.5, 0), (), False),
        ((0, 1.5, 9), (2,), False),
        ((9, 5, 9), (1, 2), True),
        ((-9, 1, -9), (0, 3), False),
        ((0, 9, 0), (), True),
    ],
)
def test_walls_before_the_eye(eye: tuple[float, float, float], walls: tuple[int, ...], above: bool) -> None:
    (node,) = new_room().nodes
    assert isinstance(node, Room)
    assert walls_before(node.shape, np.array(eye, float)) == walls
    assert is_above(node.shape, np.array(eye, float)) is above


def test_walls_are_opened_towards_the_view_and_closed_again(driver: Driver) -> None:
    driver.show(room())
    assert not driver.window.actions_["room.open_walls"].isEnabled()
    turned = Transform((1, 0, 0), axis_angle((0, 1, 0), 90))  # its right wall looks away from the viewer
    add = new_room()
    made = dataclasses.replace(add.nodes[0], transform=turned)
    driver.document.apply(Add((made,), add.materials))
    driver.do("room.open_walls")
    assert the_room(driver).without == (3,)
    view = driver.session.view
    driver.session.look(View(looking((1, 9, 0.1), (1, 0, 0)), 40.0, view.width, view.height, 9))
    driver.do("room.open_walls")
    assert the_room(driver).without == ()
    assert not the_room(driver).ceiling
    driver.do("room.close_walls")
    assert the_room(driver).ceiling
    assert driver.labels()[-1] == "Close all walls"


def test_walls_have_check_boxes(driver: Driver) -> None:
    node, form = with_room(driver)
    assert [box.text() for box in form.walls] == ["Back", "Right", "Front", "Left"]
    form.walls[2].click()
    assert the_room(driver).without == (2,)
    assert driver.labels()[-1] == "Open front wall of Room"
    form.walls[2].click()
    assert the_room(driver).without == ()
    driver.document.apply(SetFields(node, {"plan": l_plan(6, 5, 2, 1)}))
    followed(driver, form)
    assert [box.text() for box in form.walls] == ["Back", "Right 1", "Front 1", "Right 2", "Front 2", "Left"]
    form.walls[4].click()
    assert driver.labels()[-1] == "Open front 2 wall of Room"


def test_windows_are_added_changed_and_removed(driver: Driver) -> None:
    node, form = with_room(driver)
    assert form.list.count() == 1
    assert "Window · Back" in form.list.item(0).text()
    form.add["door"].click()
    door = the_room(driver).openings[1]
    assert (door.kind, door.wall, door.sill) == ("door", 0, 0)
    assert len(the_room(driver).placed()) == 2, "beside the window"
    assert form.list.currentRow() == 1
    form.wall.setCurrentIndex(1)
    form.wall.activated.emit(1)
    assert the_room(driver).openings[1].wall == 1
    form.kind.setCurrentIndex(2)
    form.kind.activated.emit(2)
    assert the_room(driver).openings[1].kind == "opening"
    assert driver.labels()[-3:] == ["New door of Room", "Wall of door", "Kind of door"]
    followed(driver, form)
    form.list.setCurrentRow(0)
    form.remove.click()
    assert [one.kind for one in the_room(driver).openings] == ["opening"]
    followed(driver, form)
    form.remove.click()
    assert not the_room(driver).openings
    followed(driver, form)
    assert not form.chosen.isVisibleTo(form)
    assert not form.remove.isEnabled()
    driver.document.undo()
    followed(driver, form)
    assert form.list.count() == 1
    assert the_room(driver, node).openings[0].kind == "opening"


def test_new_windows_find_place_on_other_walls(driver: Driver) -> None:
    _, form = with_room(driver, width=2.0, depth=1.6, openings=())
    for count in range(1, 5):
        form.add["window"].click()
        assert len(the_room(driver).placed()) == count
    assert {one.wall for one in the_room(driver).placed()} == {0, 1, 2, 3}
    form.add["window"].click()
    assert len(the_room(driver).placed()) == 4
    followed(driver, form)
    assert "finds no room" in form.doubt.text()
    assert form.list.item(4).text() == "Window · Left · left out"
    form.walls[1].click()
    followed(driver, form)
    form.list.setCurrentRow(1)
    assert form.doubt.text() == "This wall is left out."


def test_a_number_of_a_window_is_typed_and_dragged_as_one_step(driver: Driver) -> None:
    _, form = with_room(driver)
    sill = form.form.fields["sill"].spin
    sill.setFocus()
    sill.selectAll()
    driver.bot.keyClicks(sill, "50 cm")
    driver.bot.keyClick(sill, Qt.Key.Key_Return)
    assert the_room(driver).openings[0].sill == pytest.approx(0.5)
    assert driver.labels()[-1] == "Sill of window"
    steps = len(driver.labels())
    sill.hold()
    for _ in range(5):
        sill.step(1, Qt.KeyboardModifier.NoModifier)
    assert the_room(driver).openings[0].sill > 0.5
    sill.let_go_now()
    assert len(driver.labels()) == steps + 1


def test_the_size_of_a_room_is_dragged_as_one_step_and_furniture_stays(driver: Driver) -> None:
    driver.show(room())
    node, _ = with_room(driver)
    stool = driver.document.scene["stool"]
    width = driver.window.panels["properties"].form.fields["width"].spin
    steps = len(driver.labels())
    width.hold()
    for _ in range(5):
        width.step(1, Qt.KeyboardModifier.NoModifier)
    made = the_room(driver, node)
    assert made.width > 5
    assert made.geometry.bounds[1, 0] == pytest.approx(made.width / 2 + 0.2)
    width.let_go_now()
    assert len(driver.labels()) == steps + 1
    assert driver.labels()[-1] == "Width of Room"
    assert driver.document.scene["stool"] is stool
    driver.document.undo()
    assert the_room(driver, node).width == 5


def test_a_size_that_cannot_be_is_told_and_changes_nothing(driver: Driver) -> None:
    u = ((0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (2.0, 3.0), (2.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0))
    node, _ = with_room(driver, plan=u, openings=())
    before = driver.document.scene
    assert not driver.context.editing.apply(SetFields(node, {"thickness": 0.6}, "Wall thickness of Room"))
    assert driver.document.scene is before
    assert "walls 0.6 m thick" in driver.problems()[-1]


def test_the_materials_of_a_room_are_named_for_its_parts(driver: Driver) -> None:
    with_room(driver)
    panel = driver.window.panels["properties"]
    assert [combo.accessibleName() for combo in panel.slots] == [
        *("Material floor", "Material walls", "Material ceiling", "Material skirting", "Material frames")
    ]


def test_everything_in_the_form_has_a_name_and_is_reached_by_keyboard(driver: Driver) -> None:
    _, form = with_room(driver)
    for widget in (*form.walls, *form.add.values(), form.remove, form.list, form.kind, form.wall):
        assert widget.accessibleName() or widget.text()
        assert widget.focusPolicy() & Qt.FocusPolicy.TabFocus


def test_a_drag_on_the_walls_of_a_chosen_room_looks_around(driver: Driver) -> None:
    driver.show(room())
    node, _ = with_room(driver, height=1.0)
    driver.settle()
    before, place = driver.session.view, the_room(driver, node).transform
    steps = len(driver.labels())
    at = driver.at((0.2, 0.5, 2.2))
    driver.click((0.2, 0.5, 2.2))
    assert driver.session.selection == (node,)
    driver.press(at)
    driver.move(at + QPoint(40, 5))
    driver.move(at + QPoint(80, 5))
    driver.release(at + QPoint(80, 5))
    assert the_room(driver, node).transform == place
    assert len(driver.labels()) == steps
    assert driver.session.view != before


def test_a_room_becomes_an_l_and_a_rectangle_again(driver: Driver) -> None:
    door = Opening(kind="door", wall=3, sill=0.0, width=0.9, height=2.05)
    node, form = with_room(driver, openings=(WINDOW, door), without=(2,))
    plan = form.plan
    assert plan.shape.currentText() == "Rectangle"
    assert not plan.cut.isVisibleTo(form)

    def choose(text: str) -> None:
        index = plan.shape.findText(text)
        plan.shape.setCurrentIndex(index)
        plan.shape.activated.emit(index)
        followed(driver, form)

    choose("L without front right")
    assert the_room(driver).plan == l_plan(5, 4, 2.0, 1.6)
    assert [one.wall for one in the_room(driver).openings] == [0, 5]
    assert the_room(driver).without == (4,)
    assert driver.labels()[-1] == "Floor plan of Room"
    assert len(form.walls) == 6
    width = plan.cut.fields["width"].spin
    steps = len(driver.labels())
    width.hold()
    for _ in range(5):
        width.step(1, Qt.KeyboardModifier.NoModifier)
    width.let_go_now()
    assert len(driver.labels()) == steps + 1
    followed(driver, form)
    cut = l_cut(the_room(driver).shape.corners)
    assert cut is not None
    assert cut.width > 2.0
    assert cut.depth == pytest.approx(1.6)
    choose("L without back left")
    assert l_cut(the_room(driver).shape.corners).corner == "back left"  # type: ignore[union-attr]
    choose("Rectangle")
    assert the_room(driver).plan == ()
    assert the_room(driver, node).openings == (WINDOW, door)
    assert the_room(driver).without == (2,)
    driver.document.apply(SetFields(node, {"plan": ((0.0, -3.0), (3.0, 2.0), (-3.0, 3.0)), "openings": ()}))
    followed(driver, form)
    assert plan.shape.currentIndex() == -1
