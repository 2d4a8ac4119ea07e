"""The control from faster to truer, what stands behind "More", and what the status bar tells on hover."""

from __future__ import annotations

import pytest
from ui_support import Driver, Make, room

from studio_core.shading.artifacts import Error, MeasuredError
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.cuts import plugin as cuts
from studio_plugins.meshes import plugin as meshes
from studio_plugins.reference import plugin as reference
from studio_ui.panels.shading import ShadingPanel
from studio_ui.status import counted


@pytest.fixture
def driver(make: Make) -> Driver:
    """A window that knows the bundled backends; the picture is still a stand-in's."""
    made = make(plugins=(brdfs, meshes, cuts, reference))
    made.show(room())
    made.until(lambda: made.context.warm)
    made.window.docks["shading"].raise_()
    return made


def panel(driver: Driver) -> ShadingPanel:
    found: ShadingPanel = driver.window.panels["shading"]
    return found


def test_quality_is_one_thing_in_both_places(driver: Driver) -> None:
    bar = driver.window.quality
    assert bar.isVisible()
    assert bar.slider.value() == 10
    count = len(driver.fake.frames)
    bar.slider.setValue(15)
    assert driver.session.params["quality"] == 0.75
    assert panel(driver).quality.slider.value() == 15
    driver.until(lambda: len(driver.fake.frames) > count)
    driver.settle()
    assert driver.fake.frames[-1].params["quality"] == 0.75
    panel(driver).quality.slider.setValue(0)
    assert bar.slider.value() == 0


def test_projects_that_say_nothing_begin_with_the_preferred_quality(driver: Driver) -> None:
    driver.window.preferences.set("quality", 0.8)
    assert "quality" not in driver.session.params, "not for what is open"
    driver.window.files.new()
    assert driver.session.params["quality"] == 0.8
    driver.session.shade_with("cuts", {"quality": 0.3})
    driver.context.warmed.emit()
    assert driver.session.params["quality"] == 0.3


def test_a_drag_of_quality_is_told_once_at_its_end(driver: Driver) -> None:
    slider = driver.window.quality.slider
    slider.setSliderDown(True)
    for step in (11, 14, 18):
        slider.setSliderPosition(step)
    assert "quality" not in driver.session.params
    slider.setSliderDown(False)
    assert driver.session.params["quality"] == 0.9


def test_a_backend_without_it_has_no_control(driver: Driver) -> None:
    driver.session.shade_with("reference")
    assert not driver.window.quality.isVisible()
    assert panel(driver).quality is None
    assert set(panel(driver).form.fields) >= {"directions", "vertices"}
    driver.session.shade_with("cuts")
    assert driver.window.quality.isVisible()
    assert panel(driver).quality is not None


def test_what_is_advanced_is_folded_up(driver: Driver) -> None:
    form = panel(driver).form
    assert "quality" not in form.fields, "it has a control of its own"
    assert form.fields["refine"].isVisibleTo(form)
    for name in ("method", "directions", "shells"):
        assert not form.fields[name].isVisibleTo(form)
    form.more.click()
    assert form.fields["shells"].isVisibleTo(form)
    driver.session.shade_with("reference")
    assert panel(driver).form.more.isChecked(), "it stays as it was left"


def test_what_was_done_and_skipped_is_told_on_hover(driver: Driver) -> None:
    status = driver.window.status
    for label in (status.vertices, status.directions):
        assert "12,345 rays" in label.toolTip()
        assert "678 packets skipped" in label.toolTip()
    assert counted({"odd_thing": 3, "nodes": 2000}) == ["2,000 light nodes looked at", "3 odd thing"]


def test_the_error_is_told_by_light_and_for_the_worst_places(driver: Driver) -> None:
    error = MeasuredError(
        Error(0.013, 0.002, 256, 0.045), Error(0.007, 0.001, 256), {"day": Error(0.02, 0.003, 256)}
    )
    driver.window.status.show_error(error, {"day": "Daylight"})
    assert driver.window.status.error.text() == "error: 1.3 ± 0.2 %"
    told = driver.window.status.error.toolTip()
    assert "off by more than 4.5 %" in told
    assert "by Daylight alone: 2.0 ± 0.3 %" in told
