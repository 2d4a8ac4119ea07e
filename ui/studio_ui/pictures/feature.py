"""Pictures out of the window: the actions, the dialogs, and the one queue that makes them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QGuiApplication, QImage
from PySide6.QtWidgets import QWidget

from studio_core.arrays import frozen_map
from studio_core.errors import PluginError
from studio_core.params import param_infos
from studio_core.scene.nodes import Camera
from studio_core.session import ALL, View
from studio_core.shading.job import Job
from studio_core.shading.scheduler import ComputeThread, Executor
from studio_ui.ask import Ask
from studio_ui.canvas.framing import frame_in
from studio_ui.context import Context
from studio_ui.feed import Freshness
from studio_ui.pictures.child import Runner, run_program
from studio_ui.pictures.copy import framed, shown_image
from studio_ui.pictures.dialog import PictureDialog
from studio_ui.pictures.export_dialog import ExportDialog
from studio_ui.pictures.forms import LookForm, SizeForm
from studio_ui.pictures.memory import PictureMemory
from studio_ui.pictures.order import FINAL, Look, PictureOrder, Size, duration
from studio_ui.pictures.series_dialog import SeriesDialog
from studio_ui.pictures.work import Order, make, unused
from studio_ui.settings import Settings
from studio_ui.tasks import Task
from studio_ui.views.cameras import Cameras


class _Relay(QObject):
    """Previews from the working thread to the window's."""

    arrived = Signal(int, bytes)


