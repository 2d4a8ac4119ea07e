"""The outliner: what an edit tells the view, eyes and locks, dragging, filter and menu."""

from __future__ import annotations

import dataclasses
from collections import Counter
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import QModelIndex, QSize, Qt
from PySide6.QtGui import QIcon
from PySide6.QtTest import QAbstractItemModelTester
from PySide6.QtWidgets import QApplication, QLineEdit
from random_edits import random_edit
from scenes import little_scene
from ui_support import Driver, move_mouse, room

from studio_core.document import Document
from studio_core.edits import Add, Compound, Move, Remove, SetFields
from studio_core.errors import EditError
from studio_core.scene.diff import diff
from studio_core.scene.nodes import Camera, Environment, Group, MeshObject, NodeId, PointLamp, Scene
from studio_core.scene.transform import Transform
from studio_ui.editing import Editing
from studio_ui.look.icons import icon
from studio_ui.objects.material_drag import material_data
from studio_ui.panels.node_kinds import kind_name, kinds_name
from studio_ui.panels.outliner_filter import OutlinerFilter
from studio_ui.panels.outliner_model import EYE, LOCK, NAME, OutlinerModel
from studio_ui.panels.outliner_tree import OutlinerTree

MOVE = Qt.DropAction.MoveAction


def model_of(scene: Scene) -> OutlinerModel:
    return OutlinerModel(scene, Editing(Document(scene), lambda what, error: None))


def shape(model: OutlinerModel, parent: QModelIndex | None = None) -> list[Any]:
    """Ids as the model nests them, by Qt's own questions."""
    above = parent or QModelIndex()
    indices = [model.index(row, NAME, above) for row in range(model.rowCount(above))]
    for index in indices:
        assert model.parent(index) == above
    return [(model.node(index), shape(model, index)) for index in indices]


def nested(scene: Scene, parent: NodeId | None = None) -> list[Any]:
    return [(node.id, nested(scene, node.id)) for node in scene.children(parent)]


def count_signals(model: OutlinerModel) -> Counter[str]:
    told: Counter[str] = Counter()
    for name in ("modelReset", "dataChanged", "rowsInserted", "rowsRemoved", "layoutChanged"):
        getattr(model, name).connect(lambda *_, n=name: told.update([n]))
    return told


@given(st.integers(0, 2**32), st.integers(1, 12))
def test_any_edits_leave_the_tree_as_the_scene_has_it(qapp: QApplication, seed: int, count: int) -> None:
    """Rows, and what was remembered of them: persistent indices stay with their nodes, also in the view."""
    rng, scene = Random(seed), little_scene()
    model = model_of(scene)
    told = count_signals(model)
    tester = QAbstractItemModelTester(model, QAbstractItemModelTester.FailureReportingMode.Fatal)
    proxy = OutlinerFilter(model, model)
    tree = OutlinerTree()
    tree.setModel(proxy)
    tree.expandAll()
    for serial in range(count):
        try:
            after = random_edit(rng, scene, serial)(scene)
        except EditError:
            continue
        open_before = {n for n in scene.nodes if tree.isExpanded(proxy.mapFromSource(model.of(n)))}
        stayed = [n for n in scene.nodes if n in after.nodes and type(scene[n]) is type(after[n])]
        model.follow(after, diff(scene, after))
        assert shape(model) == nested(after)
        assert proxy.rowCount() == len(list(after.children(None)))
        for node in stayed:
            index = proxy.mapFromSource(model.of(node))
            if scene[node].parent == after[node].parent:
                assert tree.isExpanded(index) == (node in open_before)
            assert index.data() == after[node].name
        scene = after
    assert told["modelReset"] == 0
    tree.deleteLater()
    del tester


