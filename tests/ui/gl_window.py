"""A window on a display, driven; prints what it saw as JSON. A program: `gl_window.py SCENARIO STATE`."""

from __future__ import annotations

import gc
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from gl_support import PaintedStage
from PySide6.QtCore import QCoreApplication, QEvent, QPoint, Qt
from PySide6.QtGui import QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication
from scenes import little_scene
from ui_support import Answers

from studio.app import PluginShading, assemble
from studio_core.contract import Services
from studio_core.document import Step
from studio_core.edits import Move
from studio_core.parallel import Workers
from studio_core.raster import PictureStage
from studio_core.registry import PluginHost
from studio_core.scene.nodes import Camera
from studio_core.scene.transform import Transform
from studio_core.session import View
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.scheduler import InlineExecutor
from studio_core.shading.stages import SurfaceParams, common_stages
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.meshes import plugin as meshes
from studio_ui.feed import Freshness
from studio_ui.settings import Settings


class PaintedShading(PluginShading):
    """Made-up light instead of a backend."""

    def __init__(self, services: Services) -> None:
        super().__init__(services)
        self.services = services

    def pipeline(self, backend: str) -> Pipeline:
        return Pipeline([*common_stages(self.services), PaintedStage(), PictureStage(self.services)])

    def params(self, backend: str, values: Any) -> Any:
        return SurfaceParams(vertices=2000)

    def measure(self, *_: Any) -> None:
        return None


class Bench:
    """A studio, and time for it."""

    def __init__(self, state: Path) -> None:
        QApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
        self.application = QApplication(["lucarne"])
        host = PluginHost((brdfs, meshes))
        self.settings = Settings(state)
        self.settings.set("view_cube", False)  # what is compared is the canvas alone
        self.studio = assemble(
            settings=self.settings,
            host=host,
            shading=PaintedShading(Services(Workers(1), host)),
            ask=Answers(),
            compute=InlineExecutor(),
            files=InlineExecutor(),
            threads=1,
        )
        self.window = self.studio.window
        self.window.resize(1100, 700)
        self.window.show()
        scene = little_scene()
        self.studio.context.document.restore((Step("Open", scene),), 0)
        session = self.studio.context.session
        camera = next(scene.of(Camera))
        session.look(View.of(camera, scene, session.view.width, session.view.height))
        self.wait(self.settled)

    @property
    def inner(self) -> Any:
        return self.window.viewport.inner

    def settled(self) -> bool:
        feed = self.studio.context.feed
        return feed.state is Freshness.CURRENT and not feed.busy and not feed.moving

    def wait(self, what: Callable[[], bool], seconds: float = 60.0) -> None:
        end = time.monotonic() + seconds
        while not what():
            QTest.qWait(10)
            if time.monotonic() > end:
                raise TimeoutError(f"{what} did not come about")

    def remembered(self) -> str:
        """What is tried at the next start without asking."""
        return str(self.settings.get("canvas_card", ""))

    def gpu(self) -> None:
        self.window.canvas.prefer("gpu")
        self.wait(lambda: self.window.canvas.shown == "gpu")
        for _ in range(2):  # Qt makes the window anew for its first OpenGL, and the context with it
            QTest.qWait(40)
            self.wait(lambda: self.inner.tally.draws > 0)

    def grab(self) -> np.ndarray:
        QTest.qWait(50)
        image = self.window.viewport.grab_image().convertToFormat(QImage.Format.Format_RGB888)
        flat = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine())
        return flat[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).copy()

    def log(self) -> list[str]:
        return [entry.text for entry in self.studio.context.journal.entries if entry.level != "note"]

    def on_screen(self) -> np.ndarray:
        """What the display shows of the canvas."""
        screen = self.application.primaryScreen()
        at = self.inner.mapToGlobal(QPoint(0, 0))
        image = screen.grabWindow(0, at.x(), at.y(), self.inner.width(), self.inner.height()).toImage()
        image = image.convertToFormat(QImage.Format.Format_RGB888)
        flat = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine())
        return flat[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).copy()


def same(a: np.ndarray, b: np.ndarray) -> float:
    return float((np.abs(a.astype(int) - b).max(axis=2) <= 2).mean()) if a.shape == b.shape else 0.0


def switching(bench: Bench) -> dict[str, Any]:
    """Software, GPU, software; something chosen, another exposure, a lamp's lines over it."""
    context = bench.studio.context
    context.session.select(["cube"])
    context.session.display(exposure=0.5, tonemap="filmic")
    bench.window.appearance.set_grid(True)
    bench.wait(bench.settled)
    first = bench.grab()
    bench.gpu()
    second = bench.grab()
    shown = bench.on_screen()
    bench.window.canvas.prefer("software")
    third = bench.grab()
    return {
        "std": float(first.std()),
        "agree": same(first, second),
        "on_screen": same(second, shown),
        "back": bool(np.array_equal(first, third)),
        "remembered": bench.remembered(),
        "ratio": bench.inner.devicePixelRatioF(),
        "log": bench.log(),
    }


