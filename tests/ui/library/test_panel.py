"""The library's panel: found, used, dragged, kept, changed; broken files; pictures of what is seen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drag_support import Drag, files, on_canvas
from names import nameless
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt
from PySide6.QtGui import QDragEnterEvent, QDragMoveEvent, QDropEvent
from PySide6.QtWidgets import QAbstractItemView, QApplication, QLineEdit
from ui_support import Driver, Make, room

from studio_core.library.lucmat import Kept, read, write
from studio_core.library.presets import PRESETS
from studio_core.library.shelf import Shelf
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material
from studio_ui.library.panel import LibraryPanel
from studio_ui.objects.material_drag import entry_data, material_data


@pytest.fixture
def panel(driver: Driver, tmp_path: Path) -> LibraryPanel:
    """The panel in front; its folder and its trash are the test's own."""
    made: LibraryPanel = driver.window.panels["library"]
    made.library.shelf = Shelf(tmp_path / "mine", PRESETS)
    bin_ = tmp_path / "bin"

    def trash(path: Path) -> bool:
        bin_.mkdir(exist_ok=True)
        path.rename(bin_ / path.name)
        return True

    made.library.trash = trash
    driver.window.layout_.show("library")
    driver.until(lambda: not made.view.visibleRegion().isEmpty())
    return made


def listed(panel: LibraryPanel) -> list[str]:
    """Names and headings, without the remark."""
    return [row.title or row.entry.name for row in panel.view.rows.rows if row.title or row.entry is not None]


def choose(panel: LibraryPanel, *names: str) -> None:
    panel.view.clearSelection()
    keys = {row.entry.name: row.entry.key for row in panel.view.rows.rows if row.entry is not None}
    panel.view.choose([keys[name] for name in names])
    assert {entry.name for entry in panel.view.entries} == set(names)


def actions(panel: LibraryPanel) -> dict[str, object]:
    menu = panel.menu()
    return {action.text().split("\t")[0]: action for action in menu.actions() if action.text()}


def test_presets_are_listed_by_kind(panel: LibraryPanel) -> None:
    names = listed(panel)
    assert names[0] == "My materials"
    assert names.index("Paint") < names.index("Lacquer, black") < names.index("Lacquer, red")
    kinds = {kept.tags[0] for kept in PRESETS}
    assert len(names) == len(PRESETS) + len(kinds) + 1
    assert sum(row.count for row in panel.view.rows.rows) == len(PRESETS)


def test_search_and_tags_narrow_and_say_when_nothing_is_left(driver: Driver, panel: LibraryPanel) -> None:
    panel.search.setText("bRa")
    assert listed(panel) == ["Metal", "Brass, polished", "Brass, satin"]
    assert set(panel.tags.shown) == {"metal", "gloss", "satin"}
    panel.tags.choose("satin")
    assert listed(panel) == ["Metal", "Brass, satin"]
    assert panel.tags.chosen == ("satin",)
    panel.search.setText("brass oak")
    assert panel.view.isHidden()
    assert panel.why.text() == "No material is called “brass oak” and has the tag satin."
    panel.show_all()
    assert not panel.view.isHidden()
    assert len(listed(panel)) > len(PRESETS)
    assert not panel.tags.chosen


def test_keys_lead_from_the_search_to_a_material_in_the_scene(driver: Driver, panel: LibraryPanel) -> None:
    driver.session.select([])
    panel.search.setFocus()
    driver.bot.keyClicks(panel.search, "walnut")
    driver.bot.keyClick(panel.search, Qt.Key.Key_Down)
    assert [entry.name for entry in panel.view.entries] == ["Walnut, oiled"]
    assert panel.use.text() == "Add to scene"
    driver.bot.keyClick(panel.view, Qt.Key.Key_Return)
    assert driver.labels()[-1] == "Add Walnut, oiled"
    assert driver.document.scene.material(driver.window.panels["materials"].material).name == "Walnut, oiled"
    panel.search.clear()
    driver.bot.keyClick(panel.view, Qt.Key.Key_Home)
    assert panel.view.entries[0].name == listed(panel)[2]
    driver.bot.keyClick(panel.view, Qt.Key.Key_End)
    assert panel.view.entries[0].name == listed(panel)[-1]


