"""The window without a mouse, and for those who hear it."""

from __future__ import annotations

import gc
from pathlib import Path

import pytest
from names import nameless
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QContextMenuEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit, QWidget
from pytestqt.qtbot import QtBot
from ui_support import Driver, room

from studio_core.params import ParamInfo
from studio_core.project.store import save
from studio_core.registry import PluginHost
from studio_ui.console.running import StopDialog
from studio_ui.dialogs import KeysDialog
from studio_ui.files.report import ReportDialog
from studio_ui.forms.fields import TextField
from studio_ui.forms.sinks import PlainSink
from studio_ui.keyboard import in_order
from studio_ui.plugins.dialog import PluginsDialog


def usable(place: QWidget) -> list[QWidget]:
    return [w for w in in_order(place) if w.isVisible() and w.focusPolicy() & Qt.FocusPolicy.TabFocus]


@pytest.fixture
def chosen(driver: Driver, qtbot: QtBot) -> Driver:
    """A window with something chosen, so that panels are full; active, so that the focus moves."""
    driver.session.select(["stool"])
    driver.settle()
    with qtbot.waitActive(driver.window):
        driver.window.activateWindow()
    return driver


def test_every_control_of_the_window_has_a_name(chosen: Driver) -> None:
    assert nameless(chosen.window) == []


def test_every_control_of_the_dialogs_has_a_name(chosen: Driver) -> None:
    host = PluginHost()
    host.report("odd", "failed", ValueError("no"))
    preferences = chosen.window.preferences_.open()
    dialogs = [
        ReportDialog(chosen.window, "Report", "It went wrong.", "Try again.", "Traceback"),
        StopDialog(chosen.window),
        PluginsDialog(chosen.window, host, chosen.window.settings, chosen.context.tasks),
        KeysDialog(chosen.window, [("Undo", "Ctrl+Z")]),
        preferences,
    ]
    for dialog in dialogs:
        assert nameless(dialog) == [], dialog.windowTitle()
        dialog.close()


def test_menus_open_by_their_letters(driver: Driver) -> None:
    texts = [action.text() for action in driver.window.menuBar().actions()]
    letters = [text[text.index("&") + 1].casefold() for text in texts]
    assert len(set(letters)) == len(letters)


def test_the_keys_of_the_picture_work_as_soon_as_a_project_is_opened(chosen: Driver, tmp_path: Path) -> None:
    save(tmp_path / "room.lucarne", room())
    chosen.do("window.next")
    assert QApplication.focusWidget() is not chosen.viewport
    chosen.window.files.open(tmp_path / "room.lucarne")
    chosen.until(lambda: QApplication.focusWidget() is chosen.viewport)


def test_f6_goes_round_picture_bars_and_panels(chosen: Driver) -> None:
    keyboard = chosen.window.keyboard
    keyboard.to_picture()
    picture = chosen.viewport
    assert QApplication.focusWidget() is picture
    visited = []
    for _ in keyboard.places:
        chosen.do("window.next")
        now = QApplication.focusWidget()
        assert now is not None
        visited.append(next(i for i, place in enumerate(keyboard.places) if place.isAncestorOf(now)))
        if now is picture:
            break
    assert QApplication.focusWidget() is picture, "it comes back"
    assert len(set(visited)) == len(visited) >= 4
    assert visited == [*range(visited[0], visited[0] + len(visited) - 1), 0] or visited[-1] == 0
    chosen.do("window.previous")
    assert QApplication.focusWidget() is not picture
    chosen.do("window.next")
    assert QApplication.focusWidget() is picture


def test_going_round_leaves_the_menus_alone(chosen: Driver) -> None:
    """What Python knows of Qt's widgets must outlive being looked at."""
    for _ in chosen.window.keyboard.places:
        chosen.do("window.next")
    gc.collect()
    chosen.window.menus.fill_recent()
    chosen.window.menus.fill_cameras()
    chosen.window.palette_.open()
    assert len(chosen.window.palette_.found) > 60
    chosen.window.palette_.close()


def test_a_panel_is_come_back_to_where_it_was_left(chosen: Driver) -> None:
    dock = chosen.window.docks["properties"]
    dock.raise_()
    chosen.until(lambda: any(isinstance(w, QLineEdit) for w in usable(dock)))
    field = next(w for w in usable(dock) if isinstance(w, QLineEdit))
    field.setFocus()
    chosen.do("window.next")
    assert not dock.isAncestorOf(QApplication.focusWidget())
    chosen.do("window.previous")
    assert QApplication.focusWidget() is field


@pytest.mark.parametrize("panel", ["outliner", "history", "properties", "console"])
def test_esc_goes_back_to_the_picture(panel: str, chosen: Driver) -> None:
    dock = chosen.window.docks[panel]
    dock.show()
    dock.raise_()
    chosen.until(lambda: bool(usable(dock)))
    usable(dock)[0].setFocus()
    assert dock.isAncestorOf(QApplication.focusWidget())
    for _ in range(2):  # the first may end what is typed
        if QApplication.focusWidget() is not chosen.viewport:
            QTest.keyClick(QApplication.focusWidget(), Qt.Key.Key_Escape)
    assert QApplication.focusWidget() is chosen.viewport


def test_esc_takes_back_what_was_typed(qtbot: QtBot) -> None:
    told: list[object] = []
    field = TextField("name", ParamInfo("text", "Name"), PlainSink(lambda name, value: told.append(value)))
    qtbot.addWidget(field)
    field.show_value("Chair")
    QTest.keyClicks(field.edit, "x")
    QTest.keyClick(field.edit, Qt.Key.Key_Escape)
    assert field.edit.text() == "Chair"
    QTest.keyClicks(field.edit, "Stool")
    QTest.keyClick(field.edit, Qt.Key.Key_Return)
    assert told == ["Stool"], "what is selected is typed over"


def test_the_context_menu_s_key_opens_the_object_menu(chosen: Driver) -> None:
    chosen.window.keyboard.to_picture()
    at = QPoint(5, 5)
    event = QContextMenuEvent(QContextMenuEvent.Reason.Keyboard, at, chosen.viewport.mapToGlobal(at))
    QApplication.sendEvent(chosen.viewport, event)
    menu = chosen.window.actions_.menus["Object"]
    assert menu.isVisible()
    menu.close()
    event = QContextMenuEvent(QContextMenuEvent.Reason.Mouse, at, chosen.viewport.mapToGlobal(at))
    QApplication.sendEvent(chosen.viewport, event)
    assert not menu.isVisible(), "the right button slides the view"
