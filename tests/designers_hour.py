"""An hour of a designer's work in the real window: `python -m designers_hour STATE FOLDER`.

Does with mouse and keys what a person would, on the sample room over quick stand-in pictures, tells one
JSON line when the last change has been autosaved, then waits to be killed.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDragMoveEvent, QDropEvent
from PySide6.QtWidgets import QApplication
from pytestqt.qt_compat import qt_api
from pytestqt.qtbot import QtBot
from ui_support import Answers, Driver, Fake, block, see

from studio.app import assemble
from studio_core.project.codec import scene_digest
from studio_core.registry import PluginHost
from studio_core.scene.bounds import exact_bounds
from studio_core.scene.nodes import Camera, Environment
from studio_core.shading.artifacts import Picture
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.meshes import plugin as meshes
from studio_ui.settings import Settings

SHIFT, RIGHT = Qt.KeyboardModifier.ShiftModifier, Qt.MouseButton.RightButton
SPOT = (0.45, 0.0, 0.3)  # a free place on the floor of the sample room


class Quick(Fake):
    """Pictures of half the pixels each way, made large."""

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Picture:
        """See `Fake`."""
        view = frame.view
        small = see(frame.scene, view.sized(-(-view.width // 2), -(-view.height // 2)))

        def large(values: Any) -> Any:
            made = values.repeat(2, axis=0).repeat(2, axis=1)
            return np.ascontiguousarray(made[: view.height, : view.width])

        fields = ("linear", "coverage", "node", "distance")
        return replace(small, **{name: large(getattr(small, name)) for name in fields})


class Hour:
    """One step after the other; each checks what it did."""

    def __init__(self, driver: Driver, folder: Path) -> None:
        self.driver, self.folder = driver, folder
        self.project = folder / "room.lucarne"
        self.chair = ""

    def all(self) -> None:
        """The whole hour, up to the change that is never saved."""
        for step in (
            self.open_the_sample,
            self.drop_a_chair,
            self.place_it,
            self.turn_the_light,
            self.change_a_material,
            self.bookmark_views,
            self.undo_and_redo_everything,
            self.save,
            self.go_on,
        ):
            step()

    def open_the_sample(self) -> None:
        """From the menu, then under a name of one's own."""
        driver = self.driver
        sample = next(a for a in driver.window.menus.samples.actions() if a.text() == "Living room")
        sample.trigger()
        driver.until(lambda: bool(driver.document.scene.nodes))
        driver.settle()
        driver.answers.target = self.project
        driver.do("file.save_as")
        driver.until(lambda: self.project.exists() and not driver.window.files.modified)

    def drop_a_chair(self) -> None:
        """A model in centimetres, dropped on the floor: its unit is asked about and mended."""
        driver, file = self.driver, self.folder / "chair.obj"
        file.write_text(block(45.0, 90.0, 50.0))
        driver.until(lambda: driver.context.warm)
        data = QMimeData()
        data.setUrls([QUrl.fromLocalFile(str(file))])
        at = driver.viewport.mapTo(driver.window, driver.at(SPOT))
        copy, left, none = (
            Qt.DropAction.CopyAction,
            Qt.MouseButton.LeftButton,
            Qt.KeyboardModifier.NoModifier,
        )
        for kind, point in ((QDragEnterEvent, at), (QDragMoveEvent, at), (QDropEvent, QPointF(at))):
            QApplication.sendEvent(driver.window, kind(point, copy, data, left, none))
        driver.until(lambda: any(node.name == "chair" for node in driver.document.scene.nodes.values()))
        (question,) = driver.answers.questions
        assert question.doubt
        (self.chair,) = driver.session.selection
        assert np.allclose(self.size(), (0.45, 0.9, 0.5), atol=0.01), self.size()
        assert abs(self.box()[0][1]) < 0.02, self.box()
        assert np.abs(self.box().mean(axis=0)[[0, 2]] - (SPOT[0], SPOT[2])).max() < 0.5
        driver.settle()

    def place_it(self) -> None:
        """Dragged with the mouse, moved by a typed amount, turned, and let down on the floor."""
        driver, start = self.driver, self.box()
        driver.do("tool.move")
        low, high = start
        grip = driver.at((low[0] + 0.06, 0.75, high[2]))  # on the chair, beside the gizmo
        driver.press(grip)
        driver.move(grip + QPoint(30, 8))
        driver.move(grip + QPoint(60, 16))
        driver.release(grip + QPoint(60, 16))
        dragged = self.box()
        assert np.abs(dragged - start).max() > 0.02, "the drag moved it"
        assert driver.labels()[-1].startswith("Move chair"), driver.labels()
        assert abs(dragged[0][1]) < 0.02, "over the floor"
        driver.viewport.setFocus()
        driver.until(driver.viewport.hasFocus)
        for key in "x50cm":
            driver.bot.keyClicks(driver.viewport, key)
        driver.bot.keyClick(driver.viewport, Qt.Key.Key_Return)
        assert np.allclose(self.box()[0] - dragged[0], (0.5, 0.0, 0.0), atol=1e-4)
        driver.do("object.turn_left")
        driver.do("object.up")
        driver.do("object.drop")
        assert abs(self.box()[0][1]) < 0.02

    def turn_the_light(self) -> None:
        """Shift and the right button."""
        driver, before = self.driver, self.light().azimuth
        middle = QPoint(driver.viewport.width() // 2, driver.viewport.height() // 2)
        driver.press(middle, SHIFT, RIGHT)
        driver.move(middle + QPoint(40, 0))
        driver.move(middle + QPoint(90, 0))
        driver.release(middle + QPoint(90, 0), SHIFT, RIGHT)
        assert self.light().azimuth != before

    def change_a_material(self) -> None:
        """In its panel."""
        panel, name = self.driver.window.panels["materials"], "material-cognac-leather"
        panel.choose(name)
        assert panel.form is not None
        panel.form.fields["roughness"].spin.setValue(0.2)
        assert abs(float(self.driver.document.scene.material(name).values["roughness"]) - 0.2) < 1e-6

    def bookmark_views(self) -> None:
        """From above, and closer."""
        driver, before = self.driver, len(list(self.driver.document.scene.of(Camera)))
        driver.do("view.top")
        driver.do("view.new_camera")
        driver.session.select([self.chair])
        driver.do("view.frame_selection")
        driver.do("view.new_camera")
        assert len(list(driver.document.scene.of(Camera))) == before + 2

    def undo_and_redo_everything(self) -> None:
        """Back to the sample and forward again, to the bit."""
        driver, document = self.driver, self.driver.document
        after, steps = scene_digest(document.scene), document.position
        assert steps >= 9, driver.labels()
        first = scene_digest(document.history[0].scene)
        for _ in range(steps):
            driver.do("edit.undo")
        assert document.position == 0
        assert scene_digest(document.scene) == first
        for _ in range(steps):
            driver.do("edit.redo")
        assert scene_digest(document.scene) == after

    def save(self) -> None:
        """Ctrl+S."""
        self.driver.do("file.save")
        self.driver.until(lambda: not self.driver.window.files.modified)

    def go_on(self) -> None:
        """One more change, which only the autosave has."""
        driver = self.driver
        driver.session.select([self.chair])
        driver.do("object.right")
        driver.until(lambda: driver.window.files.keeper.kept.where == "autosaved")
        assert driver.problems() == [], driver.problems()

    def light(self) -> Environment:
        """What lights the room."""
        return next(self.driver.document.scene.of(Environment))

    def box(self) -> Any:
        """(2, 3) lowest and highest corner of the chair."""
        found = exact_bounds(self.driver.document.scene, (self.chair,))
        assert found is not None
        return np.array(found)

    def size(self) -> Any:
        """(3,) of the chair."""
        low, high = self.box()
        return high - low


def window(state: Path, bot: QtBot) -> Driver:
    """The real window over quick pictures, with real threads."""
    answers, fake = Answers(), Quick()
    settings = Settings(state)
    settings.set("animate_view", False)
    host = PluginHost([brdfs, meshes])
    studio = assemble(
        settings=settings, host=host, shading=fake, ask=answers, threads=1, thumbnails=state / "thumbnails"
    )
    driver = Driver(studio, fake, answers, bot)
    driver.patience = 60_000
    driver.window.resize(800, 560)
    return driver


def main(state: Path, folder: Path) -> int:
    """See the module."""
    qt_api.set_qt_api("pyside6")
    application = QApplication([])
    bot = QtBot(SimpleNamespace(config=SimpleNamespace(getini=lambda name: "true")))  # type: ignore[arg-type]
    driver = window(state, bot)
    hour = Hour(driver, folder)
    hour.all()
    document = driver.document
    told = {"digest": scene_digest(document.scene), "labels": driver.labels(), "chair": hour.chair}
    print(json.dumps(told), flush=True)
    return application.exec()


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
