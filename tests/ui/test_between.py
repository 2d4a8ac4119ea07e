"""Light between surfaces in the window: on and off, its method, which light is looked at, and its legend."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from bouncing import PLUGIN
from PySide6.QtCore import QSizeF
from PySide6.QtGui import QColor, QImage, QPainter
from PySide6.QtWidgets import QApplication
from ui_support import Driver, Make, room

from studio_core.arrays import frozen_map
from studio_core.false_colour import false_colours, linear_colours
from studio_core.kernels.tonemap import tonemap
from studio_core.scene.nodes import Scene
from studio_core.session import ALL, DIRECT, INDIRECT, SHARE, Session
from studio_core.shading.artifacts import Error, MeasuredError, Picture
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.cuts import plugin as cuts
from studio_plugins.meshes import plugin as meshes
from studio_ui.canvas.legend import legend_box, paint_legend
from studio_ui.canvas.viewport import Probe
from studio_ui.files.session_form import session_form, take_session
from studio_ui.panels.between import BetweenSection, told_facts
from studio_ui.pictures.copy import shown_image


@pytest.fixture
def driver(make: Make) -> Driver:
    """A window with two methods; the picture is a stand-in's."""
    made = make(plugins=(brdfs, meshes, cuts, PLUGIN))
    made.show(room())
    made.until(lambda: made.context.warm)
    made.window.docks["shading"].raise_()
    return made


def section(driver: Driver) -> BetweenSection:
    found: BetweenSection = driver.window.panels["shading"].between
    return found


def asked(driver: Driver):
    """How light goes on in the frame that was last asked for."""
    driver.settle()
    return driver.fake.frames[-1].indirect


def test_it_is_on_from_the_start_and_off_at_a_click(driver: Driver) -> None:
    part = section(driver)
    assert part.box.isChecked()
    assert asked(driver).method == "gather"
    part.box.click()
    assert not driver.session.bouncing
    assert asked(driver) is None
    assert part.combo.isHidden()
    assert part.form is None
    driver.do("shade.bounces")
    assert part.box.isChecked()
    assert driver.window.actions_["shade.bounces"].isChecked()
    assert asked(driver).method == "gather"


def test_parameters_are_kept_by_method(driver: Driver) -> None:
    part = section(driver)
    assert part.form is not None
    part.form.fields["settle"].box.click()
    assert asked(driver).params == {"settle": True}
    part.combo.setCurrentIndex(1)
    part.combo.activated.emit(1)
    assert asked(driver).method == "even"
    assert asked(driver).params == {}
    assert set(part.form.fields) >= {"level", "tiers"}
    part.combo.activated.emit(0)
    assert asked(driver).params == {"settle": True}


def test_bounces_are_asked_for_unless_light_is_followed_until_it_settles(driver: Driver) -> None:
    part = section(driver)
    assert part.form is not None
    part.form.fields["bounces"].spin.setValue(5)
    assert driver.session.indirect_params["gather"]["bounces"] == 5
    assert not part.form.fields["bounces"].isHidden()
    part.form.fields["settle"].box.click()
    assert part.form.fields["bounces"].isHidden()
    assert part.notes.text() == "Nothing between two objects stops their light"
    part.combo.activated.emit(1)
    assert part.notes.isHidden()


def test_which_light_is_looked_at(driver: Driver) -> None:
    part = section(driver)
    for light in (DIRECT, INDIRECT, SHARE, ALL):
        driver.do(f"view.light_{light}")
        assert part.shown.currentData() == light
        driver.settle()
        assert driver.fake.frames[-1].light == light
        driver.until(lambda name=light: driver.window.actions_[f"view.light_{name}"].isChecked())
    driver.session.bounce(False)
    part.shown.activated.emit(part.shown.findData(SHARE))
    assert driver.session.bouncing, "there is a share of it only while it is on"
    part.box.click()
    assert driver.session.light == ALL


def test_without_a_method_nothing_can_be_switched_on(make: Make) -> None:
    made = make()
    made.show(room())
    made.until(lambda: made.context.warm)
    part = section(made)
    assert not part.box.isEnabled()
    assert not part.box.isChecked()
    made.until(lambda: not made.window.actions_["shade.bounces"].isEnabled())


