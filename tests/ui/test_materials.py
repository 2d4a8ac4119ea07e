"""The materials panel: the list, several materials at once, pictures, and materials that are dragged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from captured_fits import made_up
from hypothesis import assume, given
from hypothesis import strategies as st
from oracles.raycast import nearest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QDragEnterEvent, QDragMoveEvent
from PySide6.QtWidgets import QApplication, QLineEdit, QToolButton, QWidget
from ui_support import Driver, Make, room

from studio_core.edits import Add, AddMaterial, Assign, SetMaterial, SetTexture
from studio_core.imaging.encode import write_png
from studio_core.scene.geometry import Geometry, Image, Table, Texture
from studio_core.scene.nodes import Material, MeshObject
from studio_core.scene.transform import Transform, looking
from studio_core.session import View
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.meshes import plugin as meshes
from studio_plugins.residual import plugin as residual
from studio_plugins.residual.material import scene_material
from studio_ui.canvas.projection import eye_of, ray
from studio_ui.look.theme import PANEL_WIDTH
from studio_ui.objects.material_drag import MIME, dragged_material, drop_material, slot_at
from studio_ui.panels.materials import MaterialsPanel
from studio_ui.panels.texture_row import small_pixmap


def panel_of(driver: Driver) -> MaterialsPanel:
    found: MaterialsPanel = driver.window.panels["materials"]
    return found


def choose(driver: Driver, *materials: str) -> MaterialsPanel:
    panel = panel_of(driver)
    driver.until(lambda: all(m in panel.list.rows for m in materials))
    panel.list.clearSelection()
    for material in materials:
        panel.list.rows[material].setSelected(True)
    assert set(panel.chosen) == set(materials)
    return panel


def test_the_list_says_who_has_a_material(driver: Driver) -> None:
    panel = panel_of(driver)
    driver.document.apply(AddMaterial(Material(id="new", name="New")))
    driver.until(lambda: len(panel.list.rows) == 3)
    assert [row.text(1) for row in panel.list.rows.values()] == ["2", "1", "unused"]
    driver.document.apply(Assign("stool", "red"))
    driver.until(lambda: [row.text(1) for row in panel.list.rows.values()] == ["3", "unused", "unused"])
    panel.choose("red")
    panel.select_users()
    assert driver.session.selection == ("seat", "back", "stool")
    panel.remove_unused()
    assert list(driver.document.scene.materials) == ["red"]
    assert driver.labels()[3:] == ["Delete 2 materials"]
    panel.remove_unused()
    assert len(driver.labels()) == 4


def test_materials_are_found_by_name(driver: Driver) -> None:
    panel = panel_of(driver)

    def listed() -> list[str]:
        return [row.text(0) for row in panel.list.rows.values() if not row.isHidden()]

    panel.find.setText("BL")
    assert listed() == ["Blue"]
    driver.document.apply(AddMaterial(Material(id="x", name="Black")))
    driver.until(lambda: listed() == ["Blue", "Black"])
    panel.find.clear()
    assert listed() == ["Red", "Blue", "Black"]


def test_a_material_is_renamed_in_place(driver: Driver) -> None:
    panel = choose(driver, "red")
    driver.window.docks["materials"].raise_()
    panel.list.setCurrentItem(panel.list.rows["red"])
    panel.list.edit_name()
    editor = panel.list.findChild(QLineEdit)
    assert editor is not None
    editor.setText("Brick")
    driver.bot.keyClick(editor, Qt.Key.Key_Return)
    driver.until(lambda: driver.document.scene.material("red").name == "Brick")
    assert driver.labels()[1:] == ["Rename Red"]


def test_several_materials_are_edited_at_once(driver: Driver) -> None:
    green = Material(
        id="green", name="Green", model="ggx", values={"base_color": (0.1, 0.5, 0.1), "roughness": 0.2}
    )
    driver.document.apply(AddMaterial(green))
    panel = choose(driver, "red", "green")
    assert panel.form is not None
    fields: Any = panel.form.fields
    assert fields["roughness"].spin.mixed
    assert not fields["metallic"].spin.mixed
    slider = fields["roughness"].slider
    slider.setSliderDown(True)
    slider.setValue(300)
    slider.setValue(400)
    slider.setSliderDown(False)
    scene = driver.document.scene
    assert scene.material("red").values["roughness"] == scene.material("green").values["roughness"]
    assert driver.labels()[2:] == ["Roughness of 2 materials"]
    panel = choose(driver, "red", "blue")
    assert panel.form is None, "they are of different kinds"
    assert panel.editor.kind.currentIndex() == -1
    assert panel.common is not None
    panel.common.fields["opacity"].spin.setValue(0.25)  # type: ignore[attr-defined]
    assert [driver.document.scene.material(m).opacity for m in ("red", "blue")] == [0.25, 0.25]
    index = panel.editor.kinds.index("ggx")
    panel.editor.kind.activated.emit(index)
    assert {driver.document.scene.material(m).model for m in ("red", "blue")} == {"ggx"}
    assert driver.labels()[3:] == ["Opacity of 2 materials", "Kind of 2 materials"]


def test_a_material_can_catch_shadows(driver: Driver) -> None:
    panel = choose(driver, "blue")
    assert panel.common is not None
    panel.common.fields["catches"].box.click()  # type: ignore[attr-defined]
    assert driver.document.scene.material("blue").catches
    assert driver.labels()[1:] == ["Catches shadows of Blue"]


def test_a_drag_that_begins_beside_the_picture_is_followed(driver: Driver) -> None:
    """Who ignores that a drag comes in is told nothing more of it."""
    panel = choose(driver, "blue")
    data = panel.list.mimeData([panel.list.rows["blue"]])
    copy, left = Qt.DropAction.CopyAction, Qt.MouseButton.LeftButton
    keys = Qt.KeyboardModifier.NoModifier
    enter = QDragEnterEvent(QPoint(3, 3), copy, data, left, keys)
    QApplication.sendEvent(driver.window, enter)
    assert enter.isAccepted()
    move = QDragMoveEvent(QPoint(3, 3), copy, data, left, keys)
    QApplication.sendEvent(driver.window, move)
    assert not move.isAccepted(), "nothing there can have a material"
    at = driver.viewport.mapTo(driver.window, driver.at((1.0, 0.5, 0.5)))
    move = QDragMoveEvent(at, copy, data, left, keys)
    QApplication.sendEvent(driver.window, move)
    assert move.isAccepted()


def two_slots() -> MeshObject:
    """A square in the xy plane: its left half has slot 0, its right half slot 1."""
    corners = np.array([[x, y, 0] for x in (-1, 0, 1) for y in (0, 1)], np.float32)
    faces = np.array([[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]], np.uint32)
    geometry = Geometry(corners, faces, slots=np.array([0, 0, 1, 1], np.uint16))
    return MeshObject(id="board", name="Board", geometry=geometry, materials=("red", "blue"))


def test_a_material_goes_to_one_slot_of_an_object(driver: Driver) -> None:
    driver.document.apply(Add((two_slots(),), (Material(id="new", name="New"),)))
    panel = panel_of(driver)
    driver.session.select(["board"])
    choose(driver, "new")
    slots = [panel.slot.itemText(i) for i in range(panel.slot.count())]
    assert slots == ["All slots", "1: Red", "2: Blue"]
    panel.slot.setCurrentIndex(2)
    panel.assign.click()
    assert driver.document.scene["board"].materials == ("red", "new")
    assert driver.labels()[2:] == ["New on Board"]
    driver.session.select(["stool"])
    assert panel.slot.isHidden()
    driver.session.select([])
    assert not panel.assign.isEnabled()


def test_a_material_is_dragged_onto_what_is_seen(driver: Driver) -> None:
    panel = choose(driver, "blue")
    data = panel.list.mimeData([panel.list.rows["blue"]])
    assert data.formats() == [MIME]
    assert dragged_material(data) == "blue"
    at = driver.at((-1.0, 0.5, 0.5))
    x, y = at.x() / driver.viewport.width(), at.y() / driver.viewport.height()
    assert drop_material(driver.context, driver.viewport, "blue", x, y)
    assert driver.document.scene["seat"].materials == ("blue",)
    assert driver.document.scene["back"].materials == ("red",)
    assert driver.labels()[1:] == ["Blue on Seat"]
    assert not drop_material(driver.context, driver.viewport, "blue", 0.01, 0.01)
    assert not drop_material(driver.context, driver.viewport, "gone", x, y)
    assert driver.problems() == []


@given(
    st.floats(0.05, 0.95), st.floats(0.05, 0.95), st.tuples(*[st.floats(-0.5, 0.5)] * 3), st.floats(0.5, 3)
)
def test_the_slot_under_the_mouse_is_that_of_the_nearest_face(
    x: float, y: float, place: tuple[float, float, float], scale: float
) -> None:
    """Against a ray caster that knows nothing of cameras or transforms."""
    world = Transform(place, scale=scale)
    view = View(looking((0.4, 0.8, 3.0), (0.0, 0.5, 0.0)), 40.0, 64, 48)
    geometry = two_slots().geometry
    mesh = (geometry.positions.astype(np.float64), geometry.faces, world.matrix())
    found = nearest([mesh], eye_of(view)[None], ray(view, x, y)[None])
    assume(found.margin[0] > 1e-9)
    assert geometry.slots is not None
    expected = int(geometry.slots[found.face[0]]) if found.face[0] >= 0 else None
    assert slot_at(geometry, world, view, x, y) == expected


def test_a_picture_of_the_roughness_is_plain_numbers(driver: Driver, tmp_path: Path) -> None:
    path = tmp_path / "rough.png"
    write_png(path, np.full((4, 4, 3), 120, np.uint8))
    driver.document.apply(SetMaterial("red", {}, model="ggx"))
    panel = choose(driver, "red")
    for name, encoding in (("roughness", "data"), ("metallic", "data"), ("base_color", "srgb")):
        panel.load_picture(name, path)
        driver.until(lambda name=name: name in driver.document.scene.material("red").textures)
        assert driver.document.scene.material("red").textures[name].image.encoding == encoding


def test_a_normal_map_is_laid_made_stronger_and_kept_by_another_kind(driver: Driver, tmp_path: Path) -> None:
    path = tmp_path / "bumps.png"
    write_png(path, np.random.default_rng(1).integers(0, 256, (4, 6, 3), dtype=np.uint8))
    panel = choose(driver, "red")
    strength = panel.editor.bumps
    assert strength.isHidden()
    panel.load_picture("normal", path)
    driver.until(lambda: "normal" in driver.document.scene.material("red").textures)
    assert driver.document.scene.material("red").textures["normal"].image.encoding == "data"
    driver.until(lambda: not strength.isHidden())
    assert strength.fields["normal"].spin.value() == 1.0
    strength.fields["normal"].spin.setValue(-0.5)
    driver.until(lambda: driver.document.scene.material("red").values.get("normal") == -0.5)
    assert driver.labels()[-1] == "Strength of Red"
    panel.editor._change_model("ggx")
    made = driver.document.scene.material("red")
    assert (made.model, made.values["normal"]) == ("ggx", -0.5)
    assert "normal" in made.textures


def test_pictures_are_laid_repeated_and_taken_away(driver: Driver, tmp_path: Path) -> None:
    path = tmp_path / "wood.png"
    write_png(path, np.full((20, 40, 3), 120, np.uint8))
    panel = choose(driver, "red")
    row = panel.editor.textures["base_color"]
    assert not row.remove.isEnabled()
    panel.load_picture("base_color", path)
    driver.until(lambda: "base_color" in driver.document.scene.material("red").textures)
    driver.until(lambda: row.text.text() == "40 × 20")
    row.pattern.repeat.setValue(3.0)
    assert driver.document.scene.material("red").textures["base_color"].scale == (3.0, 3.0)
    driver.until(lambda: row.remove.isEnabled())
    row.remove.click()
    assert not driver.document.scene.material("red").textures
    assert driver.labels()[1:] == ["Picture of Red", "Pattern of Red", "Picture of Red"]
    uneven = Texture(Image(np.ones((4, 4, 1), np.float32)), (2.0, 1.0))
    driver.document.apply(SetTexture("red", "base_color", uneven))
    driver.until(lambda: row.pattern.repeat.value() == 2.0)
    row.pattern.repeat.setValue(4.0)
    assert driver.document.scene.material("red").textures["base_color"].scale == (4.0, 2.0)


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_any_picture_has_a_small_one(driver: Driver, channels: int, dtype: Any) -> None:
    made = small_pixmap(Image(np.ones((50, 130, channels), dtype)))
    assert 0 < made.width() <= 40
    assert 0 < made.height() <= 26


def test_another_theme_after_other_forms(driver: Driver) -> None:
    panel = panel_of(driver)
    for material in ("blue", "red", "blue"):
        panel.choose(material)
    driver.bot.wait(1)
    driver.do("view.light")
    driver.do("view.dark")
    assert room().materials.keys() == panel.list.rows.keys()


def test_a_kind_is_fitted_to_a_measurement(driver: Driver) -> None:
    values = np.full((12, 6, 6, 3), 0.1, np.float32)
    values[..., 1] = 0.05
    measured = Material(
        id="felt", name="Felt", model="measured", tables={"measurement": Table(values, "Felt")}
    )
    driver.document.apply(AddMaterial(measured))
    form = choose(driver, "felt").editor
    driver.until(lambda: form.measurement is not None)
    assert form.measurement is not None
    assert not form.measurement.fit.isVisibleTo(form)  # it is shown as it was measured
    driver.document.apply(SetMaterial("felt", model="lambert"))
    driver.until(lambda: form.measurement is not None and form.measurement.fit.isVisibleTo(form))
    form.measurement.fit.click()
    driver.until(lambda: driver.labels()[-1] == "Fit Felt to its measurement")
    found = driver.document.scene.material("felt")
    np.testing.assert_allclose(found.values["base_color"], np.pi * np.array([0.1, 0.05, 0.1]), rtol=1e-3)
    driver.until(lambda: form.measurement.error.text().startswith("Off by 0.0%"))
    driver.document.apply(SetMaterial("felt", {"base_color": (0.5, 0.5, 0.5)}))
    driver.until(lambda: form.measurement.error.text() == "")
    driver.do("edit.undo")
    driver.do("edit.undo")
    assert driver.document.scene.material("felt").values == {}


def test_the_plus_makes_a_material_or_opens_the_library(driver: Driver) -> None:
    panel = panel_of(driver)
    plus = next(b for b in panel.findChildren(QToolButton) if b.toolTip() == "New material")
    new, library, photographs = plus.menu().actions()
    assert photographs.text() == "Material from photographs…"
    new.trigger()
    assert driver.document.scene.material(panel.material).name == "Material"
    library.trigger()
    driver.until(lambda: not driver.window.panels["library"].visibleRegion().isEmpty())


def test_a_pattern_has_a_size_in_metres_and_is_turned(driver: Driver) -> None:
    flat = Geometry(
        np.array([[0, 0, 0], [2, 0, 0], [2, 0, -4], [0, 0, -4]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
        uvs=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
    )
    board = Material(id="board", name="Board", textures={"base_color": Texture(Image(np.ones((4, 8, 3))))})
    driver.document.apply(AddMaterial(board))
    panel = choose(driver, "board")
    row = panel.editor.textures["base_color"].pattern
    driver.until(lambda: "No object" in row.told.text())
    assert not row.width_field.isEnabled()
    fields = {"id": "sheet", "name": "Sheet", "geometry": flat, "materials": ("board",)}
    driver.document.apply(Add((MeshObject(**fields),)))
    driver.until(lambda: row.width_field.isEnabled())
    assert (row.width_field.value(), row.height_field.value()) == pytest.approx((2.0, 4.0))
    row.width_field.setValue(row.width_field.valueFromText("40 cm"))
    driver.until(lambda: row.height_field.value() == pytest.approx(0.8))
    row.keep.setChecked(False)
    row.height_field.setValue(0.25)
    driver.until(lambda: row.height_field.value() == pytest.approx(0.25))
    row.turned.setValue(30.0)
    driver.until(lambda: driver.document.scene.material("board").textures["base_color"].rotation == 30.0)
    assert (row.width_field.value(), row.height_field.value()) == pytest.approx((0.4, 0.25))
    assert driver.labels()[-3:] == ["Pattern of Board"] * 3
    driver.document.apply(Add((MeshObject(**{**fields, "id": "two", "transform": Transform(scale=1.5)}),)))
    driver.until(lambda: "Objects differ" in row.told.text())


def widest(form: QWidget) -> int:
    """Pixels that the widest row of a form needs."""
    rows = form.findChildren(QWidget, options=Qt.FindChildOption.FindDirectChildrenOnly)
    return max(row.minimumSizeHint().width() for row in rows)


def test_a_large_picture_makes_no_form_wider_than_its_panel(driver: Driver) -> None:
    large = Texture(Image(np.ones((1024, 1024, 3), np.uint8), "srgb"))
    driver.document.apply(AddMaterial(Material(id="planks", name="Planks", textures={"base_color": large})))
    panel = choose(driver, "planks")
    assert panel.editor.textures["base_color"].text.toolTip() == "1024 × 1024 pixels"
    assert widest(panel.editor) <= PANEL_WIDTH - 40


def test_maps_of_a_captured_material_are_one_row(make: Make) -> None:
    driver = make(plugins=(brdfs, meshes, residual))
    driver.show(room())
    made = replace(scene_material(made_up()).material, id="cloth", name="Cloth")
    flat = Geometry(
        np.array([[0, 0, 0], [2, 0, 0], [2, 0, -2], [0, 0, -2]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
        uvs=np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32),
    )
    driver.document.apply(AddMaterial(made))
    driver.document.apply(Add((MeshObject(id="sheet", name="Sheet", geometry=flat, materials=("cloth",)),)))
    panel = choose(driver, "cloth")
    form = panel.editor
    assert form.textures == {}
    assert widest(form) <= PANEL_WIDTH - 40, "a narrow panel shows all of it"
    assert form.maps.text.text() == "9 × 9, 4 maps"
    driver.until(lambda: form.maps.pattern.width_field.isEnabled())
    form.maps.pattern.width_field.setValue(0.5)
    driver.until(lambda: form.maps.pattern.width_field.value() == pytest.approx(0.5))
    (scale,) = {texture.scale for texture in driver.document.scene.material("cloth").textures.values()}
    assert scale == pytest.approx((4.0, 4.0)), "all four lie alike"
    assert driver.labels()[-1] == "Pattern of Cloth"
    driver.document.apply(AddMaterial(Material(id="plain", name="Plain", model="captured")))
    choose(driver, "plain")
    assert form.maps.text.text() == "No pictures: every spot is alike"


def test_a_pattern_is_grown_for_large_surfaces(driver: Driver) -> None:
    sample = np.random.default_rng(0).random((32, 32, 3)).astype(np.float32)
    driver.document.apply(SetTexture("red", "base_color", Texture(Image(sample))))
    row = choose(driver, "red").editor.textures["base_color"]
    driver.until(lambda: row.text.text() == "32 × 32")
    assert row.grow.larger[8].isEnabled()
    row.grow.larger[2].trigger()
    driver.until(lambda: row.text.text() == "64 × 64")
    assert driver.document.scene.material("red").textures["base_color"].scale == (0.5, 0.5)
    assert driver.labels()[-1] == "Larger pattern of Red"
    driver.document.undo()
    driver.until(lambda: row.text.text() == "32 × 32")
    driver.document.apply(SetTexture("red", "base_color", Texture(Image(np.zeros((1024, 8, 3), np.float32)))))
    driver.until(lambda: row.text.text() == "8 × 1024")
    assert row.grow.larger[4].isEnabled()
    assert not row.grow.larger[8].isEnabled()


def test_pictures_ask_for_coordinates_where_there_are_none(driver: Driver) -> None:
    flat = Geometry(
        np.array([[0, 0, 0], [2, 0, 0], [2, 0, -4], [0, 0, -4]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
    )
    board = Material(id="board", name="Board")
    sheets = [MeshObject(id=i, name=i.title(), geometry=flat, materials=("board",)) for i in ("one", "two")]
    driver.document.apply(Add(tuple(sheets), (board,)))
    panel = choose(driver, "board")
    bare = panel.editor.bare
    assert bare is not None
    assert bare.isHidden()
    picture = Texture(Image(np.ones((4, 8, 3), np.float32)))
    driver.document.apply(SetTexture("board", "base_color", picture))
    driver.until(lambda: not bare.isHidden())
    assert "One, Two" in bare.told.text()
    bare.button.click()
    driver.until(lambda: bare.isHidden())
    assert driver.labels()[-1] == "Texture coordinates of 2 objects"
    row = panel.editor.textures["base_color"].pattern
    driver.until(lambda: row.width_field.isEnabled())
    assert (row.width_field.value(), row.height_field.value()) == pytest.approx((1, 1), rel=1e-3)
    driver.document.undo()
    driver.session.select(["two"])
    driver.do("object.coordinates")
    driver.until(lambda: driver.labels()[-1] == "Texture coordinates of Two")
    assert "One lacks" in bare.told.text()
