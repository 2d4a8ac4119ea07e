"""Keys that a person can change."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot
from ui_support import Driver, Make

from studio_ui.actions.catalogue import specs
from studio_ui.preferences.keys_page import KeysPage
from studio_ui.settings import Settings
from studio_ui.shortcuts import Shortcuts, portable

DEFAULTS = {"a": "Ctrl+A", "b": "Ctrl+B", "c": "", "d": "D"}


@pytest.fixture
def kept(tmp_path: Path) -> Settings:
    return Settings(tmp_path)


def test_the_catalogue_s_keys_are_keys_that_actions_can_have(kept: Settings) -> None:
    for spec in specs():
        assert not spec.shortcut or portable(spec.shortcut), spec.id
        assert not Shortcuts(kept).refuses(spec.id, portable(spec.shortcut)), spec.id


def test_a_key_is_taken_from_what_had_it_and_remembered(kept: Settings) -> None:
    shortcuts = Shortcuts(kept, DEFAULTS)
    shortcuts.give("c", "ctrl+a")
    assert [shortcuts.of(name) for name in "abcd"] == ["", "Ctrl+B", "Ctrl+A", "D"]
    again = Shortcuts(Settings(kept.folder), DEFAULTS)
    assert [again.of(name) for name in "abcd"] == ["", "Ctrl+B", "Ctrl+A", "D"]
    assert again.holder("Ctrl+A") == "c"
    assert again.holder("Ctrl+A", but="c") == ""
    again.reset("a")
    assert [again.of(name) for name in "abcd"] == ["Ctrl+A", "Ctrl+B", "", "D"]
    assert not again.is_own("c")
    assert kept.folder.joinpath("window.json").exists()
    assert "shortcuts" not in json.loads((kept.folder / "window.json").read_text("utf-8"))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
@given(
    st.lists(
        st.tuples(
            st.sampled_from("abcd"), st.sampled_from(["", "Ctrl+A", "Ctrl+B", "D", "F9", "reset", "all"])
        )
    )
)
def test_whatever_is_done_no_two_have_the_same_key(tmp_path: Path, steps: list[tuple[str, str]]) -> None:
    kept = Settings(tmp_path)
    kept.set("shortcuts", None)
    shortcuts = Shortcuts(kept, DEFAULTS)
    for name, what in steps:
        if what == "reset":
            shortcuts.reset(name)
        elif what == "all":
            shortcuts.reset_all()
        else:
            shortcuts.give(name, what)
            assert shortcuts.of(name) == what
        keys = [shortcuts.of(n) for n in DEFAULTS if shortcuts.of(n)]
        assert len(set(keys)) == len(keys)
        again = Shortcuts(kept, DEFAULTS)
        assert [again.of(n) for n in DEFAULTS] == [shortcuts.of(n) for n in DEFAULTS]


def test_what_a_person_chose_comes_before_a_later_version_s_keys(kept: Settings) -> None:
    Shortcuts(kept, DEFAULTS).give("c", "F9")
    later = Shortcuts(kept, {**DEFAULTS, "new": "F9"})
    assert (later.of("c"), later.of("new")) == ("F9", "")


def test_damaged_keys_are_left_out(kept: Settings) -> None:
    kept.set("shortcuts", {"a": 7, "b": "no such key", "gone": "F9", "c": "Esc", "d": "Ctrl+K, Ctrl+D"})
    shortcuts = Shortcuts(kept, DEFAULTS)
    assert {name: shortcuts.of(name) for name in DEFAULTS} == DEFAULTS


def test_tab_is_for_the_picture_alone(kept: Settings) -> None:
    shortcuts = Shortcuts(kept)
    shortcuts.give("view.frame_all", "Tab")
    assert Shortcuts(Settings(kept.folder)).of("view.frame_all") == "Tab"
    with pytest.raises(ValueError, match="control to control"):
        shortcuts.give("file.new", "Tab")


@pytest.mark.parametrize("keys", ["Esc", "Tab", "Return", "Space", "Nonsense+Q"])
def test_some_keys_are_refused(keys: str, kept: Settings) -> None:
    shortcuts = Shortcuts(kept, DEFAULTS)
    with pytest.raises(ValueError, match=r".+"):
        shortcuts.give("a", keys)
    assert shortcuts.of("a") == "Ctrl+A"


def test_menus_tooltips_and_keys_follow_at_once(driver: Driver) -> None:
    window = driver.window
    window.shortcuts.give("edit.duplicate", "F9")
    action = window.actions_["edit.duplicate"]
    assert action.shortcut() == QKeySequence("F9")
    assert "(F9)" in action.toolTip()
    driver.session.select(["stool"])
    driver.until(lambda: not window.following.pending)
    before = len(driver.document.scene.nodes)
    window.activateWindow()
    driver.viewport.setFocus()
    QTest.keyClick(driver.viewport, Qt.Key.Key_F9)
    assert len(driver.document.scene.nodes) > before
    window.shortcuts.reset_all()
    assert action.shortcut() == QKeySequence("Ctrl+D")


def test_keys_are_there_again_after_a_restart(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "mine"
    driver = make(state=state)
    driver.window.shortcuts.give("view.grid", "Ctrl+Alt+R")
    driver.close()
    assert make(state=state).window.actions_["view.grid"].shortcut() == QKeySequence("Ctrl+Alt+R")


def test_a_key_is_recorded_or_asked_about(kept: Settings, qtbot: QtBot) -> None:
    shortcuts = Shortcuts(kept)
    page = KeysPage(shortcuts)
    qtbot.addWidget(page)
    page.show()
    page.choose("view.frame_all")
    QTest.keyClick(page.edit, Qt.Key.Key_F9)
    assert shortcuts.of("view.frame_all") == "F9"
    page.edit.clear()
    QTest.keyClick(page.edit, Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    assert shortcuts.of("view.frame_all") == "F9"
    assert page.take.isVisibleTo(page)
    assert "Save" in page.told.text()
    page.take.click()
    assert shortcuts.of("view.frame_all") == "Ctrl+S"
    assert shortcuts.of("file.save") == ""
    page.back.click()
    assert shortcuts.of("view.frame_all") == shortcuts.default("view.frame_all")
    page.choose("file.save")
    page.back.click()
    assert shortcuts.of("file.save") == "Ctrl+S"
    page.clear.click()
    assert shortcuts.of("file.save") == ""
    page.reset_all.click()
    assert shortcuts.of("file.save") == "Ctrl+S"
    page.edit.setKeySequence(QKeySequence("Tab"))
    assert "Tab" in page.told.text(), "this one works in the whole window"
    assert shortcuts.of("file.save") == "Ctrl+S"
    page.close_panel()


def test_commands_are_found_by_name_and_by_key(kept: Settings, qtbot: QtBot) -> None:
    page = KeysPage(Shortcuts(kept))
    qtbot.addWidget(page)

    def listed() -> set[str]:
        return {name for name, item in page._items.items() if not item.isHidden()}

    page.find.setText("duplic")
    assert "edit.duplicate" in listed()
    assert "file.save" not in listed()
    page.find.setText("ctrl+s")
    assert "file.save" in listed()
    page.find.setText("")
    assert listed() == {spec.id for spec in specs()}
    page.close_panel()
