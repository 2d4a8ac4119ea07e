"""Panels that write edits: materials, properties, lighting, outliner, history."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from ui_support import Driver

from studio_core.edits import AddMaterial
from studio_core.params import param_infos
from studio_core.scene.nodes import Material
from studio_ui.forms.colour_button import to_display, to_linear
from studio_ui.panels.outliner_model import EYE, NAME


def values(driver: Driver, material: str = "red") -> dict[str, object]:
    return dict(driver.document.scene.material(material).values)


def test_a_slider_drag_is_one_step_and_is_seen_while_it_lasts(driver: Driver) -> None:
    panel = driver.window.panels["materials"]
    panel.choose("red")
    slider = panel.form.fields["roughness"].slider
    slider.setSliderDown(True)
    for step in (600, 700, 810):
        slider.setValue(step)
        assert values(driver)["roughness"] == pytest.approx(step / 1000)
    assert driver.document.in_gesture
    slider.setSliderDown(False)
    assert driver.labels() == ["Open", "Roughness of Red"]
    driver.do("edit.undo")
    assert values(driver)["roughness"] == 0.5
    driver.until(lambda: panel.form.fields["roughness"].spin.value() == 0.5)
    driver.settle()
    assert driver.fake.frames[-1].scene is driver.document.scene


def test_typing_a_number_is_one_step(driver: Driver) -> None:
    panel = driver.window.panels["materials"]
    panel.choose("red")
    spin = panel.form.fields["metallic"].spin
    spin.selectAll()
    driver.bot.keyClicks(spin, "0.25")
    driver.bot.keyClick(spin, Qt.Key.Key_Return)
    assert values(driver)["metallic"] == pytest.approx(0.25)
    assert driver.labels()[1:] == ["Metal of Red"]


def test_the_colour_dialog_previews_commits_and_rolls_back(driver: Driver) -> None:
    panel = driver.window.panels["materials"]
    panel.choose("red")
    button = panel.form.fields["base_color"].button
    assert button.colour == pytest.approx((0.6, 0.1, 0.1))
    button.click()
    button.dialog.setCurrentColor(QColor("#808080"))
    assert values(driver)["base_color"] == pytest.approx((0.2158605,) * 3, abs=1e-5)
    button.dialog.reject()
    assert values(driver)["base_color"] == (0.6, 0.1, 0.1)
    assert driver.labels() == ["Open"]
    button.click()
    button.dialog.setCurrentColor(QColor("#ff8000"))
    button.dialog.accept()
    assert driver.labels()[1:] == ["Colour of Red"]
    assert values(driver)["base_color"][0] == pytest.approx(1.0)


def test_colours_survive_the_way_over_the_display() -> None:
    for colour in ((0.0, 0.5, 1.0), (0.18, 0.002, 0.9)):
        assert to_linear(to_display(colour)) == pytest.approx(colour, abs=2e-5)


def test_another_kind_of_material_has_its_own_form(driver: Driver) -> None:
    panel = driver.window.panels["materials"]
    panel.choose("blue")
    assert "roughness" not in panel.form.fields
    index = panel.editor.kinds.index("ggx")
    panel.editor.kind.setCurrentIndex(index)
    panel.editor.kind.activated.emit(index)
    driver.until(lambda: "roughness" in panel.form.fields)
    assert driver.document.scene.material("blue").model == "ggx"
    names = set(param_infos(driver.context.host.brdf("ggx").Params))
    assert set(panel.form.fields) == names


def test_materials_are_made_assigned_and_deleted(driver: Driver) -> None:
    panel = driver.window.panels["materials"]
    panel.add()
    made = panel.material
    assert driver.document.scene.material(made).model == "ggx"
    driver.session.select(["chair"])
    driver.until(lambda: panel.material == "red")
    panel.choose(made)
    panel.assign_to_selection()
    assert driver.document.scene["seat"].materials == (made,)
    assert driver.document.scene["back"].materials == (made,)
    panel.remove()
    assert made in driver.document.scene.materials
    assert driver.problems() == ["the material is still used by Seat, Back"]


def test_a_choice_in_the_picture_shows_its_properties(driver: Driver) -> None:
    panel = driver.window.panels["properties"]
    driver.session.select(["stool"])
    driver.until(lambda: panel.nodes == ("stool",))
    place = panel.place
    assert [spin.value() for spin in place.position.spins] == [1.0, 0.0, 0.0]
    place.position.spins[0].setValue(1.5)
    place.rotation.spins[1].setValue(90)
    place.scale.spins[0].setValue(2)
    world = driver.document.scene.world("stool")
    assert world.translation == (1.5, 0.0, 0.0)
    assert world.scale == 2
    assert world.matrix()[:3, 0] == pytest.approx((0, 0, -2), abs=1e-6)
    assert driver.labels()[1:] == ["Move Stool", "Turn Stool", "Scale Stool"]
    driver.until(lambda: [spin.value() for spin in place.size.spins] == [2.0, 2.0, 2.0])
    combo = panel.slots[0]
    combo.setCurrentIndex(combo.findData("red"))
    combo.activated.emit(combo.currentIndex())
    assert driver.document.scene["stool"].materials == ("red",)


def test_showing_values_is_no_edit(driver: Driver) -> None:
    """Rounded numbers in a form must not find their way back."""
    driver.document.apply(
        AddMaterial(Material(id="odd", name="Odd", model="ggx", values={"roughness": 0.123456789}))
    )
    panel = driver.window.panels["materials"]
    driver.until(lambda: "odd" in panel.list.rows)
    panel.choose("odd")
    spin = panel.form.fields["roughness"].spin
    spin.setFocus()
    driver.bot.keyClick(spin, Qt.Key.Key_Return)
    assert values(driver, "odd")["roughness"] == 0.123456789
    assert driver.labels()[1:] == ["New material"]


def test_the_outliner_renames_hides_and_finds(driver: Driver) -> None:
    panel = driver.window.panels["outliner"]
    model = panel.model
    assert model.rowCount() == 2
    chair = model.of("chair")
    assert model.rowCount(chair) == 2
    assert model.setData(chair, "Armchair")
    assert driver.document.scene["chair"].name == "Armchair"
    assert model.data(chair) == "Armchair"
    panel.tree.pressed_cell(panel.index_of("stool", EYE))
    panel.tree.let_go()
    assert driver.document.scene["stool"].hidden
    assert driver.labels()[1:] == ["Rename Chair", "Hide Stool"]
    driver.settle()
    assert "stool" not in driver.feed.last.picture.nodes
    panel.filter.setText("back")
    assert panel.proxy.rowCount() == 1
    panel.filter.clear()
    panel.tree.selectionModel().clear()
    panel.tree.setCurrentIndex(panel.proxy.mapFromSource(model.of("seat", NAME)))
    assert driver.session.selection == ("seat",)


def test_dragging_in_the_outliner_keeps_the_place_in_the_world(driver: Driver) -> None:
    model = driver.window.panels["outliner"].model
    before = driver.document.scene.world("seat")
    data = model.mimeData([model.of("seat")])
    model.dropMimeData(data, Qt.DropAction.MoveAction, -1, 0, model.of("stool"))
    scene = driver.document.scene
    assert scene["seat"].parent == "stool"
    assert scene.world("seat").translation == pytest.approx(before.translation)
    assert len(driver.document.history) == 2
    model.dropMimeData(model.mimeData([model.of("stool")]), Qt.DropAction.MoveAction, -1, 0, model.of("seat"))
    assert driver.problems() == ["'Stool' cannot hang under 'Seat', a part of it"]
    assert driver.document.scene is scene


def test_the_history_goes_to_a_step(driver: Driver) -> None:
    driver.session.select(["stool"])
    for action in ("object.right", "object.right", "object.up"):
        driver.do(action)
    panel = driver.window.panels["history"]
    driver.until(lambda: panel.list.count() == 4)
    panel.list.setCurrentRow(1)
    assert driver.document.position == 1
    assert driver.document.scene.world("stool").translation == pytest.approx((1.05, 0, 0))
    assert panel.list.item(3).font().italic()
    assert not panel.list.item(0).font().italic()


def test_grouping_and_taking_apart(driver: Driver) -> None:
    before = driver.document.scene.world("stool")
    driver.session.select(["stool"])
    driver.do("edit.undo") if driver.document.can_undo else None
    driver.do("object.group")
    (group,) = driver.session.selection
    assert driver.document.scene["stool"].parent == group
    driver.do("object.ungroup")
    assert group not in driver.document.scene.nodes
    assert driver.document.scene.world("stool") == before


def test_an_edit_ends_a_gesture_that_is_under_way(driver: Driver) -> None:
    """A menu command during a slider's drag must find the document whole."""
    panel = driver.window.panels["materials"]
    panel.choose("red")
    slider = panel.form.fields["roughness"].slider
    slider.setSliderDown(True)
    slider.setValue(900)
    driver.session.select(["stool"])
    driver.do("object.right")
    assert driver.labels()[1:] == ["Roughness of Red", "Nudge Stool"]
    assert driver.problems() == []


def test_a_form_that_goes_ends_its_gesture(driver: Driver) -> None:
    panel = driver.window.panels["materials"]
    panel.choose("red")
    slider = panel.form.fields["roughness"].slider
    slider.setSliderDown(True)
    slider.setValue(900)
    panel.choose("blue")
    assert not driver.document.in_gesture
    assert driver.labels()[1:] == ["Roughness of Red"]
