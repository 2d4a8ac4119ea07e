"""Models that come in: when they are asked about, what is previewed, and later corrections."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from names import nameless
from PySide6.QtWidgets import QApplication
from ui_support import Driver, Make, block, box, room

from studio_core.contract import ImportedModel
from studio_core.scene.bounds import exact_bounds
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import MeshObject
from studio_core.scene.transform import Transform, axis_angle
from studio_ui.files.import_dialog import ImportDialog
from studio_ui.files.import_preview import turned
from studio_ui.files.import_question import (
    ImportChoice,
    kept,
    likely_unit,
    question,
    remembered,
    some_lines,
)
from studio_ui.files.importing import corrected


def imported(driver: Driver, path: Path, action: str = "file.import") -> tuple[np.ndarray, np.ndarray]:
    driver.answers.files = [path]
    before = len(driver.document.history)
    driver.do(action)
    driver.until(lambda: len(driver.document.history) > before)
    return exact_bounds(driver.document.scene, driver.session.selection)


def model(scale: float = 1.0) -> ImportedModel:
    cube = box()
    made = Geometry(cube.positions * np.float32(scale) * (1, 2, 1), cube.faces)
    return ImportedModel((MeshObject(id="m", name="M", geometry=made, materials=()),), (), ("A note.",))


def test_what_is_sensible_comes_in_without_a_question(driver: Driver, tmp_path: Path) -> None:
    path = tmp_path / "chair.obj"
    path.write_text(block(0.5, 0.9, 0.6))
    low, high = imported(driver, path)
    assert driver.answers.asked == []
    assert high - low == pytest.approx((0.5, 0.9, 0.6), abs=1e-5)
    assert low[1] == pytest.approx(0, abs=1e-6)


def test_options_are_asked_for_on_purpose(driver: Driver, tmp_path: Path) -> None:
    path = tmp_path / "chair.obj"
    path.write_text(block(0.5, 0.9, 0.6))
    driver.answers.import_ = lambda asked: ImportChoice(unit=2.0, stand=False, centre=False)
    low, high = imported(driver, path, "file.import_options")
    assert driver.answers.asked == [""]
    assert high - low == pytest.approx((1.0, 1.8, 1.2), abs=1e-5)
    assert (low[0] + high[0], low[2] + high[2]) == pytest.approx((0, 0), abs=1e-5), "where its file has it"


def test_what_lies_on_its_back_is_asked_about_and_turned(driver: Driver, tmp_path: Path) -> None:
    path = tmp_path / "shelf.obj"
    path.write_text(block(0.8, 1.9, 0.3, lying=True))
    low, high = imported(driver, path)
    assert "back" in driver.answers.asked[0]
    assert driver.answers.questions[0].guess.up == "z"
    assert high - low == pytest.approx((0.8, 1.9, 0.3), abs=1e-5)
    assert low[1] == pytest.approx(0, abs=1e-6)
    assert driver.document.scene[driver.session.selection[0]].transform.scale == 1


def test_a_cancelled_question_imports_nothing_and_the_next_file_comes(driver: Driver, tmp_path: Path) -> None:
    wrong, right = tmp_path / "wrong.obj", tmp_path / "right.obj"
    wrong.write_text(block(500, 900, 600))
    right.write_text(block(0.5, 0.9, 0.6))
    driver.answers.import_ = lambda asked: None
    driver.window.take_files([wrong, right])
    driver.until(lambda: driver.labels()[-1] == "Import right")
    assert driver.labels() == ["Open", "Import right"]
    assert len(driver.answers.asked) == 1


def test_a_choice_is_remembered_for_the_type_of_file(driver: Driver, tmp_path: Path) -> None:
    first, second = tmp_path / "a.obj", tmp_path / "b.obj"
    for path in (first, second):
        path.write_text(block(50, 90, 60))
    driver.answers.import_ = lambda asked: ImportChoice(unit=0.01, remember=True)
    imported(driver, first)
    low, high = imported(driver, second)
    assert len(driver.answers.asked) == 1, "the second one is not asked about"
    assert high - low == pytest.approx((0.5, 0.9, 0.6), abs=1e-5)


@pytest.mark.parametrize("damaged", [None, 5, {"unit": "x"}, {"unit": -1}, {"unit": float("nan"), "up": 3}])
def test_damaged_memories_are_none(damaged: object) -> None:
    assert remembered({".obj": damaged}, ".obj") == ImportChoice()


def test_memories_come_back() -> None:
    choice = ImportChoice(0.0254, "z", False, False, True)
    back = remembered(kept({".stl": {}}, ".obj", choice), ".obj")
    assert (back.unit, back.up, back.stand, back.centre, back.remember) == (0.0254, "z", False, False, False)


def test_the_dialog_shows_sizes_and_gives_what_was_chosen(qapp: QApplication) -> None:
    asked = question(Path("desk.obj"), model(75.0), ImportChoice())
    assert asked.guess.unit == 0.01
    assert "unusual" in asked.doubt
    dialog = ImportDialog(None, asked)
    assert nameless(dialog) == []
    dialog.show()
    assert nameless(dialog) == []
    assert dialog.choice() == asked.guess
    assert dialog.size.text().startswith("0.75 × 0.75 × 1.5")
    dialog.unit.setCurrentIndex(2)  # millimetres
    assert dialog.choice().unit == 0.001
    dialog.factor.setValue(0.02)
    assert dialog.unit.currentText() == "Other factor"
    assert dialog.size.text().startswith("1.5 × 1.5 × 3")
    dialog.axis.setCurrentIndex(1)
    assert dialog.size.text().startswith("1.5 × 3 × 1.5")
    dialog.stand.setChecked(False)
    dialog.remember.setChecked(True)
    assert dialog.choice() == ImportChoice(0.02, "z", False, True, True)
    dialog.deleteLater()


@pytest.mark.parametrize("scale", [1e-4, 1.0, 300.0])
def test_the_preview_shows_model_and_person_at_any_scale(qapp: QApplication, scale: float) -> None:
    dialog = ImportDialog(None, question(Path("x.obj"), model(scale), ImportChoice()))
    dialog.preview.show_choice(ImportChoice())
    dialog.preview.resize(300, 260)
    image = dialog.preview.grab().toImage()
    accent = dialog.palette().highlight().color()
    near = 0
    for x in range(0, image.width()):
        for y in range(0, image.height()):
            pixel = image.pixelColor(x, y)
            far = abs(pixel.red() - accent.red()) + abs(pixel.green() - accent.green())
            near += far + abs(pixel.blue() - accent.blue()) < 60
    assert near >= 9
    dialog.deleteLater()


def test_previews_of_large_models_have_few_lines() -> None:
    cube = box()
    many = Geometry(np.tile(cube.positions, (4000, 1)), np.tile(cube.faces, (4000, 1)))
    lines = some_lines(ImportedModel((MeshObject(id="m", name="M", geometry=many, materials=()),), ()))
    assert 0 < len(lines) <= 2400
    assert some_lines(ImportedModel((), ())).shape == (0, 2, 3)


def test_units_are_guessed_by_the_size_of_furniture() -> None:
    assert likely_unit((900.0, 400.0, 700.0)) == 0.001
    assert likely_unit((1.2, 0.4, 0.7)) == 1.0
    assert likely_unit((45.0, 50.0, 90.0)) == 0.01


@given(st.sampled_from([0.01, 0.0254, 3.0]), st.sampled_from("yz"), st.floats(-180, 180), st.floats(-3, 3))
def test_corrected_things_stay_on_their_foot(factor: float, up, degrees: float, at: float) -> None:
    scene = room()
    turn = Transform((at, 0.3, 1.0), axis_angle((0, 1, 0), degrees), 1.2)
    moved = scene.with_nodes(*(n.__class__(**{**vars(n), "transform": turn}) for n in [scene["stool"]]))
    low, high = exact_bounds(moved, ("stool",))
    after = exact_bounds(corrected(moved, ("stool",), factor, up)(moved), ("stool",))
    assert after[0][1] == pytest.approx(low[1], abs=1e-5)
    assert (after[0] + after[1])[[0, 2]] == pytest.approx((low + high)[[0, 2]], abs=1e-4)
    if up == "y":
        assert after[1] - after[0] == pytest.approx((high - low) * factor, abs=1e-4)


def test_units_are_corrected_later_in_one_step(make: Make, tmp_path: Path) -> None:
    driver = make()
    driver.show(room())
    driver.session.select(["chair"])
    driver.answers.import_ = lambda asked: ImportChoice(unit=0.1)
    low, high = exact_bounds(driver.document.scene, ("chair",))
    driver.do("object.correct_units")
    assert driver.answers.questions[0].correcting
    assert driver.labels()[-1] == "Correct units of Chair"
    after = exact_bounds(driver.document.scene, ("chair",))
    assert after[1] - after[0] == pytest.approx((high - low) / 10)
    driver.do("edit.undo")
    assert np.array_equal(exact_bounds(driver.document.scene, ("chair",)), (low, high))


def test_the_preview_turns_as_the_import_does() -> None:
    points = np.array([[1.0, 2.0, 3.0]])
    assert turned(points, "y").tolist() == [[1, 2, 3]]
    assert turned(points, "z").tolist() == [[1, 3, -2]]
