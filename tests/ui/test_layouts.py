"""Named layouts of the panels, the picture alone, and windows that are small."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QByteArray, Qt
from PySide6.QtWidgets import QScrollArea, QWidget
from ui_support import Driver, Make, room

from studio_ui.layouts import BUILT_IN

SMALL = (853, 480)
"""Logical pixels of 1280 × 720 at 150 %."""


def visible(driver: Driver) -> set[str]:
    return {name for name, dock in driver.window.docks.items() if not dock.isHidden()}


def in_front(driver: Driver, name: str) -> bool:
    return not driver.window.panels[name].visibleRegion().isEmpty()


def test_the_built_in_layouts_show_what_they_are_for(driver: Driver) -> None:
    for name, (shown, front) in BUILT_IN.items():
        driver.do(f"window.{name}")
        assert visible(driver) == set(shown) & driver.window.docks.keys()
        driver.until(lambda front=front: all(in_front(driver, panel) for panel in front))
    driver.do("window.reset")
    assert "lighting" in visible(driver)
    assert "history" in visible(driver)


def test_the_picture_alone_and_the_panels_as_they_were(driver: Driver) -> None:
    driver.window.docks["jobs"].hide()
    before = visible(driver)
    driver.viewport.setFocus()
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Tab)
    driver.until(lambda: visible(driver) == set())
    driver.until(lambda: driver.window.actions_["window.picture_only"].isChecked())
    driver.do("window.picture_only")
    assert visible(driver) == before
    driver.do("window.picture_only")
    driver.window.docks["log"].show()
    driver.do("window.picture_only")
    assert visible(driver) == set(), "a panel was called back: the picture was not alone any more"
    driver.do("window.picture_only")
    assert visible(driver) == {"log"}


def test_panels_come_back_after_a_start_with_the_picture_alone(make: Make, tmp_path: Path) -> None:
    driver = make(state=tmp_path / "mine")
    before = visible(driver)
    driver.do("window.picture_only")
    driver.close()
    assert visible(make(state=tmp_path / "mine")) == before


def test_a_panel_behind_another_comes_to_the_front_by_its_entry(driver: Driver) -> None:
    entry = driver.window.docks["lighting"].toggleViewAction()
    driver.until(lambda: in_front(driver, "properties"))
    entry.trigger()
    driver.until(lambda: in_front(driver, "lighting"))
    assert entry.isChecked()
    entry.trigger()
    assert driver.window.docks["lighting"].isHidden(), "it was in front: now it goes"
    entry.trigger()
    driver.until(lambda: in_front(driver, "lighting"))


def test_own_layouts_are_kept_used_and_deleted(make: Make, tmp_path: Path) -> None:
    driver = make(state=tmp_path / "mine")
    driver.window.docks["outliner"].hide()
    driver.answers.text_ = " Wide "
    driver.do("window.save_layout")
    driver.do("window.reset")
    driver.answers.text_ = None
    driver.do("window.save_layout")
    assert driver.window.layouts.names == ["Wide"]
    driver.close()
    other = make(state=tmp_path / "mine")
    layouts, menu = other.window.layouts, other.window.actions_.menus["Window/Layouts"]
    menu.aboutToShow.emit()
    entries = {action.text(): action for action in menu.actions()}
    assert "outliner" in visible(other)
    entries["Wide"].trigger()
    assert "outliner" not in visible(other)
    (delete,) = entries["Delete layout"].menu().actions()
    delete.trigger()
    menu.aboutToShow.emit()
    assert layouts.names == []
    assert "Wide" not in {action.text() for action in menu.actions()}


def test_a_damaged_list_of_layouts_is_as_good_as_none(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "mine"
    state.mkdir()
    (state / "window.json").write_text('{"layouts": {"a": 7, "b": "///"}}')
    driver = make(state=state)
    assert driver.window.layouts.names == ["b"]
    driver.window.layouts.use("b")
    driver.window.layouts.use("gone")
    assert "outliner" in visible(driver)


@pytest.mark.parametrize("layout", [*BUILT_IN, "reset"])
def test_panels_scroll_rather_than_clip_in_a_small_window(driver: Driver, layout: str) -> None:
    """No panel asks for more than a small screen has, and what is inside a scroll area fits its width."""
    driver.show(room())
    driver.session.select(["seat"])
    driver.do(f"window.{layout}")
    driver.window.resize(*SMALL)
    least = driver.window.minimumSizeHint()
    assert least.width() <= SMALL[0]
    assert least.height() <= SMALL[1]
    driver.until(lambda: (driver.window.width(), driver.window.height()) == SMALL)
    for name, panel in driver.window.panels.items():
        assert panel.minimumSizeHint().height() <= 330, name
        for area in panel.findChildren(QScrollArea):
            inside: QWidget = area.widget()
            assert inside.minimumSizeHint().width() <= area.viewport().width(), name


def test_a_panel_that_came_later_stands_behind_its_tab(driver: Driver) -> None:
    """A layout that was kept by an earlier version knows nothing of it."""
    layout = driver.window.layout_
    now, later = ("dock-library".encode("utf-16-be"), "dock-nowhere".encode("utf-16-be"))
    older = layout.state().data().replace(now, later)
    layout.show("library")
    layout.docks["library"].setFloating(True)
    layout.set_state(QByteArray(older))
    tabs = driver.window.tabifiedDockWidgets(layout.docks["outliner"])
    assert [dock.objectName() for dock in tabs] == ["dock-library"]
    assert not driver.window.panels["outliner"].visibleRegion().isEmpty()
    assert driver.window.panels["library"].visibleRegion().isEmpty()
    assert not layout.docks["library"].isHidden()
