"""The window over the real core: plugins, compute thread, kernels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pytestqt.qtbot import QtBot
from ui_support import Answers, Driver, Fake, room

from studio.app import assemble
from studio_core.edits import Add, SetMaterial
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.reference import plugin as reference
from studio_ui.settings import Settings


def test_the_reference_backend_lights_the_room_in_the_window(qtbot: QtBot, tmp_path: Path) -> None:
    host = PluginHost([brdfs, reference])
    studio = assemble(settings=Settings(tmp_path), host=host, ask=Answers(), threads=1)
    driver = Driver(studio, Fake(), Answers(), qtbot)
    driver.patience = 300_000  # kernels may have to be compiled first
    try:
        driver.window.resize(700, 500)
        driver.session.shade_with("reference", {"vertices": 500, "directions": "1024"})
        sky = Environment(id="sky", name="Sky", image=Image(np.full((8, 16, 3), 0.5, np.float32)))
        driver.show(Add((sky,))(room()))
        picture = driver.feed.last.picture
        assert np.isfinite(picture.linear).all()
        assert set(picture.nodes) == {"seat", "back", "stool"}
        chair, stool = driver.at((-1.0, 0.5, 0.5)), driver.at((1.0, 0.5, 0.5))
        image = driver.viewport.grab_image()
        assert image.pixelColor(chair).red() > 2 * image.pixelColor(chair).green(), "the chair is red"
        driver.click((1.0, 0.5, 0.5))
        assert driver.session.selection == ("stool",)
        driver.document.apply(SetMaterial("blue", {"base_color": (0.05, 0.05, 0.6)}, model="ggx"))
        driver.settle()
        seen = driver.viewport.grab_image().pixelColor(stool)
        assert seen.blue() > 2 * seen.red()
        driver.until(lambda: driver.context.warm)
        assert driver.window.status.backend.text() == host.get("backend", "reference").label
        assert "roughness" in driver.window.panels["materials"].form.fields
        assert driver.problems() == []
    finally:
        driver.close()