class PictureOut:
    """Export picture, export series, copy picture. `runner` and `executor` are others in tests."""

    def __init__(
        self,
        parent: QWidget,
        context: Context,
        ask: Ask,
        settings: Settings,
        cameras: Cameras,
        name: Callable[[], str],
        beside: Callable[[str], Path],
    ) -> None:
        self.context, self.ask, self.memory = context, ask, PictureMemory(settings)
        self.runner: Runner = run_program
        self.executor: Executor | None = None  # a thread of its own from the first picture on
        self._parent, self._cameras, self._name, self._beside = parent, cameras, name, beside
        self._relay = _Relay(parent)
        self._relay.arrived.connect(self._arrived)
        self._dialogs: dict[int, PictureDialog] = {}
        self._numbers = 0
        self._tasks: list[Task] = []

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {
            "file.export_picture": lambda: self.show(ExportDialog(self._parent, self)),
            "file.export_series": lambda: self.show(SeriesDialog(self._parent, self)),
            "file.copy_picture": self.copy,
        }

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name."""
        return {"picture": lambda: self.context.feed.last is not None}

    def show(self, dialog: PictureDialog) -> PictureDialog:
        """Open a dialog beside the window."""
        self._numbers += 1
        number = self._numbers
        self._dialogs[number] = dialog
        dialog.finished.connect(lambda _: self._dialogs.pop(number, None))
        dialog.show()
        return dialog

    # what dialogs ask

    def window_size(self) -> Size:
        """Of the canvas, or of the frame in it while a camera is looked through."""
        width, height = self.context.feed.size
        if self._cameras.camera() is not None:
            _, _, width, height = (round(side) for side in frame_in(self._cameras.aspect, width, height))
        return Size(max(width, 1), max(height, 1))

    def seen(self, camera: str, size: Size) -> tuple[str, View]:
        """Name of a camera (or `HERE`), and what a picture of it shows."""
        node = self.context.document.scene.nodes.get(camera)
        if isinstance(node, Camera):
            return node.name, self._cameras.seen(node, (size.width, size.height))
        through = self._cameras.camera()
        return "View" if through is None else through.name, self._cameras.shot(size.width, size.height)

    def framed(self, size: Size) -> QImage:
        """What of the window's picture a picture of that size will show."""
        shown, image = self.context.feed.last, self.shown_image()
        if shown is None or image.isNull():
            return image
        angles = (self._cameras.shot(size.width, size.height).fov, shown.view.fov)
        wanted, there = (math.tan(math.radians(angle) / 2) for angle in angles)
        return framed(image, size.width / size.height, wanted / there)

    def shown_image(self) -> QImage:
        """What the window shows."""
        shown, session = self.context.feed.last, self.context.session
        return QImage() if shown is None else shown_image(shown, session.exposure, session.tonemap)

    def beside(self, suffix: str) -> Path:
        """Where files of that suffix are suggested to be put."""
        return self._beside(suffix)

    def free_path(self, suffix: str) -> Path:
        """A name beside the project that no file has yet."""
        return unused(self._beside(suffix))

    def look(self, size: SizeForm, form: LookForm, *, measure: bool = False) -> Look:
        """How pictures are made, by a dialog's fields and what the window does now."""
        session, quality = self.context.session, form.quality.currentData()
        params = dict(session.params)
        if quality == "final":
            params |= self._final(session.backend)
        return Look(
            size.size_(),
            form.samples.currentData(),
            quality,
            form.kind_(),
            form.alpha.isChecked(),
            form.lights.isChecked(),
            measure,
            session.exposure,
            session.tonemap,
            session.backend,
            frozen_map(params),
            *self._bounces(),
        )

    def _bounces(self) -> tuple[str, Mapping[str, Any], str]:
        """How light goes on between surfaces ("": not at all), and which light is looked at."""
        session = self.context.session
        if not session.bouncing or session.indirect not in self.context.host.names("indirect"):
            return "", frozen_map(), ALL
        return session.indirect, session.indirect_params.get(session.indirect, frozen_map()), session.light

    def _final(self, backend: str) -> dict[str, Any]:
        if not self.context.warm:
            return {}
        try:
            infos = param_infos(self.context.host.get("backend", backend).Params)
        except PluginError:
            return {}
        return {name: value for name, value in FINAL.items() if name in infos}

    def start(self, order: Order, dialog: PictureDialog) -> Task:
        """Have it made after what is waiting already; the dialog is told how it goes, while it is open."""
        number = next((n for n, known in self._dialogs.items() if known is dialog), 0)
        scene, name, size = self.context.document.scene, self._name(), order.look.size
        views = {camera: self.seen(camera, size) for camera in order.cameras}

        def work(job: Job) -> dict[str, Any]:
            def seen(png: bytes) -> None:
                self._relay.arrived.emit(number, png)

            made: dict[str, Any] = make(order, scene, views, name, self.runner, job, seen)
            return made

        def done(result: dict[str, Any]) -> None:
            text = self._told(order, result, task)
            self.context.journal.write(text)
            if number in self._dialogs:
                self._dialogs[number].finished_well(text)

        def failed(error: Exception) -> None:
            if number in self._dialogs:
                self._dialogs[number].failed(error)

        self.executor = self.executor or ComputeThread()
        label = f"Exporting {order.path.name}"
        task = self.context.tasks.run(label, work, done, failed, executor=self.executor)
        self._tasks = [*(known for known in self._tasks if known.ended is None), task]
        return task

    def _told(self, order: Order, result: dict[str, Any], task: Task) -> str:
        """What became of it, in a sentence; what it took is remembered."""
        size = f"{result['width']} × {result['height']} pixels"
        taken = duration(task.seconds)
        finite = "" if result["finite"] else " Some pixels are no numbers."
        if isinstance(order, PictureOrder):
            self.memory.took(order.look, result["seconds"])
            error = result.get("error")
            told = f", error {100 * error['picture']['relative_rmse']:.1f} %" if error else ""
            return f"Exported {order.path.name}, {size}{told}, in {taken}.{finite}"
        kept = f", {result['kept']} of them were there" if result["kept"] else ""
        count = len(result["frames"])
        if count > result["kept"]:
            each = {"shading": result["seconds"] / (count - result["kept"]), "composing": 0.0}
            self.memory.took(order.look, each, "each")
        return f"Exported {count} pictures to {order.path.parent.name}, {size}{kept}, in {taken}.{finite}"

    def _arrived(self, number: int, png: bytes) -> None:
        if number in self._dialogs:
            self._dialogs[number].seen(png)

    # clipboard

    def copy(self) -> None:
        """What is shown onto the clipboard, in the picture's own pixels."""
        image = self.shown_image()
        QGuiApplication.clipboard().setImage(image)
        unfinished = "" if self.context.feed.state is Freshness.CURRENT else " It was still being refined."
        self.context.journal.write(
            f"Copied the picture, {image.width()} × {image.height()} pixels.{unfinished}"
        )

    def close(self) -> None:
        """Stop what is being made, and wait until it has gone."""
        for dialog in list(self._dialogs.values()):
            dialog.close()
        for task in self._tasks:
            task.job.cancel()
        if self.executor is not None:
            self.executor.close()
            self.executor = None
