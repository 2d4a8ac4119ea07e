"""The command palette, and the search behind it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot
from ui_support import Driver, Make, room

from studio_core.scene.nodes import MeshObject
from studio_ui.actions.catalogue import specs
from studio_ui.palette.fuzzy import folded, match
from studio_ui.palette.palette import Entry, search

words = st.text(st.characters(categories=["L", "Nd", "Zs", "P"]), max_size=30)


def entry(title: str, place: str = "Edit", **more: object) -> Entry:
    return Entry(f"{place} ▸ {title}", title, place, lambda: None, **more)  # type: ignore[arg-type]


@given(words, st.data())
def test_letters_taken_out_of_a_text_are_found_in_it(text: str, data: st.DataObject) -> None:
    picked = data.draw(st.sets(st.integers(0, max(len(text) - 1, 0)), max_size=6)) if text else set()
    query = "".join(text[i] for i in sorted(picked))
    found = match(query, text)
    assert found is not None
    assert len(folded(text)) == len(text)
    hits = [folded(text)[i] for i in found.at]
    assert set(hits) == set("".join(folded(query).split()))


@given(words, words)
def test_what_is_found_is_there(query: str, text: str) -> None:
    found = match(query, text)
    if found is None:
        assert not set(folded(query).split()) <= set(folded(text).split())
    else:
        assert all(0 <= i < len(text) for i in found.at)


def test_better_matches_come_first() -> None:
    titles = ["Select nothing", "Save as…", "Reset layout", "Export scene as GLB…", "Save"]
    entries = [entry(title) for title in titles]
    assert [e.title for e, _ in search(entries, "save")] == ["Save", "Save as…"]
    assert search(entries, "sa")[0][0].title == "Save"
    assert search(entries, "rl")[0][0].title == "Reset layout", "first letters of words"
    assert search(entries, "glb exp")[0][0].title == "Export scene as GLB…", "words in any order"
    assert search(entries, "RÉSET")[0][0].title == "Reset layout", "capitals and accents do not count"
    assert search(entries, "xyz") == []


def test_places_and_hints_are_searched_after_titles() -> None:
    entries = [entry("Front", "View ▸ Look from"), entry("Look closer", "View")]
    assert [e.title for e, _ in search(entries, "look")] == ["Look closer", "Front"]
    hinted = entry("Brighter", "View", hint="Half an EV more exposure")
    assert search([hinted], "exposure")[0][0] is hinted
    assert search([hinted], "exposure lower") == []


def test_what_was_used_lately_comes_first_while_nothing_is_asked() -> None:
    entries = [entry("One"), entry("Two"), entry("Three")]
    found = search(entries, " ", ["Edit ▸ Three", "Edit ▸ gone"])
    assert [e.title for e, _ in found] == ["Three", "One", "Two"]


def type_in(driver: Driver, text: str) -> None:
    driver.do("help.palette")
    palette = driver.window.palette_
    assert palette.isVisible()
    QTest.keyClicks(palette.edit, text)


def test_every_action_is_found_by_its_name(driver: Driver) -> None:
    driver.do("help.palette")
    palette = driver.window.palette_
    listed = {found.name for found in palette.found}
    shown = [spec for spec in specs() if driver.window.actions_[spec.id].isVisible()]
    assert {spec.id for spec in shown} <= listed
    assert len(shown) > 60
    for spec in shown:
        palette.edit.setText(driver.window.actions_[spec.id].text())
        assert spec.id in [found.name for found in palette.found[:4]], spec.text
    palette.close()


def test_enter_runs_what_is_chosen_and_remembers_it(driver: Driver) -> None:
    driver.session.select(["stool"])
    driver.until(lambda: not driver.window.following.pending)
    type_in(driver, "duplic")
    QTest.keyClick(driver.window.palette_.edit, Qt.Key.Key_Return)
    assert not driver.window.palette_.isVisible()
    assert driver.labels()[-1].startswith(("Duplicate", "Copy"))
    driver.do("help.palette")
    assert driver.window.palette_.found[0].name == "edit.duplicate"
    driver.window.palette_.close()


def test_what_cannot_be_done_says_why_and_is_not_run(make: Make) -> None:
    driver = make()
    type_in(driver, "delete")
    palette = driver.window.palette_
    first = palette.found[0]
    assert (first.name, first.reason) == ("edit.delete", "Nothing is chosen")
    assert "Nothing is chosen" in palette.list.model().index(0, 0).data(Qt.ItemDataRole.AccessibleTextRole)
    QTest.keyClick(palette.edit, Qt.Key.Key_Return)
    assert palette.isVisible()
    palette.close()


def test_cameras_panels_and_themes_are_found(driver: Driver) -> None:
    driver.do("view.new_camera")
    type_in(driver, "cameras camera")
    palette = driver.window.palette_
    assert "View ▸ Cameras" in [found.place for found in palette.found[:3]]
    palette.edit.setText("outliner")
    assert palette.found[0].checked, "the panel is shown"
    palette.close()


def test_things_and_materials_of_the_scene_are_found(driver: Driver) -> None:
    palette = driver.window.palette_
    type_in(driver, "stool")
    assert palette.found[0].place == "Choose ▸ Object"
    QTest.keyClick(palette.edit, Qt.Key.Key_Return)
    assert driver.session.selection == ("stool",)
    driver.do("help.palette")
    assert not palette.found[0].name.startswith("choose."), "commands are remembered, things are not"
    palette.edit.setText("red assign")
    assert palette.found[0].name == "assign.red"
    QTest.keyClick(palette.edit, Qt.Key.Key_Return)
    stool = driver.document.scene["stool"]
    assert isinstance(stool, MeshObject)
    assert stool.materials == ("red",)
    driver.session.select([])
    driver.do("help.palette")
    palette.edit.setText("red assign")
    assert palette.found[0].reason == "No object is chosen"
    palette.close()


def test_commands_come_before_things_of_the_same_name() -> None:
    thing = entry("Save", "Choose ▸ Object", rank=-6.0)
    assert search([thing, entry("Save")], "save")[0][0].place == "Edit"


def test_keys_walk_through_the_list(driver: Driver) -> None:
    driver.do("help.palette")
    palette = driver.window.palette_
    rows = len(palette.found)

    def press(key: Qt.Key) -> int:
        QTest.keyClick(palette.edit, key)
        return palette.list.currentIndex().row()

    assert palette.list.currentIndex().row() == 0
    assert press(Qt.Key.Key_Down) == 1
    assert press(Qt.Key.Key_Up) == 0
    assert press(Qt.Key.Key_Up) == rows - 1
    assert press(Qt.Key.Key_PageDown) == rows - 1
    assert press(Qt.Key.Key_PageUp) == rows - 12
    palette.edit.setText("nothing like it")
    assert palette.found == []
    QTest.keyClick(palette.edit, Qt.Key.Key_Return)
    assert palette.isVisible()
    QTest.keyClick(palette.edit, Qt.Key.Key_Escape)
    assert not palette.isVisible()


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_the_palette_is_drawn_in_the_theme(theme: str, driver: Driver, qtbot: QtBot) -> None:
    driver.show(room())
    driver.do(f"view.{theme}")
    type_in(driver, "e")
    image = driver.window.palette_.grab().toImage()
    colours = {
        image.pixelColor(x, y).name() for x in range(0, image.width(), 2) for y in range(image.height())
    }
    worn = driver.window.appearance.theme
    assert {worn.accent, worn.raised} <= colours
    driver.window.palette_.close()
    driver.do("view.dark")
