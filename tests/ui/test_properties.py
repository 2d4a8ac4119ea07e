"""The properties panel: several things at once, places and sizes, what numbers of lights and cameras mean."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import Qt
from ui_support import Driver, box, room

from studio_core.edits import Add, Move, SetFields
from studio_core.scene.geometry import Geometry, Image
from studio_core.scene.nodes import (
    AreaLamp,
    Camera,
    DirectionalLamp,
    Environment,
    MeshObject,
    PointLamp,
    SpotLamp,
)
from studio_core.scene.size import own_size, pivot_words, resized
from studio_core.scene.transform import Transform, axis_angle
from studio_ui.forms.spin import MIXED
from studio_ui.panels.light_fields import kelvin_colour, to_fov, to_lens
from studio_ui.panels.light_hints import kelvin_words, light_hint, paper_radiance, to_ev

LAMPS = (
    PointLamp(id="a", name="Left", intensity=2.0),
    PointLamp(id="b", name="Right", intensity=8.0),
    SpotLamp(id="c", name="Spot", intensity=8.0, temperature=2700.0),
)


def panel_on(driver: Driver, *nodes: str) -> Any:
    panel = driver.window.panels["properties"]
    driver.session.select(nodes)
    driver.until(lambda: panel.nodes == nodes)
    return panel


def type_in(driver: Driver, spin: Any, text: str) -> None:
    spin.setFocus()
    spin.selectAll()
    driver.bot.keyClicks(spin, text)
    driver.bot.keyClick(spin, Qt.Key.Key_Return)


def test_several_lamps_are_edited_at_once(driver: Driver) -> None:
    driver.document.apply(Add(LAMPS))
    panel = panel_on(driver, "a", "b", "c")
    assert set(panel.form.fields) == {"name", "intensity", "tint", "temperature"}, "what all of them have"
    intensity, temperature = panel.form.fields["intensity"], panel.form.fields["temperature"]
    assert MIXED in intensity.spin.text()
    assert MIXED in intensity.other.text()
    type_in(driver, intensity.spin, "8")
    scene = driver.document.scene
    assert [scene[n].intensity for n in "abc"] == [8.0, 8.0, 8.0], "also what one of them was already"
    assert driver.labels()[2:] == ["Intensity of 3 lights"]
    driver.until(lambda: intensity.spin.text() == "8")
    assert intensity.other.text() == "3 EV"
    assert MIXED in temperature.spin.text()
    panel_on(driver, "c", "a")
    temperature = panel.form.fields["temperature"]
    assert temperature.spin.text() == MIXED, "the last of them has none"
    panel_on(driver, "a", "b", "c")
    intensity = panel.form.fields["intensity"]
    driver.do("edit.undo")
    assert [driver.document.scene[n].intensity for n in "abc"] == [2.0, 8.0, 8.0]
    driver.until(lambda: MIXED in intensity.spin.text())


def test_a_slider_over_several_is_one_step(driver: Driver) -> None:
    driver.document.apply(Add(LAMPS))
    panel = panel_on(driver, "a", "b")
    slider = panel.form.fields["temperature"].slider
    slider.setSliderDown(True)
    for step in (100, 400):
        slider.setValue(step)
    slider.setSliderDown(False)
    scene = driver.document.scene
    assert scene["a"].temperature == scene["b"].temperature == pytest.approx(1700 + 0.4 * 10300)
    assert driver.labels()[2:] == ["Temperature of 2 point lamps"]


def test_leaving_a_field_of_several_values_changes_nothing(driver: Driver) -> None:
    panel = panel_on(driver, "seat", "stool")
    for spin in panel.place.position.spins:
        spin.setFocus()
        driver.bot.keyClick(spin, Qt.Key.Key_Return)
    name = panel.form.fields["name"].edit
    assert (name.text(), name.placeholderText()) == ("", MIXED)
    name.setFocus()
    driver.bot.keyClick(name, Qt.Key.Key_Return)
    assert driver.labels() == ["Open"]
    assert MIXED in panel.place.position.spins[0].text()


def test_names_and_flags_of_several(driver: Driver) -> None:
    driver.document.apply(SetFields("seat", {"locked": True}))
    panel = panel_on(driver, "seat", "stool")
    locked = panel.flags.fields["locked"].box
    assert locked.checkState() is Qt.CheckState.PartiallyChecked
    locked.click()
    assert driver.document.scene["stool"].locked
    assert driver.document.scene["seat"].locked
    driver.until(lambda: locked.checkState() is Qt.CheckState.Checked)
    locked.click()
    assert not driver.document.scene["seat"].locked
    edit = panel.form.fields["name"].edit
    edit.setText("Part")
    edit.editingFinished.emit()
    assert [driver.document.scene[n].name for n in ("seat", "stool")] == ["Part 1", "Part 2"]
    assert driver.labels()[2:] == ["Locked of 2 objects", "Locked of 2 objects", "Name of 2 objects"]


def test_one_coordinate_of_several(driver: Driver) -> None:
    panel = panel_on(driver, "chair", "stool")
    type_in(driver, panel.place.position.spins[2], "1.5")
    scene = driver.document.scene
    assert scene["chair"].transform.translation == (-1.0, 0.0, 1.5)
    assert scene["stool"].transform.translation == (1.0, 0.0, 1.5)
    assert driver.labels()[1:] == ["Move 2 objects"]


def test_a_typed_size_scales_and_leaves_it_standing(driver: Driver) -> None:
    turned = Transform((1.0, 0.25, 0.0), axis_angle((0, 1, 0), 30.0), 0.5)
    driver.document.apply(Move({"stool": turned}))
    panel = panel_on(driver, "stool")
    assert [spin.text() for spin in panel.place.size.spins] == ["0.5", "0.5", "0.5"], "not of the box around"
    type_in(driver, panel.place.size.spins[2], "2")
    made = driver.document.scene["stool"].transform
    assert made.scale == pytest.approx(2.0)
    assert made.translation == pytest.approx((1.0, 0.25, 0.0)), "its base is its pivot"
    assert driver.labels()[2:] == ["Resize Stool"]
    assert panel.place.pivot.text() == "Pivot at its base, in the middle"
    driver.until(lambda: not panel.place.resets["rotation"].isHidden())
    panel.place.resets["rotation"].click()
    assert driver.document.scene["stool"].transform.rotation == (1.0, 0.0, 0.0, 0.0)
    driver.until(lambda: panel.place.resets["rotation"].isHidden())


@given(
    st.floats(0.05, 20),
    st.floats(-180, 180),
    st.floats(0.1, 10),
    st.tuples(*[st.floats(-5, 5)] * 3),
)
def test_resizing_keeps_the_middle_of_the_base(
    factor: float, angle: float, scale: float, place: tuple[float, float, float]
) -> None:
    mesh = MeshObject(
        id="m",
        geometry=box(1.3),
        materials=("red",),
        parent="chair",
        transform=Transform(place, axis_angle((0.3, 1, 0.2), angle), scale),
    )
    before = Add((mesh,))(room())
    after = Move({"m": resized(before, "m", factor)})(before)
    base = np.array([0, 0, 0, 1.0])
    moved = after.world("m").matrix() @ base - before.world("m").matrix() @ base
    assert np.abs(moved).max() < 1e-9 * max(1, factor * scale)
    old, new = own_size(before, "m"), own_size(after, "m")
    assert old is not None
    assert new == pytest.approx([side * factor for side in old])
    assert old == pytest.approx([1.3 * scale] * 3, rel=1e-6), "turning makes nothing wider"


@pytest.mark.parametrize(
    ("low", "words"),
    [
        ((-0.5, 0.0, -0.5), "at its base, in the middle"),
        ((-0.5, -1.0, -0.5), "at its top, in the middle"),
        ((-0.5, -0.5, -0.5), "at half its height, in the middle"),
        ((0.0, -0.2, -0.5), "0.40 m above its base, 1.00 m from the middle"),
        ((-0.5, 0.3, -0.5), "0.60 m below its base, in the middle"),
    ],
)
def test_the_pivot_is_told(low: tuple[float, float, float], words: str) -> None:
    corners = box().positions - box().positions.min(axis=0) + np.array(low, np.float32)
    geometry = Geometry(corners, box().faces)
    mesh = MeshObject(id="m", geometry=geometry, materials=("red",), transform=Transform(scale=2.0))
    scene = Add((mesh,))(room())
    assert pivot_words(scene, "m") == words
    assert pivot_words(Add((Camera(id="c"),))(scene), "c") == ""


def test_materials_of_several(driver: Driver) -> None:
    panel = panel_on(driver, "seat", "stool")
    (combo,) = panel.slots
    assert combo.currentIndex() == -1
    combo.setCurrentIndex(combo.findData("blue"))
    combo.activated.emit(combo.currentIndex())
    assert driver.document.scene["seat"].materials == ("blue",)
    assert driver.labels()[1:] == ["Blue on 2 objects"]


def test_a_camera_has_a_lens(driver: Driver) -> None:
    driver.document.apply(Add((Camera(id="camera", fov=45.0),)))
    panel = panel_on(driver, "camera")
    fov = panel.form.fields["fov"]
    assert fov.other.text() == "29 mm"
    type_in(driver, fov.other, "50")
    assert driver.document.scene["camera"].fov == pytest.approx(26.99, abs=0.01)
    assert to_lens(2 * math.degrees(math.atan(12 / 35))) == pytest.approx(35)


@given(st.floats(1.0, 170.0))
def test_lenses_and_angles_go_back_and_forth(fov: float) -> None:
    assert to_fov(to_lens(fov)) == pytest.approx(fov)


def test_defaults_are_brought_back(driver: Driver) -> None:
    driver.document.apply(Add((PointLamp(id="a", intensity=2.0, temperature=2700.0),)))
    panel = panel_on(driver, "a")
    reset = panel.form._resets["temperature"]
    assert not reset.isHidden()
    assert panel.form._resets["tint"].isHidden()
    reset.click()
    assert driver.document.scene["a"].temperature == 0.0
    driver.until(reset.isHidden)
    assert panel.form.fields["temperature"].spin.text() == "none"


def test_paper_is_as_bright_as_light_makes_it() -> None:
    """Against a sum over a fine grid of the rectangle; small ones are like a point of their power."""
    lamp = AreaLamp(id="x", intensity=2.0, width=1.4, height=0.6)
    x = (np.arange(400) + 0.5) / 400 - 0.5
    across, up = np.meshgrid(1.4 * x, 0.6 * x)
    distance = across**2 + up**2 + 1
    irradiance = 2.0 * (1 / distance**2).mean() * 1.4 * 0.6
    assert paper_radiance(lamp) == pytest.approx(irradiance / math.pi, rel=1e-4)
    assert paper_radiance(PointLamp(id="x", intensity=math.pi)) == pytest.approx(1.0)
    warm = PointLamp(id="x", intensity=math.pi, temperature=2700.0)
    assert paper_radiance(warm) == pytest.approx(1.0), "kelvin changes the colour alone"
    assert paper_radiance(Environment(id="x", image=Image(np.ones((2, 4, 3), np.float32)))) is None
    assert light_hint(PointLamp(id="x", intensity=math.pi * 4)) == "White paper 1 m away: 2.0 EV over white"
    assert light_hint(DirectionalLamp(id="x", intensity=math.pi)) == "White paper in it: display white"
    assert light_hint(PointLamp(id="x", intensity=0.0)) == "Gives no light"
    assert light_hint(PointLamp(id="x", intensity=2.0), 250.0).endswith(", 500 cd")


def test_kelvin_has_words_and_colours() -> None:
    assert kelvin_words(0) == "as the tint has it"
    assert kelvin_words(2700) == "warm white, a bulb"
    assert kelvin_words(25000) == "blue sky"
    warm, cold = kelvin_colour(1800), kelvin_colour(11000)
    assert warm.red() > 2 * warm.blue()
    assert cold.blue() > cold.red()
    assert to_ev(8) == 3
    assert to_ev(0) == -math.inf
