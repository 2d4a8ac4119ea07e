"""Pictures out of the window: what is ordered, how it goes, what is left."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from names import nameless
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication, QImage
from PySide6.QtWidgets import QAbstractButton, QComboBox, QLineEdit
from scenes import little_scene
from ui_support import Driver, Make, room

import studio_ui.pictures.child as child
from studio.cli import parser
from studio_core.arrays import frozen_map
from studio_core.errors import Cancelled, InputError, LucarneError
from studio_core.imaging.io import read_image
from studio_core.kernels.tonemap import tonemap
from studio_core.project.store import load, save
from studio_core.scene.nodes import Camera
from studio_core.scene.transform import looking
from studio_core.session import View
from studio_core.shading.job import Job
from studio_core.shading.scheduler import InlineExecutor
from studio_ui.pictures.child import run_program
from studio_ui.pictures.copy import framed
from studio_ui.pictures.dialog import PictureDialog
from studio_ui.pictures.export_dialog import ExportDialog
from studio_ui.pictures.order import (
    HERE,
    KINDS,
    PRESETS,
    Look,
    PictureOrder,
    SeriesOrder,
    Size,
    duration,
    guessed,
    learned,
)
from studio_ui.pictures.series_dialog import SeriesDialog
from studio_ui.pictures.work import make as make_pictures

RESULT = {
    "width": 64,
    "height": 36,
    "finite": True,
    "seconds": {"shading": 8.0, "composing": 2.0},
    "frames": ["a_0001.png", "a_0002.png"],
    "kept": 0,
}


class Child:
    """A stand-in for the command line: notes what it was asked, writes what it was to write."""

    def __init__(self) -> None:
        self.asked: list[list[str]] = []
        self.cameras: list[Camera] = []
        self.fail: Exception | None = None

    def __call__(self, arguments: Sequence[str], job: Job, heard: Any) -> dict[str, Any]:
        self.asked.append(list(arguments))
        options = parser().parse_args(list(arguments))
        self.cameras = list(load(options.project).scene.of(Camera))
        preview = options.preview if options.verb == "render" else options.sheet
        image = QImage(8, 6, QImage.Format.Format_RGB888)
        image.fill(Qt.GlobalColor.red)
        image.save(str(preview))
        job.checkpoint(1, 2)
        heard({"done": 1, "total": 2})
        if self.fail is not None:
            raise self.fail
        options.out.write_bytes(b"a picture")
        return RESULT if options.verb == "render" else {**RESULT, "seconds": 10.0}


@pytest.fixture
def out(make: Make, tmp_path: Path) -> tuple[Driver, Child]:
    """A window with two cameras whose pictures are made by a stand-in, at once."""
    driver = make()
    scene = room().with_nodes(
        Camera(id="left", name="Left", transform=looking((-3, 1, 3), (0, 0, 0))),
        Camera(id="right", name="Right", transform=looking((3, 1, 3), (0, 0, 0))),
    )
    driver.show(scene)
    pictures, stand_in = driver.window.pictures, Child()
    pictures.runner, pictures.executor = stand_in, InlineExecutor()
    pictures._beside = lambda suffix: tmp_path / f"Room{suffix}"
    return driver, stand_in


def dialog_of(driver: Driver, action: str) -> Any:
    driver.do(action)
    (dialog,) = driver.window.pictures._dialogs.values()
    return dialog


def export(driver: Driver, dialog: Any) -> None:
    """Press the button and wait for the end."""
    dialog.export()
    driver.until(lambda: dialog.task is None)


def options_of(stand_in: Child) -> Any:
    return parser().parse_args(stand_in.asked[-1])


# --- one picture --------------------------------------------------------------------------------------


def test_a_picture_is_ordered_with_what_the_window_shows(out: tuple[Driver, Child], tmp_path: Path) -> None:
    driver, stand_in = out
    driver.session.display(exposure=1.5, tonemap="filmic")
    driver.session.shade_with("cuts", {"quality": 0.75, "refine": False})
    dialog = dialog_of(driver, "file.export_picture")
    assert isinstance(dialog, ExportDialog)
    assert nameless(dialog) == []
    dialog.size_form.preset.setCurrentIndex(dialog.size_form.preset.findText("4K  3840 × 2160"))
    export(driver, dialog)
    options = options_of(stand_in)
    assert (options.size, options.exposure, options.tonemap) == ("3840x2160", 1.5, "filmic")
    assert (options.backend, options.param) == ("cuts", ["quality=0.75", "refine=false"])
    assert (options.antialias, options.bits, options.progress, options.json) == (2, 8, "json", True)
    assert options.out == tmp_path / "Room.png"
    (camera,) = (one for one in stand_in.cameras if one.id == options.camera)
    assert camera.transform == driver.session.view.transform
    assert camera.fov == driver.window.cameras.shot(3840, 2160).fov
    assert len(list(driver.document.scene.of(Camera))) == 2  # the document is as it was
    assert not driver.document.modified or driver.labels()[-1] != "Picture"
    assert "Exported Room.png, 64 × 36 pixels" in dialog.told.text()
    assert dialog.folder_button.isVisible()
    assert dialog.path.text() == str(tmp_path / "Room 2.png")
    assert not options.project.parent.exists()


def test_a_camera_layers_and_bits_are_ordered(out: tuple[Driver, Child], tmp_path: Path) -> None:
    driver, stand_in = out
    dialog = dialog_of(driver, "file.export_picture")
    dialog.camera.setCurrentIndex(2)
    assert not dialog.look_form.lights.isEnabled()
    dialog.look_form.kind.setCurrentIndex(2)
    dialog.look_form.lights.setChecked(True)
    dialog.look_form.alpha.setChecked(True)
    dialog.measure.setChecked(True)
    export(driver, dialog)
    options = options_of(stand_in)
    (camera,) = (one for one in stand_in.cameras if one.id == options.camera)
    assert (camera.name, camera.transform) == ("Right", driver.document.scene["right"].transform)
    assert options.out == tmp_path / "Room.exr"
    assert (options.bits, options.lights, options.alpha, options.measure) == (16, True, True, 256)


def test_paper_becomes_pixels_and_the_shape_is_kept(out: tuple[Driver, Child]) -> None:
    driver, _ = out
    form = dialog_of(driver, "file.export_picture").size_form
    form.preset.setCurrentIndex(form.preset.findText("A4, 300 dpi"))
    assert form.size_() == Size(3508, 2480, 300)
    assert "297 × 210 mm at 300 dpi, 8.7 megapixels" in form.told.text()
    form.upright.setChecked(True)
    assert form.size_() == Size(2480, 3508, 300)
    form.preset.setCurrentIndex(form.preset.findText("Full HD  1920 × 1080"))
    assert form.size_() == Size(1080, 1920)
    form.upright.setChecked(False)
    form.width_.setValue(960)
    assert form.size_() == Size(960, 540)
    assert form.preset.currentText() == "Other"
    form.height_.setValue(1080)
    assert form.size_() == Size(1920, 1080)
    form.linked.setChecked(False)
    form.width_.setValue(1000)
    assert form.size_() == Size(1000, 1080)
    assert not form.upright.isChecked() or form.size_().height > form.size_().width


def test_the_last_choices_and_seconds_are_remembered(out: tuple[Driver, Child]) -> None:
    driver, _ = out
    dialog = dialog_of(driver, "file.export_picture")
    assert "known after the first" in dialog.told.text()
    dialog.size_form.show_size(Size(640, 360))
    dialog.look_form.samples.setCurrentIndex(3)
    dialog.look_form.kind.setCurrentIndex(1)
    export(driver, dialog)
    dialog.close()
    again = dialog_of(driver, "file.export_picture")
    assert again.size_form.size_() == Size(640, 360)
    assert (again.look_form.samples.currentData(), again.look_form.kind_()) == (4, KINDS[1])
    assert "About 13 s" in again.told.text()  # 3 + 8 + 2


def test_a_file_that_is_there_is_not_replaced_unasked(out: tuple[Driver, Child], tmp_path: Path) -> None:
    driver, stand_in = out
    (tmp_path / "Room.png").write_bytes(b"old")
    dialog = dialog_of(driver, "file.export_picture")
    assert dialog.path.text() == str(tmp_path / "Room 2.png")
    dialog.path.setText(str(tmp_path / "Room.png"))
    driver.answers.target = None
    export(driver, dialog)
    assert stand_in.asked == []
    driver.answers.target = tmp_path / "Room.png"  # the file dialog has asked
    export(driver, dialog)
    assert options_of(stand_in).out == tmp_path / "Room.png"


def test_what_goes_wrong_is_told_in_the_dialog_and_the_log(out: tuple[Driver, Child]) -> None:
    driver, stand_in = out
    stand_in.fail = InputError("x.png cannot be written: the disk is full")
    dialog = dialog_of(driver, "file.export_picture")
    export(driver, dialog)
    assert dialog.told.text() == "x.png cannot be written: the disk is full."
    assert any("disk is full" in problem for problem in driver.problems())
    assert dialog.export_button.isVisible()
    stand_in.fail = Cancelled("Exporting")
    export(driver, dialog)
    assert "Stopped" in dialog.told.text()
    assert len(driver.problems()) == 1


def test_a_closed_dialog_lets_the_picture_go_on(make: Make, tmp_path: Path) -> None:
    import threading

    driver = make()
    driver.show(room())
    pictures, stand_in, gate = driver.window.pictures, Child(), threading.Event()

    def slow(arguments: Sequence[str], job: Job, heard: Any) -> dict[str, Any]:
        while not gate.wait(0.002):
            job.checkpoint(1, 3)
        return stand_in(arguments, job, heard)

    pictures.runner = slow
    pictures._beside = lambda suffix: tmp_path / f"Room{suffix}"
    dialog = dialog_of(driver, "file.export_picture")
    dialog.export()
    driver.until(lambda: bool(driver.context.tasks.running))
    assert dialog.cancel_button.isVisible()
    dialog.close()
    gate.set()
    driver.idle()
    assert (tmp_path / "Room.png").exists()
    assert any("Exported Room.png" in entry.text for entry in driver.context.journal.entries)
    gate.clear()
    again = dialog_of(driver, "file.export_picture")
    again.export()
    driver.until(lambda: again.task is not None and again.task.state == "running")
    again.cancel()
    driver.until(lambda: again.task is None)
    assert "Stopped" in again.told.text()
    assert sorted(path.name for path in tmp_path.glob("*.png")) == ["Room.png"]


def test_the_preview_has_the_shape_of_the_picture() -> None:
    image = QImage(90, 60, QImage.Format.Format_RGB888)
    image.fill(Qt.GlobalColor.white)
    narrow, wide = framed(image, 1.0), framed(image, 3.0)
    assert (narrow.width(), narrow.height()) == (60, 60)
    assert (wide.width(), wide.height()) == (180, 60)
    assert wide.pixelColor(90, 30).lightness() == 255
    assert wide.pixelColor(10, 30).lightness() == wide.pixelColor(170, 30).lightness() == 34
    part = framed(image, 1.0, 0.5)
    assert (part.width(), part.height()) == (30, 30)
    assert part.pixelColor(0, 0).lightness() == 255


def test_what_a_camera_frames_is_what_is_exported(out: tuple[Driver, Child]) -> None:
    driver, stand_in = out
    driver.window.cameras.use_frame("16:9")
    driver.window.cameras.look("left")
    driver.settle()
    dialog = dialog_of(driver, "file.export_picture")
    size = dialog.size_form.size_()
    assert size.width / size.height == pytest.approx(16 / 9, rel=0.01)
    export(driver, dialog)
    (camera,) = (one for one in stand_in.cameras if one.id == options_of(stand_in).camera)
    assert (camera.name, camera.fov) == ("Left", pytest.approx(driver.document.scene["left"].fov, abs=0.5))


# --- series -------------------------------------------------------------------------------------------


def test_a_turntable_goes_around_what_is_chosen(out: tuple[Driver, Child], tmp_path: Path) -> None:
    driver, stand_in = out
    driver.session.select(["stool"])
    dialog = dialog_of(driver, "file.export_series")
    assert isinstance(dialog, SeriesDialog)
    assert nameless(dialog) == []
    dialog.count.setValue(12)
    assert dialog.length.value() == pytest.approx(0.5)
    dialog.length.setValue(2.0)
    assert dialog.count.value() == 48
    dialog.resume.setChecked(True)
    export(driver, dialog)
    options = options_of(stand_in)
    assert (options.verb, options.turntable, options.degrees, options.resume) == ("frames", 48, 360, True)
    assert [float(c) for c in options.around.split(",")] == pytest.approx([1.0, 0.5, 0.0])
    assert options.out == tmp_path / "Room frames" / "Room.png"
    assert "Exported 2 pictures to Room frames" in dialog.told.text()


def test_light_goes_around_and_paths_lead_through_ticked_cameras(out: tuple[Driver, Child]) -> None:
    driver, stand_in = out
    dialog = dialog_of(driver, "file.export_series")
    dialog.kind.setCurrentIndex(1)
    dialog.degrees.setValue(-90.0)
    export(driver, dialog)
    options = options_of(stand_in)
    assert (options.relight, options.degrees, options.turntable) == (48, -90, None)
    dialog.kind.setCurrentIndex(2)
    dialog.even.setChecked(False)
    dialog.closed.setChecked(True)
    export(driver, dialog)
    options = options_of(stand_in)
    names = {camera.id: camera.name for camera in stand_in.cameras}
    assert [names[camera] for camera in options.path.split(",")] == ["Left", "Right"]
    assert options.frames == 48
    assert (options.closed, options.ease, options.uneven) == (True, True, True)
    dialog.path_list.item(0).setCheckState(Qt.CheckState.Unchecked)
    assert not dialog.export_button.isEnabled()
    assert "two cameras" in dialog.told.text()


def test_pictures_that_are_there_are_mentioned(out: tuple[Driver, Child], tmp_path: Path) -> None:
    driver, _ = out
    dialog = dialog_of(driver, "file.export_series")
    assert dialog.files_told.text() == "Room_0001.png … Room_0048.png."
    (tmp_path / "Room frames").mkdir()
    (tmp_path / "Room frames" / "Room_0001.png").write_bytes(b"")
    dialog.name.setText("Room ")
    assert "will be replaced" in dialog.files_told.text()
    dialog.resume.setChecked(True)
    assert "will be kept" in dialog.files_told.text()
    (tmp_path / "file").write_text("")
    dialog.folder.setText(str(tmp_path / "file" / "frames"))
    export(driver, dialog)
    assert "cannot be made" in dialog.told.text()


# --- clipboard ----------------------------------------------------------------------------------------


def test_the_clipboard_gets_the_shown_picture(driver: Driver) -> None:
    driver.session.display(exposure=0.5, tonemap="filmic")
    driver.do("file.copy_picture")
    image = QGuiApplication.clipboard().image().convertToFormat(QImage.Format.Format_RGB888)
    shown = tonemap(driver.feed.last.picture.linear, 0.5, "filmic")
    assert (image.height(), image.width()) == shown.shape[:2]
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine())
    np.testing.assert_array_equal(rows[:, : 3 * image.width()].reshape(shown.shape), shown)


# --- what orders say ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.label)
def test_every_order_is_one_the_command_line_takes(kind: Any, tmp_path: Path) -> None:
    look = Look(PRESETS["A3, 150 dpi"], 3, "final", kind, True, kind.suffix == ".exr", True, -2.25, "raw")
    one = PictureOrder("camera", tmp_path / f"a b{kind.suffix}", look)
    options = parser().parse_args(one.arguments(tmp_path / "p.lucarne", tmp_path / "s.png"))
    assert (options.size, options.dpi, options.bits, options.exposure) == ("2480x1754", 150, kind.bits, -2.25)
    for what in ("turntable", "relight", "path"):
        many = SeriesOrder(what, ("a", "b"), one.path, look, 5, -90.0, (-1.0, 0.5, 2.0))
        options = parser().parse_args(many.arguments(tmp_path / "p.lucarne", tmp_path / "s.png"))
        assert options.out == one.path


def test_guesses_grow_with_the_picture() -> None:
    small, large = (Look(Size(side, side)) for side in (1000, 4000))
    past = learned(small, {"shading": 10.0, "composing": 1.0}, {})
    assert guessed(small, past) == pytest.approx(14)
    assert guessed(large, past) > 3 + 16 + 10
    assert guessed(Look(Size(10, 10), quality="final"), past) is None
    assert guessed(small, {"one screen": {"shading": "?"}}) is None
    assert [duration(s) for s in (0.2, 80, 100, 8000)] == ["1 s", "80 s", "2 min", "2 h 13 min"]


# --- the real command line ----------------------------------------------------------------------------

SMALL = Look(Size(32, 18), 1, backend="reference", params=frozen_map({"directions": "1024", "vertices": 500}))


def test_a_picture_made_by_the_child_is_there(tmp_path: Path) -> None:
    lines: list[bytes] = []
    view, job = View(looking((2.5, 1.8, 3.2), (0, 0.4, 0))), Job("Exporting")
    order = PictureOrder(HERE, tmp_path / "a.png", SMALL)
    result = make_pictures(
        order, little_scene(), {HERE: ("View", view)}, "A: room", run_program, job, lines.append
    )
    assert result["finite"]
    assert read_image(tmp_path / "a.png").pixels.shape == (18, 32, 3)
    assert QImage.fromData(lines[-1]).width() == 32
    assert job.total
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_what_the_child_complains_of_is_what_is_told(tmp_path: Path) -> None:
    save(tmp_path / "p.lucarne", little_scene())
    wrong = ["render", str(tmp_path / "p.lucarne"), "-o", str(tmp_path / "no" / "a.png"), "--json"]
    with pytest.raises(InputError, match="there is no folder"):
        run_program(wrong, Job("Exporting"), lambda _: None)


def test_a_cancelled_child_leaves_nothing(tmp_path: Path) -> None:
    job = Job("Exporting")

    def heard(told: dict[str, Any]) -> None:
        job.cancel()

    def run(arguments: Sequence[str], job: Job, _: Any) -> dict[str, Any]:
        return run_program(arguments, job, heard)

    series = SeriesOrder("turntable", (HERE,), tmp_path / "t.png", SMALL, 5000)
    with pytest.raises(Cancelled):
        make_pictures(series, little_scene(), {HERE: ("View", View())}, "A", run, job, lambda _: None)
    assert all(path.name.startswith("t_") for path in tmp_path.iterdir())


def test_a_child_that_dies_is_told_of(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    script = "import os, sys; (tmp := open(sys.argv[1], 'w')).close(); os.kill(os.getpid(), 9)"
    left = tmp_path / ".a-0123456789ab.png"
    monkeypatch.setattr(child, "PROGRAM", (sys.executable, "-c", script, str(left)))
    order = PictureOrder(HERE, tmp_path / "a.png", SMALL)
    with pytest.raises(LucarneError, match="ended"):
        make_pictures(
            order, little_scene(), {HERE: ("View", View())}, "A", run_program, Job("a"), lambda _: None
        )
    assert not list(tmp_path.iterdir())


def test_closing_the_window_stops_the_child(make: Make, tmp_path: Path, monkeypatch: Any) -> None:
    sleeps = (sys.executable, "-c", "import time; time.sleep(600)")
    started: list[subprocess.Popen[str]] = []
    real = subprocess.Popen

    def spy(*given: Any, **more: Any) -> Any:
        started.append(real(*given, **more))
        return started[-1]

    monkeypatch.setattr(child, "PROGRAM", sleeps)
    monkeypatch.setattr(child.subprocess, "Popen", spy)
    driver = make()
    driver.show(room())
    driver.window.pictures._beside = lambda suffix: tmp_path / f"Room{suffix}"
    dialog_of(driver, "file.export_picture").export()
    driver.until(lambda: bool(started))
    driver.close()
    assert started[0].poll() is not None


# --- keyboard -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("action", ["file.export_picture", "file.export_series"])
def test_every_control_has_a_name_and_the_keyboard(out: tuple[Driver, Child], action: str) -> None:
    dialog: PictureDialog = dialog_of(out[0], action)
    controls = [w for kind in (QComboBox, QAbstractButton, QLineEdit) for w in dialog.form.findChildren(kind)]
    assert len(controls) > 8
    for control in controls:
        if control.parent() is not None and control.objectName().startswith("qt_"):
            continue  # the line inside a number field
        text = control.text() if isinstance(control, QAbstractButton) else ""
        assert control.accessibleName() or text, control
        assert control.focusPolicy() & Qt.FocusPolicy.TabFocus, control