def crowd(count: int) -> Scene:
    """Groups of fifty lamps each."""
    groups = [Group(id=f"g{i}", name=f"Group {i}") for i in range(count // 50)]
    things = [PointLamp(id=f"c{i}", name=f"Lamp {i}", parent=f"g{i // 50}") for i in range(count)]
    return Add((*groups, *things))(Scene())


def test_of_five_thousand_nodes_an_edit_tells_what_it_changed(qapp: QApplication) -> None:
    scene = crowd(5000)
    model = model_of(scene)
    told = count_signals(model)

    def follow(edit: Any) -> Counter[str]:
        nonlocal scene
        before, scene = scene, edit(scene)
        told.clear()
        model.follow(scene, diff(before, scene))
        return told.copy()

    assert follow(SetFields("c77", {"name": "Other"})) == {"dataChanged": 1}
    assert follow(Move({"c77": Transform((1.0, 0, 0))})) == {}
    assert follow(SetFields("g3", {"hidden": True})) == {"dataChanged": 2}
    hide = Compound("", tuple(SetFields(f"c{i}", {"locked": True}) for i in range(5000)))
    assert follow(hide) == {"dataChanged": 100}
    assert follow(Add((Camera(id="new", parent="g0"),)))["rowsInserted"] == 1
    assert follow(Remove(("new", "g9")))["rowsRemoved"] == 2
    assert told["modelReset"] == told["layoutChanged"] == 0


def eye(driver: Driver, node: str, column: int = EYE) -> Any:
    panel = driver.window.panels["outliner"]
    return panel.tree.visualRect(panel.index_of(node, column)).center()


def test_dragging_over_eyes_hides_all_of_them_in_one_step(driver: Driver) -> None:
    panel = driver.window.panels["outliner"]
    panel.tree.expandAll()
    view = panel.tree.viewport()
    driver.bot.mousePress(view, Qt.MouseButton.LeftButton, pos=eye(driver, "seat"))
    for node in ("back", "stool", "back"):
        move_mouse(view, eye(driver, node))
    driver.until(lambda: driver.document.scene["stool"].hidden)
    driver.bot.mouseRelease(view, Qt.MouseButton.LeftButton, pos=eye(driver, "back"))
    scene = driver.document.scene
    assert [n for n in scene.nodes if scene[n].hidden] == ["seat", "back", "stool"]
    assert driver.labels() == ["Open", "Hide 3 things"]
    assert driver.session.selection == ()
    driver.bot.mouseClick(view, Qt.MouseButton.LeftButton, pos=eye(driver, "stool"))
    assert not driver.document.scene["stool"].hidden
    driver.bot.mouseClick(view, Qt.MouseButton.LeftButton, pos=eye(driver, "stool", LOCK))
    assert driver.document.scene["stool"].locked
    assert driver.labels()[2:] == ["Show Stool", "Lock Stool"]


def test_an_eye_of_what_is_chosen_stands_for_all_of_it(driver: Driver) -> None:
    driver.session.select(["seat", "stool"])
    driver.bot.mouseClick(
        driver.window.panels["outliner"].tree.viewport(), Qt.MouseButton.LeftButton, pos=eye(driver, "stool")
    )
    assert driver.document.scene["seat"].hidden
    assert driver.labels()[1:] == ["Hide 2 things"]


def test_names_are_edited_in_place(driver: Driver) -> None:
    panel = driver.window.panels["outliner"]
    driver.session.select(["stool"])
    panel.rename()
    editor = panel.tree.findChild(QLineEdit)
    assert editor is not None
    editor.setText("Bar stool")
    driver.bot.keyClick(editor, Qt.Key.Key_Return)
    driver.until(lambda: driver.document.scene["stool"].name == "Bar stool")
    assert driver.labels()[1:] == ["Rename Stool"]
    assert not panel.model.setData(panel.model.of("stool"), "   ")


def test_the_choice_is_followed_unfolded_and_made(driver: Driver) -> None:
    panel = driver.window.panels["outliner"]
    assert not panel.tree.isExpanded(panel.index_of("chair"))
    driver.session.select(["stool", "back"])
    assert panel.tree.isExpanded(panel.index_of("chair"))
    assert panel.tree.currentIndex() == panel.index_of("back")
    driver.bot.keyClick(panel.tree, Qt.Key.Key_Up)
    assert driver.session.selection == ("seat",)


def test_what_is_unfolded_and_chosen_outlasts_edits(driver: Driver) -> None:
    panel = driver.window.panels["outliner"]
    driver.session.select(["back"])
    driver.document.apply(Add((Group(id="new", name="New"),)))
    driver.document.apply(Remove(("stool",)))
    assert panel.tree.isExpanded(panel.index_of("chair"))
    assert driver.session.selection == ("back",)
    driver.document.apply(Remove(("chair",)))
    assert driver.session.selection == ()
    driver.document.undo()
    assert panel.tree.isExpanded(panel.index_of("chair")), "as it was"


def test_several_things_are_dragged_into_a_group_and_out_again(driver: Driver) -> None:
    panel = driver.window.panels["outliner"]
    model = panel.model
    scene = driver.document.scene
    data = model.mimeData([model.of("stool"), model.of("seat"), model.of("chair")])
    driver.document.apply(Add((Group(id="set", name="Set"),)))
    assert not model.dropMimeData(data, MOVE, -1, 0, model.of("set"))
    moved = driver.document.scene
    assert [n.id for n in moved.children("set")] == ["chair", "stool"], "the seat goes with its chair"
    assert moved["seat"].parent == "chair"
    assert moved.world("stool").translation == pytest.approx(scene.world("stool").translation)
    model.dropMimeData(model.mimeData([model.of("stool")]), MOVE, 0, 0, QModelIndex())
    model.dropMimeData(model.mimeData([model.of("chair")]), MOVE, -1, -1, QModelIndex())
    assert [n.id for n in driver.document.scene.children(None)] == ["stool", "set", "chair"]
    model.dropMimeData(model.mimeData([model.of("stool")]), MOVE, 2, 0, QModelIndex())
    assert [n.id for n in driver.document.scene.children(None)] == ["set", "stool", "chair"]
    assert driver.labels()[2:] == [
        *("Hang 2 things under Set", "Take Stool out", "Take Chair out", "Reorder Stool")
    ]
    model.dropMimeData(model.mimeData([model.of("chair")]), MOVE, -1, 0, model.of("seat"))
    assert driver.problems() == ["'Chair' cannot hang under 'Seat', a part of it"]


def test_cameras_and_environments_hold_nothing(driver: Driver) -> None:
    model = driver.window.panels["outliner"].model
    driver.document.apply(Add((Camera(id="camera"),)))
    assert not model.flags(model.of("camera")) & Qt.ItemFlag.ItemIsDropEnabled
    assert model.flags(model.of("chair")) & Qt.ItemFlag.ItemIsDropEnabled
    assert model.flags(QModelIndex()) & Qt.ItemFlag.ItemIsDropEnabled, "the top"


def test_a_material_is_dropped_on_a_row(driver: Driver) -> None:
    model = driver.window.panels["outliner"].model
    data = material_data("blue")
    assert model.canDropMimeData(data, Qt.DropAction.CopyAction, -1, 0, model.of("chair"))
    assert not model.canDropMimeData(data, Qt.DropAction.CopyAction, 0, 0, QModelIndex())
    model.dropMimeData(data, Qt.DropAction.CopyAction, -1, 0, model.of("chair"))
    scene = driver.document.scene
    assert scene["seat"].materials == scene["back"].materials == ("blue",)
    assert driver.labels()[1:] == ["Blue on 2 objects"]


def test_rows_are_found_by_name_and_kind(driver: Driver) -> None:
    panel = driver.window.panels["outliner"]
    driver.document.apply(Add((Camera(id="camera", name="From the stool"),)))
    driver.session.select(["stool"])

    def listed() -> list[str]:
        found = [panel.index_of(n) for n in driver.document.scene.nodes]
        return [index.data() for index in found if index.isValid()]

    panel.filter.setText("STOOL")
    assert listed() == ["Stool", "From the stool"]
    panel.kind.setCurrentText("Cameras")
    assert listed() == ["From the stool"]
    assert driver.session.selection == ("stool",), "what is not listed stays chosen"
    panel.filter.setText("chair")
    assert listed() == []
    panel.kind.setCurrentText("Everything")
    assert listed() == ["Chair", "Seat", "Back"]
    panel.filter.clear()
    assert len(listed()) == 5
    assert not panel.tree.isExpanded(panel.index_of("chair")), "as it was before"


def test_the_menu_acts_on_what_is_chosen(driver: Driver) -> None:
    panel = driver.window.panels["outliner"]
    driver.session.select(["back"])
    driver.until(lambda: not driver.window.following.pending)
    entries = {action.text().split("\t")[0]: action for action in panel.menu().actions()}
    assert {"Rename", "Hide", "Lock", "Group", "Duplicate", "Delete", "Frame selection"} <= entries.keys()
    entries["Select same material"].trigger()
    assert driver.session.selection == ("seat", "back")
    driver.do("edit.select_instances")
    assert driver.session.selection == ("seat", "back", "stool")
    entries["Hide"].trigger()
    assert driver.document.scene["back"].hidden
    assert driver.labels()[1:] == ["Hide Back"]


def test_f_frames_from_the_outliner_as_well(driver: Driver) -> None:
    panel = driver.window.panels["outliner"]
    driver.session.select(["stool"])
    driver.until(lambda: not driver.window.following.pending)
    assert driver.window.actions_["view.frame_selection"] in panel.tree.actions()


def test_kinds_have_names() -> None:
    scene = room()
    sky_like = dataclasses.replace(scene["chair"], id="x")
    assert kind_name(scene["chair"]) == "Group"
    assert kinds_name([scene["seat"], scene["stool"]]) == "2 objects"
    assert kinds_name([scene["seat"], sky_like]) == "2 things"
    assert issubclass(MeshObject, object)
    assert kind_name(Camera(id="c")) == "Camera"
    assert Environment.__mro__[1].__name__ == "Light"


def test_what_was_dropped_into_a_closed_group_is_in_sight(driver: Driver) -> None:
    """A tree unfolds nothing while a drop is under way."""
    panel = driver.window.panels["outliner"]
    driver.session.select(["stool"])
    assert not panel.tree.isExpanded(panel.index_of("chair"))
    data = panel.model.mimeData([panel.model.of("stool")])
    panel.tree.setState(panel.tree.State.DraggingState)
    panel.model.dropMimeData(data, MOVE, -1, 0, panel.model.of("chair"))
    panel.tree.setState(panel.tree.State.NoState)
    driver.until(lambda: panel.tree.isExpanded(panel.index_of("chair")))
    assert panel.tree.currentIndex() == panel.index_of("stool")


def test_a_choice_of_many_rows_is_a_few_ranges(driver: Driver) -> None:
    driver.document.apply(Add(tuple(crowd(300).nodes.values())))
    panel = driver.window.panels["outliner"]
    chosen = [n for n in crowd(300).nodes if n not in ("c7", "g3")]
    driver.session.select(chosen)
    ranges = panel.tree.selectionModel().selection()
    assert ranges.size() <= 10
    assert {panel.model.node(panel.proxy.mapToSource(i)) for i in ranges.indexes()} == set(chosen)


def test_icons_of_chosen_rows_stand_out_from_them(qapp: QApplication) -> None:
    """Also of unfolded ones, which trees draw as if they were switched on."""
    made = icon("eye", "#808080", selected="#102030")
    for state in (QIcon.State.Off, QIcon.State.On):
        image = made.pixmap(QSize(24, 24), QIcon.Mode.Selected, state).toImage()
        colours = [image.pixelColor(x, y) for x in range(24) for y in range(24)]
        assert {colour.name() for colour in colours if colour.alpha() == 255} == {"#102030"}
