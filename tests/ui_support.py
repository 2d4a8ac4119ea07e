"""A window over a quick stand-in for shading: boxes seen by slab tests, coloured by their material."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

from studio.app import Studio
from studio_core.document import Step
from studio_core.edits import Add
from studio_core.project.lock import Holder
from studio_core.project.outline import Outline
from studio_core.scene.diff import Aspect
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Group, Material, MeshObject, Scene
from studio_core.scene.transform import Transform, looking
from studio_core.session import View
from studio_core.shading.artifacts import MeasuredError, Picture
from studio_core.shading.frame import Frame, IndirectChoice
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs, Pipeline
from studio_ui.ask import Filter, LeftoverChoice, Recover, Unsaved
from studio_ui.canvas.projection import axes_of, extent, eye_of, project
from studio_ui.feed import Freshness
from studio_ui.files.import_question import ImportChoice, ImportQuestion
from studio_ui.files.leftovers import Leftover


def box(size: float = 1.0) -> Geometry:
    """A cube on the floor, centred in x and z."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (0, 1) for z in (-0.5, 0.5)], np.float32)
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return Geometry(corners * np.float32(size), np.array(faces, np.uint32))


def block(width: float, height: float, depth: float, *, lying: bool = False) -> str:
    """An OBJ box that stands on y = 0, or on z = 0."""
    corners = [(x * width, y * height, z * depth) for x in (-0.5, 0.5) for y in (0, 1) for z in (-0.5, 0.5)]
    if lying:
        corners = [(x, -z, y) for x, y, z in corners]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    faces = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
    return "\n".join([*lines, *(f"f {' '.join(map(str, face))}" for face in faces)])


def room() -> Scene:
    """A chair (a group of seat and back) and a stool, apart in x; two materials."""
    cube = box()
    red = Material(
        id="red", name="Red", model="ggx", values={"base_color": (0.6, 0.1, 0.1), "roughness": 0.5}
    )
    blue = Material(id="blue", name="Blue", model="lambert")
    return Add(
        (
            Group(id="chair", name="Chair", transform=Transform((-1.0, 0.0, 0.0))),
            MeshObject(id="seat", name="Seat", parent="chair", geometry=cube, materials=("red",)),
            MeshObject(
                id="back",
                name="Back",
                parent="chair",
                geometry=cube,
                materials=("red",),
                transform=Transform((0.0, 1.0, 0.0), scale=0.5),
            ),
            MeshObject(
                id="stool", name="Stool", geometry=cube, materials=("blue",), transform=Transform((1.0, 0, 0))
            ),
        ),
        (red, blue),
    )(Scene())