def test_what_is_chosen_gets_it_in_one_step(driver: Driver, panel: LibraryPanel) -> None:
    driver.session.select(["chair"])
    choose(panel, "Brass, polished")
    assert panel.use.text() == "Give to 2 objects"
    panel.use.click()
    scene = driver.document.scene
    (brass,) = {m for n in ("seat", "back") for m in scene[n].materials}
    assert scene.material(brass).model == "ggx-conductor"
    assert driver.labels()[1:] == ["Brass, polished on 2 objects"]
    driver.session.select(["stool"])
    at = panel.view.visualRect(panel.view.currentIndex()).center()
    driver.bot.mouseClick(panel.view.viewport(), Qt.MouseButton.LeftButton, pos=at)
    assert driver.document.scene["stool"].materials == ("blue",), "one click chooses alone"
    driver.bot.mouseDClick(panel.view.viewport(), Qt.MouseButton.LeftButton, pos=at)
    assert driver.document.scene["stool"].materials == (brass,), "the same brass is not added twice"
    driver.do("edit.undo")
    driver.do("edit.undo")
    assert set(driver.document.scene.materials) == {"red", "blue"}


def test_it_is_dragged_onto_an_object(driver: Driver, panel: LibraryPanel) -> None:
    choose(panel, "Oak, oiled")
    data = panel.view.rows.mimeData(panel.view.selectedIndexes())
    drag = Drag(driver, data)
    at = on_canvas(driver, (1.0, 0.5, 0.5))
    assert drag.over(at)
    assert driver.window.drops.overlay.text == "Give Stool this material"
    assert drag.drop(at)
    scene = driver.document.scene
    assert scene.material(scene["stool"].materials[0]).name == "Oak, oiled"
    assert driver.labels()[1:] == ["Oak, oiled on Stool"]
    assert not Drag(driver, data).over(on_canvas(driver, (0.0, 0.0, 3.0))), "nothing is there to have it"


def _drop(widget: QAbstractItemView, data: QMimeData, at: QPoint | None = None) -> bool:
    """Let go over a list; whether it took it while it hung there."""
    copy, left = Qt.DropAction.CopyAction, Qt.MouseButton.LeftButton
    place, taken = at or QPoint(20, 20), []
    for kind in (QDragEnterEvent, QDragMoveEvent, QDropEvent):
        where = place if kind is not QDropEvent else QPointF(place)
        event = kind(where, copy, data, left, Qt.KeyboardModifier.NoModifier)
        event.setAccepted(False)
        QApplication.sendEvent(widget.viewport(), event)
        taken.append(event.isAccepted())
    return all(taken[:2])


def test_it_is_dragged_into_the_list_and_the_outliner(driver: Driver, panel: LibraryPanel) -> None:
    choose(panel, "Copper, polished")
    key = panel.view.entries[0].key
    materials, outliner = driver.window.panels["materials"], driver.window.panels["outliner"]
    assert _drop(materials.list, entry_data(key))
    driver.until(lambda: driver.labels()[-1] == "Add Copper, polished")
    driver.window.layout_.show("outliner")
    tree = outliner.tree
    tree.expandAll()
    for data, label in (
        (entry_data(key), "Copper, polished on Seat"),
        (material_data("blue"), "Blue on Seat"),
    ):
        at = tree.visualRect(outliner.proxy.mapFromSource(outliner.model.of("seat"))).center()
        assert _drop(tree, data, at)
        driver.until(lambda label=label: driver.labels()[-1] == label)
    assert driver.document.scene["seat"].materials == ("blue",)