def hand(bench: Bench) -> dict[str, Any]:
    """Choose, drag, look around and undo on the GPU's canvas; a turned view is drawn before its picture."""
    bench.gpu()
    context, canvas = bench.studio.context, bench.inner
    middle = QPoint(canvas.width() // 2, canvas.height() // 2)
    QTest.mouseClick(canvas, Qt.MouseButton.LeftButton, pos=middle)
    chosen = list(context.session.selection)
    start = middle + QPoint(20, -5)  # beside the arrows
    QTest.mousePress(canvas, Qt.MouseButton.LeftButton, pos=start)
    for step in (15, 30, 60):
        QTest.mouseMove(canvas, start + QPoint(step, 10))
        QTest.qWait(20)
    QTest.mouseRelease(canvas, Qt.MouseButton.LeftButton, pos=start + QPoint(60, 10))
    bench.wait(bench.settled)
    labels = [step.label for step in context.document.history]
    colours = canvas.tally.shapes
    context.document.apply(Move({"cube": Transform((0.3, 0.5, 0.2))}))
    bench.wait(bench.settled)
    moved_shapes = canvas.tally.shapes - colours
    before, picture = bench.grab(), canvas._picture
    view = context.session.view
    canvas.set_guides(View(Transform((0.0, 1.0, 4.0)), view.fov, view.width, view.height), ())
    turned = bench.grab()
    ahead = canvas.probe(0.5, 0.6)
    bench.window.tools.refresh()  # guides and gizmo as they were
    moving = Move({"cube": Transform((-0.9, 0.5, 0.2))})
    canvas.set_scene(moving(context.document.scene))
    on_its_way, nowhere = bench.grab(), canvas.probe(0.5, 0.6)
    canvas.set_scene(context.document.scene)
    return {
        "chosen": chosen,
        "moved": same(before, on_its_way),
        "left": nowhere.node if nowhere is not None else None,
        "back": same(before, bench.grab()),
        "labels": labels,
        "moved_shapes": moved_shapes,
        "same_picture": canvas._picture is picture,
        "turned": same(before, turned),
        "ahead": ahead.node,
        "log": bench.log(),
    }


def docks(bench: Bench) -> dict[str, Any]:
    """Panels and the canvas' own window come and go."""
    bench.gpu()
    canvas = bench.inner
    dock = bench.window.docks["properties"]
    counts, memory = [], []

    def objects() -> int:
        parser = canvas.surface._canvas.context.shared.parser
        return sum(not isinstance(ob, str) for ob in parser._objects.values())

    for _ in range(26):
        dock.setFloating(True)
        QTest.qWait(15)
        dock.setFloating(False)
        dock.close()
        QTest.qWait(15)
        dock.show()
        canvas.surface.update()
        QTest.qWait(15)
        gc.collect()
        counts.append(objects())
        memory.append(resident())
    return {
        "objects": counts[5:],
        "memory": memory[5:],
        "shown": bench.window.canvas.shown,
        "log": bench.log(),
    }


class Alive:
    """How many OpenGL objects of each kind there are, by counting how they are made and deleted."""

    KINDS = ("Buffer", "Texture", "Framebuffer", "Renderbuffer", "Program", "Shader")

    def __init__(self) -> None:
        from vispy.gloo import gl

        self.count = dict.fromkeys(self.KINDS, 0)
        for kind in self.KINDS:
            for verb, step in (("Create", 1), ("Delete", -1)):
                name = f"gl{verb}{kind}"
                setattr(gl, name, self._counted(getattr(gl, name), kind, step))

    def _counted(self, call: Callable[..., Any], kind: str, step: int) -> Callable[..., Any]:
        def count(*arguments: Any) -> Any:
            self.count[kind] += step
            return call(*arguments)

        return count


def windows(bench: Bench) -> dict[str, Any]:
    """GPU canvases are made and thrown away."""
    alive = Alive()
    memory, threads, left, most = [], [], [], 0
    for _ in range(26):
        bench.gpu()
        most = max(most, alive.count["Buffer"])
        bench.window.canvas.prefer("software")
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        QTest.qWait(10)
        gc.collect()
        left.append(sum(alive.count.values()))
        memory.append(resident())
        threads.append(len(list(Path("/proc/self/task").iterdir())))
    return {"memory": memory[5:], "threads": threads[5:], "left": left, "most": most, "log": bench.log()}


def lost(bench: Bench) -> dict[str, Any]:
    """The context goes and comes again; then drawing fails for good."""
    bench.gpu()
    first = bench.grab()
    canvas = bench.inner
    surface = canvas.surface
    surface.release()
    surface.makeCurrent()
    surface.initializeGL()
    surface.doneCurrent()
    surface.update()
    second = bench.grab()
    frames = surface.frames
    surface._renderer.draw = _broken
    surface.update()
    bench.wait(lambda: bench.window.canvas.shown == "software")
    third = bench.grab()
    return {
        "again": same(first, second),
        "frames": frames,
        "fell_back": same(first, third),
        "log": bench.log(),
        "remembered": bench.remembered(),
        "trying": bench.settings.get("canvas_trying", False),
    }


def _broken(*_: Any) -> None:
    raise RuntimeError("out of memory\nand more that nobody reads")


def resident() -> int:
    """Bytes of this process in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")


SCENARIOS = {"switching": switching, "hand": hand, "docks": docks, "windows": windows, "lost": lost}

if __name__ == "__main__":
    bench = Bench(Path(sys.argv[2]))
    found = SCENARIOS[sys.argv[1]](bench)
    print(json.dumps(found), flush=True)
    bench.studio.close()
    QTest.qWait(20)
    print("closed", flush=True)