def see(scene: Scene, view: View) -> Picture:
    """The picture of axis-aligned boxes."""
    x = (np.arange(view.width) + 0.5) / view.width
    y = (np.arange(view.height) + 0.5) / view.height
    right, top = extent(view)
    grid = np.stack(np.broadcast_arrays((2 * x - 1)[None] * right, (1 - 2 * y)[:, None] * top, -1.0), axis=-1)
    towards = grid @ axes_of(view)
    towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
    nodes = [node for node in scene.of(MeshObject) if scene.shown(node.id)]
    nearest = np.full((view.height, view.width), np.inf)
    index = np.full((view.height, view.width), -1, np.int32)
    linear = np.full((view.height, view.width, 3), 0.05, np.float32)
    for number, node in enumerate(nodes):
        world = scene.world(node.id).matrix()
        low, high = (world[:3, :3] @ corner + world[:3, 3] for corner in node.geometry.bounds)
        low, high = np.minimum(low, high), np.maximum(low, high)
        seen = _window(view, low, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (low - eye_of(view)) / towards[seen], (high - eye_of(view)) / towards[seen]
        enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
        hit = (enter <= leave) & (leave > 0) & (enter < nearest[seen])
        nearest[seen][hit], index[seen][hit] = enter[hit], number
        material = scene.material(node.materials[0])
        linear[seen][hit] = material.values.get("base_color", (0.5, 0.5, 0.5))
    radiance: Any = SimpleNamespace(
        surfaces=SimpleNamespace(nodes=tuple(n.id for n in nodes)),
        valid=np.ones(8, bool),
        directions=1024,
        counts={"rays": 12345, "skipped_packets": 678},
        facts={},
    )
    covered = (index >= 0).astype(np.float32)
    return Picture(radiance, linear, covered, index, nearest.astype(np.float32))


def _window(view: View, low: np.ndarray, high: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns that a box can be seen in: all of them where it reaches behind the eye."""
    flat = project(view, np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3))
    if not np.isfinite(flat).all():
        return slice(None), slice(None)
    size = np.array([view.width, view.height])
    first = np.clip(np.floor(flat.min(axis=0) * size) - 1, 0, size).astype(int)
    last = np.clip(np.ceil(flat.max(axis=0) * size) + 1, 0, size).astype(int)
    return slice(first[1], last[1]), slice(first[0], last[0])


class Fake:
    """A stage and a `Shading` at once: counts, can wait at a gate, can fail."""

    needs: tuple[type, ...] = ()
    gives = Picture
    dirtied_by = ~(Aspect.NAME | Aspect.NONE)

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.fail: BaseException | None = None
        self.gate: threading.Event | None = None
        self.started = threading.Event()
        self.measured = 0
        self.error: MeasuredError | None = None

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Picture:
        self.frames.append(frame)
        self.started.set()
        if self.gate is not None:
            while not self.gate.wait(0.002):
                job.checkpoint(1, 2)
        if self.fail is not None:
            raise self.fail
        return see(frame.scene, frame.view)

    def pipeline(self, backend: str) -> Pipeline:
        return Pipeline([self])

    def params(self, backend: str, values: Mapping[str, Any]) -> Any:
        return dict(values)

    def indirect(self, choice: IndirectChoice) -> IndirectChoice:
        return choice

    def measure(self, pipeline: Pipeline, frame: Frame, job: Job) -> MeasuredError | None:
        self.measured += 1
        return self.error


@dataclass
class Answers:
    """Answers to every question, and which were asked."""

    unsaved_: Unsaved = "discard"
    recover_: Recover = "recovered"
    take_over_: bool = True
    version_: int | None = None  # from the newest
    compact_: bool = True
    delete_: bool = True
    import_: Callable[[ImportQuestion], ImportChoice | None] = staticmethod(lambda question: question.guess)
    photograph_: bool = True
    capture_: bool = True
    files: list[Path] = field(default_factory=list)
    target: Path | None = None
    asked: list[str] = field(default_factory=list)
    text_: str | None = None
    left: list[Leftover] = field(default_factory=list)
    questions: list[ImportQuestion] = field(default_factory=list)
    versions: list[Outline] = field(default_factory=list)

    def unsaved(self, name: str) -> Unsaved:
        self.asked.append("unsaved")
        return self.unsaved_

    def recover(self, found: Leftover) -> Recover:
        self.asked.append("recover")
        self.left = [found]
        return self.recover_

    def leftovers(self, found: Sequence[Leftover]) -> LeftoverChoice:
        self.asked.append("leftovers")
        self.left = list(found)
        if self.recover_ == "recovered":
            return LeftoverChoice(found[0])
        return LeftoverChoice(None, tuple(found) if self.recover_ == "saved" else ())

    def take_over(self, name: str, holder: Holder) -> bool:
        self.asked.append(f"take over from {holder.host}")
        return self.take_over_

    def version(self, name: str, found: Sequence[Outline]) -> Outline | None:
        self.asked.append("version")
        self.versions = list(found)
        return None if self.version_ is None else found[self.version_]

    def compact(self, name: str, versions: int) -> bool:
        self.asked.append(f"compact {versions}")
        return self.compact_

    def delete(self, name: str) -> bool:
        self.asked.append(f"delete {name}")
        return self.delete_

    def import_options(self, question: ImportQuestion) -> ImportChoice | None:
        self.asked.append(question.doubt)
        self.questions.append(question)
        return self.import_(question)

    def photograph(self, name: str) -> bool:
        self.asked.append(name)
        return self.photograph_

    def capture(self, count: int) -> bool:
        self.asked.append(f"capture {count}")
        return self.capture_

    def open_files(self, title: str, filters: Sequence[Filter], *, many: bool = False) -> list[Path]:
        return self.files

    def save_file(self, title: str, suggested: Path, filters: Sequence[Filter]) -> Path | None:
        return self.target

    def text(self, title: str, label: str, suggested: str) -> str | None:
        self.asked.append(title)
        return self.text_

    def folder(self, title: str) -> Path | None:
        return self.target


def move_mouse(widget: QWidget, at: QPoint) -> None:
    """Move the mouse over a widget, with the buttons and keys that are held.

    Qt's own way moves the cursor, and without a display the first window that was ever shown there hears it.
    """
    place, buttons = QPointF(at), QApplication.mouseButtons()
    keys, none = QApplication.keyboardModifiers(), Qt.MouseButton.NoButton
    event = QMouseEvent(QEvent.Type.MouseMove, place, widget.mapToGlobal(place), none, buttons, keys)
    QApplication.sendEvent(widget, event)
    QApplication.processEvents()


class Driver:
    """A studio under test: what a person would do with it."""

    def __init__(self, studio: Studio, fake: Fake, answers: Answers, bot: QtBot) -> None:
        self.studio, self.fake, self.answers, self.bot = studio, fake, answers, bot
        self.window, self.context = studio.window, studio.context
        self.document, self.session, self.feed = (
            self.context.document,
            self.context.session,
            self.context.feed,
        )
        self._closed = False
        self.patience = 60_000  # milliseconds: other programs may keep the processors busy
        self.window.resize(1100, 700)
        self.window.show()

    @property
    def viewport(self) -> Any:
        """The canvas that is shown now."""
        return self.window.viewport.inner

    def show(self, scene: Scene) -> None:
        """Put a scene on the screen, looked at from the front."""
        self.open(scene)
        self.settle()

    def open(self, scene: Scene) -> None:
        """The same, without waiting for the picture."""
        self.document.restore((Step("Open", scene),), 0)
        view = self.session.view
        place = looking((0.0, 2.5, 7.0), (0.0, 0.6, 0.0))
        self.session.look(View(place, 40.0, view.width, view.height, 7.2))

    def settle(self) -> None:
        """Until the picture is up to date."""
        state = self.feed
        self.until(lambda: state.state is Freshness.CURRENT and not state.busy and not state.moving)

    def until(self, what: Callable[[], bool]) -> None:
        self.bot.waitUntil(what, timeout=self.patience)

    def idle(self) -> None:
        """Until queued calls have run."""
        self.until(lambda: not self.context.tasks.running)

    def at(self, point: Sequence[float]) -> QPoint:
        """Where a point of the world is on the canvas."""
        x, y = project(self.session.view, [point])[0]
        return QPoint(round(x * self.viewport.width()), round(y * self.viewport.height()))

    def click(
        self, point: Sequence[float], keys: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier
    ) -> None:
        self.bot.mouseClick(self.viewport, Qt.MouseButton.LeftButton, keys, self.at(point))

    def press(
        self, at: QPoint, keys: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier, button: Any = None
    ) -> None:
        self.bot.mousePress(self.viewport, button or Qt.MouseButton.LeftButton, keys, at)

    def move(self, at: QPoint) -> None:
        move_mouse(self.viewport, at)

    def release(
        self, at: QPoint, keys: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier, button: Any = None
    ) -> None:
        self.bot.mouseRelease(self.viewport, button or Qt.MouseButton.LeftButton, keys, at)

    def do(self, action: str) -> None:
        """Trigger an action as its menu does."""
        self.until(lambda: not self.window.following.pending)
        assert self.window.actions_[action].isEnabled(), action
        self.window.actions_[action].trigger()

    def problems(self) -> list[str]:
        return [entry.text for entry in self.context.journal.entries if entry.level == "problem"]

    def labels(self) -> list[str]:
        return [step.label for step in self.document.history]

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            if self.fake.gate is not None:
                self.fake.gate.set()
            self.studio.close()

    def forget(self) -> None:
        """After `close`: hold on to nothing."""
        self.__dict__ = {"_closed": True}


Make = Callable[..., Driver]