def test_a_material_of_the_scene_is_kept_changed_and_thrown_away(
    driver: Driver, panel: LibraryPanel, tmp_path: Path
) -> None:
    assert _drop(panel.view, material_data("red"))
    kept = tmp_path / "mine" / "Red.lucmat"
    driver.until(lambda: [entry.name for entry in panel.view.entries] == ["Red"])
    assert kept.is_file()
    assert listed(panel)[:2] == ["My materials", "Red"]
    assert read(kept).material.values == driver.document.scene.material("red").values

    panel.view.rename()
    editor = panel.view.findChild(QLineEdit)
    editor.setText("Brick")
    driver.bot.keyClick(editor, Qt.Key.Key_Return)
    driver.until(lambda: listed(panel)[:2] == ["My materials", "Brick"])
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["Brick.lucmat"]
    assert [entry.name for entry in panel.view.entries] == ["Brick"]

    driver.answers.text_ = "wall, München ,"
    actions(panel)["Edit tags…"].trigger()
    driver.until(lambda: panel.view.entries[0].tags == ("wall", "München"))
    panel.search.setText("munch")
    assert listed(panel) == ["My materials", "Brick"]
    panel.search.clear()

    driver.answers.target = tmp_path / "out.lucmat"
    for _ in range(2):  # over itself the second time
        actions(panel)["Export…"].trigger()
        driver.idle()
        assert read(tmp_path / "out.lucmat").tags == ("wall", "München")

    driver.bot.keyClick(panel.view, Qt.Key.Key_Delete)
    driver.until(lambda: "Brick" not in listed(panel))
    assert (tmp_path / "bin" / "Brick.lucmat").is_file()
    assert driver.document.scene.material("red").name == "Red"


def test_without_a_trash_it_is_asked(driver: Driver, panel: LibraryPanel, tmp_path: Path) -> None:
    panel.keep(("blue",))
    driver.until(lambda: [entry.name for entry in panel.view.entries] == ["Blue"])
    panel.library.trash = lambda path: False
    driver.answers.delete_ = False
    panel.view.remove()
    assert (tmp_path / "mine" / "Blue.lucmat").is_file()
    driver.answers.delete_ = True
    panel.view.remove()
    driver.until(lambda: "Blue" not in listed(panel))
    assert driver.answers.asked == ["delete Blue"] * 2
    assert not (tmp_path / "mine" / "Blue.lucmat").exists()


def test_presets_stay_as_they_are(driver: Driver, panel: LibraryPanel, tmp_path: Path) -> None:
    choose(panel, "Chrome")
    assert not {"Delete", "Rename", "Edit tags…", "Show file"} & set(actions(panel))
    driver.bot.keyClick(panel.view, Qt.Key.Key_Delete)
    panel.view.rename()
    assert panel.view.state() != panel.view.State.EditingState
    actions(panel)["Copy to my materials"].trigger()
    driver.until(lambda: [entry.path is not None for entry in panel.view.entries] == [True])
    assert read(tmp_path / "mine" / "Chrome.lucmat").tags == ("metal", "gloss", "tap")


def test_a_broken_file_is_shown_with_its_reason(driver: Driver, panel: LibraryPanel, tmp_path: Path) -> None:
    panel.keep(("red",))
    driver.until(lambda: "Red" in listed(panel))
    (tmp_path / "mine" / "Torn.lucmat").write_bytes(b"nothing")
    panel.library.read()
    driver.until(lambda: listed(panel)[:3] == ["My materials", "Red", "Torn"])
    choose(panel, "Torn")
    assert "Torn.lucmat" in panel.told.text()
    assert not panel.use.isEnabled()
    assert set(actions(panel)) == {"Show file", "Delete", "Import…"}
    steps = len(driver.labels())
    panel.view.activate()
    assert len(driver.labels()) == steps
    panel.view.remove()
    driver.until(lambda: "Torn" not in listed(panel))


