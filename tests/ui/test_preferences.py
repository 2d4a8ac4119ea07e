"""Preferences: data, values that fit, a dialog that changes things at once."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget
from ui_support import Driver, Make, room

from studio.app import cache_limit
from studio_core.errors import InputError
from studio_core.params import check
from studio_core.shading.job import Job
from studio_ui.forms.spin import Spin
from studio_ui.look.appearance import system_theme
from studio_ui.look.theme import DARK, LIGHT
from studio_ui.preferences.cache_part import empty, size_of
from studio_ui.preferences.catalogue import ALL, BY_NAME, FILES, KEYS, PAGES, Preference
from studio_ui.preferences.rows import PreferenceRows
from studio_ui.preferences.store import Preferences
from studio_ui.settings import Settings


@pytest.fixture
def kept(tmp_path: Path) -> Settings:
    return Settings(tmp_path / "kept")


def other(preference: Preference) -> Any:
    """A value that is not the default."""
    info = preference.info
    if info.kind == "flag":
        return not preference.default
    if info.kind == "choice":
        return next(choice for choice in info.choices if choice != preference.default)
    return info.low if preference.default != info.low else info.high


def test_the_catalogue_is_sound() -> None:
    assert len(BY_NAME) == len(ALL)
    assert {preference.page for preference in ALL} == set(PAGES)
    for preference in ALL:
        info = preference.info
        assert check(preference.name, info, preference.default) == preference.default
        assert info.label[0].isupper()
        assert info.doc, preference.name
        assert not info.doc.endswith(".")
        assert (info.kind == "choice") == bool(preference.labels)


@pytest.mark.parametrize("preference", ALL, ids=lambda p: p.name)
def test_every_preference_is_kept_told_and_reset(preference: Preference, kept: Settings) -> None:
    preferences, value = Preferences(kept), other(preference)
    told: list[Any] = []
    preferences.bind(preference.name, told.append)
    assert preferences.is_default(preference.name)
    preferences.set(preference.name, value)
    preferences.set(preference.name, value)
    assert told == [value]
    assert Preferences(Settings(kept.folder)).get(preference.name) == value
    preferences.reset(preference.name)
    assert told == [value, preference.default]
    assert preferences.is_default(preference.name)
    preferences.close()
    preferences.set(preference.name, value)
    assert len(told) == 2


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(
    st.sampled_from(ALL),
    st.none()
    | st.booleans()
    | st.floats()
    | st.integers()
    | st.text(max_size=5)
    | st.lists(st.integers(), max_size=3),
)
def test_whatever_is_in_the_file_fits_when_it_is_read(
    kept: Settings, preference: Preference, stored: Any
) -> None:
    kept._values = {preference.name: stored}
    value = Preferences(kept).get(preference.name)
    assert check(preference.name, preference.info, value) == value
    assert type(value) is type(preference.default)


def test_what_does_not_fit_is_refused(kept: Settings) -> None:
    preferences = Preferences(kept)
    for name, value in [("theme", "pink"), ("snap_step", -1.0), ("snap", "yes")]:
        with pytest.raises(InputError):
            preferences.set(name, value)
        assert preferences.is_default(name)


def test_what_is_changed_in_the_dialog_counts_at_once(driver: Driver) -> None:
    window = driver.window
    dialog = window.preferences_.open(page="General")
    rows = dialog.rows["General"]
    combo = rows.fields["theme"].combo  # type: ignore[attr-defined]
    combo.setCurrentIndex(combo.findData("light"))
    combo.activated.emit(combo.currentIndex())
    assert window.appearance.theme is LIGHT
    driver.do("view.dark")
    assert window.appearance.theme is DARK
    assert combo.currentData() == "dark", "the dialog follows the menu"
    window.preferences.set("rest_pixels", "1")
    assert driver.feed.rest_pixels == 1_000_000
    window.preferences.set("autosave", 30.0)
    assert window.files.keeper.autosaver.interval == 30.0
    window.preferences.set("navigation", "blender")
    driver.until(lambda: window.actions_["view.navigation_blender"].isChecked())
    dialog.close()


def test_units_and_marks_are_worn_by_every_number(driver: Driver) -> None:
    driver.show(room())
    driver.session.select(["stool"])
    driver.settle()
    window = driver.window
    window.preferences.set("length_unit", "cm")
    window.preferences.set("decimal_mark", ",")
    spins = [spin for spin in window.findChildren(Spin) if spin.info.unit == "m" and spin.isVisible()]
    for spin in spins:
        spin.setValue(1.2345)
        assert spin.text().startswith("123,5")
    dialog = window.preferences_.open(name="snap_step")
    spin = dialog.rows["Snapping"].fields["snap_step"].spin  # type: ignore[attr-defined]
    assert spin.text() == "5 cm"
    assert dialog.list.currentItem().text() == "Snapping"
    assert dialog.focusWidget() is not None
    assert dialog.rows["Snapping"].fields["snap_step"].isAncestorOf(dialog.focusWidget())
    dialog.close()


def test_the_palette_finds_preferences(driver: Driver) -> None:
    palette = driver.window.palette_
    palette.open()
    palette.edit.setText("decimal mark")
    assert palette.found[0].name == "preference.decimal_mark"
    palette._run(palette.list.currentIndex())
    dialog = driver.window.preferences_.open()
    assert dialog.isVisible()
    assert dialog.list.currentItem().text() == "General"
    dialog.close()


def test_closing_the_dialog_leaves_nothing_bound(driver: Driver) -> None:
    window = driver.window

    def bound() -> int:
        return sum(len(told) for told in window.preferences._bound.values())

    before = bound()
    window.preferences_.open(page=KEYS).close()
    assert bound() == before
    assert window.preferences_._dialog is None
    driver.do("edit.preferences")
    driver.do("edit.keys")
    dialog = window.preferences_.open()
    assert dialog.list.currentItem().text() == KEYS
    dialog.close()


def test_reset_buttons_are_there_while_something_differs(kept: Settings, driver: Driver) -> None:
    preferences = Preferences(kept)
    rows = PreferenceRows(preferences, [p for p in ALL if p.page == "Snapping"])
    rows.setParent(driver.window, Qt.WindowType.Window)
    button = rows._buttons["snap_angle"]
    assert button.isHidden()
    preferences.set("snap_angle", 45.0)
    assert not button.isHidden()
    button.click()
    assert preferences.get("snap_angle") == 15.0
    assert button.isHidden()
    rows.close_panel()


def test_the_cache_is_counted_and_emptied(tmp_path: Path, kept: Settings) -> None:
    folder = tmp_path / "cache" / "computed"
    folder.mkdir(parents=True)
    (folder / "a.npz").write_bytes(bytes(1000))
    (folder / "notes.txt").write_bytes(bytes(10))
    job = Job("counting")
    assert size_of(tmp_path / "cache", job) == 1010
    assert empty(tmp_path / "cache", job) == 10, "only what was computed is deleted"
    assert size_of(tmp_path / "nothing", job) == 0
    assert cache_limit(kept) == 2**30
    Preferences(kept).set("cache", 64.0)
    assert cache_limit(kept) == 2**26


def test_the_files_page_tells_what_is_kept(driver: Driver) -> None:
    dialog = driver.window.preferences_.open(page=FILES)
    driver.until(lambda: "kept" in dialog.cache.told.text())
    dialog.close()


def test_quality_is_that_of_the_project_or_the_preferred_one(make: Make) -> None:
    driver = make()
    driver.window.preferences.set("quality", 0.8)
    driver.window.files.new()
    assert "quality" not in driver.session.params, "the test's backend has no such parameter"


def test_the_desktop_s_colours_are_followed(driver: Driver) -> None:
    window = driver.window
    driver.do("view.light")
    driver.do("view.system")
    assert window.appearance.theme is DARK, "offscreen does not say"
    assert window.actions_["view.system"].isChecked()
    assert system_theme(Qt.ColorScheme.Light) is LIGHT
    assert system_theme(Qt.ColorScheme.Dark) is DARK
    window.preferences.reset("theme")


def test_scale_and_theme_are_in_the_file(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "mine"
    driver = make(state=state)
    driver.window.preferences.set("scale", "1.5")
    driver.close()
    assert json.loads((state / "window.json").read_text("utf-8"))["scale"] == "1.5"


def test_every_control_has_a_name(driver: Driver) -> None:
    dialog = driver.window.preferences_.open()
    for rows in dialog.rows.values():
        for field in rows.fields.values():
            inner = [w for w in field.findChildren(QWidget) if w.focusPolicy() & Qt.FocusPolicy.TabFocus]
            assert inner
            own = [w for w in inner if w.window() is dialog and w.objectName() != "qt_spinbox_lineedit"]
            assert all(w.accessibleName() for w in own)
    dialog.close()
