"""What a material looks like beside its form: ball, lobe, albedo, thumbnails, known colours."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QImage
from pytestqt.qtbot import QtBot
from ui_support import Driver

from studio_core.edits import Add, SetFields, SetMaterial
from studio_core.metals import METALS
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment
from studio_ui.forms.colour_menu import tempered
from studio_ui.forms.fields import ColourField, NumberField
from studio_ui.look.theme import LIGHT
from studio_ui.material_view.albedo_plot import AlbedoPlot
from studio_ui.material_view.polar_plot import PolarPlot
from studio_ui.material_view.strip import MaterialStrip
from studio_ui.material_view.work import ALBEDO_ANGLES, PreviewWork
from studio_ui.panels.materials import MaterialsPanel


def shown(driver: Driver, material: str = "red") -> MaterialsPanel:
    """The panel where it is seen, on that material, all previews there."""
    panel: MaterialsPanel = driver.window.panels["materials"]
    dock: Any = panel
    while dock is not None and not hasattr(dock, "toggleViewAction"):
        dock = dock.parentWidget()
    dock.show()
    dock.raise_()
    driver.until(lambda: driver.context.warm and panel.strip.isVisible() and material in panel.list.rows)
    panel.choose(material)
    rest(driver, panel)
    return panel


def rest(driver: Driver, panel: MaterialsPanel) -> None:
    """Until what is seen is what is wished for."""
    strip = panel.strip

    def still() -> bool:
        if panel.work.busy or strip.seen is None or panel._relit.isActive():
            return False
        return strip.seen.wish == strip.wish()

    driver.until(still)


def middle(image: QImage | None) -> tuple[int, int, int]:
    assert image is not None
    colour = image.pixelColor(image.width() // 2, image.height() // 2)
    return colour.red(), colour.green(), colour.blue()


def lit(level: float) -> Environment:
    return Environment(id="sky", name="Sky", image=Image(np.full((16, 32, 3), level, np.float32)))


def test_the_ball_stands_in_the_scenes_light_as_the_view_shows_it(driver: Driver) -> None:
    panel = shown(driver)
    assert panel.strip.seen is not None
    assert panel.strip.seen.neutral
    assert "neutral" in panel.strip.ball.toolTip()
    driver.document.apply(Add((lit(0.5),), ()))
    rest(driver, panel)
    assert not panel.strip.seen.neutral
    assert "Sky" in panel.strip.ball.toolTip()
    ball = panel.strip.seen.own.ball
    assert ball is not None
    red, green, _ = middle(panel.strip.ball.image)
    assert red > 2 * green
    made = panel.work.made
    driver.session.display(exposure=-2.0)
    assert middle(panel.strip.ball.image)[0] < 0.7 * red
    driver.document.apply(SetFields("sky", {"intensity": 4.0}))
    rest(driver, panel)
    assert middle(panel.strip.ball.image) == (red, green, middle(panel.strip.ball.image)[2])
    assert panel.strip.seen.own.ball is ball  # the light's strength sums nothing anew
    assert panel.work.made == made


def test_a_dragged_slider_is_followed_and_is_one_step(driver: Driver) -> None:
    panel = shown(driver)
    strip, history = panel.strip, len(driver.labels())
    strip.shown["Albedo"].setChecked(True)
    rest(driver, panel)
    field = panel.form.fields["roughness"] if panel.form else None
    assert isinstance(field, NumberField)
    assert field.slider is not None
    balls = panel.work._bench._balls
    assert balls is not None
    before, first, made = dict(balls.counts), strip.ball.image, panel.work.made
    field.slider.setSliderDown(True)
    peaks = []
    for step in (450, 400, 350, 300):
        field.slider.setValue(step)
        rest(driver, panel)
        assert strip.seen is not None
        assert strip.seen.wish.quick
        peaks.append(strip.lobe.peak)
    assert peaks == sorted(peaks)  # smoother: a sharper lobe at every step
    assert balls.counts["gathered"] == before["gathered"]  # no light is looked up
    assert panel.work.made - made == 4  # lists wait until the hand rests
    field.slider.setSliderDown(False)
    rest(driver, panel)
    assert not strip.seen.wish.quick
    assert strip.ball.image != first
    assert len(driver.labels()) == history + 1
    driver.context.editing.undo()
    rest(driver, panel)
    assert strip.ball.image == first


def test_nothing_is_made_while_it_is_not_seen(driver: Driver) -> None:
    panel = shown(driver)
    panel.strip.fold.setChecked(False)
    assert panel.strip.wish() is None
    assert not panel.strip.ball.isVisible()
    panel.strip.fold.setChecked(True)
    rest(driver, panel)
    panel.strip.shown["Ball"].setChecked(False)
    panel.strip.shown["Lobe"].setChecked(False)
    panel.strip.shown["Albedo"].setChecked(True)
    rest(driver, panel)
    seen = panel.strip.seen
    assert seen is not None
    assert (seen.own.ball, seen.own.lobe) == (None, None)
    assert seen.own.albedo is not None
    assert seen.own.albedo.shape == (len(ALBEDO_ANGLES), 3)
    panel.window().hide()
    made = panel.work.made
    driver.document.apply(SetMaterial("red", {"roughness": 0.9}))
    driver.bot.wait(1)
    assert panel.work.made == made


def test_another_material_is_compared(driver: Driver) -> None:
    panel = shown(driver)
    strip = panel.strip
    assert [strip.compare.itemText(i) for i in range(strip.compare.count())] == ["Compare with…", "Blue"]
    strip.compare.setCurrentIndex(1)
    strip.compare.activated.emit(1)
    rest(driver, panel)
    assert strip.seen is not None
    assert strip.seen.other is not None
    assert strip.seen.other.lobe is not None
    assert "right Blue" in strip.ball.toolTip()
    grab = strip.ball.grab().toImage()
    y = grab.height() // 2
    left, right = (grab.pixelColor(grab.width() * part // 8, y) for part in (3, 5))
    assert left.red() > 1.5 * left.blue()
    assert abs(right.red() - right.blue()) < 12
    panel.choose("blue")  # what is compared with is now the material itself
    assert strip.compare.currentIndex() == 0
    rest(driver, panel)
    assert strip.seen.other is None


def test_the_light_of_the_lobe_is_dragged(driver: Driver) -> None:
    panel = shown(driver)
    plot = panel.strip.lobe
    foot, radius = plot._place()
    aim = QPoint(
        round(foot.x() - 0.8 * radius * np.sin(np.radians(70))), round(foot.y() - 0.8 * radius * 0.342)
    )
    driver.bot.mousePress(plot, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, aim)
    driver.bot.mouseRelease(plot, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, aim)
    assert plot.incidence == pytest.approx(70, abs=3)
    rest(driver, panel)
    assert panel.strip.seen is not None
    assert panel.strip.seen.wish.incidence == plot.incidence == panel.strip.albedo.incidence
    driver.bot.keyClick(plot, Qt.Key.Key_Right)
    assert plot.incidence == pytest.approx(65, abs=3)
    assert len(driver.labels()) == 1  # only looked at


def test_lists_show_balls_that_follow_their_materials(driver: Driver) -> None:
    panel = shown(driver)
    row = panel.list.rows["red"]
    icon = row.icon(0).pixmap(30, 30).toImage()
    assert middle(icon)[0] > 1.5 * middle(icon)[1]
    driver.document.apply(SetMaterial("red", {"base_color": (0.05, 0.1, 0.6)}))
    driver.until(lambda: middle(panel.list.rows["red"].icon(0).pixmap(30, 30).toImage())[2] > 100)
    rest(driver, panel)
    made = panel.work.made
    driver.context.editing.undo()
    driver.until(lambda: middle(panel.list.rows["red"].icon(0).pixmap(30, 30).toImage())[0] > 100)
    rest(driver, panel)
    assert panel.work.made == made + 1  # the large ball; the small one was kept


def test_a_metal_is_chosen_from_the_colours_menu(driver: Driver) -> None:
    panel = shown(driver)
    field = panel.form.fields["base_color"] if panel.form else None
    assert isinstance(field, ColourField)
    assert field.menu is not None
    field.menu.fill()
    names = [action.text() for action in field.menu.metals.actions()]
    assert names == [metal.name for metal in METALS]
    field.menu.metals.actions()[names.index("Copper")].trigger()
    values = driver.document.scene.material("red").values
    assert values["base_color"] == METALS[2].colour
    assert values["metallic"] == 1.0
    assert driver.labels()[-1] == "Copper for Red"
    driver.context.editing.undo()
    assert driver.document.scene.material("red").values["base_color"] == (0.6, 0.1, 0.1)
    warm = next(a for a in field.menu.temperatures.actions() if a.text().startswith("2700"))
    warm.trigger()
    red, green, blue = driver.document.scene.material("red").values["base_color"]  # type: ignore[misc]
    assert red > green > blue


def test_a_temperature_keeps_how_light_a_colour_is() -> None:
    from studio_core.colour import luminance

    for degrees in (1900, 4000, 12000):
        assert luminance(tempered((0.1, 0.2, 0.3), degrees)) == pytest.approx(luminance((0.1, 0.2, 0.3)))
        assert max(tempered((1.0, 1.0, 1.0), degrees)) == pytest.approx(1.0)
        assert min(tempered((0.0, 0.0, 0.0), degrees)) >= 0


def test_views_lie_side_by_side_where_there_is_room(driver: Driver, qtbot: QtBot) -> None:
    strip = MaterialStrip(driver.context, PreviewWork(driver.context))
    qtbot.addWidget(strip)
    strip.show()
    strip.shown["Albedo"].setChecked(True)

    def rows(width: int) -> int:
        strip.resize(width, 300)
        views = (strip.ball, strip.lobe, strip.albedo)
        found = {strip._grid.getItemPosition(strip._grid.indexOf(view))[0] for view in views}  # type: ignore[index]
        return len(found)

    assert [rows(width) for width in (500, 290, 150, 500)] == [1, 2, 3, 1]
    strip.resize(300, strip.minimumSizeHint().height() + 20)
    assert not strip.ball.isVisible()  # no room: nothing is made, and the form has it
    assert strip.wish() is None
    strip.resize(300, strip.sizeHint().height())
    assert strip.ball.isVisible()
    strip.shown["Lobe"].setChecked(False)
    assert strip._grid.count() == 2
    strip.close_strip()


def test_plots_draw_and_tell(qtbot: QtBot) -> None:
    polar, albedo = PolarPlot(), AlbedoPlot()
    angles = np.linspace(-90, 90, 91)
    lobe = (angles, np.cos(np.radians(angles))[:, None] * [1.0, 0.5, 0.2])
    share = np.repeat([[0.6, 0.4, 0.2]], len(ALBEDO_ANGLES), axis=0)
    for plot, show in (
        (polar, lambda: polar.show_lobe(lobe, None)),
        (albedo, lambda: albedo.show_albedo(share, share / 3)),
    ):
        qtbot.addWidget(plot)
        plot.resize(200, 140)
        empty = plot.grab().toImage()
        show()
        drawn = plot.grab().toImage()
        assert drawn != empty
        assert len(plot.curves(share)) == 3
        plot.luminance = True
        assert len(plot.curves(share)) == 1
        assert plot.grab().toImage() != drawn
        plot.set_theme(LIGHT)
        assert plot.grab().toImage() != drawn
    assert not albedo.gives_light
    albedo.show_albedo(np.full((len(ALBEDO_ANGLES), 3), 1.2), None)
    assert "not possible" in albedo.toolTip()
    polar.logarithmic = True
    np.testing.assert_allclose(polar._share(np.array([polar.peak, polar.peak / 100, 0.0])), [1, 0.5, 0])
