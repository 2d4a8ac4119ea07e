"""The panel with the stages that the program brings, on photographs that a simulated phone took."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ui_support import Make, room

from studio.bench.phone import Arc, Phone, shoot
from studio.bench.phone_files import write_shots
from studio_core.imaging.environment import load_environment
from studio_core.imaging.projection import Circle, Lens
from studio_core.scene.nodes import Environment
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.capture import plugin as capture


@pytest.mark.slow
def test_a_room_from_photographs_to_the_scenes_light(make: Make, tmp_path: Path, shared_data: Path) -> None:
    image, _ = load_environment(shared_data / "cc0/hdri_polyhaven_cc0/interior.exr")
    phone = Phone(
        size=(405, 330),
        circle=Circle(200.0, 165.0, 150.0),
        lens=Lens(fov=195),
        evs=(-3.0, 0.0, 3.0),
        arcs=(Arc("front", 40, 40, 6, 1.2),),
        jpeg=95,
    )
    front, back = write_shots(shoot(image.pixels[..., :3], phone, 1), tmp_path)
    driver = make(threads=True, plugins=(brdfs, capture))
    driver.patience = 120_000
    driver.window.settings.set("capture_placed", True)
    driver.show(room())
    driver.window.take_files([*front, *back])
    panel = driver.window.capture_panel
    desk = panel.desk
    driver.until(lambda: desk.capture is not None)
    desk.apply("stitch", "Width", width=256)
    driver.until(lambda: "captured" in desk.fresh and not desk.busy)
    work = panel.work
    told = work.told()
    assert told["photographs"].line.startswith("3 front and 3 back")
    assert {found.mark for found in told.values()} <= {"done", "warning"}
    assert desk.state.registration.lens.fov == pytest.approx(195, abs=1.5)
    for side in ("front", "back"):
        assert desk.state.circles[side].circle.radius == pytest.approx(150, abs=3)
    for step in work.forms:
        work.go(step)
        assert work.preview.view.shown is not None
        assert not panel.grab().isNull()

    before = desk.state.stitched.light
    desk.apply("stitch", "Turn", north=90.0)
    driver.until(lambda: "captured" in desk.fresh and not desk.busy)
    moved = np.roll(before, 64, axis=1)
    assert np.median(np.abs(np.log2((desk.state.stitched.light + 1e-4) / (moved + 1e-4)))) < 0.1
    work.go("result")
    work.forms["result"].use.click()
    lit = next(driver.document.scene.of(Environment))
    assert lit.image is desk.state.captured.environment
    assert driver.problems() == []