def shared(picture: Picture) -> Picture:
    """The picture as one of the share, which grows from left to right; nothing is seen in a corner."""
    height, width = picture.node.shape
    share = np.broadcast_to(np.linspace(0, 1, width, dtype=np.float32), (height, width)).copy()
    share[: height // 4, : width // 4] = np.nan
    return dataclasses.replace(picture, linear=linear_colours(share), share=share)


def test_false_colours_are_shown_as_they_are_with_a_legend(driver: Driver) -> None:
    driver.session.display(exposure=3.0, tonemap="filmic")
    plain = driver.feed.last.picture
    driver.viewport.set_picture(plain, driver.session.view)
    before = driver.viewport.grab_image()
    made = shared(plain)
    driver.viewport.set_picture(made, driver.session.view)
    image = driver.viewport.grab_image()
    middle, row = image.width() // 2, image.height() // 10
    expected = false_colours(np.array([0.5]))[0]
    colour = image.pixelColor(middle, row)
    np.testing.assert_allclose([colour.red(), colour.green(), colour.blue()], expected, atol=6)
    corner = (12 + 20, image.height() - 12 - 20)
    assert image.pixelColor(*corner) != before.pixelColor(*corner), "the legend lies there"
    shown = dataclasses.replace(driver.feed.last, picture=made)
    copied = shown_image(shown, 3.0, "filmic")
    np.testing.assert_array_equal(
        copied.pixelColor(5, copied.height() - 5).getRgb()[:3], tonemap(made.linear)[-5, 5]
    )


def test_the_share_is_told_under_the_mouse(driver: Driver) -> None:
    picture = shared(driver.feed.last.picture)
    driver.viewport.set_picture(picture, driver.session.view)
    probe = driver.viewport.probe(0.75, 0.9)
    assert probe.share == pytest.approx(0.75, abs=0.01)
    status = driver.window.status
    status.show_probe(probe, driver.document.scene)
    assert "75% from other surfaces" in status.pixel.text().replace("74%", "75%")
    status.show_probe(Probe(None, np.inf, (0.0, 0.0, 0.0), None, float("nan")), driver.document.scene)
    assert status.pixel.text() == "background"


def test_a_legend_keeps_to_its_corner(qapp: QApplication) -> None:
    image = QImage(400, 300, QImage.Format.Format_RGB32)
    image.fill(QColor("#ff00ff"))
    painter = QPainter(image)
    box = legend_box(painter, QSizeF(400, 300)).toAlignedRect()
    paint_legend(painter, QSizeF(400, 300))
    painter.end()
    assert box.left() >= 0
    assert box.bottom() < 300
    for x, y in ((0, 0), (399, 0), (399, 299), (box.center().x(), box.top() - 2)):
        assert image.pixelColor(x, y) == QColor("#ff00ff")
    assert image.pixelColor(box.center()) != QColor("#ff00ff")


def test_facts_are_told_in_words(driver: Driver) -> None:
    text = told_facts({"rays": 181000.0, "bytes": 7.25e6, "K": 16.0, "lobe_error": 0.214, "odd_things": 3.0})
    assert text == (
        "181,000 rays from every point, 7.2 MB in memory, 16 functions of a surface's gloss (K), "
        "21 % error of the sharpest gloss as a source, 3 odd things"
    )
    part, last = section(driver), driver.feed.last
    assert part.facts.isHidden()
    radiance = SimpleNamespace(**{**vars(last.picture.radiance), "facts": {"rays": 12.0}})
    picture = dataclasses.replace(last.picture, radiance=radiance)
    driver.feed.shown.emit(dataclasses.replace(last, picture=picture))
    assert part.facts.text() == "12 rays from every point"


def test_the_error_of_light_between_surfaces_is_told(driver: Driver) -> None:
    whole, own = Error(0.02, 0.001, 256), Error(0.05, 0.002, 256)
    status = driver.window.status
    status.show_error(MeasuredError(whole, whole, {}, own), {})
    assert status.error.text() == f"error: {whole}"
    assert f"of light between surfaces alone: {own}" in status.error.toolTip()
    status.show_error(MeasuredError(whole, whole), {})
    assert "between surfaces" not in status.error.toolTip()


def test_projects_remember_it() -> None:
    one = Session()
    one.bounce(False, "paths", {"samples": 64})
    one.show_light(DIRECT)
    other = Session()
    take_session(other, session_form(one), Scene(), [])
    assert (other.bouncing, other.indirect, other.light) == (False, "paths", DIRECT)
    assert other.indirect_params == {"paths": {"samples": 64}}
    take_session(other, {"bouncing": "no", "indirect": 7, "indirect_params": [], "light": "dim"}, Scene(), [])
    plain = Session()
    assert (other.bouncing, other.indirect, other.light) == (plain.bouncing, plain.indirect, plain.light)
    assert other.indirect_params == frozen_map()
