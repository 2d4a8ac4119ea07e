"""Things dropped on the window: told before, done where they were let go, refused in a sentence."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from drag_support import Drag, files, on_canvas
from PySide6.QtCore import QMimeData, QPoint, Qt, QUrl
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication
from ui_support import Answers, Driver, Make, block, room

from studio_core.project.store import save
from studio_core.scene.bounds import exact_bounds
from studio_core.scene.nodes import Environment, Scene
from studio_ui.files.drop_intent import intent_of
from studio_ui.files.landing import Landing, beside, landing, placed_model
from studio_ui.objects.material_drag import material_data

KNOWN = (".obj", ".glb")


def overlay(driver: Driver):
    return driver.window.drops.overlay


@pytest.fixture
def chair(tmp_path: Path) -> Path:
    path = tmp_path / "chair.obj"
    path.write_text(block(0.4, 0.8, 0.4))
    return path


def test_a_model_lands_on_what_is_under_the_cursor(driver: Driver, chair: Path) -> None:
    drag = Drag(driver, files(chair))
    at = on_canvas(driver, (1.0, 1.0, 0.2))  # on the stool
    assert drag.over(at)
    assert overlay(driver).isVisible()
    assert overlay(driver).text == "Add chair here"
    assert not overlay(driver).bad
    assert drag.drop(at)
    assert overlay(driver).isHidden()
    driver.until(lambda: driver.labels()[-1] == "Import chair")
    low, high = exact_bounds(driver.document.scene, driver.session.selection)
    assert low[1] == pytest.approx(1.0, abs=0.02)
    assert (low[0] + high[0]) / 2 == pytest.approx(1.0, abs=0.02)
    assert (low[2] + high[2]) / 2 == pytest.approx(0.2, abs=0.06)  # a row of pixels is 3 cm
    assert len(driver.document.history) == 2


def test_a_model_lands_on_the_floor_where_nothing_stands(driver: Driver, chair: Path) -> None:
    at = on_canvas(driver, (0.0, 0.0, 2.5))
    assert Drag(driver, files(chair)).drop(at)
    driver.until(lambda: driver.labels()[-1] == "Import chair")
    low, high = exact_bounds(driver.document.scene, driver.session.selection)
    assert low[1] == pytest.approx(0.0, abs=1e-6)
    assert ((low + high) / 2)[[0, 2]] == pytest.approx((0.0, 2.5), abs=0.03)


def test_before_a_wall_it_stands_on_the_floor_and_touches_it(driver: Driver, chair: Path) -> None:
    at = on_canvas(driver, (1.0, 0.5, 0.5))  # the stool's front
    found = landing(driver.viewport.probe, driver.session.view, *fraction(driver, (1.0, 0.5, 0.5)))
    assert found.normal == pytest.approx((0, 0, 1), abs=0.05)
    assert not found.level
    assert Drag(driver, files(chair)).drop(at)
    driver.until(lambda: driver.labels()[-1] == "Import chair")
    low, _ = exact_bounds(driver.document.scene, driver.session.selection)
    assert low[1] == pytest.approx(0.0, abs=1e-6)
    assert low[2] == pytest.approx(0.5, abs=0.03)


def fraction(driver: Driver, point: tuple[float, float, float]) -> tuple[float, float]:
    at = driver.at(point)
    return (at.x() + 0.5) / driver.viewport.width(), (at.y() + 0.5) / driver.viewport.height()


def test_several_models_stand_side_by_side(driver: Driver, tmp_path: Path) -> None:
    paths = [tmp_path / f"{name}.obj" for name in "abc"]
    for path in paths:
        path.write_text(block(0.4, 0.8, 0.4))
    drag = Drag(driver, files(*paths))
    assert drag.over(on_canvas(driver, (0.0, 0.0, 2.0)))
    assert overlay(driver).text == "Add 3 models here"
    drag.drop(on_canvas(driver, (0.0, 0.0, 2.0)))
    driver.until(lambda: driver.labels()[-1] == "Import c")
    tops = [n.id for n in driver.document.scene.children(None)][-3:]
    boxes = [exact_bounds(driver.document.scene, (top,)) for top in tops]
    for (_, high), (low, _) in itertools.pairwise(boxes):
        assert low[0] > high[0]


def test_shift_asks_for_options(driver: Driver, chair: Path) -> None:
    drag = Drag(driver, files(chair), Qt.KeyboardModifier.ShiftModifier)
    at = on_canvas(driver, (0.0, 0.0, 2.5))
    drag.over(at)
    assert overlay(driver).text.endswith("with options")
    drag.drop(at)
    driver.until(lambda: driver.labels()[-1] == "Import chair")
    assert len(driver.answers.questions) == 1


def test_beside_the_canvas_a_model_comes_to_where_one_looks(driver: Driver, chair: Path) -> None:
    at = QPoint(5, driver.window.height() - 5)
    drag = Drag(driver, files(chair))
    drag.over(at)
    assert overlay(driver).text == "Add chair to the scene"
    drag.drop(at)
    driver.until(lambda: driver.labels()[-1] == "Import chair")


def test_light_lights_the_room(make: Make, tmp_path: Path) -> None:
    from studio_core.imaging.encode import write_exr

    driver = make(threads=True)
    driver.show(room())
    path = tmp_path / "dusk.exr"
    write_exr(path, np.full((16, 32, 3), 0.5, np.float32))
    drag = Drag(driver, files(path))
    drag.over(QPoint(300, 300))
    assert overlay(driver).text == "Light the room with dusk"
    drag.drop(QPoint(300, 300))
    driver.until(lambda: any(True for _ in driver.document.scene.of(Environment)))


def picture(path: Path, width: int, height: int) -> Path:
    image = QImage(width, height, QImage.Format.Format_RGB888)
    image.fill(Qt.GlobalColor.gray)
    assert image.save(str(path))
    return path


@pytest.mark.parametrize("yes", [True, False])
def test_a_photograph_all_around_is_asked_about(make: Make, tmp_path: Path, yes: bool) -> None:
    driver = make(answers=Answers(photograph_=yes))
    driver.show(room())
    driver.window.take_files([picture(tmp_path / "hall.png", 64, 32)])
    driver.idle()
    driver.until(lambda: driver.answers.asked == ["hall.png"])
    driver.until(lambda: (any(True for _ in driver.document.scene.of(Environment))) == yes)


def test_a_project_opens_after_asking(make: Make, tmp_path: Path) -> None:
    path = tmp_path / "flat.lucarne"
    save(path, room())
    driver = make()
    driver.show(room())
    driver.session.select(["stool"])
    driver.do("object.right")
    drag = Drag(driver, files(path))
    drag.over(QPoint(300, 300))
    assert overlay(driver).text == "Open flat"
    drag.drop(QPoint(300, 300))
    driver.until(lambda: driver.window.files.path == path)
    assert driver.answers.asked == ["unsaved"]


def test_a_material_is_given_to_the_object_under_it(driver: Driver) -> None:
    drag = Drag(driver, material_data("red"))
    assert not drag.over(on_canvas(driver, (0.0, 2.4, 0.0)))
    assert overlay(driver).isHidden()
    at = on_canvas(driver, (1.0, 0.5, 0.5))
    assert drag.over(at)
    assert overlay(driver).text == "Give Stool this material"
    drag.drop(at)
    assert driver.document.scene["stool"].materials == ("red",)
    assert len(driver.document.history) == 2


def test_a_drag_that_leaves_does_nothing(driver: Driver, chair: Path) -> None:
    drag = Drag(driver, files(chair))
    drag.over(on_canvas(driver, (0.0, 0.0, 2.0)))
    drag.leave()
    assert overlay(driver).isHidden()
    assert len(driver.document.history) == 1


def test_text_is_none_of_ours(driver: Driver) -> None:
    data = QMimeData()
    data.setText("hello")
    assert not Drag(driver, data).over(QPoint(300, 300))
    assert overlay(driver).isHidden()


def test_what_is_elsewhere_is_refused(driver: Driver) -> None:
    data = QMimeData()
    data.setUrls([QUrl("https://example.org/chair.glb")])
    drag = Drag(driver, data)
    drag.over(QPoint(300, 300))
    assert overlay(driver).bad
    drag.drop(QPoint(300, 300))
    driver.until(lambda: bool(driver.problems()))
    assert "on this computer" in driver.problems()[0]


def test_reasons(tmp_path: Path, qapp: QApplication) -> None:
    names = ("a.lucarne", "b.lucarne", "c.py", "d.exr", "e.exr", "f.xyz", "g.obj", "h.jpg")
    at = {name[0]: tmp_path / name for name in names}
    for path in at.values():
        path.write_bytes(b"x")
    photograph = picture(tmp_path / "photo.jpg", 60, 40)
    folder = tmp_path / "folder"
    folder.mkdir()
    for paths, words in (
        ([at["a"], at["b"]], "by itself"),
        ([at["a"], at["g"]], "by itself"),
        ([at["c"]], "c.py is a script"),
        ([at["d"], at["e"]], "One picture of light"),
        ([at["f"]], "f.xyz is no model"),
        ([folder], "folder is a folder"),
        ([tmp_path / "gone.obj"], "gone.obj is not there"),
        ([photograph], "60 × 40"),
        ([at["h"]], "no picture that can be read"),
    ):
        found = intent_of(paths, KNOWN)
        assert not found
        assert words in found.problem
        assert "\n" not in found.problem
    both = intent_of([at["g"], at["d"]], KNOWN)
    assert both.told(here=True, options=False) == "Add g here and light the room with d"
    assert intent_of([at["f"]], ()).models == (at["f"],), "importers may not be loaded yet"


def test_the_sky_is_no_place_to_land_on(driver: Driver) -> None:
    assert landing(driver.viewport.probe, driver.session.view, 0.5, 0.01) is None


def test_the_next_stands_to_the_right(driver: Driver) -> None:
    start = Landing((0.0, 1.0, 0.0))
    after = beside(start, driver.session.view, 0.5)
    assert after.point == pytest.approx((0.5, 1.0, 0.0), abs=1e-6)


def test_the_first_model_stays_where_its_file_has_it(chair: Path) -> None:
    from studio_plugins.meshes.obj import ObjImporter

    model = ObjImporter().load(chair)
    edit, root = placed_model(Scene(), model, "chair", (5.0, 0.0, 5.0))
    low, high = exact_bounds(edit(Scene()), (root,))
    assert ((low + high) / 2)[[0, 2]] == pytest.approx((0, 0), abs=1e-6)
