"""The capture panel: every control is an edit, what runs is the newest, nothing is lost."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from capture_support import CIRCLE, FOUND, FakeCapturer, FakeRun, bracket, kept, plugin
from names import nameless
from PySide6.QtCore import QPoint, Qt
from ui_support import Driver, Make, move_mouse, room

from studio_core.capturing.edits import add_capture
from studio_core.capturing.settings import RING, CaptureSettings, Shot
from studio_core.imaging.environment import load_environment
from studio_core.imaging.projection import OCAM, Circle, Lens
from studio_core.scene.capture import Capture
from studio_core.scene.nodes import Environment
from studio_core.shading.scheduler import InlineExecutor
from studio_plugins.brdfs import plugin as brdfs
from studio_ui.capture.desk import SOON_MS
from studio_ui.capture.feature import capture_behind
from studio_ui.capture.steps.photographs import LISTED, SIDE
from studio_ui.capture.telling import STEPS
from studio_ui.capture.tools.ring import ring_points


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeRun]:
    made = FakeRun()
    monkeypatch.setattr(FakeCapturer, "current", made)
    yield made
    if made.gate is not None:
        made.gate.set()


class Wizard:
    """A window with the panel open on a capture."""

    def __init__(self, driver: Driver, *, inline: bool = True) -> None:
        self.driver, self.panel = driver, driver.window.capture_panel
        self.desk = self.panel.desk
        driver.window.settings.set("capture_placed", True)
        if inline:
            self.desk.executor = InlineExecutor()
        self.photographs = bracket()
        self.desk.give({p.digest: p for p in self.photographs})
        edit = add_capture(tuple(kept(p) for p in self.photographs))
        driver.context.editing.apply(edit)
        self.node = edit.nodes[0].id
        driver.session.select([self.node])
        driver.do("object.edit_capture")
        dock = driver.window.docks["capture"]
        dock.setFloating(True)
        dock.resize(1000, 760)

    @property
    def work(self) -> Any:
        self.driver.until(lambda: self.panel.work is not None)
        return self.panel.work

    @property
    def capture(self) -> Capture:
        found = self.driver.document.scene[self.node]
        assert isinstance(found, Capture)
        return found

    def settle(self) -> None:
        self.driver.until(lambda: not self.desk.busy and not self.panel._soon.isActive())

    def go(self, step: str) -> Any:
        self.settle()
        self.work.go(step)
        return self.work.forms[step]


@pytest.fixture
def wizard(make: Make, run: FakeRun) -> Wizard:
    driver = make(plugins=(brdfs, plugin))
    driver.show(room())
    made = Wizard(driver)
    made.settle()
    return made


def test_all_steps_tell_what_they_have(wizard: Wizard, run: FakeRun) -> None:
    assert wizard.driver.problems() == []
    told = wizard.work.told()
    assert {step: found.mark for step, found in told.items()} == {
        "photographs": "done",
        "light": "warning",
        "lens": "warning",
        "reflections": "done",
        "join": "done",
        "calibration": "done",
        "result": "done",
    }
    assert told["photographs"].line == "3 front and 3 back, two lenses, a picture each"
    assert "Exposure 1 of the front is listed as" in told["light"].warnings[0]
    assert "circle of the back" in told["lens"].warnings[0]
    assert told["reflections"].line == "1 replaced"
    assert len(run.asked) == 1


def test_every_step_shows_something_and_has_names(wizard: Wizard) -> None:
    for step in STEPS:
        form = wizard.go(step.id)
        assert form.pictures()
        for name in form.pictures():
            wizard.work._look(name)
            shown = wizard.work.preview.view.shown
            assert shown is not None
            assert shown.pixels.size
            assert not wizard.work.preview.view.grab().isNull()
        assert nameless(wizard.panel) == []
    assert wizard.driver.problems() == []


def test_the_preview_shows_the_very_arrays(wizard: Wizard) -> None:
    state = wizard.desk.state
    found = {}
    for step in ("light", "join", "calibration", "result"):
        wizard.go(step)
        found[step] = wizard.work.preview.view.shown.pixels
    assert found["light"] is state.lights["front"].light
    assert found["join"] is state.stitched.light
    assert found["calibration"] is found["result"] is state.captured.environment.pixels
    wizard.go("reflections")
    shown = wizard.work.preview.view.shown
    assert shown.pixels is state.reflections.lights["front"]
    assert shown.before is state.lights["front"].light


# edits


def test_a_circle_is_dragged_nudged_and_found_again(wizard: Wizard, run: FakeRun) -> None:
    wizard.go("lens")
    view, document = wizard.work.preview.view, wizard.driver.document
    bot, steps = wizard.driver.bot, document.position
    middle = view.to_widget(CIRCLE.x, CIRCLE.y).toPoint()
    away = view.to_widget(CIRCLE.x + 10, CIRCLE.y + 5).toPoint()
    bot.mousePress(view, Qt.MouseButton.LeftButton, pos=middle)
    for share in (0.3, 0.6, 1.0):
        move_mouse(view, middle + (away - middle) * share)
    assert len(run.asked) == 1  # nothing is computed while it is dragged
    bot.mouseRelease(view, Qt.MouseButton.LeftButton, pos=away)
    assert document.position == steps + 1
    moved = wizard.capture.settings.lens.front
    assert (moved.x, moved.y) == pytest.approx((CIRCLE.x + 10, CIRCLE.y + 5), abs=0.8)
    assert moved.radius == CIRCLE.radius
    wizard.settle()
    assert run.asked[-1][1].lens.front == moved
    assert wizard.desk.state.circles["front"].circle == moved

    rim = view.to_widget(moved.x + moved.radius, moved.y).toPoint()
    bot.mousePress(view, Qt.MouseButton.LeftButton, pos=rim)
    move_mouse(view, rim + QPoint(30, 0))
    assert wizard.capture.settings.lens.front.radius > moved.radius + 1
    bot.keyClick(view, Qt.Key.Key_Escape)
    bot.mouseRelease(view, Qt.MouseButton.LeftButton, pos=rim)
    assert wizard.capture.settings.lens.front == moved
    assert document.position == steps + 1

    bot.keyClick(view, Qt.Key.Key_Left)
    bot.keyClick(view, Qt.Key.Key_Up, Qt.KeyboardModifier.AltModifier)
    assert wizard.capture.settings.lens.front == Circle(moved.x - 1, moved.y, moved.radius + 1)
    wizard.work.forms["lens"].again.click()
    assert wizard.capture.settings.lens.front is None
    for _ in range(4):
        wizard.driver.do("edit.undo")
    assert wizard.capture.settings == CaptureSettings()
    assert document.position == steps


def test_a_lens_is_typed_and_imported(wizard: Wizard, tmp_path: Path) -> None:
    form = wizard.go("lens")
    form.falloff.fields["falloff"].spin.setValue(30)
    assert wizard.capture.settings.lens.falloff == pytest.approx(0.3)
    wizard.settle()
    form.found_falloff.click()
    assert wizard.capture.settings.lens.falloff is None
    form.coefficients.sink.apply("coefficients", "0.1; x")
    assert wizard.driver.problems() == ["'x' is no number"]
    form.coefficients.sink.apply("coefficients", "0.1; -0.02")
    assert wizard.capture.settings.lens.coefficients == (0.1, -0.02)
    path = tmp_path / "calib_results.txt"
    path.write_text(
        "#polynomial\n5 -40 0 0.004 0 0\n#inverse\n2 60 30\n#centre\n45 60\n#affine\n1 0 0\n#size\n90 120\n"
    )
    wizard.driver.answers.files = [path]
    form.load(path)
    wizard.driver.idle()
    lens = wizard.capture.settings.lens
    assert lens.model == OCAM
    assert not lens.fit_fov
    assert lens.front is not None
    assert lens.back is None
    assert wizard.driver.labels()[-1] == "Import OCamCalib"


def test_rectangles_are_drawn_moved_switched_and_taken_away(wizard: Wizard, run: FakeRun) -> None:
    form = wizard.go("reflections")
    view, bot = wizard.work.preview.view, wizard.driver.bot
    lens, circle = Lens(), CIRCLE

    def at(azimuth: float, theta: float) -> QPoint:
        return view.to_widget(*(float(v) for v in ring_points(lens, circle, azimuth, theta))).toPoint()

    def drag(start: QPoint, end: QPoint) -> None:
        bot.mousePress(view, Qt.MouseButton.LeftButton, pos=start)
        move_mouse(view, (start + end) / 2)
        move_mouse(view, end)
        bot.mouseRelease(view, Qt.MouseButton.LeftButton, pos=end)

    steps = wizard.driver.document.position
    drag(at(200, 80), at(230, 93))
    assert wizard.driver.document.position == steps + 1
    found, drawn = wizard.capture.settings.reflections.patches
    assert found == FOUND  # what was found stays as it is
    assert drawn.azimuth == pytest.approx(200, abs=3)
    assert drawn.width == pytest.approx(30, abs=4)
    assert (drawn.inner, drawn.outer) == pytest.approx((80, 93), abs=1.5)
    assert form.patch == drawn

    drag(at(35, 89), at(75, 89))
    assert wizard.capture.settings.reflections.patches[0].azimuth == pytest.approx(60, abs=3)
    assert form.index == 0
    form.table.topLevelItem(1).setCheckState(0, Qt.CheckState.Unchecked)
    assert not wizard.capture.settings.reflections.patches[1].used
    form.fields.fields["width"].spin.setValue(44)
    assert wizard.capture.settings.reflections.patches[0].width == 44
    form.fields.fields["source"].combo.activated.emit(1)
    assert wizard.capture.settings.reflections.patches[0].source == RING
    bot.keyClick(view, Qt.Key.Key_Delete)
    assert len(wizard.capture.settings.reflections.patches) == 1
    form.again.click()
    assert wizard.capture.settings.reflections.patches is None
    wizard.settle()
    assert run.asked[-1][1] == CaptureSettings()


def test_the_joined_picture_is_turned_by_hand(wizard: Wizard, run: FakeRun) -> None:
    form = wizard.go("join")
    view, bot = wizard.work.preview.view, wizard.driver.bot
    start, end = view.to_widget(40, 32).toPoint(), view.to_widget(56, 32).toPoint()
    bot.mousePress(view, Qt.MouseButton.LeftButton, pos=start)
    move_mouse(view, end)
    wizard.work.refresh()
    assert view.turning is not None
    assert not view.grab().isNull()
    bot.mouseRelease(view, Qt.MouseButton.LeftButton, pos=end)
    stitch = wizard.capture.settings.stitch
    assert stitch.north == pytest.approx(45, abs=2)  # 16 of 128 pixels to the right
    assert (stitch.pitch, stitch.roll) == pytest.approx((0, 0), abs=2)
    wizard.settle()
    assert form.turned() is None
    assert view.turning is None
    bot.keyClick(view, Qt.Key.Key_Up)
    assert wizard.capture.settings.stitch.pitch != stitch.pitch
    assert run.asked[-1][1].stitch == stitch


def test_places_are_clicked(wizard: Wizard) -> None:
    form = wizard.go("calibration")
    view, bot = wizard.work.preview.view, wizard.driver.bot
    form.forms["calibration"].fields["white"].combo.activated.emit(2)
    wizard.settle()
    assert form.picks["card"].isChecked()
    bot.mouseClick(view, Qt.MouseButton.LeftButton, pos=view.to_widget(32, 16).toPoint())
    assert wizard.capture.settings.calibration.card == pytest.approx((0.25, 0.25), abs=0.01)
    form.forms["calibration"].fields["scale"].combo.activated.emit(1)
    wizard.settle()
    form.facing.activated.emit(form.facing.findText("the left"))
    assert wizard.capture.settings.calibration.facing == (1.0, 0.0, 0.0)
    form.facing.activated.emit(form.facing.count() - 1)
    wizard.settle()
    form.picks["facing"].setChecked(True)
    assert not form.picks["card"].isChecked()
    bot.mouseClick(view, Qt.MouseButton.LeftButton, pos=view.to_widget(64, 32).toPoint())
    assert wizard.capture.settings.calibration.facing == pytest.approx((0, 0, 1), abs=0.05)
    wizard.settle()
    assert "80 cd/m²" in form.told.text()


def test_photographs_are_typed_left_out_and_moved(wizard: Wizard, run: FakeRun) -> None:
    form = wizard.go("photographs")
    first = form.table.topLevelItem(0)
    digest = form.rows[0].kept.digest
    assert [form.table.topLevelItem(i).text(0) for i in range(6)] == [
        f"{side}{i}.jpg" for side in ("front", "back") for i in range(3)
    ]
    first.setText(LISTED, "-1,5")
    assert wizard.capture.settings.bracket.shots == (Shot(digest, ev=-1.5),)
    first.setText(LISTED, "much")
    assert wizard.capture.settings.bracket.shots == (Shot(digest, ev=-1.5),)
    assert len(wizard.driver.problems()) == 1
    first.setText(SIDE, "Back")
    form.table.topLevelItem(5).setCheckState(0, Qt.CheckState.Unchecked)
    shots = {shot.photograph: shot for shot in wizard.capture.settings.bracket.shots}
    assert shots[digest] == Shot(digest, "back", -1.5)
    assert not shots[form.rows[5].kept.digest].used
    wizard.settle()
    assert len(run.asked[-1][0]) == 6
    form.table.topLevelItem(0).setText(LISTED, "")
    form.table.topLevelItem(0).setText(SIDE, "as found")
    assert [shot.used for shot in wizard.capture.settings.bracket.shots] == [False]
    form.table.setCurrentItem(form.table.topLevelItem(1))
    assert wizard.work.preview.view.shown.pixels is wizard.photographs[1].pixels
    form.remove.click()
    assert len(wizard.capture.photographs) == 5
    wizard.driver.do("edit.undo")
    assert len(wizard.capture.photographs) == 6


def test_the_light_goes_into_the_scene_and_into_files(wizard: Wizard, tmp_path: Path) -> None:
    form = wizard.go("result")
    captured = wizard.desk.state.captured
    form.use.click()
    scene = wizard.driver.document.scene
    lit = next(scene.of(Environment))
    assert lit.image is captured.environment
    assert wizard.capture.environment == lit.id
    assert form.lit.text() == "Capture lights the scene with this."
    assert capture_behind(scene, lit.id) == wizard.node
    assert capture_behind(scene, "stool") is None
    wizard.driver.answers.target = tmp_path / "room.exr"
    form.save_around()
    wizard.driver.idle()
    image, _ = load_environment(tmp_path / "room.exr")
    assert np.array_equal(image.pixels, captured.environment.pixels)
    wizard.driver.answers.target = tmp_path / "faces"
    form.save_cube("six")
    wizard.driver.idle()
    assert len(list((tmp_path / "faces").iterdir())) == 6
    assert wizard.driver.problems() == []
    wizard.driver.do("edit.undo")
    assert next(wizard.driver.document.scene.of(Environment), None) is None
    wizard.settle()
    wizard.work.refresh()
    assert form.lit.text() == "Nothing is lit by it yet."


# running


@pytest.fixture
def slow(make: Make, run: FakeRun) -> Wizard:
    """Computes on threads and stops at the lens."""
    run.gate = threading.Event()
    driver = make(threads=True, plugins=(brdfs, plugin))
    driver.show(room())
    return Wizard(driver, inline=False)


def test_the_newest_settings_win(slow: Wizard, run: FakeRun) -> None:
    desk, work = slow.desk, slow.work
    slow.driver.until(lambda: "lights" in desk.fresh)
    told = work.told()  # what is there is shown while the rest is computed
    assert (told["light"].mark, told["lens"].mark) == ("warning", "working")
    assert told["result"].mark == "waiting"
    slow.driver.until(run.started.is_set)
    run.started.clear()
    desk.apply("lens", "Field of view", fov=200.0)
    desk.apply("lens", "Field of view", fov=205.0)
    slow.driver.until(run.started.is_set)
    run.gate.set()
    slow.settle()
    assert [asked[1].lens.fov for asked in run.asked] == [190.0, 205.0]
    assert desk.state.captured.report["lens"]["fov"] == 205.0
    assert work.told()["result"].mark == "done"
    assert slow.driver.problems() == []


def test_a_cancelled_run_keeps_what_is_there(slow: Wizard, run: FakeRun) -> None:
    desk, work = slow.desk, slow.work
    run.gate.set()
    slow.settle()
    before = desk.state
    run.gate.clear()
    run.started.clear()
    desk.apply("radiance", "Ghosts", ghosts=False)
    slow.driver.until(run.started.is_set)
    slow.driver.until(lambda: work.stop.isVisible())
    work.stop.click()
    slow.settle()
    assert desk.state.captured is before.captured
    assert "captured" not in desk.fresh
    assert not slow.go("result").use.isEnabled()
    assert work.preview.view.remark == "from earlier settings"
    assert "Cancelled" in desk.error
    assert work.again.isVisible()
    run.gate.set()
    work.again.click()
    slow.settle()
    assert "captured" in desk.fresh
    assert desk.error == ""
    slow.driver.until(lambda: work.preview.view.remark == "")


def test_the_window_closes_while_something_is_computed(slow: Wizard, run: FakeRun) -> None:
    slow.driver.until(run.started.is_set)
    desk = slow.desk
    slow.driver.close()
    assert desk.executor is not None
    assert desk.task is None or desk.task.job.cancelled
    assert not desk.executor._thread.is_alive()


def test_what_fails_is_told_where_it_failed(wizard: Wizard, run: FakeRun) -> None:
    run.fail = "registration"
    wizard.desk.apply("lens", "Field of view", fov=200.0)
    wizard.settle()
    told = wizard.work.told()
    assert told["light"].mark == "warning"
    assert told["reflections"].mark == "error"
    assert told["reflections"].line == "the registration did not work"
    assert told["result"].mark == "waiting"
    run.fail = ""
    wizard.driver.do("edit.undo")
    wizard.settle()
    assert wizard.work.told()["result"].mark == "done"


def test_nothing_is_computed_while_nobody_looks(wizard: Wizard, run: FakeRun) -> None:
    wizard.driver.window.docks["capture"].hide()
    wizard.desk.apply("lens", "Field of view", fov=200.0)
    wizard.driver.bot.wait(2 * SOON_MS)
    assert len(run.asked) == 1
    wizard.driver.window.layout_.show("capture")
    wizard.driver.until(lambda: len(run.asked) == 2)
    wizard.settle()


def test_undo_and_another_project_take_the_capture_away(wizard: Wizard) -> None:
    wizard.driver.do("edit.undo")
    wizard.driver.until(lambda: wizard.panel.empty.isVisible())
    assert wizard.desk.capture is None
    wizard.driver.do("edit.redo")
    wizard.driver.until(lambda: wizard.work.isVisible())
    assert wizard.desk.capture is wizard.capture
    wizard.driver.show(room())
    wizard.driver.until(lambda: wizard.panel.empty.isVisible() and not wizard.desk.busy)


def test_where_it_is_narrow_the_preview_is_above(wizard: Wizard) -> None:
    dock = wizard.driver.window.docks["capture"]
    dock.setFloating(True)
    for width, orientation in ((1100, Qt.Orientation.Horizontal), (420, Qt.Orientation.Vertical)):
        dock.resize(width, 800)
        wizard.driver.until(lambda o=orientation: wizard.work.split.orientation() == o)
        for step in STEPS:
            wizard.go(step.id)
            assert wizard.work.minimumSizeHint().width() <= dock.width()
    wizard.work.steps.next.click()
    assert wizard.work.step == "result"
    wizard.work.steps.back.click()
    assert wizard.work.step == "calibration"