def test_files_of_materials_are_imported(driver: Driver, panel: LibraryPanel, tmp_path: Path) -> None:
    write(tmp_path / "velvet.lucmat", Kept(Material(id="x", name="Velvet", model="oren-nayar"), ("fabric",)))
    (tmp_path / "chair.obj").write_text(
        "mtllib chair.mtl\nusemtl Green\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    )
    (tmp_path / "chair.mtl").write_text("newmtl Green\nKd 0 1 0\n")
    (tmp_path / "bad.lucmat").write_text("no")
    driver.answers.files = [tmp_path / n for n in ("velvet.lucmat", "chair.obj", "bad.lucmat")]
    panel.library.ask_import()
    driver.until(lambda: listed(panel)[:3] == ["My materials", "Green", "Velvet"])
    driver.until(lambda: any("bad.lucmat" in problem for problem in driver.problems()))
    assert read(tmp_path / "mine" / "Velvet.lucmat").tags == ("fabric",)
    assert len(driver.labels()) == 1, "the scene is as it was"


def test_materials_go_out_as_models_and_come_back(make: Make, tmp_path: Path) -> None:
    from studio_plugins.brdfs import plugin as brdfs
    from studio_plugins.export import plugin as export
    from studio_plugins.meshes import plugin as meshes

    driver = make(plugins=(brdfs, meshes, export))
    driver.show(room())
    library = driver.window.panels["library"].library
    library.shelf = Shelf(tmp_path / "mine", PRESETS)
    brass = next(kept for kept in PRESETS if kept.name == "Brass, satin")
    driver.answers.target = tmp_path / "brass.glb"
    library.export_kept([brass])
    driver.until((tmp_path / "brass.glb").is_file)
    library.import_files([tmp_path / "brass.glb"])
    driver.until((tmp_path / "mine" / "Brass, satin.lucmat").is_file)
    assert read(tmp_path / "mine" / "Brass, satin.lucmat").material.values["metallic"] == 1
    driver.answers.target = tmp_path / "without an ending"
    library.export_kept([brass])
    driver.until((tmp_path / "without an ending.lucmat").is_file)


def test_a_material_file_is_dropped_on_the_window(driver: Driver, tmp_path: Path) -> None:
    path = tmp_path / "Velvet.lucmat"
    write(path, Kept(Material(id="x", name="Velvet", model="oren-nayar")))
    drag = Drag(driver, files(path))
    stool = on_canvas(driver, (1.0, 0.5, 0.5))
    assert drag.over(stool)
    assert driver.window.drops.overlay.text == "Give Stool Velvet"
    assert drag.drop(stool)
    driver.until(lambda: driver.labels()[-1] == "Velvet on Stool")
    driver.do("edit.undo")
    beside = on_canvas(driver, (0.0, 0.0, 3.0))
    drag.over(beside)
    assert driver.window.drops.overlay.text == "Add the material Velvet"
    assert drag.drop(beside)
    driver.until(lambda: driver.labels()[-1] == "Add Velvet")
    assert driver.document.scene["stool"].materials == ("blue",)


def test_opening_a_material_keeps_it_once_and_shows_it(
    driver: Driver, panel: LibraryPanel, tmp_path: Path
) -> None:
    path = tmp_path / "Velvet.lucmat"
    write(path, Kept(Material(id="x", name="Velvet", model="oren-nayar"), ("fabric",)))
    driver.window.layout_.show("outliner")
    panel.search.setText("brass")
    for _ in range(2):
        driver.window.files.open(path)
        driver.until(lambda: [entry.name for entry in panel.view.entries] == ["Velvet"])
    assert not panel.visibleRegion().isEmpty()
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["Velvet.lucmat"]
    driver.window.files.open(tmp_path / "mine" / "Velvet.lucmat")
    driver.idle()
    assert len(list((tmp_path / "mine").iterdir())) == 1
    assert driver.labels() == ["Open"], "the project that is open stays"


def test_files_are_dropped_on_the_library(driver: Driver, panel: LibraryPanel, tmp_path: Path) -> None:
    for name in ("Velvet", "Loden"):
        write(tmp_path / f"{name}.lucmat", Kept(Material(id="x", name=name, model="oren-nayar")))
    picture = tmp_path / "room.exr"
    picture.write_bytes(b"")
    _drop(panel.view, files(tmp_path / "Velvet.lucmat", picture))
    driver.until(
        lambda: driver.problems() == ["Materials and pictures of light are dropped one after the other."]
    )
    assert "Velvet" not in listed(panel)
    assert _drop(panel.view, files(tmp_path / "Velvet.lucmat", tmp_path / "Loden.lucmat"))
    driver.until(lambda: listed(panel)[:3] == ["My materials", "Loden", "Velvet"])
    assert driver.labels() == ["Open"]


def test_several_are_tagged_exported_and_added_together(
    driver: Driver, panel: LibraryPanel, tmp_path: Path
) -> None:
    panel.keep(("red", "blue"))
    driver.until(lambda: listed(panel)[:3] == ["My materials", "Blue", "Red"])
    choose(panel, "Blue", "Red")
    driver.answers.text_ = "loft"
    actions(panel)["Add tags…"].trigger()
    driver.until(lambda: [entry.tags for entry in panel.view.entries] == [("loft",)] * 2)
    panel.tags.choose("loft")
    assert listed(panel) == ["My materials", "Blue", "Red"]
    driver.answers.target = tmp_path / "out"
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "Red.lucmat").write_text("somebody's")
    actions(panel)["Export…"].trigger()
    driver.idle()
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ["Blue.lucmat", "Red 2.lucmat", "Red.lucmat"]
    assert (tmp_path / "out" / "Red.lucmat").read_text() == "somebody's"
    actions(panel)["Add to scene"].trigger()
    assert driver.labels()[1:] == ["Add 2 materials"]
    assert [m.name for m in driver.document.scene.materials.values()] == ["Red", "Blue", "Blue 2", "Red 2"]


