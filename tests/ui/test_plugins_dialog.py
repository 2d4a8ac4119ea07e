"""Help ▸ Plugins, and panels that plugins bring."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QDialog
from ui_support import Driver, Make, room

from studio_core.contract import API, Plugin
from studio_core.registry import GROUP, PluginHost
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.meshes import plugin as meshes
from studio_ui.plugins.dialog import OFF, PluginsDialog

EXAMPLE = Path(__file__).parent.parent / "example_plugin"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The example plugin and a broken one, found through their entry points."""
    info = tmp_path / "lucarne_example-1.5.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lucarne-example\nVersion: 1.5\n")
    points = "example = lucarne_example:plugin\nexample_broken = lucarne_example.broken:plugin\n"
    (info / "entry_points.txt").write_text(f"[{GROUP}]\n{points}")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.syspath_prepend(str(EXAMPLE))
    importlib.invalidate_caches()
    yield info
    for name in [name for name in sys.modules if name.startswith("lucarne_example")]:
        del sys.modules[name]


def dialog_of(driver: Driver, host: PluginHost | None = None) -> PluginsDialog:
    context = driver.context
    return PluginsDialog(driver.window, host or context.host, driver.window.settings, context.tasks)


def rows(dialog: PluginsDialog) -> dict[str, list[str]]:
    tree = dialog.tree
    items = [tree.topLevelItem(i) for i in range(tree.topLevelItemCount())]
    return {item.text(0): [item.text(column) for column in range(1, 5)] for item in items}


def test_it_tells_what_there_is_and_what_failed(driver: Driver, installed: Path) -> None:
    host = PluginHost.discover()
    dialog = dialog_of(driver, host)
    found = rows(dialog)
    state, provides, version, origin = found["Example plugin"]
    assert (state, version, origin) == ("Not needed yet", "1.5", "lucarne-example")
    assert "materials: minnaert, unfinished" in provides
    assert "panel: census" in provides
    assert found["example_broken"][0] == "Failed"
    assert dialog.tree.topLevelItem(0).text(0) == "example_broken"
    assert "a_library_that_nobody_has" in dialog.detail.toPlainText()
    assert "Traceback" in dialog.detail.toPlainText()
    assert dialog.summary.text().startswith("One plugin did not work")
    dialog.copy.click()
    assert "a_library_that_nobody_has" in QGuiApplication.clipboard().text()


def test_everything_can_be_loaded_now(make: Make) -> None:
    good = Plugin("good", API, {"solver": {"pi": "math:pi"}}, "Good")
    bad = Plugin("bad", API, {"solver": {"tau": "math:nothing"}}, "Bad")
    driver = make(plugins=(brdfs, meshes, good, bad))
    driver.show(room())
    dialog = dialog_of(driver)
    assert rows(dialog)["Good"][0] == "Not needed yet"
    dialog.load.click()
    driver.idle()
    driver.until(dialog.load.isEnabled)
    assert rows(dialog)["Good"][0] == "Loaded"
    assert rows(dialog)["Bad"][0] == "Failed"
    driver.until(lambda: driver.window.actions_["help.plugins"].text() == "Plugins (1 failed)")


def test_other_peoples_plugins_are_switched_off_for_the_next_start(driver: Driver, installed: Path) -> None:
    host = PluginHost.discover()
    settings = driver.window.settings
    dialog = dialog_of(driver, host)
    tree = dialog.tree
    items = {tree.topLevelItem(i).text(0): tree.topLevelItem(i) for i in range(tree.topLevelItemCount())}
    checkable = Qt.ItemFlag.ItemIsUserCheckable
    own = [item for name, item in items.items() if "xample" not in name]
    assert own
    assert all(item.data(0, Qt.ItemDataRole.CheckStateRole) is None for item in own)
    assert items["Example plugin"].flags() & checkable
    assert not dialog.restart.isVisibleTo(dialog)
    items["Example plugin"].setCheckState(0, Qt.CheckState.Unchecked)
    assert dialog.restart.isVisibleTo(dialog)
    assert settings.get(OFF, []) == ["lucarne-example:example"]
    again = PluginHost.discover(settings.get(OFF, []))
    assert "minnaert" not in again.names("brdf")
    other = dialog_of(driver, again)
    state = rows(other)["example"][0]
    assert state == "Switched off"
    items["Example plugin"].setCheckState(0, Qt.CheckState.Checked)
    assert settings.get(OFF, []) == []
    assert not dialog.restart.isVisibleTo(dialog)


def test_what_is_stored_badly_switches_nothing_off(driver: Driver, installed: Path) -> None:
    driver.window.settings.set(OFF, [3, None, "nobody:nothing"])
    assert "minnaert" in PluginHost.discover(driver.window.settings.get(OFF, [])).names("brdf")
    assert rows(dialog_of(driver, PluginHost.discover()))["Example plugin"][0] == "Not needed yet"


def test_a_dialog_that_is_gone_hears_nothing_any_more(make: Make) -> None:
    driver = make(threads=True)
    driver.show(room())
    dialog = dialog_of(driver)
    dialog.load_all()
    dialog.done(QDialog.DialogCode.Rejected)
    driver.idle()
    assert driver.problems() == []


def test_a_plugins_panel_is_a_dock_that_is_made_when_it_is_shown(make: Make, installed: Path) -> None:
    from lucarne_example import plugin as example

    driver = make(plugins=(brdfs, meshes, example))
    driver.show(room())
    dock = driver.window.docks["plugin-census"]
    assert dock.isHidden()
    assert dock.toggleViewAction() in driver.window.actions_.menus["Window"].actions()
    assert "lucarne_example.census" not in sys.modules
    dock.show()
    census = driver.window.panels["plugin-census"].widget
    assert census is not None
    assert dock.windowTitle() == "Census"
    assert "MeshObject: 3" in census.label.text()
    driver.session.select(["stool"])
    driver.do("edit.delete")
    assert "MeshObject: 2" in census.label.text()
    assert driver.problems() == []
