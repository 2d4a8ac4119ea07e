"""The window as a whole: start, layout, actions, many lives."""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QEvent
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot
from ui_support import Driver, Make, room

from studio_core.document import Document
from studio_core.edits import Add, SetFields
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment
from studio_core.strokes.stroke import Stroke
from studio_ui.actions.catalogue import ACTIONS, specs
from studio_ui.dialogs import KeysDialog
from studio_ui.feed import REST_MS
from studio_ui.look.icons import ICONS, icon

HEAVY = ("numba", "trimesh", "OpenImageIO", "cv2", "scipy", "embreex", "vispy", "pyqtgraph", "PIL", "mitsuba")


def test_the_window_imports_nothing_heavy() -> None:
    """What takes long to import waits for the compute thread."""
    code = f"import studio.app, sys; print([m for m in {HEAVY!r} if m in sys.modules])"
    path = os.pathsep.join(sys.path)
    ran = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": path},
    )
    assert ran.stdout.strip() == "[]"


def test_every_action_is_reachable_and_told_apart(driver: Driver) -> None:
    names = [spec.id for spec in specs()]
    assert len(set(names)) == len(names)
    keys = [QKeySequence(spec.shortcut).toString() for spec in specs() if spec.shortcut]
    assert len(set(keys)) == len(keys)
    assert "" not in keys
    assert all(spec.icon in ICONS for spec in specs() if spec.icon)
    shown = {
        action.text()
        for menu in driver.window.actions_.menus.values()
        for action in menu.actions()
        if not action.isSeparator()
    }
    driver.until(lambda: not driver.window.following.pending)
    for spec in specs():
        assert driver.window.actions_[spec.id].text() in shown
    assert None in ACTIONS


def test_what_cannot_be_done_is_disabled(make: Make) -> None:
    driver = make()
    driver.until(lambda: not driver.window.following.pending)
    enabled = {name: action.isEnabled() for name, action in driver.window.actions_.actions.items()}
    assert not enabled["edit.undo"]
    assert not enabled["edit.delete"]
    assert enabled["file.open"]
    driver.show(room())
    driver.session.select(["stool"])
    driver.do("edit.delete")
    driver.until(lambda: driver.window.actions_["edit.undo"].text() == "Undo Delete Stool")


def test_what_is_gone_is_not_chosen(driver: Driver) -> None:
    driver.session.select(["stool"])
    driver.do("edit.delete")
    driver.do("edit.undo")
    driver.session.select(["stool"])
    driver.do("edit.redo")
    assert driver.session.selection == ()