def test_the_palette_finds_it(driver: Driver, panel: LibraryPanel) -> None:
    driver.session.select(["stool"])
    driver.do("help.palette")
    palette = driver.window.palette_
    palette.edit.setText("walnut oiled")
    assert (palette.found[0].title, palette.found[0].place) == ("Walnut, oiled", "Library ▸ Give to Stool")
    driver.bot.keyClick(palette.edit, Qt.Key.Key_Return)
    assert driver.labels()[-1] == "Walnut, oiled on Stool"


def test_only_pictures_that_are_seen_are_made(make: Make, tmp_path: Path) -> None:
    driver = make(threads=True)
    driver.show(room())
    panel: LibraryPanel = driver.window.panels["library"]
    image = Image(np.full((600, 600, 3), (1.0, 0.0, 0.0), np.float32), "linear")
    cloth = Material(
        id="m",
        name="A cloth",
        model="lambert",
        values={"base_color": (0.8, 0.8, 0.8)},
        textures={"base_color": Texture(image)},
    )
    shelf = Shelf(tmp_path / "mine", PRESETS)
    shelf.add(cloth, ("fabric",))
    shelf.add(replace(cloth, name="B paint", textures={}))
    panel.library.shelf = shelf
    assert panel.thumbnails._asked == {}, "nobody has looked yet"
    driver.window.layout_.show("library")
    driver.until(lambda: listed(panel)[:3] == ["My materials", "A cloth", "B paint"])
    first = panel.library.entries[len(PRESETS)]
    assert not first.whole, "its picture stays in the file"
    work = driver.window.panels["materials"].work
    driver.until(lambda: first.key in panel.thumbnails._icons and not work.busy)
    ball = panel._picture(first).pixmap(56, 56).toImage().pixelColor(28, 20)
    assert ball.red() > 3 * ball.green(), "the picture lies on it"
    made = set(panel.thumbnails._icons)
    assert len(made) < len(PRESETS), "what is scrolled out of sight waits"
    assert panel.thumbnails._asked == {}
    panel.view.scrollToBottom()
    driver.until(lambda: "preset:preset-glass-clear" in panel.thumbnails._icons)


@pytest.mark.parametrize("width", [110, 200, 420])
def test_cells_fill_the_width_and_every_control_has_a_name(
    driver: Driver, panel: LibraryPanel, width: int
) -> None:
    panel.setParent(None)
    panel.resize(width, 600)
    panel.show()
    driver.bot.waitExposed(panel)
    view = panel.view
    rights = [view.visualRect(view.rows.index(i)).right() for i in range(view.rows.rowCount())]
    assert max(rights) <= view.viewport().width()
    assert max(rights) >= view.viewport().width() - view.cells.columns - 2
    tops = [view.visualRect(view.rows.index(i)).top() for i in range(view.rows.rowCount())]
    assert tops == sorted(tops)
    assert view.cells.columns == max(1, (view.viewport().width() - 1) // 76)
    chips = [chip for tag, chip in panel.tags._chips.items() if tag in panel.tags.shown]
    assert all(chip.geometry().right() <= panel.tags.width() for chip in chips)
    assert all(chip.geometry().bottom() <= panel.tags.height() for chip in chips)
    assert nameless(panel) == []
    panel.close()