def test_layout_and_theme_are_remembered_and_reset(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "mine"
    driver = make(state=state)
    driver.window.docks["outliner"].hide()
    driver.do("view.light")
    driver.close()
    stored = json.loads((state / "window.json").read_text("utf-8"))
    assert stored["theme"] == "light"
    other = make(state=state)
    assert other.window.docks["outliner"].isHidden()
    assert other.window.actions_["view.light"].isChecked()
    other.do("window.reset")
    assert not other.window.docks["outliner"].isHidden()
    other.do("view.dark")


def test_a_damaged_state_file_is_as_good_as_none(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "mine"
    state.mkdir()
    (state / "window.json").write_text('{"layout": 7, "recent": "x", "theme": ["dark"], "geometry": "///"}')
    driver = make(state=state)
    driver.show(room())
    assert driver.window.settings.recent == []


def test_twenty_lives_leave_nothing_behind(make: Make, qapp: QApplication, qtbot: QtBot) -> None:
    def count() -> tuple[int, int, int]:
        qtbot.wait(2 * REST_MS)  # timers that were under way
        gc.collect()
        qapp.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        documents = sum(type(found) is Document for found in gc.get_objects())  # proxies may be dead
        return threading.active_count(), len(qapp.allWidgets()), documents

    def live() -> None:
        driver = make(threads=True)
        driver.open(room())
        driver.session.select(["stool"])
        driver.do("object.right")
        driver.until(lambda: driver.feed.last is not None)
        driver.close()
        driver.forget()

    live()
    live()
    before = count()
    for _ in range(20):
        live()
    after = count()
    assert after[0] == before[0]
    assert after[1] <= before[1]
    assert after[2] <= before[2]


def test_two_windows_do_not_share_anything(make: Make, tmp_path: Path) -> None:
    one, other = make(state=tmp_path / "a"), make(state=tmp_path / "b")
    one.show(room())
    one.session.select(["stool"])
    assert other.document.scene.nodes == {}
    assert other.session.selection == ()
    assert other.feed.last is None or other.feed.last.picture.nodes == ()


def test_a_closed_window_lets_late_results_go(make: Make) -> None:
    driver = make(threads=True)
    driver.show(room())
    driver.fake.gate = threading.Event()
    driver.fake.started.clear()
    driver.session.select(["stool"])
    driver.do("object.right")
    driver.until(driver.fake.started.is_set)
    driver.window.close()
    driver.close()
    QApplication.processEvents()
    assert driver.problems() == []


def test_dialogs_show_what_they_are_for(make: Make) -> None:
    driver = make()
    assert KeysDialog(driver.window, [("Undo", "Ctrl+Z")]).windowTitle()


@pytest.mark.parametrize("name", sorted(ICONS))
def test_icons_have_strokes(name: str, qapp: QApplication) -> None:
    image = icon(name, "#ffffff").pixmap(24, 24).toImage()
    assert any(image.pixelColor(x, y).alpha() > 128 for x in range(24) for y in range(24))


def camera_menu(driver: Driver) -> list[str]:
    """What View ▸ Cameras offers."""
    driver.window.menus.fill_cameras()
    return [action.text() for action in driver.window.menus.cameras.actions() if action.isVisible()]


def test_help_and_lists_open(driver: Driver) -> None:
    for action in ("help.keys", "help.plugins"):
        driver.do(action)
    opened = [w for w in driver.window.findChildren(QWidget) if w.isWindow() and w.isVisible()]
    assert len(opened) == 2
    for dialog in opened:
        dialog.close()
    driver.window.menus.fill_recent()
    assert camera_menu(driver) == ["None yet"]
    driver.do("view.new_camera")
    assert camera_menu(driver) == ["Camera"]
    assert driver.window.view_controls.camera.currentText() == "Camera"


def test_only_turning_the_light_ticks_off_the_hint_of_it(driver: Driver) -> None:
    def ticked() -> bool:
        return driver.window.hints._labels[1].text().startswith("✓")

    def light(level: float) -> Image:
        return Image(np.full((8, 16, 3), level, np.float32))

    document = driver.document
    document.apply(Add((Environment(id="sky", image=light(1)),)))
    document.apply(SetFields("sky", {"image": light(2), "luminance_scale": 50.0}))  # as a capture does
    assert not ticked()
    document.apply(SetFields("sky", {"image": light(3), "azimuth": 0.0}))
    assert not ticked()
    document.apply(SetFields("sky", {"azimuth": 30.0}))
    assert ticked()


def test_the_last_hint_leads_to_strokes(driver: Driver) -> None:
    label = driver.window.hints._labels[2]
    assert "P" in label.text()
    driver.do("tool.stroke")
    assert driver.window.panels["strokes"].isVisible()
    assert not label.text().startswith("✓")
    driver.document.apply(Add((Stroke(id="s", name="Colour on Stool"),)))
    assert label.text().startswith("✓")


def test_hints_are_ticked_off_and_never_come_again(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "mine"
    driver = make(state=state)
    driver.show(room())
    assert driver.window.hints.isVisible()
    size = driver.viewport.size()
    driver.session.select(["stool"])
    driver.do("object.right")
    assert driver.window.hints._labels[0].text().startswith("✓")
    driver.settle()
    assert driver.viewport.size() == size, "a text must not resize the picture"
    driver.window.hints.dismiss()
    driver.close()
    again = make(state=state)
    again.show(room())
    assert again.window.hints.isHidden()
    again.do("help.hints")
    assert again.window.hints.isVisible()
    assert again.window.hints._labels[0].text().startswith("1")
